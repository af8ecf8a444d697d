//! Contenders on the same rays, taking turns.

use super::{
    batch::{Caster, Query, Ray, hits_on_all_threads},
    clock::{process_seconds, thread_seconds},
};
use serde::Serialize;
use std::{fmt, time::Instant};

/// How one contender did. Rates are millions of rays a second, medians.
#[derive(Serialize)]
pub struct Lane {
    name: String,
    /// Share of the rays that hit something.
    hit_share: f64,
    /// A second of processor time, one thread.
    rate_one_thread: f64,
    /// A second of processor time, all threads at work: what sharing caches and memory costs, whatever else runs.
    rate_a_thread: f64,
    /// A second of wall time, all threads.
    rate_all_threads: f64,
    /// Wall time of one thread over that of all.
    speed_up: f64,
    /// Luxel's rate over this one's, one thread; none for luxel.
    luxel_over_this: Option<Spread>,
    /// The same, wall time on all threads.
    luxel_over_this_all_threads: Option<Spread>,
}

/// The ratio of two medians, and the range of the ratios of single rounds.
#[derive(Clone, Copy, Serialize)]
pub struct Spread {
    pub ratio: f64,
    pub least: f64,
    pub most: f64,
}

impl Spread {
    /// Of the figures of the same rounds.
    pub fn new(over: &[f64], under: &[f64]) -> Self {
        let rounds = || over.iter().zip(under).map(|(a, b)| a / b);
        let (least, most) = (rounds().fold(f64::INFINITY, f64::min), rounds().fold(0.0, f64::max));
        Spread { ratio: median(over) / median(under), least, most }
    }
}

/// Seconds of each round.
#[derive(Default)]
struct Seconds {
    hits: usize,
    processor: Vec<f64>,
    wall: Vec<f64>,
    processor_all: Vec<f64>,
    wall_all: Vec<f64>,
}

/// Lets every contender trace all rays once a round, in turn; a round begins with another one each time. The first is
/// luxel.
pub fn run(contenders: &[(&str, &dyn Caster)], rays: &[Ray], query: Query, rounds: usize) -> Vec<Lane> {
    let n = contenders.len();
    let mut seconds: Vec<Seconds> = (0..n).map(|_| Seconds::default()).collect();
    for k in (0..rounds).flat_map(|round| (0..n).map(move |k| (round + k) % n)) {
        let (caster, s) = (contenders[k].1, &mut seconds[k]);
        let (start, wall) = (thread_seconds(), Instant::now());
        s.hits = caster.hits(rays, query);
        s.processor.push(thread_seconds() - start);
        s.wall.push(wall.elapsed().as_secs_f64());
        let (start, wall) = (process_seconds(), Instant::now());
        let hits = hits_on_all_threads(caster, rays, query);
        s.processor_all.push(process_seconds() - start);
        s.wall_all.push(wall.elapsed().as_secs_f64());
        assert_eq!(hits, s.hits, "{}: the same hits on any number of threads", contenders[k].0);
    }
    let rate = |seconds: &[f64]| rays.len() as f64 / median(seconds) / 1e6;
    let luxel = &seconds[0];
    let lane = |k: usize| {
        let s = &seconds[k];
        Lane {
            name: contenders[k].0.into(),
            hit_share: s.hits as f64 / rays.len().max(1) as f64,
            rate_one_thread: rate(&s.processor),
            rate_a_thread: rate(&s.processor_all),
            rate_all_threads: rate(&s.wall_all),
            speed_up: median(&s.wall) / median(&s.wall_all),
            luxel_over_this: (k > 0).then(|| Spread::new(&s.processor, &luxel.processor)),
            luxel_over_this_all_threads: (k > 0).then(|| Spread::new(&s.wall_all, &luxel.wall_all)),
        }
    };
    (0..n).map(lane).collect()
}

/// The middle one.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:.3} ({:.3} to {:.3})", self.ratio, self.least, self.most)
    }
}

impl fmt::Display for Lane {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Lane { name, rate_one_thread, rate_a_thread, rate_all_threads, speed_up, .. } = self;
        let hit = self.hit_share * 100.0;
        write!(
            f,
            "{name:16} {hit:5.1} % hit, {rate_one_thread:6.2} M/s on one thread, {rate_a_thread:6.2} a thread and "
        )?;
        write!(f, "{rate_all_threads:6.2} by wall on all ({speed_up:.2} times)")?;
        if let (Some(one), Some(all)) = (self.luxel_over_this, self.luxel_over_this_all_threads) {
            write!(f, ", luxel/this {one}, on all {all}")?;
        }
        Ok(())
    }
}
