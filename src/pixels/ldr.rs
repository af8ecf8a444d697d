//! PNG, JPEG and WebP in: eight bits a channel, as stored (no curve is applied).
//!
//! A picture's claimed size is compared with the bytes it comes in before anything of that size is allocated.

use glam::UVec2;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Longest edge of a picture that is decoded.
const MAX_EDGE: u32 = 32_768;
/// Pictures up to this many pixels are decoded whatever their file's size (64 MB).
const SMALL: u64 = 1 << 24;
/// Pixels that a byte of a larger file can stand for: one-bit PNG at deflate's best ratio.
const PIXELS_PER_BYTE: u64 = 8 * 1032;

/// A decoded picture.
#[derive(Clone, Debug)]
pub struct Ldr {
    /// Width and height, both at least 1.
    pub size: UVec2,
    /// Rows from the top.
    pub rgba: Vec<[u8; 4]>,
}

/// What a picture's header says.
#[derive(Clone, Copy, Debug)]
pub struct Header {
    /// Width and height, both at least 1.
    pub size: UVec2,
    /// Bytes that [`decode`] takes at most at a time, its result included.
    pub bytes: u64,
}

/// Looks at the header of a PNG, JPEG or WebP file held in memory; the error is the reason in words.
pub fn measure(bytes: &[u8]) -> Result<Header, String> {
    let (decoder, size) = open(bytes)?;
    // As stored, as eight bits a channel, and as the result.
    let pixels = u64::from(size.x) * u64::from(size.y);
    Ok(Header { size, bytes: decoder.total_bytes() + 8 * pixels })
}

/// Decodes a PNG, JPEG or WebP file held in memory; the error is the reason in words.
pub fn decode(bytes: &[u8]) -> Result<Ldr, String> {
    let (decoder, size) = open(bytes)?;
    let rgba = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?.into_rgba8();
    Ok(Ldr { size, rgba: rgba.pixels().map(|p| p.0).collect() })
}

/// The decoder of a picture whose header can be believed.
fn open(bytes: &[u8]) -> Result<(impl ImageDecoder + '_, UVec2), String> {
    let reason = |e: image::ImageError| e.to_string();
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    match reader.format() {
        Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP) => {}
        Some(other) => return Err(format!("is {other:?}, not PNG, JPEG or WebP")),
        None => return Err("is not PNG, JPEG or WebP".into()),
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(1 << 31);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(reason)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 {
        return Err("has no pixels".into());
    }
    if pixels > SMALL && pixels / PIXELS_PER_BYTE > bytes.len() as u64 {
        return Err(format!("claims {width} x {height} pixels in {} bytes", bytes.len()));
    }
    if width > MAX_EDGE || height > MAX_EDGE || decoder.total_bytes() > 1 << 31 {
        return Err(format!("is too large: {width} x {height} pixels"));
    }
    Ok((decoder, UVec2::new(width, height)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_round_trip() {
        let rgb = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [1, 2, 3], [4, 5, 6], [7, 8, 9]];
        let back = decode(&crate::pixels::encode_png(UVec2::new(3, 2), &rgb).unwrap()).unwrap();
        assert_eq!(back.size, UVec2::new(3, 2));
        assert_eq!(back.rgba, rgb.map(|[r, g, b]| [r, g, b, 255]));
    }

    #[test]
    fn refuses_what_is_no_picture() {
        assert!(decode(b"").is_err());
        assert!(decode(b"hello").is_err());
    }
}
