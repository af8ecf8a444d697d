//! Rays used again: in the last gather a texel also takes what its neighbours' rays met.
//!
//! Neighbours on one smooth surface see nearly the same. Those of a small square of the page, and a margin around it, put
//! their rays into one [`Pool`], which weighs every ray for each of them. What stands between two texels parts them into
//! pools of their own, and so does what the weights say of those who see less than the others.

mod pool;
mod trend;

use crate::{
    atlas::{Coverage, NO_TEXEL},
    error::Result,
    math::{Frame, luminance, simd::Level},
    patches::{Patches, continues},
    progress::{Observer, check},
    trace::{NOWHERE, Segment, Tracer},
    transport::Transport,
};
use glam::{UVec2, Vec3};
use pool::Pool;
use rayon::prelude::*;
use trend::Sample;

/// Edge of the squares of texels that share their rays, and how far beyond they look for more.
const TILE: u32 = 6;
const MARGIN: u32 = 2;
/// Height, in texels, above which something that stands between two texels parts them.
const LIFT: f32 = 0.5;

/// What the last gather needs to know.
pub(super) struct Gather<'a> {
    pub transport: &'a Transport,
    pub tracer: &'a Tracer<'a>,
    pub coverage: &'a Coverage,
    pub patches: &'a Patches,
    /// Radiosity of every column.
    pub radiosity: &'a [Vec3],
}

impl Gather<'_> {
    /// Replaces the irradiance of fronts by what their neighbours' rays make of it.
    pub fn run(&self, irradiance: &mut [Vec3], observer: &dyn Observer) -> Result<()> {
        let rows = |page: usize| (0..self.coverage.sizes[page].y.div_ceil(TILE)).map(move |y| (page, y));
        let strips: Vec<(usize, u32)> = (0..self.coverage.sizes.len()).flat_map(rows).collect();
        let level = Level::best();
        observer.begin("reuse", strips.len() as u64);
        let own = &*irradiance;
        let strip = |&(page, y): &(usize, u32)| {
            let tiles = 0..self.coverage.sizes[page].x.div_ceil(TILE);
            let tiles =
                tiles.filter(|_| !observer.cancelled()).map(|x| self.tile(page, UVec2::new(x, y) * TILE, own, level));
            let found = tiles.flatten().collect();
            observer.advance(1);
            found
        };
        let found: Vec<Vec<(u32, Vec3)>> = strips.par_iter().map(strip).collect();
        check(observer)?;
        found.iter().flatten().for_each(|&(texel, e)| irradiance[texel as usize] = e);
        Ok(())
    }

    /// New values of the texels of the tile that begins at `first`.
    fn tile(&self, page: usize, first: UVec2, own: &[Vec3], level: Level) -> Vec<(u32, Vec3)> {
        let inner = self.texels(page, first, first + TILE);
        let mut left = self.texels(page, first.saturating_sub(UVec2::splat(MARGIN)), first + TILE + MARGIN);
        let mut found = Vec::with_capacity(inner.len());
        while let Some(&leader) = left.iter().find(|t| inner.contains(t)) {
            let members = self.around(leader, &left);
            let values = Pool::new(self, &members).shared(level);
            let done = members.into_iter().zip(values).filter_map(|(t, value)| Some((t, value?)));
            let mut done: Vec<(u32, Vec3)> = done.collect();
            self.straighten(&mut done, own);
            for (texel, value) in done {
                left.retain(|&t| t != texel);
                if inner.contains(&texel) {
                    found.push((texel, value));
                }
            }
            // Whoever does not share in its own pool keeps to its own rays.
            left.retain(|&t| t != leader);
        }
        found
    }

    /// Puts back what sharing has blurred.
    fn straighten(&self, done: &mut [(u32, Vec3)], own: &[Vec3]) {
        let Some(&(first, _)) = done.first() else { return };
        let axes = Frame::around(self.transport.eyes[first as usize].normal);
        let at = |t: u32| axes.flat(self.transport.eyes[t as usize].position);
        let sample = |&(t, shared): &(u32, Vec3)| Sample { at: at(t), own: own[t as usize], shared };
        let samples: Vec<Sample> = done.iter().map(sample).collect();
        if let Some(trend) = trend::of(&samples) {
            for ((_, value), s) in done.iter_mut().zip(&samples) {
                *value = (*value + trend(s.at)).max(Vec3::ZERO);
            }
        }
    }

    /// Texels of a rectangle of the page that have rays.
    fn texels(&self, page: usize, low: UVec2, high: UVec2) -> Vec<u32> {
        let (grid, size) = (&self.coverage.grids[page], self.coverage.sizes[page]);
        let high = high.min(size);
        let cells = (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| y * size.x + x));
        let texels = cells.map(|cell| grid[cell as usize]);
        texels.filter(|&t| t != NO_TEXEL && !self.patches.buried[t as usize]).collect()
    }

    /// Those that lie on the same smooth surface as the leader, with nothing standing between.
    fn around(&self, leader: u32, texels: &[u32]) -> Vec<u32> {
        let some = texels.iter().copied().filter(|&t| self.continues(leader, t));
        let above = |t: u32| {
            let eye = &self.transport.eyes[t as usize];
            eye.position + eye.normal * (LIFT * self.patches.area[t as usize].sqrt())
        };
        let origin = above(leader);
        let (some, ways): (Vec<u32>, Vec<Segment>) =
            some.map(|t| (t, Segment { origin, direction: above(t) - origin, t: 1.0, from: NOWHERE })).unzip();
        let mut through = vec![Vec3::ZERO; ways.len()];
        self.tracer.transmittance_of_each(&ways, &mut through);
        let joined = some.into_iter().zip(through).filter(|&(t, way)| t == leader || luminance(way) > 0.5);
        joined.map(|(t, _)| t).collect()
    }

    /// True if the surface goes on smoothly from one texel to the other.
    fn continues(&self, a: u32, b: u32) -> bool {
        let (p, q) = (&self.transport.eyes[a as usize], &self.transport.eyes[b as usize]);
        let area = self.patches.area[a as usize].max(self.patches.area[b as usize]);
        // Texels of other charts may lie beside it on the page; half as far again allows for stretched ones.
        let apart = 1.5 * std::f32::consts::SQRT_2 * (TILE + MARGIN) as f32 * area.sqrt();
        a == b || continues([p.position, p.normal], [q.position, q.normal], apart)
    }
}
