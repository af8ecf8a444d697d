//! PNG out: pictures for the eye, eight bits a channel.

use glam::UVec2;
use image::{ExtendedColorType, ImageEncoder, codecs::png};

/// Encodes sRGB texels, rows from the top. The error is the encoder's reason.
pub fn encode(size: UVec2, rgb: &[[u8; 3]]) -> Result<Vec<u8>, String> {
    if rgb.len() != size.x as usize * size.y as usize {
        return Err(format!("a picture of {} x {} texels cannot hold {} values", size.x, size.y, rgb.len()));
    }
    let mut bytes = Vec::new();
    png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Default, png::FilterType::Adaptive)
        .write_image(rgb.as_flattened(), size.x, size.y, ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}
