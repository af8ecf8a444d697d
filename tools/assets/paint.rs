//! Pictures made by code, as PNG.

use image::{ExtendedColorType::Rgb8, ExtendedColorType::Rgba8, ImageEncoder, codecs::png};

/// Floor boards: 2 m x 2 m of sixteen rows, repeating in both directions.
pub fn boards() -> Vec<u8> {
    const SIZE: u32 = 256;
    const ROW: u32 = 16;
    let mut rgb = Vec::new();
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let row = y / ROW;
        // Two boards a row, staggered; the first column and line of a board are its joint.
        let along = (x + 96 * row) % SIZE;
        let board = row * 2 + along / 128;
        let joint = y.is_multiple_of(ROW) || along.is_multiple_of(128);
        let tone = 0.8 + 0.2 * noise(board, 0);
        let grain = 0.9 + 0.1 * (0.5 * noise(along / 16, y + 512) + 0.5 * noise(along / 4, y / 2 + 1024));
        let light = if joint { 0.45 } else { tone * grain };
        rgb.extend([190.0, 142.0, 96.0].map(|c: f32| (c * light / 4.0) as u8 * 4));
    }
    png(&rgb, SIZE, SIZE, Rgb8)
}

/// One leaf, its tip at the top; what is not leaf has alpha 0.
pub fn leaf() -> Vec<u8> {
    const SIZE: u32 = 64;
    let mut rgba = Vec::new();
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let (across, along) = ((x as f32 + 0.5) / SIZE as f32 - 0.5, 1.0 - (y as f32 + 0.5) / SIZE as f32);
        let half_width = 0.46 * libm::sinf(std::f32::consts::PI * libm::powf(along, 0.8));
        let vein = across.abs() < 0.02 || (along * 12.0 - across.abs() * 14.0).rem_euclid(1.0) < 0.12;
        let [r, g, b] = if vein { [110, 150, 70] } else { [64, 118, 44] };
        rgba.extend([r, g, b, if across.abs() < half_width { 255 } else { 0 }]);
    }
    png(&rgba, SIZE, SIZE, Rgba8)
}

/// A number in [0, 1) that looks random.
fn noise(a: u32, b: u32) -> f32 {
    let mut h = a.wrapping_mul(0x9E37_79B1) ^ b.wrapping_mul(0x85EB_CA77);
    for _ in 0..2 {
        h = (h ^ h >> 15).wrapping_mul(0x2C1B_3C6D);
        h = (h ^ h >> 12).wrapping_mul(0x297A_2D39);
    }
    (h >> 8) as f32 / (1 << 24) as f32
}

fn png(bytes: &[u8], width: u32, height: u32, kind: image::ExtendedColorType) -> Vec<u8> {
    let mut out = Vec::new();
    png::PngEncoder::new_with_quality(&mut out, png::CompressionType::Best, png::FilterType::Adaptive)
        .write_image(bytes, width, height, kind)
        .expect("a picture in memory");
    out
}
