//! Physics before pixels: lights by their formulas, furnaces, the balance of power, the same bytes on any threads.

mod bounces;
mod bright;
mod contacts;
mod groups;
mod lights;

#[path = "../common/mod.rs"]
mod common;

use common::{
    bakes::{Shot, grey, options, parts, shoot, shoot_with, spread, unwrapped, within_sigma, worst},
    exact,
    scenes::{Ball, Cuboid, FACES, Face, furnished, rectangle, unit_room},
    stage::{Chart, Stage},
};
use glam::{DVec3, UVec2, Vec3, uvec2, vec3};
use luxel::{
    atlas::{self, Density},
    bake, radiosity,
    scene::{LightKind, Sky},
    transport,
};

#[test]
fn power_put_in_is_power_absorbed() {
    let mut stage = Stage::new();
    let (wall, block) = (stage.material(0.8, 0.0), stage.material(0.3, 2.0));
    furnished(&mut stage, wall, block, 16);
    let shot = shoot(stage, 256);
    let [absorbed, emitted] = shot.power();
    // 2176 rows of 256 rays, each off by some 5 % of its value: 5 % / sqrt(2176) = .1 %.
    assert!((absorbed / emitted - 1.0).abs() < 3e-3, "{absorbed} of {emitted}");
    let energy = &shot.baked.report.energy;
    assert!((energy.emitted / (3.0 * emitted) - 1.0).abs() < 1e-4);
    assert!(energy.imbalance.abs() < 3e-3, "{}", energy.imbalance);
}

#[test]
fn walls_bleed_their_colour() {
    let mut stage = Stage::new();
    let mut paint = |r, g, b| stage.rgb(vec3(r, g, b), Vec3::ZERO, false);
    let (white, red, green) = (paint(0.8, 0.8, 0.8), paint(0.8, 0.05, 0.05), paint(0.05, 0.8, 0.05));
    let lamp = stage.material(0.0, 5.0);
    let room = unit_room();
    let charts = FACES.map(|f| {
        let material = match f {
            Face::Left => red,
            Face::Right => green,
            Face::Top => lamp,
            _ => white,
        };
        room.face(&mut stage, f, material, UVec2::ONE, UVec2::splat(16))
    });
    let shot = shoot(stage, 256);
    let floor = shot.rows(charts[2]);
    let side = |columns: std::ops::Range<usize>| {
        let texels = floor.iter().flat_map(|row| row[columns.clone()].iter().flatten());
        texels.map(|i| shot.baked.irradiance[*i]).sum::<Vec3>()
    };
    let (near_red, near_green) = (side(0..4), side(12..16));
    assert!(near_red.x > 1.05 * near_red.y && near_green.y > 1.05 * near_green.x, "{near_red} {near_green}");
    // The room is symmetric but for the colours.
    assert!((near_red.x / near_green.y - 1.0).abs() < 0.02);
    let (blue, _) = spread(&shot.values(charts[2]).iter().map(|e| f64::from(e.z)).collect::<Vec<_>>());
    assert!(blue > 0.0);
}

#[test]
fn reflectance_is_capped_with_a_warning() {
    let mut stage = Stage::new();
    let white = stage.material(1.0, 1.0);
    unit_room().all(&mut stage, white, 8);
    let shot = shoot_with(stage, bake::Options { transport: transport::Options::of(32), ..bake::Options::default() });
    assert!(worst(shot.baked.irradiance.iter().map(|e| grey(*e)), 1.0 / (1.0 - 0.98)) < 2e-3);
    assert!(shot.baked.report.warnings.iter().any(|w| w.contains("capped")), "{:?}", shot.baked.report.warnings);
    assert!((shot.baked.report.reflectance.capped_area - 6.0).abs() < 1e-4);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut stage = Stage::new();
    let (wall, block) = (stage.material(0.7, 0.0), stage.material(0.4, 1.0));
    furnished(&mut stage, wall, block, 16);
    Cuboid::block(Vec3::splat(0.8), Vec3::splat(0.9)).all(&mut stage, block, 4);
    stage.light(LightKind::Point { radius: 0.05 }, vec3(1.0, 0.5, 1.2), Vec3::ZERO, 3.0);
    stage.lay_out();
    let mut options = options(64);
    options.atlas.density = Density::Resolution(128);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let baked = pool.install(|| parts(&stage.scene, &options));
        let bits = |v: &[Vec3]| v.iter().flat_map(|e| e.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        (bits(&baked.irradiance), baked.lightmaps.pages.iter().map(|m| bits(&m.irradiance)).collect::<Vec<_>>())
    };
    let once = run(1);
    assert!(once == run(2) && once == run(3) && once == run(1));
}
