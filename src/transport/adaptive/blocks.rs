//! [`Blocks`]: squares of texels over which the light can hardly vary.

use super::{LEVELS, surroundings::Surroundings};
use crate::{atlas::Coverage, trace::Tracer, transport::LIFT};
use glam::UVec2;
use rayon::prelude::*;

/// How far a texel may lie from where its corners say, in texels: those at borders are cut.
const ASTRAY: f32 = 0.5;

/// A square with a texel at each corner, which it shares with the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub page: u32,
    /// Place of its first corner on the page.
    pub first: UVec2,
    /// Its edge is 2^level texels, from corner to corner.
    pub level: u32,
}

/// Squares of all pages, the largest first; none lies in another.
pub(super) struct Blocks {
    pub all: Vec<Block>,
}

impl Block {
    /// Texels from corner to corner.
    pub fn side(&self) -> u32 {
        1 << self.level
    }

    /// Places of its texels, row by row, its edges with them.
    pub fn places(&self) -> impl Iterator<Item = UVec2> + use<> {
        let (first, side) = (self.first, self.side());
        (0..=side).flat_map(move |y| (0..=side).map(move |x| first + UVec2::new(x, y)))
    }

    /// Places of its corners, row by row.
    pub fn corners(&self) -> [UVec2; 4] {
        let side = self.side();
        [[0, 0], [side, 0], [0, side], [side, side]].map(|d| self.first + UVec2::from(d))
    }

    fn quarters(&self) -> [Block; 4] {
        let half = Block { level: self.level - 1, ..*self };
        half.corners().map(|first| Block { first, ..half })
    }
}

impl Blocks {
    /// Finds the largest squares with no more `variation`.
    pub fn new(tracer: &Tracer, coverage: &Coverage, surroundings: &[Surroundings], variation: f32) -> Self {
        let judge = Judge { tracer, coverage, surroundings, variation };
        let edge = 1 << LEVELS;
        let strips =
            (0..coverage.sizes.len()).flat_map(|p| (0..coverage.sizes[p].y.div_ceil(edge)).map(move |y| (p, y)));
        let strips: Vec<(usize, u32)> = strips.collect();
        let strip = |&(page, y): &(usize, u32)| {
            let mut found = Vec::new();
            for x in 0..coverage.sizes[page].x.div_ceil(edge) {
                let whole = Block { page: page as u32, first: UVec2::new(x, y) * edge, level: LEVELS };
                judge.divide(whole, &mut found);
            }
            found
        };
        let mut all = strips.par_iter().map(strip).collect::<Vec<Vec<Block>>>().concat();
        all.sort_by_key(|b| std::cmp::Reverse(b.level));
        Blocks { all }
    }

    /// Of each texel the edge of the largest square of which it is a corner, in texels; 1 if of none.
    pub fn sides(&self, coverage: &Coverage) -> Vec<u8> {
        let mut sides = vec![1; coverage.texels.len()];
        for block in self.all.iter().rev() {
            for t in block.corners().into_iter().filter_map(|at| coverage.texel(block.page, at.as_ivec2())) {
                sides[t as usize] = block.side() as u8;
            }
        }
        sides
    }
}

struct Judge<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    surroundings: &'a [Surroundings],
    variation: f32,
}

impl Judge<'_> {
    /// Keeps the block, or asks its quarters; single texels are no blocks.
    fn divide(&self, block: Block, found: &mut Vec<Block>) {
        if self.holds(&block) {
            found.push(block);
        } else if block.level > 1 {
            block.quarters().into_iter().for_each(|b| self.divide(b, found));
        }
    }

    fn around(&self, page: u32, at: UVec2) -> Option<&Surroundings> {
        self.coverage.texel(page, at.as_ivec2()).map(|t| &self.surroundings[t as usize])
    }

    /// True if its texels are one smooth surface with nothing near.
    fn holds(&self, block: &Block) -> bool {
        let corner = |at: UVec2| self.around(block.page, at).filter(|g| !g.odd);
        let [Some(a), Some(b), Some(c), Some(d)] = block.corners().map(corner) else { return false };
        let normal = (a.normal + b.normal + c.normal + d.normal).normalize_or_zero();
        let edges = [(a, b), (c, d), (a, c), (b, d)].map(|(p, q)| p.center.distance(q.center));
        let edge = edges.into_iter().fold(0.0, f32::max);
        let side = block.side() as f32;
        let pitch = edge / side;
        let (mut near, mut least) = (0f32, 1f32);
        for at in block.places() {
            let Some(g) = self.around(block.page, at).filter(|g| !g.odd) else { return false };
            let f = (at - block.first).as_vec2() / side;
            let expected = a.center.lerp(b.center, f.x).lerp(c.center.lerp(d.center, f.x), f.y);
            near = near.max(g.near);
            least = least.min(g.normal.dot(normal));
            let astray = g.center.distance_squared(expected) > ASTRAY * ASTRAY * pitch * pitch;
            let varies = edge * near + bend(least) > self.variation;
            if astray || varies {
                return false;
            }
        }
        self.is_open([a, b, c, d], pitch)
    }

    /// True if nothing stands between the corners.
    fn is_open(&self, corners: [&Surroundings; 4], pitch: f32) -> bool {
        let above = corners.map(|g| g.center + g.normal * (LIFT * pitch));
        let ways = [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)];
        self.tracer.are_open(&ways.map(|(a, b)| [above[a], above[b]])).into_iter().all(|open| open)
    }
}

/// Ward's term for normals that lie on both sides of their mean, by the least cosine to it.
fn bend(least: f32) -> f32 {
    2.0 * (1.0 - least).max(0.0).sqrt()
}
