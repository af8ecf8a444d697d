//! Layouts and pages: what every unwrapper must keep, and what the author's own layout must be.

mod keep;
mod scenes;

use luxel::{
    atlas::{self, Atlas, Options},
    error::Error,
    progress::Silent,
    scene::Scene,
};
use std::path::Path;

/// The atlas of `scene`, validated, with its warnings.
fn unwrapped(scene: &Scene, options: &Options) -> Result<(Atlas, Vec<String>), Error> {
    let mut warnings = Vec::new();
    let atlas = atlas::unwrap(scene, options, Path::new("test.glb"), &Silent, &mut warnings)?;
    assert_eq!(atlas.validate(scene), Ok(()));
    Ok((atlas, warnings))
}
