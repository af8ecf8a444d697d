//! What the lightmap of a bake knows, and that of a file.

use super::View;
use crate::{
    atlas::Coverage,
    bake::Baked,
    lightmaps::{Content, Lightmaps, Reading},
    scene::{Bake, Light},
    trace::{Hit, Tracer},
};
use glam::Vec3;

/// A view of what was just baked, its maps read so: all of its light, whatever they hold.
pub fn of_bake<'v, 's>(baked: &'v Baked<'s>, reading: Reading, paths: u32) -> View<'v, 's> {
    let content = baked.lightmaps.content;
    let known = move |hit: &Hit| {
        let charted = &baked.coverage.charted[hit.triangle as usize];
        // A hidden page is no map: paths see more than its coarse texels.
        baked.atlas.pages.get(charted.page as usize).filter(|page| !page.hidden)?;
        if content != Content::Direct {
            return Some(baked.lightmaps.read(&baked.coverage, hit.triangle, hit.bary, reading));
        }
        let texel = baked.coverage.texel_near(charted, charted.at(hit.bary));
        Some(texel.map_or(Vec3::ZERO, |t| baked.irradiance[t as usize]))
    };
    // The irradiance of the bake lacks only lamps of which nothing was baked.
    let left_out = |lamp: &Light| match content {
        Content::Direct => lamp.bake == Bake::None,
        _ => leaves_out(content, lamp),
    };
    View::new(&baked.tracer, Box::new(known), &left_out, paths)
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
        lightmaps.pages.get(charted.page as usize).map(|map| map.bilinear(charted.at(hit.bary)))
    };
    View::new(tracer, Box::new(known), &|lamp| leaves_out(lightmaps.content, lamp), paths)
}

/// True if maps of this content leave the first hit of a lamp to who draws them.
fn leaves_out(content: Content, lamp: &Light) -> bool {
    lamp.bake != Bake::Full || content == Content::Indirect
}
