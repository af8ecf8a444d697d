//! How near the gather loop comes to the rays alone: a bare closest-hit loop over the rays of the rows, against the
//! measuring of those rows (points, directions, hits, look-up, sorting), with the same tree, alternating.

use super::{
    batch::{Query, Ray, hits_on_all_threads},
    clock::process_seconds,
    race::{Spread, median},
};
use luxel::{
    atlas::Coverage,
    patches::Patches,
    progress::Silent,
    trace::Tracer,
    transport::{Options, Transport},
};
use serde::Serialize;
use std::fmt;

/// Millions of rays a second of processor time, on all threads; medians.
#[derive(Serialize)]
pub struct Gather {
    rate_bare: f64,
    rate_gather: f64,
    gather_over_bare: Spread,
}

/// `batch`: the rays of `coverage`, `rays` a texel.
pub fn measure(tracer: &Tracer, coverage: &Coverage, batch: &[Ray], rays: u32, rounds: usize) -> Gather {
    let fronts = Patches::new(&tracer.world, coverage, 0.98);
    let options = Options { reuse: false, ..Options::of(rays) };
    let (mut bare, mut gather) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        let start = process_seconds();
        hits_on_all_threads(tracer, batch, Query::Closest);
        bare.push(batch.len() as f64 / (process_seconds() - start) / 1e6);
        let mut patches = fronts.clone();
        let start = process_seconds();
        let t = Transport::measure(tracer, coverage, &mut patches, &options, &Silent).expect("nobody stops it");
        gather.push(t.stats.traced as f64 / (process_seconds() - start) / 1e6);
    }
    Gather { rate_bare: median(&bare), rate_gather: median(&gather), gather_over_bare: Spread::new(&gather, &bare) }
}

impl fmt::Display for Gather {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Gather { rate_bare, rate_gather, gather_over_bare } = self;
        write!(f, "gather loop {rate_gather:.2} M/s a thread, bare {rate_bare:.2}: {gather_over_bare}")
    }
}
