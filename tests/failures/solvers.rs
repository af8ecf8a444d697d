//! The failure scenes that concern the solver, small, over all of them.

use super::{each, reads};
use crate::common::{
    bakes::{Shot, grey, options, shoot_with},
    scenes::{Cuboid, unit_room},
    stage::Stage,
};
use glam::{Vec3, vec3};
use luxel::{
    bake::Options,
    radiosity::{self, Solver, TOLERANCE},
    scene::LightKind,
    transport::Receivers,
};

/// A bake by every solver; it may pass on to another, but must be sure of its answer.
fn by_each(rays: u32, build: impl Fn(&mut Stage), check: impl Fn(Solver, &Shot)) {
    for solver in Solver::ALL {
        let mut stage = Stage::new();
        build(&mut stage);
        let radiosity = radiosity::Options { solver, bounces: None };
        let shot = shoot_with(stage, Options { radiosity, ..options(rays) });
        let report = &shot.baked.report.solver;
        let by = report.fallback.unwrap_or(report.name);
        println!("{}: {by}, {} entries, bound {:.1e}", report.name, report.entries, report.relative_bound.unwrap());
        assert!(report.converged, "{solver:?}: {report:?}");
        check(solver, &shot);
    }
}

fn furnace(rho: f32) -> impl Fn(&mut Stage) {
    move |stage| {
        let m = stage.material(rho, 1.0);
        unit_room().all(stage, m, 6);
    }
}

#[test]
fn every_solver_albedo_to_one() {
    by_each(16, furnace(0.999), |_, shot| reads(shot, 1000.0));
}

#[test]
fn every_solver_row_sum_over_one() {
    for rays in [1, 3] {
        by_each(rays, furnace(0.8), |_, shot| reads(shot, 5.0));
    }
}

#[test]
fn every_solver_f32_accumulation() {
    let one = |stage: &mut Stage| {
        let m = stage.material(0.8, 1.0);
        unit_room().all(stage, m, 1);
    };
    by_each(65536, one, |_, shot| reads(shot, 5.0));
}

/// A sealed dark room beside a lit one stays black; shooting's ambient estimate shines into it, less than its bound says.
#[test]
fn every_solver_thin_wall_leak() {
    let two = |stage: &mut Stage| {
        let white = stage.material(0.8, 0.0);
        Cuboid::room(vec3(1.01, 0.0, 0.0), vec3(2.01, 1.0, 1.0)).all(stage, white, 6);
        unit_room().all(stage, white, 6);
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.9, 0.5, 0.5), Vec3::ZERO, 10.0);
    };
    by_each(16, two, |solver, shot| {
        let (dark, lit): (Vec<_>, Vec<_>) =
            (0..shot.baked.irradiance.len()).partition(|i| shot.baked.patches.center[*i].x > 1.005);
        let mean = lit.iter().map(|i| grey(shot.baked.irradiance[*i])).sum::<f64>() / lit.len() as f64;
        let most = dark.iter().map(|i| grey(shot.baked.irradiance[*i]).abs()).fold(0.0, f64::max);
        let allowed = if solver == Solver::Shooting { 1e-2 * TOLERANCE * mean } else { 0.0 };
        assert!(mean > 1.0 && most <= allowed, "{solver:?}: {most} beside {mean}");
    });
}

/// With their own rays and with their neighbours', at every texel and at some.
#[test]
fn every_solver_serves_neighbours() {
    for solver in Solver::ALL {
        let refused = |o: &Options| solver == Solver::ConjugateGradient && o.transport.receivers == Receivers::Auto;
        for options in each(16).into_iter().filter(|o| !refused(o)) {
            let mut stage = Stage::new();
            furnace(0.8)(&mut stage);
            let radiosity = radiosity::Options { solver, bounces: None };
            reads(&shoot_with(stage, Options { radiosity, ..options }), 5.0);
        }
    }
}
