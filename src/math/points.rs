//! Low-discrepancy points from one table, and hashes that key what must differ.
//!
//! Owen-scrambled Sobol points (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020) cost 84 ns each when made
//! for every texel and 7.5 ns from a shared table. A texel takes a contiguous block of the table (again a net), by its place
//! on a Z-order curve, so that blocks of neighbours are nets together, too: of two by two texels, four by four, all of a
//! square (Ahmed and Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of
//! Pixels", 2020). Each square is to turn its directions by an angle of its own, so that no pattern repeats.

use super::cosine_hemisphere;
use glam::{UVec2, Vec2, Vec3};
use std::ops::Range;

/// One sample: a place in a texel and a direction.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Place, in the unit square.
    pub place: Vec2,
    /// Two more dimensions, in the unit square.
    pub extra: Vec2,
    /// `extra` as a cosine-distributed direction around +z.
    pub direction: Vec3,
}

/// Blocks of points for all texels.
pub struct PointTable {
    points: Vec<Point>,
    block: usize,
    blocks: usize,
    /// Edge, in texels, of the squares whose first blocks differ from each other.
    side: u32,
}

const LONGEST: usize = 1 << 16;
/// Blocks at most: those of 8 by 8 texels.
const BLOCKS: usize = 64;

impl PointTable {
    /// Blocks of `block` points (1..=65536), for means over texels: of few points, too, the places are a net.
    pub fn of_places(block: usize, seed: u32) -> Self {
        let point = |[a, b, c, d]: [f32; 4]| (Vec2::new(a, b), Vec2::new(c, d));
        Self::new(0..block, seed, point)
    }

    /// Blocks for means over directions, of which few, too, are a net. They grow: those of the points `part` begin where
    /// those of shorter ones end, so that no point is there twice, and up to 1024 points, where both are powers of two, those
    /// of a square stay one net.
    pub fn of_directions(part: Range<usize>, seed: u32) -> Self {
        let point = |[a, b, c, d]: [f32; 4]| (Vec2::new(c, d), Vec2::new(a, b));
        Self::new(part, seed, point)
    }

    /// `point`: place and extra from four dimensions, of which the first two are the better net.
    fn new(part: Range<usize>, seed: u32, point: impl Fn([f32; 4]) -> (Vec2, Vec2)) -> Self {
        let block = part.len();
        // A power of two, so that every texel has another one in every pass.
        let blocks = 1 << (LONGEST / block).clamp(1, BLOCKS).ilog2();
        let first = BLOCKS * part.start;
        let point = |i: usize| {
            // Where the sequence ends, another begins.
            let seed = seed.wrapping_add((i / LONGEST) as u32);
            let (place, extra) = point(sobol_burley::sample_4d((i % LONGEST) as u32, 0, seed));
            Point { place, extra, direction: cosine_hemisphere(extra) }
        };
        let points = (first..first + block * blocks).map(point).collect();
        PointTable { points, block, blocks, side: 1 << (blocks.ilog2() / 2) }
    }

    /// Sorts every block into wedges around the normal, and each wedge by elevation: points at the same place of the order,
    /// in blocks turned by [`PointTable::turned`], have neighbouring directions. The first part of a block is no net then.
    pub fn by_direction(mut self) -> Self {
        let wedge = self.wedge();
        for block in self.points.chunks_mut(self.block) {
            block.sort_by(|p, q| azimuth(p).total_cmp(&azimuth(q)));
            block.chunks_mut(wedge).for_each(|w| w.sort_by(|p, q| p.direction.z.total_cmp(&q.direction.z)));
        }
        self
    }

    /// Where to begin in a block by direction that is turned by a `share` of the circle, [0, 1), so that its points keep
    /// step with those of blocks that are not.
    pub fn turned(&self, share: f32) -> usize {
        let wedge = self.wedge();
        let wedges = self.block.div_ceil(wedge);
        (wedges - (share * wedges as f32) as usize) * wedge % self.block
    }

    /// Points of a wedge: as many as there are wedges.
    fn wedge(&self) -> usize {
        (self.block as f32).sqrt().round() as usize
    }

    /// Number of blocks: passes beyond it repeat.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// The `pass`-th block for the texel at column `x`, row `y`; those of the first 2^k passes are a net.
    pub fn block(&self, x: u32, y: u32, pass: usize) -> &[Point] {
        let b = (self.place_in_square(x, y) ^ pass) % self.blocks;
        &self.points[b * self.block..(b + 1) * self.block]
    }

    /// Along the Z-order curve.
    fn place_in_square(&self, x: u32, y: u32) -> usize {
        let (x, y) = (x % self.side, y % self.side);
        (0..self.side.ilog2()).map(|bit| (x >> bit & 1 | (y >> bit & 1) << 1) << (2 * bit)).sum::<u32>() as usize
    }

    /// A word for the square in which a texel lies: blocks inside it differ.
    pub fn square(&self, at: UVec2) -> u32 {
        hash(at.x / self.side, at.y / self.side)
    }
}

fn azimuth(p: &Point) -> f32 {
    libm::atan2f(p.direction.y, p.direction.x)
}

/// Mixes two words into one (the finalizer of MurmurHash3 over a multiplicative combination).
pub fn hash(a: u32, b: u32) -> u32 {
    let mut h = a ^ b.wrapping_mul(0x9e37_79b9).rotate_left(15);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// A word as a number in [0, 1).
pub fn unit_float(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points by cell of a grid that has as many cells.
    fn cells<'p>(points: impl Iterator<Item = &'p Point>, count: u32) -> Vec<u32> {
        let edge = count.isqrt();
        let mut found = vec![0; count as usize];
        for p in points {
            let cell = (p.extra * edge as f32).as_uvec2();
            found[(cell.y * edge + cell.x) as usize] += 1;
        }
        found
    }

    /// Directions of a texel, of two by two, of four by four and of eight by eight; and those of a texel's passes.
    #[test]
    fn squares_of_texels_are_nets() {
        let table = PointTable::of_directions(0..16, 1);
        for edge in [1, 2, 4, 8] {
            // Not the first square of the page.
            let texels = (0..edge).flat_map(|y| (0..edge).map(move |x| (x + 16, y + 40)));
            let found = cells(texels.flat_map(|(x, y)| table.block(x, y, 0)), 16 * edge * edge);
            assert!(found.iter().all(|&n| n == 1), "{edge} by {edge}: {found:?}");
            let passes = (0..(edge * edge) as usize).flat_map(|pass| table.block(21, 46, pass));
            let found = cells(passes, 16 * edge * edge);
            assert!(found.iter().all(|&n| n == 1), "{edge} times {edge} passes: {found:?}");
        }
    }

    /// Where one sequence has too few points for that, too.
    #[test]
    fn blocks_of_a_square_differ() {
        for (rays, side) in [(1, 8), (1024, 8), (1025, 4), (4096, 4), (16384, 2), (20000, 1), (65536, 1)] {
            let table = PointTable::of_directions(0..rays, 1);
            let mut first: Vec<[u32; 2]> = (0..side)
                .flat_map(|y| (0..side).map(move |x| (x, y)))
                .map(|(x, y)| table.block(x, y, 0)[0].extra.to_array().map(f32::to_bits))
                .collect();
            first.sort_unstable();
            first.dedup();
            assert_eq!(first.len(), (side * side) as usize, "{rays} rays");
            let square = |x, y| table.square(UVec2::new(x, y));
            assert!(square(0, 0) == square(side - 1, side - 1) && square(0, 0) != square(side, 0), "{rays} rays");
        }
    }
}
