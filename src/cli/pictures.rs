//! A finished bake as a picture: the preview.

use super::camera;
use glam::{UVec2, Vec3};
use luxel::{
    bake::Baked,
    files,
    lightmaps::Reading,
    pixels::encode_png,
    preview::{self, Picture},
    scene::{Camera, Scene},
};
use std::path::Path;

/// Width and height of the preview.
const SIZE: UVec2 = UVec2::new(960, 540);

/// What `camera`, or a camera that is found, sees of the baked scene.
pub fn preview(scene: &Scene, baked: &Baked, camera: Option<Camera>) -> Picture {
    let cast = |origin: Vec3, direction: Vec3| preview::sight(baked, origin, direction, Reading::Bilinear);
    let aspect = SIZE.x as f32 / SIZE.y as f32;
    let camera = camera.unwrap_or_else(|| camera::find(scene, &cast, aspect));
    preview::paint(&cast, &scene.sky, &camera, SIZE, None)
}

/// Writes a picture as PNG, whole or not at all.
pub fn write(picture: &Picture, file: &Path) -> luxel::error::Result<()> {
    files::write_whole(file, |out| out.write_all(&encode_png(picture.size, &picture.rgb)?))
}
