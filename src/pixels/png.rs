//! PNG out: pictures for the eye, eight bits a channel.

use glam::UVec2;
use image::{ExtendedColorType, ImageEncoder, codecs::png};
use std::io;

/// A PNG file in memory, rows of rgb (as stored, no curve is applied) from the top.
pub fn encode_png(size: UVec2, rgb: &[[u8; 3]]) -> io::Result<Vec<u8>> {
    if rgb.len() != size.x as usize * size.y as usize {
        let what = format!("a picture of {} x {} texels cannot hold {} values", size.x, size.y, rgb.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    let mut bytes = Vec::new();
    png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Default, png::FilterType::Adaptive)
        .write_image(rgb.as_flattened(), size.x, size.y, ExtendedColorType::Rgb8)
        .map_err(io::Error::other)?;
    Ok(bytes)
}
