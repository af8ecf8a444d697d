//! Frames, polygons, low-discrepancy points, hashes, colour curves: leaves without knowledge of light.

mod color;

pub use color::{SRGB_TO_LINEAR, linear_to_srgb, luminance};
