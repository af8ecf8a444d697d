//! [`Inspection`]: what a lightmap is like, as a colour for each of its texels: for pictures in uv and on the surface.

mod charts;
mod color;
mod look;

use crate::{
    atlas::{Atlas, Coverage},
    audit::{self, Options, Reference, Subject},
    math::hash,
};
use charts::Charts;
use color::{RED, YELLOW, distinct, ramp};
use glam::{IVec2, Vec3};
use look::Look;

/// What can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Texels per metre.
    Density,
    /// Charts, each in a colour of its own.
    Charts,
    /// Texels that two charts share, or that filtering mixes with another chart's.
    Overlaps,
    /// Share of the surface that other geometry does not enclose.
    Validity,
    /// Texels that have rows of their own.
    Receivers,
    /// Sum of a row: share of the hemisphere in which lit surfaces are seen.
    Rows,
    /// Error by the audit's paths.
    Error,
}

impl Layer {
    /// Everything there is to choose from.
    pub const ALL: [Layer; 7] =
        [Layer::Density, Layer::Charts, Layer::Overlaps, Layer::Validity, Layer::Receivers, Layer::Rows, Layer::Error];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Layer::Density => "density",
            Layer::Charts => "charts",
            Layer::Overlaps => "overlaps",
            Layer::Validity => "validity",
            Layer::Receivers => "receivers",
            Layer::Rows => "rows",
            Layer::Error => "error",
        }
    }
}

/// A layer, painted.
#[derive(Clone, Debug)]
pub struct Painted {
    /// Linear colour of each covered texel, in the order of [`Coverage::texels`].
    pub colors: Vec<Vec3>,
    /// What the colours mean, with figures.
    pub legend: String,
}

/// Density at which the scale of colours ends, times the median or divided by it.
const OCTAVES: f64 = 2.0;
/// Relative error at which the scale of colours ends.
const WORST: f64 = 0.1;

/// What has a row, and what reads others'.
const BRIGHT: Vec3 = Vec3::splat(0.8);
const DIM: Vec3 = Vec3::splat(0.05);

/// Texels that stand for a square.
const EACH: usize = 4;
/// Where the error of a texel has no meaning: geometry encloses it.
const ENCLOSED: Vec3 = Vec3::splat(0.02);

/// A lightmap to be looked at.
pub struct Inspection<'i, 's> {
    subject: Subject<'i, 's>,
    charts: Charts,
    looks: Vec<Look>,
    /// Texels whose error is estimated, at most.
    points: usize,
    /// Texels with rows; `None`: all.
    receivers: Option<Vec<u32>>,
}

impl<'i, 's> Inspection<'i, 's> {
    /// Looks at a lightmap; its error is estimated at about `points` texels. `receivers`: the texels that have rows, if not
    /// all of them.
    pub fn new(subject: Subject<'i, 's>, atlas: &Atlas, points: usize, receivers: Option<Vec<u32>>) -> Self {
        let charts = Charts::new(&subject.tracer.world, atlas, subject.coverage);
        Inspection { subject, charts, looks: look::around(&subject), points, receivers }
    }

    /// Paints a layer.
    pub fn paint(&self, layer: Layer) -> Painted {
        match layer {
            Layer::Density => self.density(),
            Layer::Charts => self.charts(),
            Layer::Overlaps => self.overlaps(),
            Layer::Validity => self.validity(),
            Layer::Receivers => self.receivers(),
            Layer::Rows => self.rows(),
            Layer::Error => self.error(),
        }
    }

    fn coverage(&self) -> &Coverage {
        self.subject.coverage
    }

    fn texels(&self) -> usize {
        self.coverage().texels.len()
    }

    fn density(&self) -> Painted {
        let densities: Vec<f64> = (0..self.texels()).map(|t| self.charts.density(self.coverage(), t)).collect();
        let mut sorted: Vec<f64> = densities.iter().copied().filter(|d| d.is_finite() && *d > 0.0).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| sorted.get(((sorted.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(1.0);
        let median = at(0.5);
        let place = |d: &f64| 0.5 + 0.5 * libm::log2((d / median).max(1e-9)) / OCTAVES;
        let legend = format!(
            "{:.3} texels/m in the median, {:.3} to {:.3} at nine in ten; dark: a quarter, bright: four times",
            median,
            at(0.05),
            at(0.95)
        );
        Painted { colors: densities.iter().map(|d| ramp(place(d))).collect(), legend }
    }

    fn charts(&self) -> Painted {
        let color = |t: usize| distinct(self.charts.of(self.coverage(), t));
        let legend = format!("{} charts", self.charts.count);
        Painted { colors: (0..self.texels()).map(color).collect(), legend }
    }

    fn overlaps(&self) -> Painted {
        let (mut shared, mut mixed) = (0, 0);
        let mut color = |t: usize| {
            let own = self.charts.of(self.coverage(), t);
            if self.charts.overlap(self.coverage(), t) {
                shared += 1;
                return RED;
            }
            let (texel, around) = (self.coverage().texels[t], [-1, 0, 1].map(|y| [-1, 0, 1].map(|x| IVec2::new(x, y))));
            let beside = around.as_flattened().iter();
            let mut beside = beside.filter_map(|d| self.coverage().texel(texel.page, texel.at.as_ivec2() + *d));
            if beside.any(|other| self.charts.of(self.coverage(), other as usize) != own) {
                mixed += 1;
                return YELLOW;
            }
            Vec3::splat(0.2)
        };
        let colors = (0..self.texels()).map(&mut color).collect();
        let legend = format!("{shared} texels are shared by charts (red), {mixed} touch another chart (yellow)");
        Painted { colors, legend }
    }

    fn validity(&self) -> Painted {
        let (mut partly, mut buried) = (0, 0);
        for look in &self.looks {
            partly += usize::from(look.valid < 1.0 && look.valid > 0.0);
            buried += usize::from(look.valid == 0.0);
        }
        let colors = self.looks.iter().map(|l| RED.lerp(Vec3::splat(0.4), l.valid)).collect();
        Painted { colors, legend: format!("{buried} texels are enclosed by geometry (red), {partly} in part") }
    }

    fn receivers(&self) -> Painted {
        let Some(receivers) = &self.receivers else {
            let legend = "every texel has a row of its own".into();
            return Painted { colors: vec![BRIGHT; self.texels()], legend };
        };
        let mut colors = vec![DIM; self.texels()];
        receivers.iter().for_each(|&t| colors[t as usize] = BRIGHT);
        let legend =
            format!("{} of {} texels have rows (bright), the others read theirs", receivers.len(), self.texels());
        Painted { colors, legend }
    }

    fn rows(&self) -> Painted {
        let mean = self.looks.iter().map(|l| f64::from(l.seen)).sum::<f64>() / self.texels().max(1) as f64;
        let colors = self.looks.iter().map(|l| ramp(f64::from(l.seen))).collect();
        Painted {
            colors,
            legend: format!("{mean:.3} on average; dark: nothing but sky or backs, bright: surfaces all around"),
        }
    }

    /// A few texels of each square stand for all of it.
    fn error(&self) -> Painted {
        let coverage = self.coverage();
        let edge = (((self.texels() * EACH) as f64 / self.points.max(1) as f64).sqrt().ceil() as u32).max(1);
        let key = |t: &usize| {
            let texel = coverage.texels[*t];
            (texel.page, texel.at.y / edge, texel.at.x / edge, self.charts.of(coverage, *t))
        };
        let mut order: Vec<usize> = (0..self.texels()).collect();
        // Any of them, but always the same.
        order.sort_by_cached_key(|t| (key(t), hash(*t as u32, 0x696e_7370)));
        let squares: Vec<&[usize]> = order.chunk_by(|a, b| key(a) == key(b)).collect();
        let drawn: Vec<usize> = squares.iter().flat_map(|s| s.iter().take(EACH).copied()).collect();
        let options = Options { paths: 16, ..Options::default() };
        let truth = audit::reference(&self.subject, &drawn, &options);
        let value = |t: usize| self.subject.lightmaps.value(coverage, t);
        let light = (0..self.texels()).map(|t| f64::from(value(t).element_sum())).sum::<f64>() / 3.0;
        let mean = (light / self.texels().max(1) as f64).max(f64::MIN_POSITIVE);

        let (mut colors, mut left, mut far) = (vec![Vec3::ZERO; self.texels()], &truth[..], 0);
        for square in &squares {
            let (truth, rest) = left.split_at(square.len().min(EACH));
            left = rest;
            let open = truth.iter().zip(*square).filter(|(truth, _)| truth.enclosed < 0.5);
            // The product of independent differences has the squared error as its mean.
            let squared = |(truth, &t): (&Reference, &usize)| {
                let x = value(t).as_dvec3();
                ((x - truth.halves[0]) * (x - truth.halves[1])).element_sum() / 3.0
            };
            let (sum, n) = open.map(squared).fold((0.0, 0), |(sum, n), e| (sum + e, n + 1));
            let error = (sum / f64::from(n.max(1))).max(0.0).sqrt() / mean;
            far += usize::from(error > WORST);
            let color = if n == 0 { ENCLOSED } else { ramp(error / WORST) };
            square.iter().for_each(|&t| colors[t] = color);
        }
        let legend = format!(
            "of the mean, by {} texels for squares of {edge} x {edge}, each of which is noisy; bright: {} % and more, {far} of \
             {} squares",
            drawn.len(),
            WORST * 100.0,
            squares.len()
        );
        Painted { colors, legend }
    }
}
