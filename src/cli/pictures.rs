//! A finished bake as pictures: the preview, and the pages of `--flat`.

use super::camera;
use glam::{UVec2, Vec3};
use luxel::{
    atlas::{NO_TEXEL, PADDING},
    bake::Baked,
    files,
    lightmaps::Content,
    math::{hash, luminance},
    pixels::encode_png,
    preview::{self, Picture, Sight},
    scene::{Camera, Scene},
    trace::Hit,
};
use std::{f32::consts::PI, path::Path};

/// Width and height of the preview.
const SIZE: UVec2 = UVec2::new(960, 540);

/// What `camera`, or a camera that is found, sees of the baked scene.
pub fn preview(scene: &Scene, baked: &Baked, camera: Option<Camera>) -> Picture {
    let cast = |origin: Vec3, direction: Vec3| sight(scene, baked, origin, direction);
    let aspect = SIZE.x as f32 / SIZE.y as f32;
    let camera = camera.unwrap_or_else(|| camera::find(scene, &cast, aspect));
    preview::paint(&cast, &scene.sky, &camera, SIZE)
}

/// Writes a picture as PNG, whole or not at all.
pub fn write(picture: &Picture, file: &Path) -> luxel::error::Result<()> {
    files::write_whole(file, |out| out.write_all(&encode_png(picture.size, &picture.rgb)?))
}

/// Radiance of each visible page, gutters filled, and the exposure that shows it well.
pub fn flat(baked: &Baked) -> (Vec<(UVec2, Vec<Vec3>)>, f32) {
    let mut luminances = Vec::new();
    let visible = baked.atlas.pages.iter().zip(&baked.coverage.grids).enumerate().filter(|(_, (p, _))| !p.hidden);
    let pages = visible.map(|(index, (page, grid))| {
        let texel =
            |(at, &texel): (usize, &u32)| (texel != NO_TEXEL).then(|| radiance(baked, index, at, texel as usize));
        let mut texels: Vec<Option<Vec3>> = grid.iter().enumerate().map(texel).collect();
        luminances.extend(texels.iter().flatten().map(|c| luminance(*c)));
        for _ in 0..PADDING {
            grow(&mut texels, page.size);
        }
        (page.size, texels.into_iter().map(Option::unwrap_or_default).collect())
    });
    let pages = pages.collect();
    (pages, preview::auto_exposure(luminances))
}

fn radiance(baked: &Baked, page: usize, at: usize, texel: usize) -> Vec3 {
    // The map of all light has its buried texels filled; the others do not hold all light.
    let map = baked.lightmaps.pages.get(page).filter(|_| baked.lightmaps.content == Content::Full);
    let irradiance = map.map_or(baked.irradiance[texel], |map| map.irradiance[at]);
    (baked.patches.reflectance[texel] * irradiance + baked.patches.exitance[texel]) / PI
}

/// Gives every empty texel beside full ones their mean.
fn grow(texels: &mut [Option<Vec3>], size: UVec2) {
    let from = texels.to_vec();
    let (width, height) = (i64::from(size.x), i64::from(size.y));
    for (i, texel) in texels.iter_mut().enumerate().filter(|(_, t)| t.is_none()) {
        let (x, y) = (i as i64 % width, i as i64 / width);
        let around = (0..9).map(|k| (x + k % 3 - 1, y + k / 3 - 1));
        let around = around.filter(|&(x, y)| (0..width).contains(&x) && (0..height).contains(&y));
        let (sum, n) = around
            .filter_map(|(x, y)| from[(y * width + x) as usize])
            .fold((Vec3::ZERO, 0.0), |(sum, n), c| (sum + c, n + 1.0));
        *texel = (n > 0.0).then(|| sum / n);
    }
}

/// What a ray sees: the surface in the light of the map, as a viewer would draw it.
fn sight(scene: &Scene, baked: &Baked, origin: Vec3, direction: Vec3) -> Option<Sight> {
    let world = &baked.tracer.world;
    let key = direction.to_array().map(f32::to_bits).into_iter().fold(0, hash);
    let hit = baked.tracer.closest(origin, direction, key)?;
    let front = hit.front || world.material(hit.triangle).double_sided;
    let (instance, t) = world.locate(hit.triangle);
    let surface = scene.surface(world.mesh(instance), t, hit.bary, 0.0);
    let radiance = surface.reflectance * seen_irradiance(baked, &hit) / PI + surface.emission;
    Some(Sight { distance: hit.t, front, radiance })
}

/// Bilinear irradiance of the lightmap, or of the patch where the map does not hold all light.
fn seen_irradiance(baked: &Baked, hit: &Hit) -> Vec3 {
    let charted = &baked.coverage.charted[hit.triangle as usize];
    let Some(page) = baked.atlas.pages.get(charted.page as usize) else { return Vec3::ZERO };
    let at = charted.at(hit.bary);
    if !page.hidden && baked.lightmaps.content == Content::Full {
        return baked.lightmaps.pages[charted.page as usize].bilinear(at);
    }
    let texel = baked.coverage.texel_near(charted, at);
    texel.map_or(Vec3::ZERO, |t| baked.irradiance[t as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gutters_take_the_mean_of_their_neighbours() {
        let mut texels = vec![Some(Vec3::ONE), None, None, Some(Vec3::splat(3.0)), None, None];
        grow(&mut texels, UVec2::new(3, 2));
        let two = Some(Vec3::splat(2.0));
        assert_eq!(texels, [Some(Vec3::ONE), two, None, Some(Vec3::splat(3.0)), two, None]);
    }
}
