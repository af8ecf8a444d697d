//! [`Coverage`]: which texels each surface touches, exactly, and with how much area.

use glam::UVec2;

/// Every covered texel with the pieces of surface inside it.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// Covered texels, by page, then row by row.
    pub texels: Vec<Texel>,
    /// Pieces of surface; `starts[i]..starts[i + 1]` are texel i's.
    pub fragments: Vec<Fragment>,
    /// Where each texel's fragments begin, and their number.
    pub starts: Vec<u32>,
    /// For each page, row by row, the index in `texels`, or [`NO_TEXEL`].
    pub grids: Vec<Vec<u32>>,
}

/// An uncovered place of a page.
pub const NO_TEXEL: u32 = u32::MAX;

/// A covered place of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texel {
    /// Index of the page.
    pub page: u32,
    /// Column and row.
    pub at: UVec2,
}

/// The part of one triangle inside one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Global triangle ([`crate::scene::triangle_starts`]).
    pub triangle: u32,
    /// World area, m^2.
    pub area: f32,
}
