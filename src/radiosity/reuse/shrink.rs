//! What own rays say against those of the neighbours, as far as that is no noise.
//!
//! Own rays are right on average, but noisy; shared ones may be wrong where things stand so near that every texel sees
//! something else. Their difference is shrunk by the share of it that noise explains: James and Stein, "Estimation with
//! Quadratic Loss" (1961), the positive part, for all of a pool, with half as much noise again; for one texel, where noise
//! hardly ever is so large: beyond three standard deviations and what a few rays can do (as in Bernstein's inequality), for
//! small bright patches are met by chance, and noise is as skewed as they are bright.

use super::Sample;
use crate::math::luminance;
use glam::Vec3;

/// Standard deviations of the noise below which one difference says nothing.
const RARE: f32 = 3.0;

/// Rays of one texel that may have met the brightest patch by chance.
const LUCKY: f32 = 4.0;

/// Times the noise of a pool that chance may make of it, where few rays meet the light: less came through as grain.
const CHANCE: f32 = 1.5;

/// Of each sample what to add to the shared value; `most` is the brightest that a ray has met.
pub(super) fn of(samples: &[Sample], most: f32) -> Vec<Vec3> {
    let difference = |s: &Sample| s.own - s.shared;
    let square = |v: Vec3| luminance(v) * luminance(v);
    let noise: f32 = samples.iter().map(|s| s.noise).sum();
    // One who was lucky must not speak for all.
    let squares = || samples.iter().map(|s| square(difference(s)));
    let all = squares().sum::<f32>() - squares().fold(0.0, f32::max);
    let left = |noise: f32, all: f32| if noise >= all { 0.0 } else { 1.0 - noise / all };
    // A texel none of whose rays met the light knows nothing of its noise.
    let least = noise / samples.len() as f32;
    let of_all = left(CHANCE * noise, all);
    let keep = |s: &Sample| {
        let (d, chance) = (difference(s), RARE * s.noise.max(least).sqrt() + LUCKY * most / s.rays);
        d * left(chance * chance, square(d)).max(of_all)
    };
    samples.iter().map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{hash, unit_float};
    use glam::Vec2;

    /// Own values of variance `noise` about `law`; all share 1.
    fn samples(law: impl Fn(u32) -> f32, noise: f32, seed: u32) -> Vec<Sample> {
        let sample = |k: u32| {
            let chance = (0..12).map(|i| unit_float(hash(hash(k, seed), i))).sum::<f32>() - 6.0;
            let own = Vec3::splat(law(k) + noise.sqrt() * chance);
            Sample { at: Vec2::ZERO, own, shared: Vec3::ONE, noise, rays: 64.0 }
        };
        (0..100).map(sample).collect()
    }

    /// Mean squared error of shared values and what is added.
    fn error(law: impl Fn(u32) -> f32 + Copy, noise: f32, seed: u32) -> f32 {
        let added = of(&samples(law, noise, seed), 0.0);
        (0..).zip(added).map(|(k, add)| (1.0 + add.x - law(k)).powi(2)).sum::<f32>() / 100.0
    }

    #[test]
    fn noise_is_left_away() {
        let mean = (0..100).map(|seed| error(|_| 1.0, 0.01, seed)).sum::<f32>() / 100.0;
        assert!(mean < 0.0005, "{mean} of .01");
    }

    /// It is a fifth more than rays say.
    #[test]
    fn noise_by_chance_is_left_away() {
        let mut some = samples(|_| 1.0, 0.01, 1);
        some.iter_mut().for_each(|s| s.noise /= 1.2);
        assert!(of(&some, 0.0).iter().all(|add| *add == Vec3::ZERO));
    }

    #[test]
    fn neighbours_who_see_something_else_are_not_believed() {
        let law = |k: u32| if k.is_multiple_of(2) { 0.5 } else { 1.5 };
        assert!(error(law, 0.01, 1) < 0.02, "{}", error(law, 0.01, 1));
    }

    #[test]
    fn one_who_sees_something_else_keeps_to_it() {
        let law = |k: u32| if k == 7 { 2.0 } else { 1.0 };
        let added = of(&samples(law, 0.01, 1), 3.0);
        assert!((added[7].x - 1.0).abs() < 0.3, "{}", added[7]);
    }

    /// None of its rays met the light: that is chance, however sure of itself it seems.
    #[test]
    fn nothing_met_says_nothing() {
        let mut some = samples(|_| 1.0, 0.5, 1);
        (some[7].own, some[7].noise) = (Vec3::ZERO, 0.0);
        assert!(of(&some, 0.0)[7].x.abs() < 0.2, "{}", of(&some, 0.0)[7]);
    }

    /// Both rays of one met a light that one in fifty meets: of a hundred texels there are such by chance.
    #[test]
    fn few_rays_that_met_the_light_are_not_believed() {
        let mut some = samples(|_| 1.0, 25.0, 1);
        some.iter_mut().for_each(|s| s.rays = 2.0);
        some[7].own = Vec3::splat(50.0);
        assert_eq!(of(&some, 50.0)[7], Vec3::ZERO);
    }
}
