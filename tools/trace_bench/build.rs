//! Trees, built several times in turn.

use super::{
    embree::{self, Embree, Flavour},
    race::median,
};
use glam::Vec3;
use luxel::{
    scene::{Scene, World},
    trace::Tracer,
};
use serde::Serialize;
use std::{fmt, time::Instant};

const ROUNDS: usize = 3;

/// What a tree costs.
#[derive(Serialize)]
pub struct Built {
    name: String,
    /// Wall time on all threads, median, a million placed triangles.
    seconds_per_million: f64,
    /// Bytes a placed triangle, where they are known.
    bytes_per_triangle: Option<f64>,
}

/// Luxel's tracer and Embree's scenes by name, and what they cost.
pub fn measure<'s>(
    scene: &'s Scene,
    corners: &'s [[Vec3; 3]],
    embree: Option<&'s Embree>,
) -> (Tracer<'s>, Vec<(&'static str, embree::Scene<'s>)>, Vec<Built>) {
    let ours = || timed(|| Tracer::new(World::new(scene)));
    let instanced = scene.instances.len() > scene.meshes.len();
    let flavours: Vec<Flavour> = Flavour::ALL.into_iter().filter(|f| *f != Flavour::Instances || instanced).collect();
    let mut seconds = vec![Vec::new(); 1 + flavours.len()];
    let (mut tracer, mut theirs) = (None, Vec::new());
    for _ in 0..ROUNDS {
        theirs.clear();
        // Old trees go before new ones come.
        drop(tracer.take());
        let (t, s) = ours();
        seconds[0].push(s);
        tracer = Some(t);
        for (seconds, flavour) in seconds[1..].iter_mut().zip(&flavours) {
            let Some(embree) = embree else { continue };
            let (t, s) = embree.build(&World::new(scene), corners, *flavour);
            seconds.push(s);
            theirs.push((flavour.name(), t));
        }
    }
    let count = corners.len().max(1) as f64;
    let built = |name: &str, seconds: &[f64], bytes: Option<usize>| Built {
        name: name.into(),
        seconds_per_million: median(seconds) / count * 1e6,
        bytes_per_triangle: bytes.map(|b| b as f64 / count),
    };
    let mut all = vec![built("luxel", &seconds[0], tracer.as_ref().map(|t| t.bytes()))];
    all.extend(theirs.iter().zip(&seconds[1..]).map(|((name, t), s)| built(name, s, Some(t.bytes))));
    (tracer.expect("rounds"), theirs, all)
}

/// What `f` returns, and the seconds it took.
pub fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let t = f();
    (t, start.elapsed().as_secs_f64())
}

impl fmt::Display for Built {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let bytes = self.bytes_per_triangle.map_or("-".into(), |b| format!("{b:.0}"));
        write!(
            f,
            "build: {:18} {:.2} s a million triangles, {bytes} bytes a triangle",
            self.name, self.seconds_per_million
        )
    }
}
