//! A finished bake as the eye has it: the light that leaves its surfaces.

use super::{Sight, auto_exposure};
use crate::{
    atlas::NO_TEXEL,
    bake::Baked,
    lightmaps::{Content, Reading, gutters},
    math::{hash, luminance},
    trace::{Hit, NOWHERE, Ray},
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

/// What a ray sees: the surface in the light of the map, as a viewer would draw it if it read the map so.
pub fn sight(baked: &Baked, origin: Vec3, direction: Vec3, reading: Reading) -> Option<Sight> {
    let world = &baked.tracer.world;
    let scene = world.scene;
    let key = direction.to_array().map(f32::to_bits).into_iter().fold(0, hash);
    let hit = baked.tracer.closest(&Ray { origin, direction, key, from: NOWHERE })?;
    let front = hit.front || world.material(hit.triangle).double_sided;
    let (instance, t) = world.locate(hit.triangle);
    let (mesh, unlit) = (world.mesh(instance), world.material(hit.triangle).unlit);
    let radiance = if unlit {
        scene.base_color(mesh, t, hit.bary, 0.0).truncate()
    } else {
        let surface = scene.surface(mesh, t, hit.bary, 0.0);
        surface.reflectance * seen_irradiance(baked, &hit, reading) / PI + surface.emission
    };
    Some(Sight { distance: hit.t, front, radiance, unlit })
}

/// Irradiance of the lightmap, or of the patch where the map does not hold all light.
fn seen_irradiance(baked: &Baked, hit: &Hit, reading: Reading) -> Vec3 {
    let charted = &baked.coverage.charted[hit.triangle as usize];
    let Some(page) = baked.atlas.pages.get(charted.page as usize) else { return Vec3::ZERO };
    let at = charted.at(hit.bary);
    if !page.hidden && baked.lightmaps.content == Content::Full {
        return baked.lightmaps.read(&baked.coverage, hit.triangle, hit.bary, reading);
    }
    let texel = baked.coverage.texel_near(charted, at);
    texel.map_or(Vec3::ZERO, |t| baked.irradiance[t as usize])
}
