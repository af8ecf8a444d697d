//! All solvers with receivers' own rays and with their neighbours', at every texel and at some.

use super::{each, reads};
use crate::common::{bakes::shoot_with, scenes::unit_room, stage::Stage};
use luxel::{
    bake::Options,
    radiosity::{self, Solver},
    transport::Receivers,
};

#[test]
fn every_solver_serves_neighbours() {
    for solver in Solver::ALL {
        let refused = |o: &Options| solver == Solver::ConjugateGradient && o.transport.receivers == Receivers::Auto;
        for options in each(16).into_iter().filter(|o| !refused(o)) {
            let mut stage = Stage::new();
            let m = stage.material(0.8, 1.0);
            unit_room().all(&mut stage, m, 6);
            let radiosity = radiosity::Options { solver, bounces: None };
            reads(&shoot_with(stage, Options { radiosity, ..options }), 5.0);
        }
    }
}
