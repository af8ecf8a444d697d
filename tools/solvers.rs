//! Holds the solvers against each other on a scene, with every surface painted anew: reflectance .5, .9, .99, and one
//! texel of .99 among .5.
//!
//!     cargo run --release --example solvers -- SCENE.glb [--resolution N] [--rays N]      # 256, 64
//!
//! Of each solver: entries touched (in all that the matrix has) until the true error is below 1e-3, and until the solver
//! itself is sure of its tolerance; the seconds to there, and the true error then. Errors are those of the worst texel over
//! the mean of the darker half; the truth is the dense solution, or the default solver's at a tolerance of 1e-9.

#[path = "../tests/common"]
#[allow(dead_code, reason = "the solvers need scenes only")]
mod common {
    pub mod npz;
    pub mod score;
}

use common::score;
use glam::{DVec3, Vec3};
use luxel::{
    atlas::{self, Coverage, Density},
    direct::{Direct, Sources, sky_cells},
    patches::Patches,
    progress::Silent,
    radiosity::{Solver, System, TOLERANCE},
    scene::World,
    trace::Tracer,
    transport::{self, Transport},
};
use std::{error::Error, path::Path, process::exit};

/// The true error to be reached.
const ERROR: f64 = 1e-3;
/// Shadow rays a source.
const SHADOW_RAYS: u32 = 16;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (mut resolution, mut rays) = (256, 64);
    let Some((scene, options)) = words.split_first().filter(|(_, o)| o.len() % 2 == 0) else { usage() };
    for option in options.chunks(2) {
        match option[0].as_str() {
            "--resolution" => resolution = option[1].parse()?,
            "--rays" => rays = option[1].parse()?,
            _ => usage(),
        }
    }
    compare(Path::new(scene), resolution, rays)
}

fn usage() -> ! {
    eprintln!("usage: solvers SCENE.glb [--resolution N] [--rays N]");
    exit(2);
}

fn compare(file: &Path, resolution: u32, rays: u32) -> Result<(), Box<dyn Error>> {
    let scene = score::read_scene(file)?;
    let options = atlas::Options { density: Density::Resolution(resolution), ..atlas::Options::default() };
    let atlas = atlas::unwrap(&scene, &options, file, &Silent, &mut Vec::new())?;
    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let mut patches = Patches::new(&tracer.world, &coverage, 0.98);
    let measuring = transport::Options { reuse: false, ..transport::Options::of(rays) };
    let transport = Transport::measure(&tracer, &coverage, &mut patches, &measuring, &Silent)?;
    let (receivers, entries) = (transport.receivers.len(), transport.rows.entries());
    println!("{}: {receivers} receivers, {rays} rays each, {entries} entries", file.display());
    let sky = sky_cells(&scene.sky);
    println!("| reflectance | solver | passes to a true error of 1e-3 | passes | seconds | true error | |");
    println!("|---|---|---|---|---|---|---|");
    for (name, rho, bright) in
        [(".5", 0.5, 0.5), (".9", 0.9, 0.9), (".99", 0.99, 0.99), ("one .99 among .5", 0.5, 0.99)]
    {
        patches.reflectance.fill(Vec3::splat(rho));
        let middle = patches.len() / 2;
        patches.reflectance[middle] = Vec3::splat(bright);
        let sources = Sources::new(&tracer, &patches);
        let direct = Direct::measure(&tracer, &coverage, &patches, &sources, SHADOW_RAYS, &Silent)?;
        let system = System::new(&transport, &patches, &direct, &sky, sources.gathered);
        rank(name, &system)?;
    }
    Ok(())
}

/// A line a solver.
fn rank(name: &str, system: &System) -> Result<(), Box<dyn Error>> {
    let reference =
        if Solver::Direct.check(system.unknowns(), true).is_ok() { Solver::Direct } else { Solver::default() };
    let mut truth = Vec::new();
    system.watched(reference, 1e-9, &Silent, &mut |_, x| truth = x.to_vec())?;
    let (dark, matrix) = (system.dark_mean(&truth), system.entries() as f64);
    let error = |x: &[DVec3]| {
        let off = x.iter().zip(&truth).map(|(x, t)| (*x - *t).abs().max_element());
        off.fold(0.0, f64::max) / dark
    };
    for solver in Solver::ALL.into_iter().filter(|s| s.check(system.unknowns(), true).is_ok()) {
        let (mut reached, mut last) = (None, 0.0);
        let solved = system.watched(solver, TOLERANCE, &Silent, &mut |touched, x| {
            last = error(x);
            reached = reached.or((last <= ERROR).then_some(touched));
        })?;
        let r = solved.report;
        let passes = |entries: u64| format!("{:.1}", entries as f64 / matrix);
        let reached = reached.map_or("-".into(), passes);
        let fallback = r.fallback.map_or(String::new(), |f| format!("{f} went on"));
        let (solver, all) = (solver.name(), passes(r.entries));
        println!("| {name} | {solver} | {reached} | {all} | {:.3} | {last:.1e} | {fallback} |", r.seconds);
    }
    Ok(())
}
