//! What view rays see, where the answer is known.

mod common;

use common::{
    scenes::{Cuboid, FACES, Face},
    stage::Stage,
};
use glam::{UVec2, Vec3, vec3};
use luxel::{
    atlas::{self, Density},
    bake::{self, Baked, Options},
    lightmaps::{Content, Reading},
    progress::Silent,
    render,
    scene::{Bake, LightKind, Material, Scene},
};
use std::f32::consts::PI;

fn baked(scene: &Scene, content: Content) -> Baked<'_> {
    let atlas = atlas::Options { density: Density::Resolution(64), ..atlas::Options::default() };
    bake::bake(scene, &Options { atlas, content, ..Options::default() }, &Silent).unwrap()
}

/// Radiance of a block of metal, from many directions, in a closed room whose black walls shine with radiance 1.
fn seen(metal: Material, paths: u32) -> Vec<Vec3> {
    let mut stage = Stage::new();
    let wall = stage.material(0.0, PI);
    let block = stage.add(metal);
    Cuboid::room(Vec3::splat(-2.0), Vec3::splat(2.0)).all(&mut stage, wall, 8);
    Cuboid::block(vec3(-0.5, -0.3, -0.4), vec3(0.5, 0.3, 0.4)).all(&mut stage, block, 8);
    let baked = baked(&stage.scene, Content::Full);
    let view = render::of_bake(&baked, Reading::Bilinear, paths);
    let eyes = (0..40).map(|i| vec3(1.8 - 0.09 * i as f32, 1.1, 1.7 - 0.03 * i as f32));
    eyes.map(|eye| view.sight(eye, -eye.normalize()).unwrap().radiance).collect()
}

fn metal(roughness: f32) -> Material {
    Material { base_color: vec3(1.0, 0.6, 0.2).extend(1.0), metallic: 1.0, roughness, ..Material::default() }
}

#[test]
fn metal_in_a_furnace_has_its_colour() {
    for radiance in seen(metal(0.0), 1) {
        // Fresnel's share brightens what is seen at a slant.
        assert!((radiance.x - 1.0).abs() < 1e-3, "{radiance}");
        assert!((0.599..0.75).contains(&radiance.y) && (0.199..0.5).contains(&radiance.z), "{radiance}");
    }
    for radiance in seen(metal(0.6), 256) {
        // What microfacets mirror twice is lost, as in glTF: at a slant a quarter.
        assert!(radiance.x < 1.02 && radiance.x > 0.7, "{radiance}");
    }
}

#[test]
fn half_a_metal_is_half_of_both() {
    let black = Material { base_color: Vec3::ZERO.extend(1.0), ..Material::default() };
    let half = Material { metallic: 0.5, base_color: Vec3::ONE.extend(1.0), roughness: 0.0, ..Material::default() };
    assert!(seen(black, 1).iter().all(|l| *l == Vec3::ZERO));
    for radiance in seen(half, 4) {
        // Half a mirror, and half of irradiance pi that is reflected diffusely.
        assert!((radiance - 1.0).abs().max_element() < 0.03, "{radiance}");
    }
}

/// Half extents of a patch of floor.
const FLOOR: f32 = 2.0;

/// Metal around the origin under a lamp at height 1, of intensity 1, by view rays towards points at (x, -1, z): the lamp's
/// mirror image is at (0, -1, 0).
fn highlight(kind: LightKind, roughness: f32, paths: u32, points: &[[f32; 2]]) -> Vec<f32> {
    let mut stage = Stage::new();
    let floor = stage.add(metal(roughness));
    let (low, high) = (vec3(-FLOOR, -1.0, -FLOOR), vec3(FLOOR, 0.0, FLOOR));
    Cuboid::block(low, high).face(&mut stage, Face::Top, floor, UVec2::ONE, UVec2::splat(8));
    stage.light(kind, Vec3::Y, Vec3::NEG_Y, 1.0);
    let baked = baked(&stage.scene, Content::Full);
    let view = render::of_bake(&baked, Reading::Bilinear, paths);
    let eye = vec3(1.0, 1.0, 0.3);
    let seen = |[x, z]: &[f32; 2]| view.sight(eye, (vec3(*x, -1.0, *z) - eye).normalize()).unwrap().radiance.x;
    points.iter().map(seen).collect()
}

#[test]
fn a_mirror_shows_a_lamp_as_a_disc_of_even_light() {
    let radius = 0.15;
    let shine = 1.0 / (PI * radius * radius);
    let inside: Vec<_> = (0..200).map(|i| [0.05 * (i as f32 / 200.0), 0.11 * (i as f32 / 100.0 - 1.0)]).collect();
    for roughness in [0.0, 0.05] {
        // A point of the lamp that is mirrored by chance counts as one path.
        for radiance in highlight(LightKind::Point { radius }, roughness, 256, &inside) {
            assert!((radiance / shine - 1.0).abs() < 0.05, "{roughness}: {radiance} {shine}");
        }
        for radiance in highlight(LightKind::Point { radius }, roughness, 16, &[[0.5, 0.0], [0.0, -0.3], [-0.4, 0.2]]) {
            assert!(radiance < 1e-2 * shine, "{roughness}: {radiance} {shine}");
        }
    }
}

#[test]
fn a_lamp_that_grows_spreads_its_highlight_and_keeps_its_light() {
    let points: Vec<_> = (0..60 * 60).map(|i| [(i % 60) as f32, (i / 60) as f32].map(|x| x / 20.0 - 1.475)).collect();
    for roughness in [0.25, 0.4] {
        let sum = |radius| highlight(LightKind::Point { radius }, roughness, 64, &points).iter().sum::<f32>();
        let share = sum(0.12) / sum(0.0);
        assert!((share - 1.0).abs() < 0.02, "{roughness}: {share}");
    }
}

/// Means over walls and over a floor without a map, in a closed room with a lamp.
fn walls_and_floor(of: Bake, content: Content, of_file: bool) -> [Vec3; 2] {
    let mut stage = Stage::new();
    let grey = stage.material(0.5, 0.0);
    Cuboid::room(Vec3::splat(-FLOOR), Vec3::splat(FLOOR)).all(&mut stage, grey, 8);
    let bare = FACES.iter().position(|f| *f == Face::Bottom).unwrap();
    stage.scene.instances[bare].texels_per_meter = Some(0.0);
    stage.light(LightKind::Point { radius: 0.1 }, vec3(0.2, 0.5, 0.1), Vec3::Y, 5.0);
    stage.scene.lights[0].bake = of;
    let baked = baked(&stage.scene, content);
    let view = if of_file {
        render::of_file(&baked.tracer, &baked.coverage, &baked.lightmaps, 64)
    } else {
        render::of_bake(&baked, Reading::Bilinear, 64)
    };
    let mean = |point: &dyn Fn(f32, f32) -> Vec3| {
        let at = |i: u32| point((i % 16) as f32 / 4.5 - 1.65, (i / 16) as f32 / 4.5 - 1.65);
        (0..256).map(|i| view.sight(Vec3::ZERO, at(i).normalize()).unwrap().radiance).sum::<Vec3>() / 256.0
    };
    [mean(&|x, y| vec3(x, y, -FLOOR)), mean(&|x, z| vec3(x, -FLOOR, z))]
}

#[test]
fn every_light_is_counted_once_whatever_the_map_holds() {
    let truth = walls_and_floor(Bake::Full, Content::Full, true);
    for of in [Bake::Full, Bake::Indirect] {
        for content in Content::ALL {
            // Of a file of direct light the rest is missing, as it says.
            for of_file in [false, true].into_iter().filter(|of_file| !of_file || content != Content::Direct) {
                let seen = walls_and_floor(of, content, of_file);
                for (seen, truth) in seen.iter().zip(&truth) {
                    let off = (*seen / *truth - 1.0).abs().max_element();
                    assert!(off < 0.02, "{of:?} {content:?} {of_file}: {seen} {truth}");
                }
            }
        }
    }
}
