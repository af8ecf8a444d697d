//! Rays used again: in the last gather a texel also takes what its neighbours' rays met.
//!
//! Neighbours on one smooth surface see nearly the same. Those of a small square of the page, and a margin around it, put
//! their rays into one [`Pool`], which weighs every ray for each of them. What stands between two texels parts them into
//! pools of their own, and so does what the weights say of those who see less than the others. What is still wrong shows in
//! their own rays, and is put back as far as it is no noise.
//!
//! Margins overlap, so most texels have a value of more than one pool. They take the mean, weighed by how far inside each
//! they lie: an eighth less noise for nothing, and no step where one pool ends. Noise that is left is wider than a pool, and
//! shows as blotches; where nothing is near, a curve through many pools takes it ([`wide`]).

mod alone;
mod ends;
mod far;
mod pool;
mod shrink;
mod trend;
mod wide;

use crate::{
    direct::Parts,
    error::Result,
    math::{
        Frame,
        simd::{LANES, Level},
    },
    progress::{Observer, check},
    transport::{Eye, Neighbours, Stats},
};
use glam::{UVec2, Vec2, Vec3};
use pool::{Own, Pool, Sums};
use rayon::prelude::*;
use wide::{Summary, Tile};

/// Edge of the squares of texels that share their rays, and how far beyond they look for more.
const TILE: u32 = 6;
const MARGIN: u32 = 2;
/// Edge of both.
const EDGE: u32 = TILE + 2 * MARGIN;

/// Receivers of a pool, at least: fewer see too little of what they do not have in common. Measured in sponza: among less
/// than this, four times the rays are worth more.
const ENOUGH: usize = 16;

/// Squared distance, over a patch's area, within which a ray tells which part of it it has met. From further away all of it
/// is seen, and its mean has less noise.
const CLOSE: f32 = 16.0;

/// One receiver of a pool.
struct Sample {
    /// Where it lies in the pool's plane.
    at: Vec2,
    /// What its own rays say, and those of all.
    own: Vec3,
    shared: Vec3,
    /// Variance of the luminance of its own, and number of these.
    noise: f32,
    rays: f32,
}

/// What a pool says of one of its receivers.
struct Found {
    receiver: u32,
    irradiance: Vec3,
    /// Against what other pools say, above 0.
    weight: f32,
}

/// What a pool says of all its receivers.
struct Shared {
    found: Vec<Found>,
    summary: Summary,
}

/// What the last gather needs to know.
pub(super) struct Gather<'a> {
    neighbours: Neighbours<'a>,
    /// What rays may meet; what is [dark](crate::transport::DARK) is none of it.
    columns: Vec<Column>,
    parts: &'a Parts,
    /// Mean luminance of the scene's irradiance.
    mean: f32,
}

/// What a ray has met: together, for rays of a pool meet columns that lie anywhere in memory.
#[derive(Clone, Copy, Default)]
#[repr(align(32))]
struct Column {
    radiosity: Vec3,
    /// Nothing of what faces whoever sees it.
    normal: Vec3,
    /// Squared distance, m^2, within which a ray tells which part of it it has met; 0 if parts are alike.
    close: f32,
}

impl<'a> Gather<'a> {
    /// `radiosity`: of every column, of which `parts` reflect more or less light than all.
    pub fn new(neighbours: Neighbours<'a>, radiosity: &[Vec3], parts: &'a Parts, mean: f32) -> Self {
        let patches = neighbours.patches;
        let column = |(i, &radiosity)| Column {
            radiosity,
            normal: patches.normal.get(i).copied().unwrap_or_default(),
            close: if parts.divide(i) { CLOSE * patches.area[i] } else { 0.0 },
        };
        Gather { columns: radiosity.par_iter().enumerate().map(column).collect(), neighbours, parts, mean }
    }

    /// What a ray from `eye` has met at `spot`.
    #[inline]
    fn met(&self, eye: &Eye, column: u32, spot: Vec3) -> Column {
        let mut met = self.columns.get(column as usize).copied().unwrap_or_default();
        if eye.position.distance_squared(spot) < met.close {
            let beyond = self.parts.beyond(column as usize, spot).unwrap_or_default();
            met.radiosity += self.neighbours.patches.reflectance[column as usize] * beyond;
        }
        met
    }

    /// Replaces the irradiance of receivers that are fronts by what their neighbours' rays make of it, or more of their own.
    /// Returns what these were.
    pub fn run(&self, irradiance: &mut [Vec3], observer: &dyn Observer) -> Result<Stats> {
        let Neighbours { transport, coverage, .. } = self.neighbours;
        let mut strides: Vec<u32> = (0..transport.eyes.len()).map(|r| transport.stride(r)).collect();
        strides.sort_unstable();
        strides.dedup();
        let rows = |stride: u32, page: usize| {
            let count = coverage.sizes[page].y.div_ceil(TILE * stride);
            (0..count).map(move |y| (stride, page, y))
        };
        let pages = 0..coverage.sizes.len();
        let strips = strides.into_iter().flat_map(|stride| pages.clone().flat_map(move |page| rows(stride, page)));
        let strips: Vec<(u32, usize, u32)> = strips.collect();
        let level = Level::best();
        observer.begin("reuse", strips.len() as u64);
        let strip = |&(stride, page, y): &(u32, usize, u32)| {
            let (tiles, mut pool) = (0..coverage.sizes[page].x.div_ceil(TILE * stride), Pool::default());
            let tiles = tiles
                .filter(|_| !observer.cancelled())
                .map(|x| self.tile(page, UVec2::new(x, y) * TILE * stride, stride, level, &mut pool));
            let shared = tiles.flatten().collect();
            observer.advance(1);
            shared
        };
        let shared: Vec<Vec<Shared>> = strips.par_iter().map(strip).collect();
        check(observer)?;
        let (found, summaries): (Vec<Vec<Found>>, Vec<Summary>) =
            shared.into_iter().flatten().map(|Shared { found, summary }| (found, summary)).unzip();
        // Below zero where rows take back what was sampled; nothing is cut off before that is added.
        let found = found.iter().zip(wide::corrections(&summaries, self.neighbours.tracer));
        let found = found.flat_map(|(found, add)| found.iter().map(move |f| (f, f.irradiance + add)));
        let mut weights = vec![0.0; irradiance.len()];
        for (&Found { receiver, weight, .. }, e) in found {
            let (mean, sum) = (&mut irradiance[receiver as usize], &mut weights[receiver as usize]);
            *sum += weight;
            *mean = if *sum == weight { e } else { mean.lerp(e, weight / *sum) };
        }
        let buried = |r: usize| self.neighbours.patches.buried[transport.receivers[r] as usize];
        let alone = |&r: &u32| weights[r as usize] == 0.0 && !buried(r as usize);
        let alone: Vec<u32> = (0..transport.eyes.len() as u32).filter(alone).collect();
        self.add_rays(&alone, irradiance, observer)
    }

    /// The pools of receivers of this stride in the tile that begins at `first`, and in its margin.
    fn tile(&self, page: usize, first: UVec2, stride: u32, level: Level, pool: &mut Pool) -> Vec<Shared> {
        let Gather { neighbours, .. } = self;
        let Neighbours { transport, coverage, patches, .. } = neighbours;
        let end = first + TILE * stride;
        let mut inner = neighbours.receivers(page, first, end, stride);
        inner.retain(|&r| transport.stride(r as usize) == stride);
        if inner.is_empty() {
            return Vec::new();
        }
        let margin = MARGIN * stride;
        let mut left = neighbours.receivers(page, first.saturating_sub(UVec2::splat(margin)), end + margin, stride);
        let tile = Tile { page, stride, at: first / (TILE * stride) };
        let texel = |receiver: u32| transport.receivers[receiver as usize] as usize;
        let find = |(receiver, irradiance): (u32, Vec3)| {
            let from_corner = (coverage.texels[texel(receiver)].at + margin - first) / stride;
            Found { receiver, irradiance, weight: depth(from_corner) }
        };
        let mut found = Vec::new();
        while let Some(&leader) = left.iter().find(|r| inner.contains(r)) {
            let members = neighbours.around(leader, &left, (TILE + MARGIN) * stride);
            pool.collect(self, &members);
            let shared = pool.shared(level);
            let of_members = members.into_iter().zip(shared).zip(pool.own());
            let (sharing, mut samples, sums) = self.samples(of_members);
            // They are in the order of those that are left.
            let mut leaving = sharing.iter().copied().peekable();
            left.retain(|&r| leaving.next_if_eq(&r).is_none() && r != leader);
            if sharing.len() < ENOUGH {
                continue;
            }
            straighten(&mut samples, sums.most);
            let area = sharing.iter().map(|&r| patches.area[texel(r)]).sum::<f32>() / sharing.len() as f32;
            let eyes = sharing.iter().map(|&r| transport.eyes[r as usize]);
            let of_members = eyes.zip(samples.iter().map(|s| s.shared));
            let summary = Summary::of(tile, area.sqrt() * stride as f32, of_members, &sums);
            let of_stride = sharing.into_iter().zip(samples).filter(|(r, _)| transport.stride(*r as usize) == stride);
            found.push(Shared { found: of_stride.map(|(r, s)| find((r, s.shared))).collect(), summary });
        }
        found
    }

    /// The receivers of a pool that share, what is known of them, and the sums over their rays.
    fn samples(&self, members: impl Iterator<Item = ((u32, Option<Vec3>), Own)>) -> (Vec<u32>, Vec<Sample>, Sums) {
        let (mut axes, mut all) = (None, Sums::default());
        let sample = |((r, shared), Own { light, noise, sums }): ((u32, Option<Vec3>), Own)| {
            let eye = &self.neighbours.transport.eyes[r as usize];
            let shared = shared?;
            let at = axes.get_or_insert_with(|| Frame::around(eye.normal)).flat(eye.position);
            all.add(&sums);
            Some((r, Sample { at, own: light, shared, noise, rays: sums.rays }))
        };
        let (receivers, samples) = members.filter_map(sample).unzip();
        (receivers, samples, all)
    }
}

/// Puts back what sharing has blurred. `most`: the brightest that a ray has met.
fn straighten(samples: &mut [Sample], most: f32) {
    if let Some(trend) = trend::of(samples) {
        samples.iter_mut().for_each(|s| s.shared += trend(s.at));
    }
    let added = shrink::of(samples, most);
    samples.iter_mut().zip(added).for_each(|(s, add)| s.shared += add);
}

/// Bytes of one pool, at most, of rows of so many rays: what every receiver makes of every ray, and the rays.
pub fn bytes_of_pool(rays: u64) -> u64 {
    let members = u64::from(EDGE * EDGE);
    members * rays.next_multiple_of(LANES as u64) * (4 * members + 88)
}

/// Pools that are there at once, at most, on a page of this height.
pub fn pools(height: u32) -> u64 {
    u64::from(height.div_ceil(TILE))
}

/// How far inside its margin a receiver of a tile lies, along one side of the page times the other; `from_corner`: of the
/// margin, in strides.
fn depth(from_corner: UVec2) -> f32 {
    let from_edge = from_corner.as_vec2() + 0.5;
    from_edge.min(EDGE as f32 - from_edge).element_product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_counts_most_and_the_edge_a_little() {
        let at = |x, y| depth(UVec2::new(x, y));
        for k in 0..EDGE {
            assert!(at(k, 3) == at(EDGE - 1 - k, 3) && at(k, 3) == at(3, k) && at(k, 0) > 0.0);
        }
        assert!(at(1, 5) > at(0, 5) && at(5, 5) > at(3, 3) && at(EDGE - 1, EDGE - 1) == 0.25);
    }
}
