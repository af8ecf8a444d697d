//! Writes the scenes of our own in `assets/`: `cargo run --release --example assets`.
//!
//! Every byte comes from this code: no data is read, no random number drawn, so the same code writes the same files.

mod assets {
    pub mod cornell;
    pub mod furniture;
    pub mod glb;
    pub mod paint;
    pub mod room;
    pub mod shape;
}

use std::{fs, io, path::Path};

fn main() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    fs::create_dir_all(&folder)?;
    for (name, glb) in [("cornell.glb", assets::cornell::cornell()), ("room.glb", assets::room::room())] {
        let bytes = glb.to_bytes();
        fs::write(folder.join(name), &bytes)?;
        println!("{name}: {} bytes", bytes.len());
    }
    Ok(())
}
