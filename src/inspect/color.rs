//! Colours, linear.

use crate::math::{SRGB_TO_LINEAR, hash};
use glam::Vec3;

/// What is wrong.
pub(super) const RED: Vec3 = Vec3::new(0.9, 0.02, 0.02);
/// What may be wrong.
pub(super) const YELLOW: Vec3 = Vec3::new(0.9, 0.6, 0.02);

/// Stops of viridis: even to the eye, and in grey, too.
const STOPS: [[u8; 3]; 5] = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

/// Colour of a number from 0 to 1.
pub(super) fn ramp(x: f64) -> Vec3 {
    let x = if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) as f32 } * (STOPS.len() - 1) as f32;
    let k = (x as usize).min(STOPS.len() - 2);
    let [a, b] = [STOPS[k], STOPS[k + 1]].map(|stop| Vec3::from(stop.map(|c| SRGB_TO_LINEAR[c as usize])));
    a.lerp(b, x - k as f32)
}

/// A colour that is unlike those of neighbouring numbers.
pub(super) fn distinct(n: u32) -> Vec3 {
    let h = hash(n, 0x6368_6172);
    let channel = |shift: u32| 0.08 + 0.6 * ((h >> shift & 0xff) as f32 / 255.0);
    Vec3::new(channel(0), channel(8), channel(16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::luminance;

    #[test]
    fn the_ramp_grows_brighter_and_takes_nonsense() {
        let bright: Vec<f32> = (0..=100).map(|i| luminance(ramp(f64::from(i) / 100.0))).collect();
        assert!(bright.windows(2).all(|w| w[1] > w[0]));
        assert_eq!(ramp(f64::NAN), ramp(-1.0));
        assert_eq!(ramp(f64::INFINITY), ramp(1.0));
    }
}
