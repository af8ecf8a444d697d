//! What the lightmap of a bake knows, and that of a file.

use super::View;
use crate::{
    atlas::{Coverage, NO_PAGE},
    bake::Baked,
    lightmaps::{Content, Lightmaps, Reading},
    trace::{Hit, Tracer},
};
use glam::Vec3;

/// A view of what was just baked, its maps read so: all of its light, whatever they hold.
pub fn of_bake<'v, 's>(baked: &'v Baked<'s>, reading: Reading, paths: u32) -> View<'v, 's> {
    let content = baked.lightmaps.content;
    let known = move |hit: &Hit| {
        let charted = &baked.coverage.charted[hit.triangle as usize];
        let page = baked.atlas.pages.get(charted.page as usize)?;
        if !page.hidden && content != Content::Direct {
            return Some(baked.lightmaps.read(&baked.coverage, hit.triangle, hit.bary, reading));
        }
        let texel = baked.coverage.texel_near(charted, charted.at(hit.bary));
        Some(texel.map_or(Vec3::ZERO, |t| baked.irradiance[t as usize]))
    };
    View::new(&baked.tracer, Box::new(known), content, paths)
}

/// A view of what a file holds. Its direct light alone is shown as it is.
pub fn of_file<'v, 's>(
    tracer: &'v Tracer<'s>,
    coverage: &'v Coverage,
    lightmaps: &'v Lightmaps,
    paths: u32,
) -> View<'v, 's> {
    let known = |hit: &Hit| {
        let charted = &coverage.charted[hit.triangle as usize];
        (charted.page != NO_PAGE).then(|| lightmaps.pages[charted.page as usize].bilinear(charted.at(hit.bary)))
    };
    View::new(tracer, Box::new(known), lightmaps.content, paths)
}
