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
mod lamps;
mod lookup;
mod path;
mod points;
mod sky;
pub(crate) mod surface;

use crate::{
    atlas::{Coverage, NO_PAGE},
    error::Result,
    lightmaps::Lightmaps,
    math::hash,
    progress::{self, Observer},
    trace::{Hit, Tracer},
};
use figures::Point;
use glam::{DVec3, Vec3};
use path::{Bundle, Lights, PARTS, Sum, net};
use points::Texels;
use rayon::prelude::*;
use serde::Serialize;
use std::time::{Duration, Instant};
use surface::{Footprint, Place};

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

/// Places of either half of a point.
const PLACES: u32 = 32;
/// Points between two looks at the clock.
const ROUND: u32 = 16;
/// Points that are enough for anything.
const MOST: u32 = 1 << 24;
/// A texel of which more is enclosed is left out.
const ENCLOSED: f64 = 0.02;
/// Share of the rays from an enclosed place that may meet fronts, if all backs that they meet are dark.
const FRONTS: f64 = 0.125;
/// Least paths from a place: their first rays decide whether it is enclosed.
const LEAST_PATHS: u32 = 16;

impl Audit {
    /// Audits a lightmap.
    pub fn of(subject: &Subject, options: &Options, observer: &dyn Observer) -> Result<Self> {
        let (start, level) = (Instant::now(), options.level);
        let mut audit = Audit { level, ..Audit::default() };
        let Some(texels) = Texels::new(subject) else { return Ok(audit) };
        let lights = Lights::new(subject);
        let most = if let Budget::Points(n) = options.budget { n.min(MOST) } else { MOST };
        observer.begin("audit", if most < MOST { u64::from(most) } else { 0 });
        let (mut points, mut drawn) = (Vec::new(), 0);
        while drawn < most && !options.budget.ends(start.elapsed(), audit.rays, drawn) {
            let next = drawn..(drawn + ROUND).min(most);
            drawn = next.end;
            let looks: Vec<Look> = next
                .into_par_iter()
                .map_init(Bundle::default, |bundle, i| look(subject, &lights, &texels, options, i, bundle))
                .collect();
            progress::check(observer)?;
            observer.advance(looks.len() as u64);
            for found in looks {
                audit.rays += found.rays;
                match found.point {
                    Some(point) => points.push(point),
                    None => audit.enclosed += 1,
                }
            }
        }
        audit.points = points.len();
        audit.paths = u64::from(drawn) * 2 * u64::from(PLACES * options.paths_a_place());
        audit.conclude(&points, options.seed);
        audit.seconds = start.elapsed().as_secs_f64();
        Ok(audit)
    }

    fn conclude(&mut self, points: &[Point], seed: u32) {
        let level = self.level;
        self.error = figures::error(points, level, seed);
        self.dark = figures::error_of_dark(points, level, seed);
        self.border = figures::error_of_part(points, level, seed, |p| p.border);
        self.bias = figures::bias(points, level, seed);
        self.median = figures::quantile(points, 0.5, level, seed);
        self.p95 = figures::quantile(points, 0.95, level, seed);
        self.texel_size = figures::texel_size(points, level, seed);
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
        let charted = &self.coverage.charted[hit.triangle as usize];
        if charted.page == NO_PAGE || !hit.front {
            return Vec3::ZERO;
        }
        let texel = self.coverage.texel_near(charted, charted.at(hit.bary));
        texel.map_or(Vec3::ZERO, |t| self.value(t as usize))
    }
}

/// One point looked at; none if its texel is enclosed.
struct Look {
    point: Option<Point>,
    rays: u64,
}

fn look(subject: &Subject, lights: &Lights, texels: &Texels, options: &Options, i: u32, bundle: &mut Bundle) -> Look {
    // Points spread evenly over the area, however many there are.
    let share = net(i, 0, hash(options.seed, 0x6175_6469)).x;
    let (texel, weight) = texels.at(f64::from(share));
    let halves = Halves::walk(subject, lights, texel, options, hash(hash(options.seed, 0x706f_696e), i), bundle);
    let point = (halves.enclosed() <= ENCLOSED).then(|| {
        let x = subject.value(texel).as_dvec3();
        let [a, b] = halves.irradiance();
        let truth = mean(a + b) * 0.5;
        let difference = mean(x) - truth;
        Point {
            weight,
            value: mean(x),
            truth,
            square: mean((x - a) * (x - b)),
            relative: [mean(x - a) * mean(x - b), difference * difference],
            lookups: halves.lookups(subject),
            dark: texels.is_dark(subject, texel),
            border: points::is_border(subject, texel),
        }
    });
    Look { point, rays: halves.rays }
}

/// Both halves of a point: open places, and what the parts of their paths found.
struct Halves {
    open: [Vec<(Place, [DVec3; PARTS])>; 2],
    places: usize,
    rays: u64,
}

impl Halves {
    fn walk(
        subject: &Subject,
        lights: &Lights,
        texel: usize,
        options: &Options,
        seed: u32,
        bundle: &mut Bundle,
    ) -> Self {
        let (world, footprint) = (&subject.tracer.world, Footprint::new(subject.coverage, texel));
        let each = options.paths_a_place();
        let mut halves = Halves { open: Default::default(), places: 0, rays: 0 };
        for half in 0..2 {
            let seed = hash(seed, half);
            let on_surface = |k| footprint.at(net(k, 5, seed)).map(|(t, bary)| Place::on(world, t, bary, true));
            let places: Vec<Place> = (0..PLACES).filter_map(on_surface).collect();
            let mut sums = vec![Sum::default(); places.len() * PARTS];
            halves.rays += bundle.walk(subject, lights, &places, each as usize, seed, &mut sums);
            halves.places += places.len();
            let open = |sums: &[Sum]| {
                let all = |of: fn(&Sum) -> u32| sums.iter().map(of).sum::<u32>();
                let most = if all(|s| s.sheets) > 0 { 0.0 } else { FRONTS * f64::from(each) };
                all(|s| s.out) > 0 || f64::from(all(|s| s.fronts)) > most
            };
            let each_part = f64::from(each) / PARTS as f64;
            let found = places.iter().zip(sums.chunks(PARTS)).filter(|(_, sums)| open(sums));
            halves.open[half as usize] =
                found.map(|(p, sums)| (*p, std::array::from_fn(|i| sums[i].irradiance / each_part))).collect();
        }
        halves
    }

    fn enclosed(&self) -> f64 {
        1.0 - (self.open[0].len() + self.open[1].len()) as f64 / self.places.max(1) as f64
    }

    /// Mean over the open places of either half.
    fn irradiance(&self) -> [DVec3; 2] {
        [0, 1].map(|half| {
            let open = &self.open[half];
            let sum: DVec3 = open.iter().map(|(_, parts)| parts.iter().sum::<DVec3>()).sum();
            sum / (open.len() * PARTS).max(1) as f64
        })
    }

    /// Squared errors at places, on average: of the bilinear look-up, and of the map at half its density.
    fn lookups(&self, subject: &Subject) -> [f64; 2] {
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for (place, [a, b]) in self.open.iter().flatten() {
            let charted = &subject.coverage.charted[place.triangle as usize];
            let (at, map) = (charted.at(place.bary), &subject.lightmaps.pages[charted.page as usize]);
            for (sum, x) in sums.iter_mut().zip([map.bilinear(at), lookup::halved(map, at)]) {
                *sum += mean((x.as_dvec3() - *a) * (x.as_dvec3() - *b));
            }
            count += 1.0;
        }
        sums.map(|s| s / f64::max(count, 1.0))
    }
}

/// Over three channels.
fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}
