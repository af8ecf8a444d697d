//! Frames, polygons, low-discrepancy points, hashes, colour curves: leaves without knowledge of light.

mod color;
mod frame;
mod points;
mod polygon;
mod quadratic;
mod random;
pub(crate) mod simd;
mod sphere;

pub use color::{SRGB_TO_LINEAR, linear_to_srgb, luminance, srgb};
pub use frame::{Frame, cosine_hemisphere, square_to_disc};
pub use points::{Point, PointTable, hash, unit_float};
pub use polygon::Polygon;
pub(crate) use quadratic::Quadratic;
pub(crate) use random::Random;
pub use sphere::{CELLS, cell_center, cell_of};
