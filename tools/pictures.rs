//! Paints the rows of pictures in the README: the Cornell box with the light of 0, 1, 3 and all bounces, and with coarse
//! patches, fine ones, and fine ones interpolated.
//!
//!     cargo run --release --example pictures          # writes assets/pictures/{bounces,patches}.png

use glam::UVec2;
use luxel::{
    atlas::{self, Density},
    bake::{self, Baked},
    files,
    gltf::{self, ReadOptions},
    lightmaps::Reading,
    pixels::encode_png,
    preview::{self, Picture},
    progress::Silent,
    radiosity, render,
    scene::Scene,
};
use std::{error::Error, path::Path};

/// Width and height of a picture, and the gap between two.
const SIZE: UVec2 = UVec2::new(240, 240);
const GAP: usize = 4;
/// Rays a pixel and axis.
const GRID: u32 = 2;
/// Edges of the lightmap: for the row of bounces, fine and coarse patches.
const SMOOTH: u32 = 160;
const FINE: u32 = 96;
const COARSE: u32 = 40;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let scene = gltf::read(&root.join("cornell.glb"), &ReadOptions::default())?.scene;
    let bounces = |bounces| baked(&scene, SMOOTH, bounces);
    let whole = bounces(None)?;
    // One exposure for all: less light is darker.
    let exposure = painted(&scene, &whole, Reading::Bilinear, None)?.exposure;
    let paint = |baked: &Baked, reading| painted(&scene, baked, reading, Some(exposure));
    let mut row = Vec::new();
    for n in [0, 1, 3] {
        row.push(paint(&bounces(Some(n))?, Reading::Bilinear)?);
    }
    row.push(paint(&whole, Reading::Bilinear)?);
    write(&root.join("pictures/bounces.png"), &row)?;
    let [coarse, fine] = [baked(&scene, COARSE, None)?, baked(&scene, FINE, None)?];
    let row = [paint(&coarse, Reading::Constant)?, paint(&fine, Reading::Constant)?, paint(&fine, Reading::Bilinear)?];
    write(&root.join("pictures/patches.png"), &row)
}

fn baked(scene: &Scene, edge: u32, bounces: Option<u32>) -> Result<Baked<'_>, Box<dyn Error>> {
    let atlas = atlas::Options { density: Density::Resolution(edge), ..atlas::Options::default() };
    let radiosity = radiosity::Options { bounces, ..radiosity::Options::default() };
    Ok(bake::bake(scene, &bake::Options { atlas, radiosity, ..bake::Options::default() }, &Silent)?)
}

fn painted(scene: &Scene, baked: &Baked, reading: Reading, exposure: Option<f32>) -> Result<Picture, Box<dyn Error>> {
    let camera = scene.cameras.first().ok_or("the scene has a camera")?;
    // Nothing in the box is metal.
    let view = render::of_bake(baked, reading, 1);
    Ok(preview::paint(&|o, d| view.sight(o, d), &scene.sky, camera, SIZE, GRID, exposure))
}

/// Side by side, on white.
fn write(file: &Path, row: &[Picture]) -> Result<(), Box<dyn Error>> {
    let width = row.len() * (SIZE.x as usize + GAP) - GAP;
    let line = |y: usize| {
        let one = |p: &Picture| p.rgb[y * SIZE.x as usize..][..SIZE.x as usize].to_vec();
        let lines: Vec<Vec<[u8; 3]>> = row.iter().map(one).collect();
        lines.join(&[[255; 3]; GAP][..])
    };
    let rgb: Vec<[u8; 3]> = (0..SIZE.y as usize).flat_map(line).collect();
    let png = encode_png(UVec2::new(width as u32, SIZE.y), &rgb)?;
    println!("{} ({} KB)", file.display(), png.len() / 1000);
    Ok(files::write_whole(file, |out| out.write_all(&png))?)
}
