//! The sRGB curve and luminance, linear Rec. 709.

use glam::Vec3;
use std::sync::LazyLock;

/// Linear value of each eight-bit sRGB code.
pub static SRGB_TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let c = i as f32 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { libm::powf((c + 0.055) / 1.055, 2.4) }
    })
});

/// sRGB code in [0, 1] of a linear value, clamped.
pub fn linear_to_srgb(c: f32) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * libm::powf(c, 1.0 / 2.4) - 0.055 }
}

/// sRGB code of a linear colour, clamped.
pub fn srgb(c: Vec3) -> [u8; 3] {
    c.to_array().map(|x| (linear_to_srgb(x) * 255.0 + 0.5) as u8)
}

/// Luminance of linear Rec. 709.
pub fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
