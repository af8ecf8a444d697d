//! What view rays see of metal, where the answer is known.

mod common;

use common::{scenes::Cuboid, stage::Stage};
use glam::{Vec3, vec3};
use luxel::{
    atlas::{self, Density},
    bake::{self, Options},
    lightmaps::Reading,
    progress::Silent,
    render,
    scene::Material,
};
use std::f32::consts::PI;

/// Radiance of a block of metal, from many directions, in a closed room whose black walls shine with radiance 1.
fn seen(metal: Material, paths: u32) -> Vec<Vec3> {
    let mut stage = Stage::new();
    let wall = stage.material(0.0, PI);
    let block = stage.add(metal);
    Cuboid::room(Vec3::splat(-2.0), Vec3::splat(2.0)).all(&mut stage, wall, 8);
    Cuboid::block(vec3(-0.5, -0.3, -0.4), vec3(0.5, 0.3, 0.4)).all(&mut stage, block, 8);
    let atlas = atlas::Options { density: Density::Resolution(64), ..atlas::Options::default() };
    let options = Options { atlas, ..Options::default() };
    let baked = bake::bake(&stage.scene, &options, &Silent).unwrap();
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
