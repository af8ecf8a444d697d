//! Speed by threads.

use super::{Bench, Quiet};
use crate::{
    bake,
    error::{Error, Result},
};
use serde::Serialize;
use std::time::Instant;

/// The fastest of several bakes. Wall seconds, whatever the clock.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ThreadPoint {
    /// Threads.
    pub threads: usize,
    /// Of the whole bake.
    pub seconds: f64,
    /// By room.
    pub rooms: Vec<(&'static str, f64)>,
}

/// Other work on the machine comes and goes: rounds over all numbers, of which the fastest bake of each counts.
const ROUNDS: usize = 3;

pub(super) fn measure(bench: &Bench) -> Result<Vec<ThreadPoint>> {
    let most = rayon::current_num_threads();
    let doubled = std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|n| *n < most);
    let mut all: Vec<ThreadPoint> = doubled
        .chain([most])
        .map(|threads| ThreadPoint { threads, seconds: f64::INFINITY, rooms: Vec::new() })
        .collect();
    for round in 0..ROUNDS {
        for point in &mut all {
            // The first round is whole in any case.
            if round > 0 && !bench.fits(2.0) {
                return Ok(all);
            }
            let pool = rayon::ThreadPoolBuilder::new().num_threads(point.threads).build();
            let pool = pool.map_err(|e| Error::Usage(format!("{} threads: {e}", point.threads)))?;
            let quiet = Quiet(bench.observer);
            let start = Instant::now();
            let rooms = pool
                .install(|| bake::bake(bench.scene, &bench.options.bake, &quiet).map(|baked| baked.report.seconds))?;
            let seconds = start.elapsed().as_secs_f64();
            if seconds < point.seconds {
                (point.seconds, point.rooms) = (seconds, rooms);
            }
        }
    }
    Ok(all)
}
