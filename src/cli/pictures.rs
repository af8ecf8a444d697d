//! A lit scene as a picture: `luxel render`'s, and the preview of a bake.

use super::camera;
use glam::UVec2;
use luxel::{
    bake::Baked,
    error::{Error, Result},
    files::has_extension,
    lightmaps::Reading,
    memory,
    pixels::{encode_png, exr},
    preview::{self, Cast, Picture},
    render::{self, View},
    scene::{Camera, Scene, Sky},
};
use std::{io, path::Path};

/// Width and height of the preview.
const SIZE: UVec2 = UVec2::new(960, 540);
/// Rays a pixel and axis, and paths of each where it meets metal.
const GRID: u32 = 2;
const PATHS: u32 = 16;
/// Bytes that encoding takes for a pixel beside the picture, where all is noise: streams whose buffers have just doubled,
/// two of a PNG; one of an EXR, and the channels apart.
const BYTES_OF_PNG: u64 = 12;
const BYTES_OF_EXR: u64 = 36;

/// What `camera`, or a camera that is found, sees of what was just baked.
pub fn preview(scene: &Scene, baked: &Baked, camera: Option<Camera>) -> Picture {
    paint(scene, &mut render::of_bake(baked, Reading::Bilinear, PATHS), camera, SIZE, GRID)
}

/// Refuses a picture that would not fit, before it is painted.
pub fn fits(size: UVec2, file: &Path) -> Result<()> {
    let encoding = if has_extension(file, &["exr"]) { BYTES_OF_EXR } else { BYTES_OF_PNG };
    let bytes = u64::from(size.x) * u64::from(size.y) * (Picture::BYTES_A_PIXEL + encoding);
    memory::fits(bytes >> 20, memory::free_mb(), "lower --size")
}

/// What `camera`, or one that is found, sees by `grid` times `grid` rays a pixel.
pub fn paint(scene: &Scene, view: &mut View, camera: Option<Camera>, size: UVec2, grid: u32) -> Picture {
    let camera = camera.unwrap_or_else(|| {
        // To choose where to stand, a glance is enough.
        let paths = std::mem::replace(&mut view.paths, 1);
        let camera = camera::find(scene, &|o, d| view.sight(o, d), size.x as f32 / size.y as f32);
        view.paths = paths;
        camera
    });
    preview::paint(&|o, d| view.sight(o, d), &scene.sky, &camera, size, grid, None)
}

/// What a ray sees as it is, without a sky.
pub fn plain(cast: &Cast, camera: &Camera) -> Picture {
    preview::paint(cast, &Sky::Black, camera, SIZE, GRID, None)
}

/// Width of such a picture over its height.
pub fn aspect() -> f32 {
    SIZE.x as f32 / SIZE.y as f32
}

/// The bytes of a picture of this name: radiance as EXR, what is shown of it as PNG.
pub fn encode(picture: &Picture, file: &Path) -> Result<Vec<u8>> {
    let bytes = if has_extension(file, &["exr"]) {
        exr::encode(picture.size, &picture.radiance, true).map(|e| e.bytes).map_err(io::Error::other)
    } else {
        encode_png(picture.size, &picture.rgb)
    };
    bytes.map_err(|e| Error::writing(file, e))
}
