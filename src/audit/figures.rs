//! From points to figures with intervals.
//!
//! A figure is a mean over a mean. Its interval is that of the bootstrap of the studentized figure (Hall, "On the
//! Bootstrap and Confidence Intervals", 1986): squared errors have a heavy tail, and the few points that happen to be
//! drawn understate it, which this corrects to the second order and percentiles of plain resampling do not.

use super::{Interval, TexelSize};
use crate::math::hash;
use rayon::prelude::*;

/// What was found at one point. Three channels are averaged.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    /// Area that it stands for, 1 on average.
    pub weight: f64,
    /// What the map says.
    pub value: f64,
    /// The mean of both halves.
    pub truth: f64,
    /// Product of the differences to both halves: the squared error, on average.
    pub square: f64,
    /// Products of what both halves say in grey: relative noise is judged by them.
    pub relative: [f64; 2],
    /// Products of the differences at single places: of the look-up, and of that of the halved map.
    pub lookups: [f64; 2],
    /// The darker half.
    pub dark: bool,
    /// At a chart's border.
    pub border: bool,
}

/// Resamplings. With 2000, an end of an interval is found within a twentieth of its own uncertainty.
const RESAMPLES: u32 = 2000;
/// Points that a figure needs at least: with fewer, resampling knows nothing of the tail.
const LEAST: usize = 10;
/// What is darker than this share of the mean has no relative error.
const BLACK: f64 = 0.01;

/// Root of the mean square over the mean of the truth.
pub(super) fn error(points: &[Point], level: f64, seed: u32) -> Option<Interval> {
    over(points, level, seed, |_| true, |p| p.square, |p| p.truth)
}

/// The same for the darker half, unless it is black.
pub(super) fn error_of_dark(points: &[Point], level: f64, seed: u32) -> Option<Interval> {
    let dark: Vec<Point> = points.iter().filter(|p| p.dark).copied().collect();
    let black = mean(&dark, |p| p.truth) < BLACK * mean(points, |p| p.truth);
    if black { None } else { error(&dark, level, seed) }
}

/// The same for a part of the points, over the mean of all.
pub(super) fn error_of_part(
    points: &[Point],
    level: f64,
    seed: u32,
    keep: impl Fn(&Point) -> bool,
) -> Option<Interval> {
    let whole = mean(points, |p| p.truth);
    over(points, level, seed, keep, |p| p.square, |_| whole)
}

fn over(
    points: &[Point],
    level: f64,
    seed: u32,
    keep: impl Fn(&Point) -> bool,
    square: impl Fn(&Point) -> f64,
    truth: impl Fn(&Point) -> f64,
) -> Option<Interval> {
    let pairs: Vec<Pair> = points.iter().filter(|p| keep(p)).map(|p| [square(p), truth(p), p.weight]).collect();
    let found = studentized(&pairs, 2.0, level, seed)?;
    Some(found.map(|x| x.max(0.0).sqrt()))
}

/// The mean of the map over that of the truth, less 1.
pub(super) fn bias(points: &[Point], level: f64, seed: u32) -> Option<Interval> {
    let pairs: Vec<Pair> = points.iter().map(|p| [p.value - p.truth, p.truth, p.weight]).collect();
    studentized(&pairs, 1.0, level, seed)
}

/// A quantile of |x - t| / t. What noise adds to the differences is taken off by narrowing all of them alike, until their
/// mean square is that without noise: not exact, unlike the other figures.
pub(super) fn quantile(points: &[Point], share: f64, level: f64, seed: u32) -> Option<Interval> {
    let whole = mean(points, |p| p.truth);
    let used: Vec<(f64, [f64; 2], f64)> = points
        .iter()
        .filter(|p| p.value > BLACK * whole)
        .map(|p| (((p.value - p.truth) / p.value).abs(), p.relative.map(|r| r / (p.value * p.value)), p.weight))
        .collect();
    if used.len() < LEAST || whole <= 0.0 {
        return None;
    }
    let of = |which: &mut dyn FnMut(usize) -> usize| {
        let mut values = Vec::with_capacity(used.len());
        let (mut sums, mut all) = ([0.0; 2], 0.0);
        for i in 0..used.len() {
            let (difference, squares, weight) = used[which(i)];
            values.push((difference, weight));
            sums[0] += squares[0] * weight;
            sums[1] += squares[1] * weight;
            all += weight;
        }
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut below = 0.0;
        let reaches = |v: &&(f64, f64)| {
            below += v.1;
            below >= share * all
        };
        let at = values.iter().find(reaches).or(values.last()).map_or(0.0, |v| v.0);
        let narrower = if sums[1] > 0.0 { (sums[0] / sums[1]).clamp(0.0, 1.0).sqrt() } else { 0.0 };
        at * narrower
    };
    let value = of(&mut |i| i);
    let mut found: Vec<f64> = (0..RESAMPLES)
        .into_par_iter()
        .map(|r| {
            let mut random = Random::new(seed, r);
            of(&mut |_| random.below(used.len()))
        })
        .collect();
    found.sort_unstable_by(f64::total_cmp);
    let [low, high] = ends(&found, level);
    Some(Interval { value, low: low.min(value), high: high.max(value) })
}

/// The error of look-ups, and by how much the density of texels would have to grow to halve it.
pub(super) fn texel_size(points: &[Point], level: f64, seed: u32) -> Option<TexelSize> {
    let error = over(points, level, seed, |_| true, |p| p.lookups[0], |p| p.truth)?;
    let [own, halved] = [0, 1].map(|k| mean(points, |p| p.lookups[k]));
    // A power law between the two densities; where a finer map is hardly better, texels are not what errs.
    let power = if own > 0.0 && halved > own { 0.5 * libm::log2(halved / own) } else { 0.0 };
    let density_to_halve = (power > 0.25).then(|| libm::exp2(1.0 / power));
    Some(TexelSize { error, density_to_halve })
}

fn mean(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    let weights: f64 = points.iter().map(|p| p.weight).sum();
    points.iter().map(|p| p.weight * of(p)).sum::<f64>() / weights.max(f64::MIN_POSITIVE)
}

/// Two values and the weight of both.
type Pair = [f64; 3];

/// Interval of mean(a) / mean(b)^power over weighted pairs (a, b).
fn studentized(pairs: &[Pair], power: f64, level: f64, seed: u32) -> Option<Interval> {
    if pairs.len() < LEAST {
        return None;
    }
    let (value, error) = ratio(pairs.iter().copied(), power);
    if !value.is_finite() {
        return None;
    }
    let mut found: Vec<f64> = (0..RESAMPLES)
        .into_par_iter()
        .filter_map(|r| {
            let mut random = Random::new(seed, r);
            let drawn: Vec<Pair> = pairs.iter().map(|_| pairs[random.below(pairs.len())]).collect();
            let (v, e) = ratio(drawn.iter().copied(), power);
            let t = (v - value) / e;
            t.is_finite().then_some(t)
        })
        .collect();
    if error == 0.0 || found.is_empty() {
        return Some(Interval { value, low: value, high: value });
    }
    found.sort_unstable_by(f64::total_cmp);
    let [low, high] = ends(&found, level);
    Some(Interval { value, low: value - high * error, high: value - low * error })
}

/// mean(a) / mean(b)^power and its standard error, linearized.
fn ratio(pairs: impl ExactSizeIterator<Item = Pair> + Clone, power: f64) -> (f64, f64) {
    let n = pairs.len() as f64;
    let sum = pairs.clone().fold([0.0; 3], |s, [a, b, w]| [s[0] + w * a, s[1] + w * b, s[2] + w]);
    let [a, b] = [sum[0] / sum[2], sum[1] / sum[2]];
    let scale = if power == 2.0 { b * b } else { b };
    let slope = power * a / b;
    let square: f64 = pairs.map(|p| p[2] * ((p[0] - a) - slope * (p[1] - b))).map(|d| d * d).sum();
    (a / scale, (square * n / (n - 1.0)).sqrt() / (sum[2] * scale.abs()))
}

/// Where the middle `level` of sorted values begins and ends.
fn ends(sorted: &[f64], level: f64) -> [f64; 2] {
    let last = sorted.len() - 1;
    [0.5 - 0.5 * level, 0.5 + 0.5 * level].map(|q| sorted[((q * last as f64).round() as usize).min(last)])
}

/// Indices that look random.
struct Random(u32, u32);

impl Random {
    fn new(seed: u32, stream: u32) -> Self {
        Random(hash(seed, stream), 0)
    }

    fn below(&mut self, n: usize) -> usize {
        self.1 += 1;
        ((u64::from(hash(self.0, self.1)) * n as u64) >> 32) as usize
    }
}

impl Interval {
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Interval { value: f(self.value), low: f(self.low), high: f(self.high) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of values with a tail, as squared errors have: 95 % intervals hold the true mean nearly as often.
    #[test]
    fn intervals_hold_means_of_heavy_tails() {
        let holds = (0..200u32).filter(|s| {
            let mut random = Random::new(77, *s);
            let mut unit = || (random.below(1 << 30) as f64 + 0.5) / f64::from(1 << 30);
            // Squares of exponentials: mean 2, skewness above 6.
            let pairs: Vec<Pair> = (0..150).map(|_| [libm::log(unit()).powi(2), 1.0, 1.0]).collect();
            let found = studentized(&pairs, 2.0, 0.95, *s).unwrap();
            found.low <= 2.0 && 2.0 <= found.high
        });
        let holds = holds.count();
        assert!(holds >= 180, "{holds} of 200");
    }

    #[test]
    fn few_points_make_no_figure() {
        assert!(error(&[Point::default(); LEAST - 1], 0.95, 0).is_none());
    }
}
