//! [`Transport`]: form factors from receivers to everything they see. Geometry and alpha only: no light, no reflectance.
//!
//! A row is measured with rays, unless another of [`FormFactors`] is asked for: the share of a receiver's cosine-distributed
//! rays that meet patch j is F_ij. Rows are non-negative and sum to at most 1 whatever the noise. The sky is seen as cells of
//! equal solid angle, columns behind the patches, so that rows relight under any sky. Receivers may be fewer than patches;
//! [`Interpolation`] spreads what they receive with convex weights.

mod adaptive;
mod analytic;
mod check;
mod contour;
mod draft;
mod form_factors;
mod groups;
mod hemicube;
mod neighbours;
mod rays;
mod receiver;
mod rows;
mod sight;
mod waves;

pub use check::Checked;
pub use form_factors::FormFactors;
pub use groups::Groups;
pub use neighbours::Neighbours;
pub use rays::{rays_of_rows, sample};
pub use rows::{DARK, Ends, Row, Rows, UNKNOWN};

use crate::{
    atlas::Coverage,
    error::{Error, Result},
    memory,
    patches::Patches,
    progress::Observer,
    trace::Tracer,
};
use glam::Vec3;
use rayon::prelude::*;
use std::{iter::Sum, ops::Mul};

/// Rows at receivers, and how patches read them.
pub struct Transport {
    /// The patch of each receiver, ascending.
    pub receivers: Vec<u32>,
    /// One row a receiver over `patches` patches and [`CELLS`](crate::math::CELLS) cells of the sky.
    pub rows: Rows,
    /// Number of patches: columns below it are patches, columns from it on are cells of the sky.
    pub patches: usize,
    /// From receivers to patches.
    pub interpolation: Interpolation,
    /// Where the rays of each receiver that is a front start; empty unless neighbours may use them.
    pub eyes: Vec<Eye>,
    /// Of each receiver that is a front, texels to the neighbours with which it may share, 1, 2, 4 or 8; empty: 1.
    pub strides: Vec<u8>,
    /// Between which bounces are followed, where every patch is a receiver and neighbours share rays.
    pub groups: Option<Groups>,
    /// Rays of a row where rows are counts of rays, but for what is enclosed; else 0.
    pub rays: u32,
    /// What became of the rays.
    pub stats: Stats,
}

/// How rows are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// The estimator. Default: rays.
    pub form_factors: FormFactors,
    /// Rays a row, 1..=65536, but for hemicubes, which have as many as pixels. Default: 64.
    pub rays: u32,
    /// Whether neighbours use each other's rays in the last gather, if rows are of rays and have at most 64 or all together
    /// at most 2^28. Default: true.
    pub reuse: bool,
    /// Which texels have rows of their own. Default: all.
    pub receivers: Receivers,
}

/// Where rows are measured. Backs of sheets that rays meet have rows of their own in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Receivers {
    /// At every texel.
    #[default]
    All,
    /// Where geometry is near, curved or creased; what lies between is interpolated.
    Auto,
}

impl Receivers {
    /// Everything there is to choose from.
    pub const ALL: [Receivers; 2] = [Receivers::All, Receivers::Auto];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Receivers::All => "all",
            Receivers::Auto => "auto",
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Options { form_factors: FormFactors::default(), rays: 64, reuse: true, receivers: Receivers::default() }
    }
}

impl Options {
    /// `rays` a row, the rest as by default.
    pub fn of(rays: u32) -> Self {
        Options { rays, ..Options::default() }
    }

    /// True if neighbours use each other's rays.
    pub fn shares(&self, receivers: usize) -> bool {
        self.reuse && self.form_factors == FormFactors::Rays && self.rays <= Self::most_shared(receivers)
    }

    /// Rays a row, at most, of so many receivers whose rays neighbours can use: each takes 16 bytes then instead of 4.
    pub fn most_shared(receivers: usize) -> u32 {
        let many = SHARED_IN_ALL / receivers.max(1) as u64;
        SHARED.max(many.min(u64::from(u32::MAX)) as u32)
    }

    /// Rays of a row.
    pub fn rays_of_row(&self) -> u64 {
        self.form_factors.rays(self.rays)
    }

    /// Bytes that are kept of the rows of so many receivers.
    pub fn bytes_of_rows(&self, receivers: usize) -> u64 {
        let places = if self.shares(receivers) { 12 * receivers as u64 * u64::from(self.rays) } else { 0 };
        self.bytes_of_entries(receivers, receivers) + places
    }

    /// Bytes of the entries of so many rows over so many patches.
    pub fn bytes_of_entries(&self, rows: usize, patches: usize) -> u64 {
        rows as u64 * self.form_factors.entries(self.rays, patches as u64) * self.bytes_of_entry()
    }

    /// A column; its weight, too, where entries differ in it.
    fn bytes_of_entry(&self) -> u64 {
        if self.form_factors == FormFactors::Rays { 4 } else { 8 }
    }
}

/// Rays of a row, and of all rows, that neighbours use.
const SHARED: u32 = 64;
const SHARED_IN_ALL: u64 = 1 << 28;

/// A receiver as its neighbours see it.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Where its rays start on average.
    pub position: Vec3,
    /// Unit shading normal in the middle.
    pub normal: Vec3,
}

/// Height, in texels, above which something that stands between two texels parts them.
const LIFT: f32 = 0.5;

impl Eye {
    /// Where it looks to others from; its texel is so wide, metres.
    pub fn above(&self, edge: f32) -> Vec3 {
        self.position + self.normal * (LIFT * edge)
    }
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

impl Interpolation {
    /// One more patch, which is this receiver.
    fn add_own(&mut self, receiver: u32) {
        if let Interpolation::Convex { starts, entries } = self {
            entries.push((receiver, 1.0));
            starts.push(entries.len() as u32);
        }
    }
}

/// Texels, ascending, that have rows of so many rays where [`Receivers::Auto`] chooses.
pub fn adaptive_receivers(
    tracer: &Tracer,
    coverage: &Coverage,
    rays: u32,
    observer: &dyn Observer,
) -> Result<Vec<u32>> {
    Ok(adaptive::choose(tracer, coverage, rays, observer)?.texels)
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
    /// Rows whose form factors summed to something else than they may, and were scaled.
    pub rescaled: u64,
    /// Furthest that such a sum was from 1.
    pub excess: f64,
}

impl Stats {
    /// Notes that a row of this sum is scaled, unless it is off by no more than `slack`.
    fn rescale(&mut self, sum: f64, slack: f64) {
        let off = (sum - 1.0).abs();
        if off > slack {
            self.rescaled += 1;
            self.excess = self.excess.max(off);
        }
    }
}

impl std::ops::AddAssign for Stats {
    fn add_assign(&mut self, o: Self) {
        self.traced += o.traced;
        self.escaped += o.escaped;
        self.dark += o.dark;
        self.lost += o.lost;
        self.rescaled += o.rescaled;
        self.excess = self.excess.max(o.excess);
    }
}

impl Transport {
    /// Chooses receivers and measures their rows, and tells `patches` which backs rays met and what is buried.
    pub fn measure(
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &mut Patches,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let (receivers, strides, interpolation) = match options.receivers {
            Receivers::All => ((0..patches.fronts as u32).collect(), Vec::new(), Interpolation::Identity),
            Receivers::Auto => {
                let chosen = adaptive::choose(tracer, coverage, options.rays, observer)?;
                // Until now nobody knew how many there are.
                memory::fits(options.bytes_of_rows(chosen.texels.len()) >> 20, memory::free_mb(), memory::REMEDY)?;
                (chosen.texels, chosen.strides, chosen.interpolation)
            }
        };
        let nothing = Self::of(patches.fronts, receivers, Rows::new(Vec::new()));
        Transport { strides, interpolation, ..nothing }.add(tracer, coverage, patches, options, observer)
    }

    /// True if rows as `options` say hold these and more.
    pub fn can_refine(&self, options: &Options) -> bool {
        let all = matches!(self.interpolation, Interpolation::Identity) && options.receivers == Receivers::All;
        let more = (1..options.rays).contains(&self.rays) && options.form_factors == FormFactors::Rays;
        all && more && (!self.eyes.is_empty() || !options.reuse)
    }

    /// Shoots the rays that rows lack to be as `options` say, which it [can refine](Self::can_refine); what these rows hold is
    /// kept. `patches` are those that know of them.
    pub fn refine(
        self,
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &mut Patches,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self> {
        if !self.can_refine(options) {
            return Err(Error::Usage(format!(
                "rows of {} rays cannot become those of {options:?}\n  measure anew",
                self.rays
            )));
        }
        self.add(tracer, coverage, patches, options, observer)
    }

    /// Rays for the receivers that it has, and for the backs that they meet.
    fn add(
        mut self,
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &mut Patches,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let known = self.receivers.len();
        options.form_factors.measure(tracer, coverage, patches, &mut self, options, observer)?;
        (known..self.receivers.len()).for_each(|back| self.interpolation.add_own(back as u32));
        self.patches = patches.len();
        self.rays = if options.form_factors == FormFactors::Rays { options.rays } else { 0 };
        let shared = !self.eyes.is_empty() && matches!(self.interpolation, Interpolation::Identity);
        self.groups = shared.then(|| Groups::new(&Neighbours { transport: &self, tracer, coverage, patches }));
        debug_assert!(self.validate(patches).is_ok(), "{:?}", self.validate(patches));
        Ok(self)
    }

    /// Rows given by hand over `patches` patches, one receiver each: columns, and the weight of every entry.
    pub fn from_rows(patches: usize, rows: impl IntoIterator<Item = (Vec<u32>, f32)>) -> Self {
        let rows = Rows::from_rows(rows);
        Self::of(patches, (0..rows.len() as u32).collect(), rows)
    }

    /// Receivers that are the patches they stand at.
    fn of(patches: usize, receivers: Vec<u32>, rows: Rows) -> Self {
        Transport {
            receivers,
            rows,
            patches,
            interpolation: Interpolation::Identity,
            eyes: Vec::new(),
            strides: Vec::new(),
            groups: None,
            rays: 0,
            stats: Stats::default(),
        }
    }

    /// The receiver at a patch, if its row was measured.
    pub fn receiver_at(&self, patch: u32) -> Option<usize> {
        match self.interpolation {
            Interpolation::Identity => Some(patch as usize),
            Interpolation::Convex { .. } => self.receivers.binary_search(&patch).ok(),
        }
    }

    /// Texels from a receiver that is a front to the neighbours with which it may share.
    pub fn stride(&self, receiver: usize) -> u32 {
        self.strides.get(receiver).map_or(1, |&s| u32::from(s))
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
}
