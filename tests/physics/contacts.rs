//! Light from surfaces nearer than a texel.

use super::{bright::Rooms, *};
use luxel::{
    direct::{Sampler, Sources},
    math::Random,
    patches::{Patches, SurfacePoint},
    scene::World,
    trace::{NOWHERE, Ray, Tracer},
};

/// Mean irradiance of a black wall of texels of one metre on a floor of such texels, under a sun that reaches the floor from
/// `lit[0]` to `lit[1]` metres from the wall, along one texel.
fn wall(rho: f32, lit: [f32; 2]) -> f64 {
    let mut stage = Stage::new();
    let (black, floor) = (stage.material(0.0, 0.0), stage.material(rho, 0.0));
    let wall = rectangle(&mut stage, black, [vec3(0.0, 0.0, -8.0), Vec3::Y, Vec3::Z * 16.0], uvec2(1, 16));
    rectangle(&mut stage, floor, [vec3(0.0, 0.0, -16.0), Vec3::Z * 32.0, Vec3::X], uvec2(32, 1));
    for (from, to) in [(-1.0, lit[0]), (lit[1], 2.0)] {
        let shade = [vec3(from, 5.0, -20.0), Vec3::Z * 40.0, Vec3::X * (to - from)];
        rectangle(&mut stage, black, shade, uvec2(40, 1));
    }
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 1.0);
    shoot(stage, 1024).mean(&[wall]).1.x
}

/// The same in closed form: an endless strip as wide as w at its edge has the form factor
/// (1 - sqrt(1 + w^2) + w) / 2 from a wall as high as 1. The second value: if the texel reflected as one.
fn exact(rho: f32, lit: [f32; 2]) -> [f64; 2] {
    let [from, to] = lit.map(f64::from);
    let form_factor = |w: f64| 0.5 * (1.0 - libm::sqrt(1.0 + w * w) + w);
    [form_factor(to) - form_factor(from), form_factor(1.0) * (to - from)].map(|f| f * f64::from(rho))
}

/// What is left is light that comes along the wall from further away than is near.
#[test]
fn a_wall_sees_which_part_of_a_texel_is_lit() {
    for (rho, lit) in [(0.8, [0.0, 0.25]), (0.8, [0.0, 0.5]), (0.5, [0.0, 0.1]), (0.8, [0.5, 1.0])] {
        let (got, [expected, as_one]) = (wall(rho, lit), exact(rho, lit));
        let left = (got - expected) / (as_one - expected);
        assert!(left.abs() < 0.15, "{lit:?}: {got} instead of {expected}, not of {as_one}");
    }
}

/// The mean of single samples at a point is what a texel of a square millimetre receives from a lamp near it, many far ones, a
/// point light and the sun, half of them in a shadow.
#[test]
fn samples_at_a_point_have_the_texels_mean() {
    let stage = || {
        let mut stage = Stage::new();
        let (black, lamp) = (stage.material(0.0, 0.0), stage.material(0.0, 5.0));
        rectangle(&mut stage, black, [vec3(-5e-4, 0.0, -5e-4), Vec3::Z * 1e-3, Vec3::X * 1e-3], UVec2::ONE);
        let down = |x: f32, y: f32, edge: f32| [vec3(x, y, -0.1), Vec3::X * edge, Vec3::Z * edge];
        rectangle(&mut stage, lamp, down(0.1, 0.1, 0.2), UVec2::ONE);
        (0..40).for_each(|k| _ = rectangle(&mut stage, lamp, down(-4.0 + 0.2 * k as f32, 3.0, 0.1), UVec2::ONE));
        rectangle(&mut stage, black, down(-1.0, 0.5, 0.9), uvec2(9, 9));
        rectangle(&mut stage, black, [vec3(-50.0, -1.0, 50.0), Vec3::X * 100.0, Vec3::NEG_Z * 100.0], UVec2::splat(4));
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.3, 0.05, 0.5), Vec3::ZERO, 0.2);
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, vec3(0.3, -1.0, 1.0), 1.0);
        stage
    };
    let rooms = Rooms::new(stage(), 4096);
    let expected = grey(rooms.direct.total(0));
    let mut stage = stage();
    stage.lay_out();
    let tracer = Tracer::new(World::new(&stage.scene));
    let sources = Sources::new(&tracer, &Patches { fronts: 0, ..rooms.patches.clone() });
    let ray = Ray { origin: Vec3::Y * 0.01, direction: Vec3::NEG_Y, key: 0, from: NOWHERE };
    let hit = tracer.closest(&ray).expect("the texel");
    let p = SurfacePoint::met(&tracer.world, &hit);
    let (mut sampler, mut random, n) = (Sampler::default(), Random::new(7), 200_000);
    let samples = (0..n).map(|_| grey(sampler.irradiance(&tracer, &sources, &p, &mut random)));
    let (sum, squares) = samples.fold((0.0, 0.0), |(sum, squares), x| (sum + x, squares + x * x));
    let mean = sum / f64::from(n);
    let sigma = libm::sqrt((squares / f64::from(n) - mean * mean) / f64::from(n));
    assert!(sigma < 0.01 * expected, "too few samples: {sigma}");
    assert!((mean - expected).abs() < 4.0 * sigma + 2e-3 * expected, "{mean} +- {sigma} instead of {expected}");
}
