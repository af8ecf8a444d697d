//! [`Transport`]: form factors from receivers to everything they see. Geometry and alpha only: no light, no reflectance.
//!
//! A row is measured with rays: the share of a receiver's cosine-distributed rays that meet patch j is F_ij. Rows are
//! non-negative and sum to at most 1 whatever the noise. The sky is seen as cells of equal solid angle, columns behind
//! the patches, so that rows relight under any sky. Receivers may be fewer than patches; [`Interpolation`] spreads what
//! they receive with convex weights.

mod rays;
mod receiver;
mod rows;

pub use rays::rays_of_rows;
pub use rows::{DARK, Ends, Row, Rows};

use crate::{atlas::Coverage, error::Result, math::CELLS, patches::Patches, progress::Observer, trace::Tracer};
use glam::Vec3;
use rayon::prelude::*;
use std::{iter::Sum, ops::Mul};

/// Rows at receivers, and how patches read them.
pub struct Transport {
    /// The patch of each receiver.
    pub receivers: Vec<u32>,
    /// One row a receiver over `patches` patches and [`CELLS`] cells of the sky.
    pub rows: Rows,
    /// Number of patches: columns below it are patches, columns from it on are cells of the sky.
    pub patches: usize,
    /// From receivers to patches.
    pub interpolation: Interpolation,
    /// Where the rays of each front start; empty unless neighbours may use them.
    pub eyes: Vec<Eye>,
    /// What became of the rays.
    pub stats: Stats,
}

/// How rows are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Rays a row, 1..=65536. Default: 64.
    pub rays: u32,
    /// Whether neighbours use each other's rays in the last gather, if rows have at most 64 rays or all together at most
    /// 2^26. Default: true.
    pub reuse: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options { rays: 64, reuse: true }
    }
}

impl Options {
    /// `rays` a row, the rest as by default.
    pub fn of(rays: u32) -> Self {
        Options { rays, ..Options::default() }
    }

    /// True if neighbours use each other's rays, each of which takes 16 bytes then: with many rays it would be too many.
    pub fn shares(&self, texels: usize) -> bool {
        self.reuse && (self.rays <= SHARED || texels as u64 * u64::from(self.rays) <= SHARED_IN_ALL)
    }

    /// Bytes that are kept of a ray.
    pub fn bytes_a_ray(&self, texels: usize) -> u64 {
        if self.shares(texels) { 16 } else { 4 }
    }
}

/// Rays of a row, and of all rows, that neighbours use.
const SHARED: u32 = 64;
const SHARED_IN_ALL: u64 = 1 << 26;

/// A receiver as its neighbours see it.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Where its rays start on average.
    pub position: Vec3,
    /// Unit shading normal in the middle.
    pub normal: Vec3,
}

/// P: how patches read what receivers received.
#[derive(Clone, Debug)]
pub enum Interpolation {
    /// Every patch is a receiver, in order.
    Identity,
    /// Each patch is a convex combination of receivers: `starts[i]..starts[i + 1]` of `entries` are patch i's
    /// (receiver, weight).
    Convex {
        /// Where each patch's entries begin, and their number.
        starts: Vec<u32>,
        /// Receivers and weights; a patch's weights sum to 1.
        entries: Vec<(u32, f32)>,
    },
}

/// Counts of rays.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stats {
    /// Rays traced for rows.
    pub traced: u64,
    /// Rays that left the scene.
    pub escaped: u64,
    /// Rays that ended on an unlit surface or the back of a single-sided one.
    pub dark: u64,
    /// Rays that hit a surface that no texel covers.
    pub lost: u64,
}

impl std::ops::AddAssign for Stats {
    fn add_assign(&mut self, o: Self) {
        self.traced += o.traced;
        self.escaped += o.escaped;
        self.dark += o.dark;
        self.lost += o.lost;
    }
}

impl Transport {
    /// Measures a row at every patch, and tells `patches` which backs rays met and what is buried.
    pub fn measure(
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &mut Patches,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let measured = rays::measure(tracer, coverage, patches, options, observer)?;
        let transport = Transport {
            receivers: (0..patches.len() as u32).collect(),
            rows: measured.rows,
            patches: patches.len(),
            interpolation: Interpolation::Identity,
            eyes: measured.eyes,
            stats: measured.stats,
        };
        debug_assert!(transport.validate().is_ok(), "{:?}", transport.validate());
        Ok(transport)
    }

    /// Rows given by hand over `patches` patches, one receiver each: columns, and the weight of every entry.
    pub fn from_rows(patches: usize, rows: impl IntoIterator<Item = (Vec<u32>, f32)>) -> Self {
        let rows = Rows::from_rows(rows);
        let n = rows.len();
        Transport {
            receivers: (0..n as u32).collect(),
            rows,
            patches,
            interpolation: Interpolation::Identity,
            eyes: Vec::new(),
            stats: Stats::default(),
        }
    }

    /// Spreads values at receivers to all patches.
    pub fn interpolate<T>(&self, at_receivers: &[T], at_patches: &mut [T])
    where
        T: Copy + Send + Sync + Sum + Mul<f64, Output = T>,
    {
        match &self.interpolation {
            Interpolation::Identity => at_patches.copy_from_slice(at_receivers),
            Interpolation::Convex { starts, entries } => {
                at_patches.par_iter_mut().enumerate().for_each(|(i, out)| {
                    let row = &entries[starts[i] as usize..starts[i + 1] as usize];
                    *out = row.iter().map(|&(r, w)| at_receivers[r as usize] * f64::from(w)).sum();
                });
            }
        }
    }

    /// Checks shapes, ranges and sums.
    pub fn validate(&self) -> std::result::Result<(), String> {
        let n = self.receivers.len();
        if self.rows.len() != n {
            return Err(format!("{n} receivers, {} rows", self.rows.len()));
        }
        let columns = self.patches as u32 + CELLS;
        for i in 0..n {
            let row = self.rows.row(i);
            if row.columns.iter().any(|&c| c >= columns) {
                return Err(format!("row {i} names a column beyond {columns}"));
            }
            let sum = row.columns.len() as f32 * row.weight;
            if !(0.0..=1.0 + 1e-5).contains(&sum) {
                return Err(format!("row {i} sums to {sum}"));
            }
        }
        if let Interpolation::Convex { starts, entries } = &self.interpolation {
            for (i, w) in starts.windows(2).enumerate() {
                let row = &entries[w[0] as usize..w[1] as usize];
                let sum: f32 = row.iter().map(|e| e.1).sum();
                if row.iter().any(|e| e.1 < 0.0 || e.0 as usize >= n) || (sum - 1.0).abs() > 1e-4 {
                    return Err(format!("patch {i} is no convex combination: sum {sum}"));
                }
            }
        }
        Ok(())
    }
}
