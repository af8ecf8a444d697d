//! What a pool has blurred, put back.
//!
//! A pool takes it that all its receivers see what one of them sees. Where an edge hides something from some of them by
//! degrees, the sky behind a window's frame, that flattens the light across the pool. Their own rays tell so: noisy one by
//! one, but on a straight line all together.

use super::Sample;
use crate::math::luminance;
use glam::{Mat2, Vec2, Vec3};

/// What the trend explains, by what it leaves, each a degree of freedom, must be more than chance makes it once in so many
/// pools (the F-test; with two degrees of freedom its quantiles have a closed form).
const RARE: f32 = 500.0;

/// What to add to the shared value at a place; `None` where chance explains all of it. More than three samples.
pub(super) fn of(samples: &[Sample]) -> Option<impl Fn(Vec2) -> Vec3 + use<>> {
    debug_assert!(samples.len() > 3);
    let share = 1.0 / samples.len() as f32;
    let middle = samples.iter().map(|s| s.at).sum::<Vec2>() * share;
    let mean = samples.iter().map(|s| s.own - s.shared).sum::<Vec3>() * share;
    let (mut spread, mut along, mut all) = (Mat2::ZERO, [Vec3::ZERO; 2], 0.0);
    for s in samples {
        let (x, r) = (s.at - middle, s.own - s.shared - mean);
        spread += Mat2::from_cols(x * x.x, x * x.y);
        along[0] += r * x.x;
        along[1] += r * x.y;
        all += luminance(r) * luminance(r);
    }
    let inverse = spread.inverse();
    let slope = [0, 1].map(|k| along[0] * inverse.col(0)[k] + along[1] * inverse.col(1)[k]);
    let explained = luminance(slope[0]) * luminance(along[0]) + luminance(slope[1]) * luminance(along[1]);
    let freedom = (samples.len() - 3) as f32;
    let rare = 0.5 * freedom * (libm::powf(RARE, 2.0 / freedom) - 1.0);
    let plain = explained / 2.0 > rare * (all - explained).max(0.0) / freedom;
    (plain && explained.is_finite()).then_some(move |at: Vec2| {
        let x = at - middle;
        mean + slope[0] * x.x + slope[1] * x.y
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{hash, unit_float};

    /// A square of receivers whose own rays say `law` and some noise of deviation `noise`.
    fn samples(law: impl Fn(Vec2) -> f32, noise: f32, seed: u32) -> Vec<Sample> {
        let sample = |k: u32| {
            let at = Vec2::new((k % 6) as f32, (k / 6) as f32) * 0.1 + Vec2::new(7.0, -3.0);
            let chance = (0..12).map(|i| unit_float(hash(hash(k, seed), i))).sum::<f32>() - 6.0;
            Sample { at, own: Vec3::splat(1.0 + law(at) + noise * chance), shared: Vec3::ONE, noise: 0.0, rays: 1.0 }
        };
        (0..36).map(sample).collect()
    }

    #[test]
    fn a_slope_is_put_back() {
        let law = |at: Vec2| 0.05 + 0.4 * (at.x - 7.25) - 0.3 * (at.y + 2.75);
        let trend = of(&samples(law, 0.01, 1)).expect("a plain slope");
        let place = Vec2::new(7.5, -3.0);
        assert!((trend(place).x - law(place)).abs() < 0.015, "{} {}", trend(place), law(place));
    }

    #[test]
    fn chance_is_left_alone() {
        let found = (0..1000).filter(|&seed| of(&samples(|_| 0.0, 0.1, seed)).is_some()).count();
        assert!(found < 10, "{found} of 1000 are trends");
        let few = |seed| samples(|_| 0.0, 0.1, seed).into_iter().step_by(4).collect::<Vec<_>>();
        let found = (0..1000).filter(|&seed| of(&few(seed)).is_some()).count();
        assert!(found < 10, "{found} of 1000 are trends");
        assert!(of(&samples(|_| 0.0, 0.0, 0)).is_none());
    }

    /// Receivers in a row say nothing across it.
    #[test]
    fn a_row_has_no_plane() {
        let mut row = samples(|at| at.x, 0.01, 3);
        row.iter_mut().for_each(|s| s.at.y = -3.0);
        assert!(of(&row).is_none());
    }
}
