//! What is closer than a texel, and what a texel is folded over.

use super::*;

/// Mean irradiance of the lowest texels of a black wall, of one metre, on a floor of such texels, under a sun that reaches
/// the floor from `lit[0]` to `lit[1]` metres from the wall, along one texel. The wall is as high as so many texels.
fn wall(rho: f32, lit: [f32; 2], high: u32) -> f64 {
    let mut stage = Stage::new();
    let (black, floor) = (stage.material(0.0, 0.0), stage.material(rho, 0.0));
    let edges = [vec3(0.0, 0.0, -8.0), Vec3::Y * high as f32, Vec3::Z * 16.0];
    let wall = rectangle(&mut stage, black, edges, uvec2(high, 16));
    rectangle(&mut stage, floor, [vec3(0.0, 0.0, -16.0), Vec3::Z * 32.0, Vec3::X], uvec2(32, 1));
    for (from, to) in [(-1.0, lit[0]), (lit[1], 2.0)] {
        let shade = [vec3(from, 9.0, -20.0), Vec3::Z * 40.0, Vec3::X * (to - from)];
        rectangle(&mut stage, black, shade, uvec2(40, 1));
    }
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 1.0);
    let shot = shoot_with(stage, bake::Options { transport: transport::Options::of(1024), ..options(1024) });
    let lowest: Vec<f64> = shot
        .placed(wall)
        .iter()
        .filter(|(_, at)| at.x * f64::from(high) < 1.0)
        .map(|(i, _)| grey(shot.baked.irradiance[*i]))
        .collect();
    assert_eq!(lowest.len(), 16);
    lowest.iter().sum::<f64>() / 16.0
}

/// The same in closed form: an endless strip as wide as w at its edge has the form factor
/// (1 - sqrt(1 + w^2) + w) / 2 from a wall as high as 1. The second value: if the texel reflected as one.
fn exact(rho: f32, lit: [f32; 2]) -> [f64; 2] {
    let [from, to] = lit.map(f64::from);
    let form_factor = |w: f64| 0.5 * (1.0 - libm::sqrt(1.0 + w * w) + w);
    [form_factor(to) - form_factor(from), form_factor(1.0) * (to - from)].map(|f| f * f64::from(rho))
}

/// Down to a quarter of a texel, whether texels share rays or have more of their own. What is left is light that comes along
/// the wall from where all of a texel is seen as one.
#[test]
fn a_wall_sees_which_part_of_a_texel_is_lit() {
    for (rho, lit) in [(0.8, [0.0, 0.25]), (0.8, [0.0, 0.5]), (0.5, [0.25, 0.5]), (0.8, [0.5, 1.0])] {
        for high in [1, 4] {
            let (got, [expected, as_one]) = (wall(rho, lit, high), exact(rho, lit));
            let left = (got - expected) / (as_one - expected);
            assert!(left.abs() < 0.15, "{lit:?}, {high}: {got} instead of {expected}, not of {as_one}");
        }
    }
}

/// Prisms of three sides on charts of one texel each, so that a texel is folded over all of its sides, under a sun that
/// nothing hides. Few shadow rays must not be mistaken for knowing how much of the texel faces the sun.
#[test]
fn a_folded_texel_has_the_mean_of_its_sides() {
    let sun = vec3(0.6, -0.8, 0.0);
    for turn in 0..8 {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let angle = |side: u32| (f64::from(side) + f64::from(turn) / 8.0) * std::f64::consts::TAU / 3.0;
        let corner = |i: u32, j: u32| {
            let a = angle(i);
            vec3(libm::cos(a) as f32, libm::sin(a) as f32, j as f32)
        };
        let prism = stage.grid("prism", black, [uvec2(3, 1), uvec2(1, 1)], false, corner, None);
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, 1.0);
        let shot = shoot(stage, 16);
        let side = |k: u32| {
            let [a, b] = [corner(k, 0), corner(k + 1, 0)];
            let normal = (b - a).cross(Vec3::Z).normalize();
            f64::from(normal.dot(-sun).max(0.0)) / 3.0
        };
        let (expected, got) = ((0..3).map(side).sum::<f64>(), grey(shot.values(prism)[0]));
        assert!((got / expected - 1.0).abs() < 0.02, "{turn}: {got} instead of {expected}");
    }
}
