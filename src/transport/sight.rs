//! `Sight`: what the rays of rows meet, as columns. Shared by all methods that shoot.

use super::receiver::Receiver;
use super::{
    Stats,
    rows::{Block, DARK, UNKNOWN},
};
use crate::{
    atlas::Coverage,
    math::{CELLS, cell_of},
    patches::{Enclosure, Met, Seen, SurfacePoint, seen},
    trace::{Hit, Ray, Tracer},
};
use glam::Vec3;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Entries before all backs are known: a texel's front, its back, or a cell of the sky.
const BACK: u32 = 1 << 30;
const SKY: u32 = 1 << 31;

/// Rays that escape end at this multiple of the longest way within the scene: for all texels in the same direction.
const FAR: f32 = 64.0;

pub(super) struct Sight<'a> {
    pub tracer: &'a Tracer<'a>,
    pub coverage: &'a Coverage,
    enclosure: Enclosure<'a>,
    /// Where rays that escape end.
    far: f32,
    /// One bit a texel: a ray has met its back.
    met: Vec<AtomicU64>,
}

/// The end of a ray.
pub(super) struct End {
    /// The column that it met, or what it saw if its point may be enclosed.
    pub column: Result<u32, Seen>,
    pub spot: Vec3,
}

impl<'a> Sight<'a> {
    pub fn new(tracer: &'a Tracer<'a>, coverage: &'a Coverage) -> Self {
        Sight {
            tracer,
            coverage,
            enclosure: Enclosure::new(tracer, coverage),
            far: FAR * tracer.reach(),
            met: (0..coverage.texels.len().div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// The column that a ray has met, or what it has seen if its point may be enclosed.
    #[inline(always)]
    pub fn end(&self, ray: &Ray, hit: &Option<Hit>, stats: &mut Stats) -> End {
        stats.traced += 1;
        let Some(hit) = hit else {
            stats.escaped += 1;
            let spot = ray.origin + ray.direction * self.far;
            return End { column: Ok(SKY | cell_of(ray.direction)), spot };
        };
        let seen = seen(self.coverage, hit);
        let column = if self.enclosure.may_enclose(hit) { Err(seen) } else { Ok(self.column(seen, stats)) };
        End { column, spot: ray.origin + ray.direction * hit.t }
    }

    #[inline(always)]
    pub fn column(&self, seen: Seen, stats: &mut Stats) -> u32 {
        match seen {
            Seen::Front(t) => t,
            Seen::Back(t) => {
                self.met[t as usize / 64].fetch_or(1 << (t % 64), Relaxed);
                BACK | t
            }
            Seen::Dark => {
                stats.dark += 1;
                DARK
            }
            Seen::Lost => {
                stats.lost += 1;
                DARK
            }
        }
    }

    /// Counts a ray that begins at a receiver.
    #[inline(always)]
    pub fn count(&self, met: &mut Met, hit: &Option<Hit>) {
        met.add(&self.enclosure, hit);
    }

    /// Which points of a receiver are enclosed; `found` counts them.
    pub fn holds(&self, receiver: &Receiver, points: &[SurfacePoint], found: &mut usize) -> Vec<bool> {
        self.enclosure.holds(points, receiver.at, receiver.turn, found)
    }

    /// Texels whose backs were met and are not in `known`, ascending.
    pub fn take_met(&self, known: &[u32]) -> Vec<u32> {
        let known: std::collections::HashSet<u32> = known.iter().copied().collect();
        let bits = self.met.iter().enumerate().flat_map(|(w, bits)| {
            let bits = bits.load(Relaxed);
            (0..64u32).filter(move |b| bits >> b & 1 == 1).map(move |b| w as u32 * 64 + b)
        });
        bits.filter(|t| !known.contains(t)).collect()
    }
}

/// Takes the columns from `sky` on, its cells, back: more backs may be met.
pub(super) fn reopen(block: &mut Block, sky: u32) {
    block.columns_mut().filter(|c| **c >= sky).for_each(|c| *c = SKY | (*c - sky));
}

/// Which columns backs and cells of the sky have: fronts, backs in order, then the sky.
pub(super) struct Numbering {
    /// By texel; empty if there are no backs.
    of_back: Vec<u32>,
    sky: u32,
}

impl Numbering {
    /// `backs`: the texels whose backs have columns; [`UNKNOWN`] takes the place of others.
    pub fn new(texels: u32, backs: &[u32]) -> Self {
        let mut of_back = vec![UNKNOWN; if backs.is_empty() { 0 } else { texels as usize }];
        for (k, &t) in backs.iter().enumerate() {
            of_back[t as usize] = texels + k as u32;
        }
        Numbering { of_back, sky: texels + backs.len() as u32 }
    }

    /// Gives a block its columns.
    pub fn settle(&self, block: &mut Block) {
        for c in block.columns_mut() {
            if *c & SKY != 0 {
                debug_assert!(*c & !SKY < CELLS);
                *c = self.sky + (*c & !SKY);
            } else if *c & BACK != 0 {
                *c = self.of_back.get((*c & !BACK) as usize).copied().unwrap_or(UNKNOWN);
            }
        }
    }
}
