//! The pipeline, one line a room. Touches no file.

use crate::{
    atlas::{self, Atlas, Coverage},
    error::Result,
    lightmaps::{Content, Lightmaps},
    patches::Patches,
    progress::Observer,
    report::Report,
    scene::Scene,
    trace::Tracer,
};
use glam::Vec3;

/// What a bake does. Lights, sky and exclusions are part of the scene.
#[derive(Clone, Debug)]
pub struct Options {
    /// Layout and texel size. Default: uvunwrap, one page of 1024.
    pub atlas: atlas::Options,
    /// Rays a form-factor row. Default: 256.
    pub rays: u32,
    /// Largest reflectance, (0, .9999]. Default: .98.
    pub max_reflectance: f32,
    /// What the maps hold. Default: full.
    pub content: Content,
}

impl Default for Options {
    fn default() -> Self {
        Options { atlas: atlas::Options::default(), rays: 256, max_reflectance: 0.98, content: Content::Full }
    }
}

/// A finished bake, with the rooms that pictures and checks look at again.
pub struct Baked {
    /// Rays against the scene.
    pub tracer: Tracer,
    /// Layouts and rectangles.
    pub atlas: Atlas,
    /// Covered texels.
    pub coverage: Coverage,
    /// What they stand for.
    pub patches: Patches,
    /// Irradiance E of each patch, direct and indirect, whatever [`Options::content`] says.
    pub irradiance: Vec<Vec3>,
    /// The pages.
    pub lightmaps: Lightmaps,
    /// What was measured on the way.
    pub report: Report,
}

/// Bakes `scene`.
pub fn bake(scene: &Scene, options: &Options, observer: &dyn Observer) -> Result<Baked> {
    let _ = (scene, options, observer);
    unimplemented!()
}
