//! A lightmap against another that is taken for the truth, texel by texel.

use super::{Audit, Interval, Subject, mean, points};
use crate::lightmaps::Lightmaps;

/// A texel in grey, but for its squared error.
struct Texel {
    area: f64,
    value: f64,
    truth: f64,
    square: f64,
    border: bool,
}

impl Audit {
    /// The figures of `subject` if `truth`, on the same layout, were right. Texels that geometry encloses count, too.
    pub fn against(subject: &Subject, truth: &Lightmaps) -> Self {
        let coverage = subject.coverage;
        let visible = coverage.texels.partition_point(|t| (t.page as usize) < subject.lightmaps.pages.len());
        let truth = Subject { lightmaps: truth, ..*subject };
        let texel = |t: usize| {
            let (x, t0) = (subject.value(t).as_dvec3(), truth.value(t).as_dvec3());
            let area = coverage.fragments_of(t).iter().map(|f| f64::from(f.area)).sum();
            let square = mean((x - t0) * (x - t0));
            Texel { area, value: mean(x), truth: mean(t0), square, border: points::is_border(subject, t) }
        };
        let mut all: Vec<Texel> = (0..visible).map(texel).collect();
        all.sort_by(|a, b| a.truth.total_cmp(&b.truth));
        let whole: f64 = all.iter().map(|t| t.area).sum();
        let mut below = 0.0;
        let half = all.iter().take_while(|t| {
            below += t.area;
            below <= 0.5 * whole
        });
        let dark = half.count();
        let average = |of: &mut dyn Iterator<Item = &Texel>, value: fn(&Texel) -> f64| {
            let (sum, area) = of.fold((0.0, 0.0), |(s, a), t| (s + value(t) * t.area, a + t.area));
            sum / area
        };
        let truth = |t: &Texel| t.truth;
        let level = average(&mut all.iter(), truth);
        let exact = |x: f64| x.is_finite().then_some(Interval { value: x, low: x, high: x });
        let square = |t: &Texel| t.square;
        Audit {
            points: all.len(),
            level: 1.0,
            error: exact(average(&mut all.iter(), square).sqrt() / level),
            dark: exact(average(&mut all[..dark].iter(), square).sqrt() / average(&mut all[..dark].iter(), truth)),
            border: exact(average(&mut all.iter().filter(|t| t.border), square).sqrt() / level),
            bias: exact(average(&mut all.iter(), |t| t.value) / level - 1.0),
            ..Audit::default()
        }
    }
}
