//! Lamps, the sun and the sky by their formulas.

use super::*;
use std::f64::consts::PI;

/// A black floor [-2, 2]^2 at y = 0 that looks up, of n x n texels, under one light.
fn floor(n: u32, kind: LightKind, position: Vec3, direction: Vec3, range: f32) -> (Shot, Chart) {
    let mut stage = Stage::new();
    let black = stage.material(0.0, 0.0);
    let corner = vec3(-2.0, 0.0, -2.0);
    let chart = rectangle(&mut stage, black, [corner, Vec3::Z * 4.0, Vec3::X * 4.0], UVec2::splat(n));
    stage.light(kind, position, direction, 10.0);
    stage.scene.lights[0].range = range;
    (shoot(stage, 256), chart)
}

/// Every texel is a mean over points inside it: between the law's extremes there; and their mean is the law's.
fn follows(shot: &Shot, chart: Chart, law: impl Fn(DVec3) -> f64) {
    let n = shot.rows(chart).len();
    let side = 4.0 / n as f64;
    let (mut sum, mut expected) = (0.0, 0.0);
    for (i, place) in shot.placed(chart) {
        let c = DVec3::new(place.y * 4.0 - 2.0, 0.0, place.x * 4.0 - 2.0);
        let e = grey(shot.baked.irradiance[i]);
        let at = |k: i32| law(c + DVec3::new(f64::from(k / 9 - 4), 0.0, f64::from(k % 9 - 4)) * (side / 8.0));
        let (low, high) = (0..81).map(at).fold((f64::INFINITY, 0f64), |(l, h), v| (l.min(v), h.max(v)));
        assert!(e >= low * (1.0 - 1e-4) - 1e-6 && e <= high * (1.0 + 1e-4) + 1e-6, "{c}: {e} outside {low}..{high}");
        sum += e;
        let square = [c - DVec3::new(side, 0.0, side) / 2.0, DVec3::X * side, DVec3::Z * side];
        expected += exact::mean_over(square, 8, &law);
    }
    // Points of a texel are stratified: their mean is off by far less than the law's range in it.
    assert!((sum / expected - 1.0).abs() < 1e-3, "mean {sum} instead of {expected}");
}

#[test]
fn point_light_falls_with_the_square() {
    let light = vec3(0.3, 1.0, -0.2);
    let (shot, chart) = floor(64, LightKind::Point { radius: 0.0 }, light, Vec3::ZERO, f32::INFINITY);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        10.0 * v.y / v.length().powi(3)
    });
}

#[test]
fn range_ends_a_light() {
    let light = vec3(0.3, 1.0, -0.2);
    let (shot, chart) = floor(64, LightKind::Point { radius: 0.0 }, light, Vec3::ZERO, 1.5);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        let d = v.length();
        10.0 * v.y / d.powi(3) * (1.0 - (d / 1.5).powi(4)).clamp(0.0, 1.0)
    });
}

#[test]
fn spot_has_the_cone_of_the_extension() {
    let (cos_inner, cos_outer) = (libm::cos(0.3), libm::cos(0.7));
    let kind = LightKind::Spot { cos_inner: cos_inner as f32, cos_outer: cos_outer as f32, radius: 0.0 };
    let (light, axis) = (vec3(0.3, 1.5, -0.2), vec3(0.3, -1.0, 0.1).normalize());
    let (shot, chart) = floor(64, kind, light, axis, f32::INFINITY);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        let d = v.length();
        let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
        let cone = (-v.dot(axis.as_dvec3()) / d * scale - cos_outer * scale).clamp(0.0, 1.0);
        10.0 * v.y / d.powi(3) * cone * cone
    });
}

#[test]
fn directional_light_is_lux_times_cosine() {
    let sun = vec3(0.5, -0.8, 0.2).normalize();
    let (shot, chart) = floor(16, LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, f32::INFINITY);
    let e = shot.values(chart);
    assert!(worst(e.iter().map(|e| grey(*e)), -10.0 * f64::from(sun.y)) < 1e-5);
}

/// A wall shadows whatever the signs of the zeros in the sun's direction.
#[test]
fn a_sun_along_an_axis_plane_casts_shadows() {
    for sun in [vec3(1.0, -1.0, 0.0), vec3(1.0, -1.0, -0.0), vec3(0.0, -1.0, 1.0), vec3(-0.0, -1.0, 1.0)] {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let bowl = Ball::bowl(0.5, uvec2(64, 16), 1).build(&mut stage, black);
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, 1.0);
        let shot = shoot(stage, 64);
        // All that enters the opening of pi m^2 lands on 2 pi m^2; facets and shadow edges: 2 %.
        let got = shot.mean(&[bowl]).1.x;
        assert!((got / (0.5 * libm::sqrt(0.5)) - 1.0).abs() < 0.02, "{sun}: {got}");
    }
}

#[test]
fn uniform_sky_over_a_plane_is_pi_l() {
    let mut stage = Stage::new();
    let white = stage.material(0.9, 0.0);
    let plane = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(8));
    stage.scene.sky = Sky::Uniform(Vec3::splat(2.0));
    let shot = shoot(stage, 64);
    assert!(worst(shot.values(plane).iter().map(|e| grey(*e)), 2.0 * PI) < 1e-5);
}

/// A half plane 1 m above the floor under a sun in the zenith of 10 degrees across: the share of the disc beside the
/// edge. sin for tan and the cosine over the disc cost (sin 5 deg)^2; texels are a sixteenth of the disc's radius.
#[test]
fn penumbra_is_the_share_of_the_disc() {
    let (mut stage, rays, angle) = (Stage::new(), 1024, 10f64.to_radians());
    let black = stage.material(0.0, 0.0);
    let r = libm::sin(angle / 2.0);
    let n = 48u32;
    let half = 1.5 * r;
    let corner = vec3(-half as f32, 0.0, -0.1);
    let edges = [corner, Vec3::Z * 0.2, Vec3::X * (2.0 * half) as f32];
    let chart = rectangle(&mut stage, black, edges, uvec2(8, n));
    rectangle(&mut stage, black, [vec3(-9.0, 1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 9.0], UVec2::splat(4));
    stage.light(LightKind::Directional { angle: angle as f32 }, Vec3::ZERO, -Vec3::Y, 1.0);
    let shot = shoot(stage, rays);
    let share = |x: f64| {
        let u = (x / r).clamp(-1.0, 1.0);
        0.5 + (u * libm::sqrt(1.0 - u * u) + libm::asin(u)) / PI
    };
    let side = 2.0 * half / f64::from(n);
    let errors: Vec<f64> = shot
        .placed(chart)
        .into_iter()
        .map(|(i, place)| {
            let x = (place.y - 0.5) * 2.0 * half;
            let expected = (share(x - side / 4.0) + share(x + side / 4.0)) / 2.0;
            let sigma = libm::sqrt(expected * (1.0 - expected) / f64::from(rays)) + r * r;
            (grey(shot.baked.irradiance[i]) - expected) / sigma
        })
        .collect();
    within_sigma(&errors).unwrap();
}
