//! Bakes a scene and holds it against the truth; prints one line of figures.
//!
//!     cargo run --release --example score -- SCENE.glb TRUTH.npz [--own-unwrap] [--rays N]
//!
//! Without --own-unwrap the author's UVs are kept and texel is compared with texel. The scene's sky stands in
//! `scenes[0].extras.bench.sky`. The figures are explained in tests/common/score.rs.

#[path = "../tests/common"]
mod common {
    pub mod npz;
    pub mod score;
}

use common::score::{self, Metrics, Truth};
use luxel::{
    atlas::{self, Density, Unwrap},
    bake,
    progress::Silent,
};
use std::{error::Error, path::Path, process::exit, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let Some(arguments) = Arguments::parse(std::env::args().skip(1)) else {
        eprintln!("usage: score SCENE.glb TRUTH.npz [--own-unwrap] [--rays N]");
        exit(2);
    };
    let scene = score::read_scene(Path::new(&arguments.scene))?;
    let truth = Truth::read(Path::new(&arguments.truth))?;
    let unwrap = if arguments.own_unwrap { Unwrap::Uvunwrap } else { Unwrap::Keep };
    let density = Density::Resolution(truth.resolution as u32);
    let atlas = atlas::Options { unwrap, density, ..atlas::Options::default() };
    let mut options = bake::Options { atlas, ..bake::Options::default() };
    options.transport.rays = arguments.rays.unwrap_or(options.transport.rays);

    let start = Instant::now();
    let baked = bake::bake(&scene, &options, &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let values = match unwrap {
        Unwrap::Keep => score::texels(&baked.lightmaps, &truth),
        _ => score::probe(&scene, &baked.atlas, &baked.lightmaps, &truth),
    };
    println!("{} | {seconds:.1} s", Metrics::new(&truth, &values));
    Ok(())
}

struct Arguments {
    scene: String,
    truth: String,
    own_unwrap: bool,
    rays: Option<u32>,
}

impl Arguments {
    fn parse(mut words: impl Iterator<Item = String>) -> Option<Self> {
        let (mut files, mut own_unwrap, mut rays) = (Vec::new(), false, None);
        while let Some(word) = words.next() {
            match word.as_str() {
                "--own-unwrap" => own_unwrap = true,
                "--rays" => rays = Some(words.next()?.parse().ok()?),
                _ if word.starts_with('-') => return None,
                _ => files.push(word),
            }
        }
        let [scene, truth] = <[String; 2]>::try_from(files).ok()?;
        Some(Arguments { scene, truth, own_unwrap, rays })
    }
}
