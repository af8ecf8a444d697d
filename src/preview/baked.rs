//! A finished bake as pages of the light that leaves its surfaces.

use super::auto_exposure;
use crate::{
    atlas::NO_TEXEL,
    bake::Baked,
    lightmaps::{Content, gutters},
    math::luminance,
};
use glam::{UVec2, Vec3};
use std::f32::consts::PI;

/// Radiance of each visible page, gutters filled, and the exposure that shows it well.
pub fn flat(baked: &Baked) -> (Vec<(UVec2, Vec<Vec3>)>, f32) {
    let mut luminances = Vec::new();
    let visible = baked.atlas.pages.iter().zip(&baked.coverage.grids).enumerate().filter(|(_, (p, _))| !p.hidden);
    let pages = visible.map(|(index, (page, grid))| {
        let empty: Vec<bool> = grid.iter().map(|&texel| texel == NO_TEXEL).collect();
        let texel = |(at, &texel): (usize, &u32)| {
            if empty[at] { Vec3::ZERO } else { radiance(baked, index, at, texel as usize) }
        };
        let mut texels: Vec<Vec3> = grid.iter().enumerate().map(texel).collect();
        luminances.extend(texels.iter().zip(&empty).filter(|(_, empty)| !**empty).map(|(c, _)| luminance(*c)));
        gutters(page.size, &mut texels, &empty);
        (page.size, texels)
    });
    let pages = pages.collect();
    (pages, auto_exposure(luminances))
}

fn radiance(baked: &Baked, page: usize, at: usize, texel: usize) -> Vec3 {
    // The map of all light has its buried texels filled; the others do not hold all light.
    let map = baked.lightmaps.pages.get(page).filter(|_| baked.lightmaps.content == Content::Full);
    let irradiance = map.map_or(baked.irradiance[texel], |map| map.irradiance[at]);
    (baked.patches.reflectance[texel] * irradiance + baked.patches.exitance[texel]) / PI
}
