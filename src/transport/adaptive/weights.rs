//! From blocks to receivers and convex weights.
//!
//! A texel in a block reads its corners bilinearly. A corner that lies on the edge of a larger block is no receiver: it
//! reads that edge as all do there, so that the light is continuous. Weights are products of whole numbers over powers of
//! two: they sum to exactly 1.

use super::blocks::{Block, Blocks};
use crate::{atlas::Coverage, transport::Interpolation};
use glam::UVec2;
use rayon::prelude::*;

/// Texels whose rows are made before they are joined to the others.
const STRIP: usize = 1 << 16;
/// In place of a block: the texel is a receiver.
const OWN: u32 = u32::MAX;

/// The receivers' texels, ascending, and how all texels read them.
pub(super) fn from(blocks: &Blocks, coverage: &Coverage) -> (Vec<u32>, Interpolation) {
    let weights = Weights { blocks: &blocks.all, coverage, within: within(&blocks.all, coverage) };
    let texels: Vec<u32> = (0..coverage.texels.len() as u32).filter(|&t| weights.within[t as usize] == OWN).collect();
    let mut index = vec![0; coverage.texels.len()];
    texels.iter().enumerate().for_each(|(k, &t)| index[t as usize] = k as u32);
    let all: Vec<u32> = (0..coverage.texels.len() as u32).collect();
    let rows = |texels: &[u32]| texels.iter().map(|&t| weights.row(t, &index)).collect::<Vec<_>>();
    let (mut starts, mut entries) = (vec![0], Vec::new());
    for strip in all.chunks(STRIP) {
        for row in strip.par_chunks(STRIP / 64).map(rows).collect::<Vec<_>>().concat() {
            entries.extend(row);
            starts.push(entries.len() as u32);
        }
    }
    entries.shrink_to_fit();
    (texels, Interpolation::Convex { starts, entries })
}

struct Weights<'a> {
    blocks: &'a [Block],
    coverage: &'a Coverage,
    /// Of each texel the block that it reads, the largest that holds it otherwise than at a corner; or [`OWN`].
    within: Vec<u32>,
}

/// Blocks come the largest first: the first that holds a texel decides.
fn within(blocks: &[Block], coverage: &Coverage) -> Vec<u32> {
    const OPEN: u32 = OWN - 1;
    let mut within = vec![OPEN; coverage.texels.len()];
    for (k, block) in blocks.iter().enumerate() {
        let corners = block.corners();
        for at in block.places() {
            let texel = coverage.texel(block.page, at.as_ivec2());
            if let Some(w) = texel.map(|t| &mut within[t as usize]).filter(|w| **w == OPEN) {
                *w = if corners.contains(&at) { OWN } else { k as u32 };
            }
        }
    }
    within.iter_mut().filter(|w| **w == OPEN).for_each(|w| *w = OWN);
    within
}

impl Weights<'_> {
    /// Receivers that a texel reads, ascending, by their `index`, and weights.
    fn row(&self, texel: u32, index: &[u32]) -> Vec<(u32, f32)> {
        let mut row = Vec::with_capacity(4);
        self.add(texel, 1.0, &mut row);
        row.iter_mut().for_each(|e| e.0 = index[e.0 as usize]);
        row.sort_unstable_by_key(|e| e.0);
        row.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.1 += if same { next.1 } else { 0.0 };
            same
        });
        row
    }

    /// Adds what a texel reads, times `weight`: of corners that are no receivers what they read in turn, in blocks that
    /// are larger each time.
    fn add(&self, texel: u32, weight: f32, row: &mut Vec<(u32, f32)>) {
        let within = self.within[texel as usize];
        if within == OWN {
            row.push((texel, weight));
            return;
        }
        let block = &self.blocks[within as usize];
        let side = block.side();
        let far = self.coverage.texels[texel as usize].at - block.first;
        let near = UVec2::splat(side) - far;
        let shares = [near.x * near.y, far.x * near.y, near.x * far.y, far.x * far.y];
        for (at, share) in block.corners().into_iter().zip(shares).filter(|(_, share)| *share > 0) {
            if let Some(corner) = self.coverage.texel(block.page, at.as_ivec2()) {
                self.add(corner, weight * (share as f32 / (side * side) as f32), row);
            }
        }
    }
}
