//! [`Audit`]: how wrong a lightmap is, measured by a path tracer that knows nothing of how it was made.
//!
//! At points drawn by area, and where the map changes, the truth is the mean of irradiance over a texel's footprint. Two independent halves t1 and t2
//! estimate it without bias; (x - t1)(x - t2) then has the squared error as its mean, whatever the noise of the halves.
//! Shared with the bake: [`Tracer`], [`crate::scene`], [`Coverage`]. Not shared: patches, rows, receivers, solver, and
//! how lights are sampled.
//!
//! The figures are those of the project's scorer, with these differences. Texels count by their area on the surface. The
//! darker half is that of the map, not of the truth, which is only known with noise. The border is every texel within
//! two of one whose centre no surface covers. Left out are texels of which more than 2 % is enclosed by geometry: a place
//! is enclosed if all rays from it end on backs that do not shine, but for a few on fronts: a pillar is often open where it
//! meets the ceiling.
//!
//! Light and matter are the contract's. One difference: the bake caps the mean reflectance of a texel, the audit that of
//! each point.

pub(crate) mod emitters;
mod figures;
mod given;
mod halves;
mod lamps;
mod lookup;
mod path;
mod points;
mod sky;
pub(crate) mod surface;
mod truth;

pub use truth::Truth;

use crate::{
    atlas::Coverage,
    error::Result,
    lightmaps::{Lightmaps, Reading},
    math::hash,
    progress::Observer,
    trace::{Hit, Tracer},
};
use figures::Point;
use glam::{DVec3, Vec3};
use halves::Halves;
use path::{Bundle, Lights};
use rayon::prelude::*;
use serde::Serialize;
use std::time::{Duration, Instant};
use truth::{Drawn, draw};

/// The lightmap to be audited, and the scene it is of.
#[derive(Clone, Copy)]
pub struct Subject<'a, 's> {
    /// Rays against the scene.
    pub tracer: &'a Tracer<'s>,
    /// Which texel a surface point belongs to.
    pub coverage: &'a Coverage,
    /// The values, one page for each of the first of `coverage`; texels of further pages are not audited.
    pub lightmaps: &'a Lightmaps,
    /// Largest reflectance of a point, (0, .9999].
    pub max_reflectance: f32,
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// When to stop. Default: 2 seconds.
    pub budget: Budget,
    /// Paths from each of the 64 places of a point, 16..=65536; rounded up to a power of two. Default: 32.
    pub paths: u32,
    /// Other seeds draw other points and other paths, independent of those of this one. Default: 0.
    pub seed: u32,
    /// Nominal share of audits whose intervals hold the truth, (0, 1); less where few texels carry most of the error.
    /// Default: .95.
    pub level: f64,
}

/// When an audit stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// After so many points: the same result on any machine.
    Points(u32),
    /// After so many rays, but not before a few points: the same result on any machine.
    Rays(u64),
    /// After about so much time, but not before a few points.
    Time(Duration),
}

impl Default for Options {
    fn default() -> Self {
        Options { budget: Budget::Time(Duration::from_secs(2)), paths: 32, seed: 0, level: 0.95 }
    }
}

/// What was found. Errors are relative; `None`: too few points.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Audit {
    /// Points that count.
    pub points: usize,
    /// Points left out because geometry encloses their texel, or part of it.
    pub enclosed: usize,
    /// Paths that were walked, both halves.
    pub paths: u64,
    /// Rays that were traced.
    pub rays: u64,
    /// Wall time.
    pub seconds: f64,
    /// Nominal share of audits whose intervals hold the truth.
    pub level: f64,
    /// Root mean square error over the mean.
    pub error: Option<Interval>,
    /// The same over the darker half, over that half's mean; none where that is black, below a hundredth of the mean.
    pub dark: Option<Interval>,
    /// The same over the borders of charts, over the mean of all.
    pub border: Option<Interval>,
    /// Mean of the map over that of the truth, less 1.
    pub bias: Option<Interval>,
    /// Median of |x - t| / t.
    pub median: Option<Interval>,
    /// Its 95th percentile.
    pub p95: Option<Interval>,
    /// What the size of texels costs.
    pub texel_size: Option<TexelSize>,
}

/// A figure and its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The error of bilinear look-ups at points of the surface, which holds the texels' own error, too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TexelSize {
    /// Root mean square over the mean.
    pub error: Interval,
    /// Factor on the density of texels that would halve it, by how it grows at half the density; `None` where that is lost in
    /// noise, or no density would.
    pub density_to_halve: Option<f64>,
}

/// The truth at a texel as two independent halves, each an unbiased estimate of the mean over the texel's footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Irradiance by either half.
    pub halves: [DVec3; 2],
    /// Share of the places that geometry encloses.
    pub enclosed: f64,
}

/// Points between two looks at the clock.
const ROUND: u32 = 16;
/// Least paths from a place: their first rays decide whether it is enclosed.
const LEAST_PATHS: u32 = 16;

impl Audit {
    /// Audits a lightmap.
    pub fn of(subject: &Subject, options: &Options, observer: &dyn Observer) -> Result<Self> {
        let start = Instant::now();
        let mut drawn = Drawn::default();
        draw(&mut drawn, subject, options, observer, |known| known.point_with_look_ups(subject))?;
        let (points, level, seed) = (&drawn.kept[..], options.level, options.seed);
        let mut audit = Audit::errors(&drawn, options);
        audit.median = figures::quantile(points, 0.5, level, seed);
        audit.p95 = figures::quantile(points, 0.95, level, seed);
        audit.texel_size = figures::texel_size(points, level, seed);
        audit.seconds = start.elapsed().as_secs_f64();
        Ok(audit)
    }

    /// The mean figures alone: the others take long.
    fn errors(drawn: &Drawn<Point>, options: &Options) -> Self {
        let (points, level, seed) = (&drawn.kept[..], options.level, options.seed);
        Audit {
            points: points.len(),
            enclosed: drawn.enclosed,
            paths: drawn.paths,
            rays: drawn.rays,
            level,
            error: figures::error(points, level, seed),
            dark: figures::error_of_dark(points, level, seed),
            border: figures::error_of_part(points, level, seed, |p| p.border),
            bias: figures::bias(points, level, seed),
            ..Audit::default()
        }
    }
}

/// An audit that goes on: its mean figures, after more and more points.
pub struct Look {
    drawn: Drawn<Point>,
    options: Options,
    seconds: f64,
}

impl Look {
    /// No point yet.
    pub fn new(options: &Options) -> Self {
        Look { drawn: Drawn::default(), options: *options, seconds: 0.0 }
    }

    /// Draws points of the same subject until those of all calls have used up so many rays.
    pub fn until(&mut self, rays: u64, subject: &Subject, observer: &dyn Observer) -> Result<Audit> {
        let start = Instant::now();
        let options = Options { budget: Budget::Rays(rays), ..self.options };
        draw(&mut self.drawn, subject, &options, observer, |known| known.point(subject))?;
        let audit = Audit::errors(&self.drawn, &options);
        self.seconds += start.elapsed().as_secs_f64();
        Ok(Audit { seconds: self.seconds, ..audit })
    }
}

/// The truth at chosen covered texels, by the paths that an audit with these options walks at each of its points.
pub fn reference(subject: &Subject, texels: &[usize], options: &Options) -> Vec<Reference> {
    let lights = Lights::new(subject);
    let one = |bundle: &mut Bundle, texel: &usize| {
        let at = Halves::walk(subject, &lights, *texel, options, hash(options.seed, *texel as u32), bundle);
        Reference { halves: at.irradiance(), enclosed: at.enclosed() }
    };
    texels.par_iter().map_init(Bundle::default, one).collect()
}

impl Options {
    fn paths_a_place(&self) -> u32 {
        self.paths.clamp(LEAST_PATHS, 1 << 16).next_power_of_two()
    }
}

impl Budget {
    /// True once it is used up by `drawn` points, or would be by one more round.
    fn ends(self, elapsed: Duration, rays: u64, drawn: u32) -> bool {
        match self {
            Budget::Points(_) => false,
            Budget::Rays(most) => drawn > 0 && rays + rays / u64::from(drawn) * u64::from(ROUND) > most,
            Budget::Time(time) => drawn > 0 && elapsed + elapsed * ROUND / drawn > time,
        }
    }
}

impl Subject<'_, '_> {
    /// What the map says of a covered texel; 0 on pages that it does not have.
    fn value(&self, texel: usize) -> Vec3 {
        self.lightmaps.value(self.coverage, texel)
    }

    /// What the map says of the irradiance where a ray ended; 0 where it says nothing.
    fn known(&self, hit: &Hit) -> Vec3 {
        let Subject { coverage, lightmaps, .. } = *self;
        let read = || lightmaps.read(coverage, hit.triangle, hit.bary, Reading::Constant);
        if hit.front { read() } else { Vec3::ZERO }
    }
}

/// Over three channels.
fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixteen points took .4 s: another round fits into .8 s, and not into less.
    #[test]
    fn time_ends_before_a_round_that_would_not_fit() {
        let ends = |milliseconds: u64, drawn: u32| {
            let budget = Budget::Time(Duration::from_millis(milliseconds));
            budget.ends(Duration::from_millis(400), 0, drawn)
        };
        assert!(!ends(800, ROUND) && ends(799, ROUND));
        assert!(!ends(0, 0), "a first round is always drawn");
    }
}
