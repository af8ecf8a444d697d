//! PNG out: pictures for the eye, eight bits a channel.

use glam::UVec2;
use image::{ExtendedColorType, ImageEncoder, codecs::png};
use std::io;

/// A PNG file in memory, rows of rgb or rgba (as stored, no curve is applied) from the top.
pub fn encode_png<const N: usize>(size: UVec2, texels: &[[u8; N]]) -> io::Result<Vec<u8>> {
    const { assert!(N == 3 || N == 4) };
    let color = if N == 3 { ExtendedColorType::Rgb8 } else { ExtendedColorType::Rgba8 };
    if texels.len() != size.x as usize * size.y as usize {
        let what = format!("a picture of {} x {} texels cannot hold {} values", size.x, size.y, texels.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    let mut bytes = Vec::new();
    png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Default, png::FilterType::Adaptive)
        .write_image(texels.as_flattened(), size.x, size.y, color)
        .map_err(io::Error::other)?;
    Ok(bytes)
}
