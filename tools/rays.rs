//! How near the gather loop comes to the rays alone: a bare closest-hit loop over the rays of a bake's rows, against the
//! measuring of those rows (points, directions, hits, look-up, sorting), with the same tree, alternating.
//!
//!     cargo run --release --example rays -- SCENE.glb [--resolution N] [--rays N] [--keep-uv]
//!
//! The bare loop keeps its rays in memory: 28 bytes each. Prints one line a pair and the median ratio.

use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    gltf,
    patches::Patches,
    progress::Silent,
    scene::World,
    trace::Tracer,
    transport::Transport,
};
use rayon::prelude::*;
use std::path::Path;

const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str, default: u32| {
        let at = args.iter().position(|a| a == name);
        at.and_then(|i| args.get(i + 1)).map_or(Ok(default), |v| v.parse())
    };
    let file = args.first().ok_or("usage: rays SCENE.glb [--resolution N] [--rays N] [--keep-uv]")?;
    let (resolution, rays) = (value("--resolution", 128)?, value("--rays", 256)?);
    let unwrap = if args.iter().any(|a| a == "--keep-uv") { Unwrap::Keep } else { Unwrap::default() };
    let options = atlas::Options { unwrap, density: Density::Resolution(resolution), ..atlas::Options::default() };

    let scene = gltf::read(Path::new(file), &gltf::ReadOptions::default())?.scene;
    let atlas = atlas::unwrap(&scene, &options, &scene.file, &Silent, &mut Vec::new())?;
    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let fronts = Patches::new(&tracer.world, &coverage, 0.98);
    let batch = luxel::transport::rays_of_rows(&tracer, &coverage, rays);
    println!("{file}: {} rays, {} threads", batch.len(), rayon::current_num_threads());
    let bare = || {
        let start = cpu_seconds();
        let hits: usize = batch
            .par_chunks(64 * rays as usize)
            .map_init(Vec::new, |hits, rays| {
                tracer.closest_of_each(rays, hits);
                hits.iter().flatten().count()
            })
            .sum();
        (hits, batch.len() as f64 / (cpu_seconds() - start) / 1e6)
    };
    let gather = || {
        let mut patches = fronts.clone();
        let start = cpu_seconds();
        let t = Transport::measure(&tracer, &coverage, &mut patches, rays, &Silent).expect("nobody stops it");
        t.stats.traced as f64 / (cpu_seconds() - start) / 1e6
    };
    let mut ratios = Vec::new();
    for _ in 0..ROUNDS {
        let ((_, bare), gather) = (bare(), gather());
        println!("bare {bare:.2} million rays a CPU second, gather loop {gather:.2}: {:.3}", gather / bare);
        ratios.push(gather / bare);
    }
    ratios.sort_by(f64::total_cmp);
    println!("median ratio {:.3}", ratios[ROUNDS / 2]);
    Ok(())
}

/// Processor time of all threads of this process: other programs on the machine do not count.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux tells the time of a process");
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |i: usize| fields[i].parse::<f64>().expect("ticks");
    // utime and stime, in hundredths of a second.
    (ticks(11) + ticks(12)) / 100.0
}
