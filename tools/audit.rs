//! Holds the audit itself against the truth.
//!
//!     cargo run --release --example audit -- SCENE.glb TRUTH.npz [--rays N]
//!     cargo run --release --example audit -- --coverage SEEDS
//!
//! The first bakes a scene on its author's UVs and prints what the audit says of it beside what the truth says, and by
//! how many standard errors the audit's paths and the truth disagree. The second bakes rooms of as many seeds, counts how
//! often the intervals hold the true error, which is that of all texels by many more paths, and exits 1 below nine in ten.

#[path = "../tests/common"]
#[allow(dead_code, reason = "nothing uses all of them")]
mod common {
    pub mod npz;
    pub mod rooms;
    pub mod scenes;
    pub mod score;
    pub mod stage;
    pub mod true_error;
}

use common::{
    rooms,
    score::{self, Metrics, Truth},
    true_error::{self, Held},
};
use luxel::{
    atlas::{self, Density, Unwrap},
    audit::{self, Audit, Interval, Subject},
    bake::{self, Baked},
    progress::Silent,
};
use std::{error::Error, path::Path, process::exit, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--coverage", seeds] => coverage(seeds.parse()?),
        [scene, truth] => compare(scene, truth, None),
        [scene, truth, "--rays", rays] => compare(scene, truth, Some(rays.parse()?)),
        _ => {
            eprintln!("usage: audit SCENE.glb TRUTH.npz [--rays N] | audit --coverage SEEDS");
            exit(2);
        }
    }
}

fn compare(scene: &str, truth: &str, rays: Option<u32>) -> Result<(), Box<dyn Error>> {
    let scene = score::read_scene(Path::new(scene))?;
    let truth = Truth::read(Path::new(truth))?;
    let density = Density::Resolution(truth.resolution as u32);
    let atlas = atlas::Options { unwrap: Unwrap::Keep, density, ..atlas::Options::default() };
    let mut options = bake::Options { atlas, ..bake::Options::default() };
    options.transport.rays = rays.unwrap_or(options.transport.rays);
    let start = Instant::now();
    let baked = bake::bake(&scene, &options, &Silent)?;
    println!("bake {:.1} s", start.elapsed().as_secs_f64());
    println!("truth | {}", Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth)));
    let subject = subject(&baked, &options);
    for seconds in [2, 8] {
        let budget = audit::Budget::Time(std::time::Duration::from_secs(seconds));
        let audit = Audit::of(&subject, &audit::Options { budget, ..audit::Options::default() }, &Silent)?;
        print(&audit);
    }
    disagreement(&subject, &baked, &truth);
    Ok(())
}

fn subject<'a, 's>(baked: &'a Baked<'s>, options: &bake::Options) -> Subject<'a, 's> {
    let Baked { tracer, coverage, lightmaps, .. } = baked;
    Subject { tracer, coverage, lightmaps, max_reflectance: options.max_reflectance }
}

fn print(audit: &Audit) {
    let show = |name: &str, i: Option<Interval>| match i {
        Some(i) => print!(" {name} {:.4} ({:.4} to {:.4})", i.value, i.low, i.high),
        None => print!(" {name} -"),
    };
    print!("audit |");
    show("error", audit.error);
    show("dark", audit.dark);
    show("border", audit.border);
    show("bias", audit.bias);
    show("median", audit.median);
    show("p95", audit.p95);
    show("look-up", audit.texel_size.map(|t| t.error));
    let Audit { points, enclosed, paths, rays, seconds, .. } = audit;
    let density = audit.texel_size.and_then(|t| t.density_to_halve);
    println!(" x {density:.2?} | {points} points, {enclosed} enclosed, {paths} paths, {rays} rays, {seconds:.2} s");
}

/// The audit's paths at the truth's own texels.
fn disagreement(subject: &Subject, baked: &Baked, truth: &Truth) {
    let some = truth.texels.iter().filter(|t| !t.buried).step_by(truth.texels.len().div_ceil(500));
    let grid = &baked.coverage.grids[0];
    let (texels, truth): (Vec<usize>, Vec<_>) = some.map(|t| (grid[t.index] as usize, t)).unzip();
    let options = audit::Options { paths: 128, ..audit::Options::default() };
    let found = audit::reference(subject, &texels, &options);
    let (mut squares, mut difference, mut sum, mut noise) = (0.0, 0.0, 0.0, 0.0);
    for (t, r) in truth.iter().zip(&found) {
        let [a, b] = r.halves;
        let own = (a - b) * 0.5;
        difference += ((a + b) * 0.5 - t.irradiance).element_sum();
        sum += t.irradiance.element_sum();
        squares += ((a + b) * 0.5 - t.irradiance).length_squared();
        noise += own.length_squared() + t.error.length_squared();
    }
    let (rms, expected) = ((squares / noise).sqrt(), 1.0);
    println!(
        "paths | {} texels: mean {:+.5}, differences {rms:.3} of {expected} standard errors",
        found.len(),
        difference / sum
    );
}

fn coverage(seeds: u32) -> Result<(), Box<dyn Error>> {
    let mut held = Held::default();
    for seed in 0..seeds {
        let one = true_error::held(rooms::seeded(seed), seed, 200, 4);
        println!("{seed:3} {one}");
        held += one;
    }
    println!("all {held}");
    exit(i32::from(!held.is_enough()));
}
