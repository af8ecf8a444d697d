//! Light and matter, point by point, each against a closed form or an exact symmetry.

mod buried;
mod light;
mod surface;

#[path = "../common/mod.rs"]
mod common;

use common::{
    bakes::{Shot, grey},
    scenes::rectangle,
    stage::{Chart, Stage},
};
use glam::{DVec3, UVec2, Vec3, vec3};
use luxel::scene::{Material, Sky};

const PI: f64 = std::f64::consts::PI;

/// A black square that looks up: edge `a`, centre `o`.
fn plane(stage: &mut Stage, o: Vec3, a: f32, texels: u32) -> Chart {
    let black = stage.material(0.0, 0.0);
    sheet(stage, black, o, a, texels)
}

/// A square that looks up: edge `a`, centre `o`. Its chart: u along x, v along -z.
fn sheet(stage: &mut Stage, material: u32, o: Vec3, a: f32, texels: u32) -> Chart {
    rectangle(stage, material, corners(o, a), UVec2::splat(texels))
}

fn corners(o: Vec3, a: f32) -> [Vec3; 3] {
    [o + vec3(-a, 0.0, a) / 2.0, Vec3::X * a, Vec3::NEG_Z * a]
}

/// The four corners of a part of a parallelogram.
fn part([o, s, t]: [Vec3; 3], u: [f32; 2], v: [f32; 2]) -> [DVec3; 4] {
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (o + s * u[i] + t * v[j]).as_dvec3())
}

fn mean(shot: &Shot, chart: Chart) -> f64 {
    shot.mean(&[chart]).1.x
}

fn white(l: f32) -> Sky {
    Sky::Uniform(Vec3::splat(l))
}

/// Asserts |got / expected - 1| <= tolerance.
#[track_caller]
fn close(what: &str, got: f64, expected: f64, tolerance: f64) {
    let off = got / expected - 1.0;
    assert!(off.abs() <= tolerance, "{what}: {got:.5} instead of {expected:.5} ({:+.2} %)", 100.0 * off);
}

/// First channels of a chart's irradiance.
fn greys(shot: &Shot, chart: Chart) -> Vec<f64> {
    shot.values(chart).into_iter().map(grey).collect()
}

fn black() -> Material {
    Material { base_color: Vec3::ZERO.extend(1.0), ..Material::default() }
}
