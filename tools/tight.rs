//! Shoots rays from inside closed meshes and counts those that get out: none may.
//!
//!     cargo run --release --example tight -- [RAYS]       # 100 million by default, shared among the meshes

#[path = "tight/closed.rs"]
mod closed;

use std::{process::exit, time::Instant};

fn main() {
    let rays: u64 = match std::env::args().nth(1).map(|r| r.parse()) {
        None => 100_000_000,
        Some(Ok(rays)) => rays,
        Some(Err(_)) => {
            eprintln!("usage: tight [RAYS]");
            exit(2);
        }
    };
    let (scenes, mut sum) = (closed::scenes(), 0);
    let count = rays.div_ceil(scenes.len() as u64);
    for (name, scene) in &scenes {
        let start = Instant::now();
        let escaped = closed::escaped(scene, count);
        println!("{name}: {count} rays, {escaped} get out, {:.1} s", start.elapsed().as_secs_f64());
        sum += escaped;
    }
    exit(i32::from(sum > 0));
}
