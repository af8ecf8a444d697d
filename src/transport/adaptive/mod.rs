//! Receivers where the light can vary: rows at some texels, and convex weights for what lies between.
//!
//! Indirect light varies where something is near: over a way d by about d / R, R the harmonic mean distance to what a
//! place sees, and with the turn of the normal (Ward, Rubinstein and Clear, "A Ray Tracing Solution for Diffuse
//! Interreflection", 1988). A few rays from every texel tell R ([`surroundings`]). Squares of texels over which little varies
//! are kept whole, others are cut into four, down to single texels in corners ([`blocks`]); the corners of squares are
//! the receivers, and what lies between is read bilinearly ([`weights`]). Geometry alone decides: the receivers serve any
//! light.

mod blocks;
mod surroundings;
mod weights;

use super::Interpolation;
use crate::{
    atlas::Coverage,
    error::Result,
    progress::{Observer, check},
    trace::Tracer,
};
use blocks::Blocks;

/// Receivers among the fronts.
pub(super) struct Chosen {
    /// Their texels, ascending.
    pub texels: Vec<u32>,
    /// Of each, texels to the neighbours with which it may share rays.
    pub strides: Vec<u8>,
    /// From them to all fronts.
    pub interpolation: Interpolation,
}

/// Levels of squares: the largest have edges of 2^LEVELS texels.
const LEVELS: u32 = 3;
/// Variation over a square, at most, if rows have so many rays. With more rays, whose noise falls with about the root of
/// their number, the error of a bilinear look-up, of second order, keeps step.
const VARIATION: f32 = 0.14;
const RAYS: f32 = 16.0;
/// Variation from one receiver to the next, at most, among those that share rays, which are ten in a row: where it is more,
/// most of them see what others do not.
const SHARED_VARIATION: f32 = 0.05;

/// Chooses receivers for rows of so many rays.
pub(super) fn choose(tracer: &Tracer, coverage: &Coverage, rays: u32, observer: &dyn Observer) -> Result<Chosen> {
    observer.begin("receivers", coverage.texels.len() as u64);
    let surroundings = surroundings::at_all(tracer, coverage, observer);
    check(observer)?;
    let variation = VARIATION * libm::powf(RAYS / rays as f32, 0.25);
    let blocks = Blocks::new(tracer, coverage, &surroundings, variation);
    let (texels, interpolation) = weights::from(&blocks, coverage);
    let sides = blocks.sides(coverage);
    let stride = |t: usize| surroundings[t].stride(SHARED_VARIATION).min(sides[t]);
    let strides = texels.iter().map(|&t| stride(t as usize)).collect();
    Ok(Chosen { texels, strides, interpolation })
}
