//! The tracer on a bake's own rays: throughput, build, correctness; beside Embree 4 where it is installed.
//!
//!     cargo run --release --example trace_bench -- SCENE.glb [OPTION...]
//!
//!     --resolution N   texels on a page's side, 128 by default
//!     --rays N         rays a texel, 256 by default; the loops keep them in memory, 64 bytes each
//!     --keep-uv        the author's layout
//!     --rounds N       alternating rounds, 7 by default
//!     --embree LIB     Embree's library; else the variable EMBREE_LIBRARY, else libembree4.so.4 as the loader finds it
//!     --json FILE      the figures as JSON, for tools/results/
//!
//! Embree comes with `pip download embreex --no-deps`: a wheel is a zip, the library lies in its folder embreex.libs.
//!
//! Closest hits: the rays of the rows, in the order of the bake. Any hit: from the same origins to lamps nearby (see
//! trace_bench/batch.rs). Every contender gets the same rays in the same order, luxel 64 a call as a bake asks, Embree one
//! a call. Rates are medians over
//! the rounds, in millions of rays: a second of processor time on one thread, a second of wall time on all threads.
//! "luxel/x" is the ratio of the medians on one thread, with the range of the single rounds behind it.
//!
//! Embree runs at build quality medium: without scene flags, with the flag ROBUST (watertight, as luxel is), and with
//! ROBUST and one scene a mesh where meshes are used again; luxel chooses between these two ways itself. Embree's build seconds are
//! those of its commits, luxel's also hold the placing of corners. Embree's bytes are what its memory monitor reports.
//!
//! Embree here knows no holes, so materials are made opaque for both; only the gather loop sees the scene as it is. The
//! gather loop (points, directions, hits, look-up, backs) is held against the bare closest hits of its rays.

mod trace_bench {
    pub mod batch;
    pub mod build;
    pub mod check;
    pub mod clock;
    pub mod embree;
    pub mod gather;
    pub mod machine;
    pub mod race;
}

use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    gltf,
    progress::Silent,
    scene::{Alpha, Scene, World},
    trace::Tracer,
    transport::rays_of_rows,
};
use serde::Serialize;
use std::{error::Error, fs, path::Path, process::exit};
use trace_bench::{
    batch::{self, Query, Ray},
    build::{self, Built},
    check::{self, Agreement},
    embree::Embree,
    gather::{self, Gather},
    machine::Machine,
    race::{self, Lane},
};

/// Everything measured in one run.
#[derive(Serialize)]
struct Results {
    machine: Machine,
    scene: SceneCounts,
    build: Vec<Built>,
    closest: Vec<Lane>,
    any: Vec<Lane>,
    gather: Gather,
    agreement: Vec<Agreement>,
}

#[derive(Serialize)]
struct SceneCounts {
    file: String,
    triangles: u32,
    triangles_made_opaque: usize,
    texels: usize,
    rays: usize,
    shadow_rays: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let Some(arguments) = Arguments::parse(std::env::args().skip(1)) else {
        eprintln!(
            "usage: trace_bench SCENE.glb [--resolution N] [--rays N] [--keep-uv] [--rounds N] [--embree LIB] [--json FILE]"
        );
        exit(2);
    };
    let embree = match Embree::load(arguments.embree.as_deref()) {
        Ok(embree) => Some(embree),
        // A library that was named has to be there.
        Err(e) if arguments.embree.is_some() => return Err(e),
        Err(e) => {
            println!("without Embree: {e}");
            None
        }
    };
    let results = measure(&arguments, embree.as_ref())?;
    if let Some(file) = &arguments.json {
        fs::write(file, serde_json::to_string_pretty(&results)? + "\n")?;
    }
    Ok(())
}

fn measure(arguments: &Arguments, embree: Option<&Embree>) -> Result<Results, Box<dyn Error>> {
    let machine = Machine::new(embree.map(Embree::version));
    println!("{machine}");
    let path = Path::new(&arguments.scene);
    let scene = gltf::read(path, &gltf::ReadOptions::default())?.scene;
    let unwrap = if arguments.keep_uv { Unwrap::Keep } else { Unwrap::default() };
    let density = Density::Resolution(arguments.resolution);
    let options = atlas::Options { unwrap, density, ..atlas::Options::default() };
    let atlas = atlas::unwrap(&scene, &options, &scene.file, &Silent, &mut Vec::new())?;
    let coverage = Coverage::new(&World::new(&scene), &atlas);

    let product = Tracer::new(World::new(&scene));
    let rays: Vec<Ray> = rays_of_rows(&product, &coverage, arguments.rays).into_iter().map(Ray::from).collect();
    let (opaque, opened) = without_holes(&scene);
    let mut counts = SceneCounts {
        file: path.file_name().unwrap_or_default().to_string_lossy().into(),
        triangles: product.world.len(),
        triangles_made_opaque: opened,
        texels: coverage.texels.len(),
        rays: rays.len(),
        shadow_rays: 0,
    };
    println!(
        "{}: {} triangles ({opened} of them made opaque), {} texels, {} rays",
        counts.file, counts.triangles, counts.texels, counts.rays
    );
    let gather = gather::measure(&product, &coverage, &rays, arguments.rays, arguments.rounds);
    println!("{gather}");
    drop(product);

    let corners = check::corners(&World::new(&opaque));
    let (tracer, theirs, build) = build::measure(&opaque, &corners, embree);
    build.iter().for_each(|b| println!("{b}"));
    let shadow_rays = batch::towards_lamps(&tracer, &rays);
    counts.shadow_rays = shadow_rays.len();

    let agreement = check::compare(&tracer, &theirs, &corners, &rays, &shadow_rays);
    agreement.iter().for_each(|a| println!("{a}"));
    let mut lanes: Vec<(&str, &dyn batch::Caster)> = vec![("luxel", &tracer)];
    lanes.extend(theirs.iter().map(|(name, scene)| (*name, scene as &dyn batch::Caster)));
    let closest = race::run(&lanes, &rays, Query::Closest, arguments.rounds);
    closest.iter().for_each(|lane| println!("closest hit: {lane}"));
    let any = race::run(&lanes, &shadow_rays, Query::Any, arguments.rounds);
    any.iter().for_each(|lane| println!("any hit: {lane}"));
    Ok(Results { machine, scene: counts, build, closest, any, gather, agreement })
}

/// The scene with every material opaque, and the number of placed triangles that had holes.
fn without_holes(scene: &Scene) -> (Scene, usize) {
    let primitives = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh as usize].primitives);
    let holed = primitives.filter(|p| scene.materials[p.material as usize].has_holes());
    let opened = holed.map(|p| p.triangles.len()).sum();
    let mut opaque = scene.clone();
    for m in &mut opaque.materials {
        m.alpha = Alpha::Opaque;
        m.transmission = 0.0;
    }
    (opaque, opened)
}

struct Arguments {
    scene: String,
    resolution: u32,
    rays: u32,
    rounds: usize,
    keep_uv: bool,
    embree: Option<String>,
    json: Option<String>,
}

impl Arguments {
    fn parse(mut words: impl Iterator<Item = String>) -> Option<Self> {
        let embree = std::env::var("EMBREE_LIBRARY").ok();
        let (scene, json) = (String::new(), None);
        let mut a = Arguments { scene, resolution: 128, rays: 256, rounds: 7, keep_uv: false, embree, json };
        while let Some(word) = words.next() {
            match word.as_str() {
                "--keep-uv" => a.keep_uv = true,
                "--resolution" => a.resolution = words.next()?.parse().ok()?,
                "--rays" => a.rays = words.next()?.parse().ok()?,
                "--rounds" => a.rounds = words.next()?.parse().ok().filter(|&n| n > 0)?,
                "--embree" => a.embree = Some(words.next()?),
                "--json" => a.json = Some(words.next()?),
                _ if word.starts_with('-') || !a.scene.is_empty() => return None,
                _ => a.scene = word,
            }
        }
        (!a.scene.is_empty()).then_some(a)
    }
}
