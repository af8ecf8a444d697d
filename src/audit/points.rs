//! The points of an audit: texels drawn by their area, more of them where the map changes, and what they are.
//!
//! Squared errors have a heavy tail: a few texels at edges and contacts hold most of the error, and an audit that draws
//! none of them says too little. They lie where the map changes from texel to texel.

use super::Subject;
use crate::atlas::NO_TEXEL;
use glam::{DVec2, IVec2};

/// Texels that can be drawn: those on visible pages.
pub(super) struct Texels {
    /// Area, m^2, and running sum of the area by which they are drawn.
    area: Vec<f64>,
    until: Vec<f64>,
    /// Sum of all area.
    all: f64,
    /// Sum of the map's channels at or below which half of the area lies.
    middle: f32,
}

/// Texels this near, counted as a king moves, to one whose centre no surface covers are the border of a chart.
const BORDER: i32 = 2;

impl Texels {
    /// `None` if nothing is covered.
    pub fn new(subject: &Subject) -> Option<Self> {
        let coverage = subject.coverage;
        let visible = coverage.texels.partition_point(|t| (t.page as usize) < subject.lightmaps.pages.len());
        let area = |t: usize| coverage.fragments_of(t).iter().map(|f| f64::from(f.area)).sum::<f64>();
        let area: Vec<f64> = (0..visible).map(area).collect();
        let sum: f64 = area.iter().sum();
        let contrast: Vec<f64> = (0..visible).map(|t| f64::from(contrast(subject, t))).collect();
        let mean = contrast.iter().zip(&area).map(|(c, a)| c * a).sum::<f64>() / sum;
        let mut until = Vec::with_capacity(visible);
        let mut drawn = 0.0;
        for (c, a) in contrast.iter().zip(&area) {
            drawn += a * if mean > 0.0 { 0.5 + 0.5 * c / mean } else { 1.0 };
            until.push(drawn);
        }
        let mut by_light: Vec<(f32, f64)> = (0..visible).map(|t| (subject.value(t).element_sum(), area[t])).collect();
        by_light.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut below = 0.0;
        let half = by_light.iter().find(|(_, area)| {
            below += area;
            below >= 0.5 * sum
        });
        half.filter(|_| sum > 0.0).map(|&(middle, _)| Texels { area, until, all: sum, middle })
    }

    /// The texel at a share of the area by which they are drawn, and the area that it stands for, 1 on average.
    pub fn at(&self, share: f64) -> (usize, f64) {
        let drawn = self.until[self.until.len() - 1];
        let texel = self.until.partition_point(|u| *u <= share * drawn).min(self.until.len() - 1);
        let density = self.until[texel] - if texel > 0 { self.until[texel - 1] } else { 0.0 };
        (texel, self.area[texel] / density * (drawn / self.all))
    }

    /// True for the darker half of the area, by the map: a reference that is noisy itself would choose where it errs
    /// towards the dark.
    pub fn is_dark(&self, subject: &Subject, texel: usize) -> bool {
        subject.value(texel).element_sum() <= self.middle
    }
}

/// Largest difference of the map to a texel beside it.
fn contrast(subject: &Subject, texel: usize) -> f32 {
    let t = subject.coverage.texels[texel];
    let own = subject.value(texel);
    let around = [IVec2::X, IVec2::Y, IVec2::NEG_X, IVec2::NEG_Y].map(|d| t.at.as_ivec2() + d);
    let beside = around.iter().filter_map(|&at| subject.coverage.texel(t.page, at));
    beside.map(|n| (subject.value(n as usize) - own).element_sum().abs()).fold(0.0, f32::max)
}

/// True if the texel lies at the border of a chart.
pub(super) fn is_border(subject: &Subject, texel: usize) -> bool {
    let coverage = subject.coverage;
    let t = coverage.texels[texel];
    let size = coverage.sizes[t.page as usize].as_ivec2();
    let grid = &coverage.grids[t.page as usize];
    let around = (-BORDER..=BORDER).flat_map(|y| (-BORDER..=BORDER).map(move |x| IVec2::new(x, y)));
    around.map(|d| t.at.as_ivec2() + d).any(|p| {
        let outside = p.cmplt(IVec2::ZERO).any() || p.cmpge(size).any();
        outside || !centre_is_covered(subject, grid[(p.y * size.x + p.x) as usize])
    })
}

fn centre_is_covered(subject: &Subject, texel: u32) -> bool {
    if texel == NO_TEXEL {
        return false;
    }
    let coverage = subject.coverage;
    let at = coverage.texels[texel as usize].at.as_dvec2() + 0.5;
    coverage.fragments_of(texel as usize).iter().any(|f| {
        let [p, q, r] = coverage.charted[f.triangle as usize].exact();
        let side = |a: DVec2, b: DVec2| (b - a).perp_dot(at - a) / (q - p).perp_dot(r - p);
        [side(p, q), side(q, r), side(r, p)].iter().all(|w| *w > -1e-6)
    })
}
