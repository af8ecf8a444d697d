//! Light of some bounces, and of all: furnaces, sums, what the maps hold.

use super::*;
use luxel::{lightmaps::Content, radiosity::Solver};

/// Patches near the lamp are bright enough to be sampled as sources themselves, which is their light's first bounce.
#[test]
fn no_bounce_is_direct_light_alone() {
    let bake = |reuse, receivers| {
        let mut stage = Stage::new();
        let (white, lamp) = (stage.material(0.8, 0.0), LightKind::Point { radius: 0.0 });
        unit_room().all(&mut stage, white, 24);
        stage.light(lamp, vec3(0.5, 0.95, 0.5), Vec3::ZERO, 1.0);
        let radiosity = radiosity::Options { bounces: Some(0), ..Default::default() };
        let transport = transport::Options { reuse, receivers, ..transport::Options::of(32) };
        shoot_with(stage, bake::Options { transport, radiosity, ..options(32) }).baked.irradiance
    };
    let [all, adaptive] = transport::Receivers::ALL;
    let alone = bake(false, all);
    assert!(alone == bake(true, all) && alone == bake(false, adaptive) && alone == bake(true, adaptive));
}

#[test]
fn furnaces_read_their_value_at_every_texel() {
    let ball = |smooth| Ball { smooth, ..Ball::whole(Vec3::ZERO, 1.0, uvec2(24, 12), true) };
    for (rho, m) in [(0.5, 1.0), (0.9, 0.25), (0.97, 1.0), (0.99, 1.0), (0.9999, 1.0)] {
        for which in 0..4 {
            let mut stage = Stage::new();
            let grey_wall = stage.material(rho, m);
            match which {
                0 => drop(unit_room().all(&mut stage, grey_wall, 12)),
                1 => drop(furnished(&mut stage, grey_wall, grey_wall, 12)),
                _ => drop(vec![ball(which == 3).build(&mut stage, grey_wall)]),
            }
            let expected = f64::from(m) / (1.0 - f64::from(rho));
            let baked = unwrapped(stage, 128, 32);
            let off = worst(baked.irradiance.iter().map(|e| grey(*e)), expected);
            // Reflectance and the weights of rows are single precision.
            let rounding = f64::from(f32::EPSILON) / (1.0 - f64::from(rho));
            assert!(off < radiosity::TOLERANCE + rounding, "scene {which}, rho {rho}: off by {off}");
            assert_eq!((baked.report.rays.lost, baked.report.rays.escaped), (0, 0), "scene {which}");
            assert!(
                baked.report.solver.converged,
                "scene {which}, rho {rho}: {:?}",
                baked.report.solver.relative_bound
            );
        }
    }
}

#[test]
fn bounces_of_a_furnace_are_the_geometric_sum() {
    let (rho, m) = (0.75f32, 2.0);
    for bounces in [0, 1, 2, 7] {
        let mut stage = Stage::new();
        let wall = stage.material(rho, m);
        furnished(&mut stage, wall, wall, 8);
        let radiosity = radiosity::Options { bounces: Some(bounces), ..radiosity::Options::default() };
        let baked = shoot_with(stage, bake::Options { radiosity, ..options(64) }).baked;
        let rho = grey(baked.patches.reflectance[0]);
        let sum: f64 = (0..=bounces).map(|k| libm::pow(rho, k.into())).sum();
        let off = worst(baked.irradiance.iter().map(|e| grey(*e)), f64::from(m) * sum);
        assert!(off < 2e-6, "{bounces} bounces: off by {off}");
        let report = &baked.report;
        assert!(report.solver.bounces == Some(bounces) && report.solver.bound.is_none(), "{:?}", report.solver);
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    }
}

/// A lamp that sends its first hit to the direct map and a glowing block: contents at every number of bounces.
#[test]
fn contents_of_some_bounces_add_up() {
    let bake = |content, bounces, solver| {
        let mut stage = Stage::new();
        let (wall, block) = (stage.material(0.8, 0.0), stage.material(0.4, 1.0));
        let charts = furnished(&mut stage, wall, block, 8);
        stage.light(LightKind::Point { radius: 0.0 }, vec3(1.0, 0.9, 1.2), Vec3::ZERO, 3.0);
        let radiosity = radiosity::Options { solver, bounces };
        let shot = shoot_with(stage, bake::Options { content, radiosity, ..options(64) });
        charts.iter().flat_map(|c| shot.mapped(*c)).map(|e| e.as_dvec3()).collect::<Vec<_>>()
    };
    let (default, other) = (Solver::default(), Solver::Jacobi);
    let mut before = vec![DVec3::ZERO; bake(Content::Direct, None, default).len()];
    for bounces in [Some(0), Some(1), Some(3), None] {
        let [full, direct, indirect] =
            [Content::Full, Content::Direct, Content::Indirect].map(|c| bake(c, bounces, default));
        assert!(direct == bake(Content::Direct, None, default), "the first hit has no bounce");
        for (full, (direct, indirect)) in full.iter().zip(direct.iter().zip(&indirect)) {
            assert!((*full - (*direct + *indirect)).abs().max_element() <= 1e-6 * full.max_element());
        }
        let grows = full.iter().zip(&before).all(|(now, before)| now.cmpge(*before * (1.0 - 1e-3)).all());
        assert!(grows, "{bounces:?}: more bounces, more light");
        assert!(full.iter().sum::<DVec3>().x > 1.01 * before.iter().sum::<DVec3>().x, "{bounces:?}");
        if bounces.is_some() {
            assert!(full == bake(Content::Full, bounces, other), "{bounces:?}: a sum is a sum");
        }
        before = full;
    }
}
