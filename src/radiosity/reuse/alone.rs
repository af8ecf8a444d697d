//! Texels that share with too few, in narrow channels, on small charts, behind thin walls: they are given more rays of their
//! own, and again where what these meet differs much.

use super::Gather;
use crate::{
    error::Result,
    math::luminance,
    progress::Observer,
    transport::{Ends, Stats, UNKNOWN, sample},
};
use glam::Vec3;
use rayon::prelude::*;

/// How many times as many rays a texel has after each round.
const TIMES: u32 = 4;
/// Rounds at most, and rays: there are no more points.
const ROUNDS: u32 = 3;
const MOST: u32 = 1 << 16;
/// Standard error, as if rays were random, over the scene's mean irradiance, that calls for a second round; twice that calls
/// for a third, as errors are least where rays follow the deviations (Neyman, 1934). Measured: with half as much errors fall
/// no faster than by more rays for all.
const ERROR: f32 = 1.0 / 16.0;
/// Texels on either side, in the order of the page, whose mean variance counts if it is more than one's own: rays none of which
/// met the light agree by chance, and would stay too dark.
const BESIDE: usize = 8;

/// What rays of a receiver have told.
#[derive(Clone, Copy, Default)]
struct Told {
    light: Vec3,
    /// Of its luminance.
    squares: f32,
    /// Rays, without those that met backs of which nothing is known.
    rays: f32,
}

impl Told {
    fn and(self, o: Self) -> Self {
        Told { light: self.light + o.light, squares: self.squares + o.squares, rays: self.rays + o.rays }
    }

    /// What the receiver receives; `None` if nothing is known.
    fn mean(&self) -> Option<Vec3> {
        (self.rays > 0.0).then(|| self.light / self.rays)
    }

    /// Variance of its luminance.
    fn variance(&self) -> f32 {
        let rays = self.rays.max(1.0);
        (self.squares / rays - luminance(self.light / rays).powi(2)).max(0.0) / rays
    }
}

/// Those whose standard error is more than `most`.
fn uncertain(asked: &[(u32, Told)], most: f32) -> Vec<(u32, Told)> {
    let variances: Vec<f32> = asked.iter().map(|(_, told)| told.variance()).collect();
    let around = |k: usize| &variances[k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(variances.len())];
    let variance = |k: usize| variances[k].max(around(k).iter().sum::<f32>() / around(k).len() as f32);
    (0..asked.len()).filter(|&k| variance(k) > most * most).map(|k| asked[k]).collect()
}

impl Gather<'_> {
    /// Asks receivers again, whose `irradiance` is that of their rows' rays and these; what the rays were.
    pub(super) fn add_rays(&self, alone: &[u32], irradiance: &mut [Vec3], observer: &dyn Observer) -> Result<Stats> {
        let transport = self.neighbours.transport;
        let of_row = |&r: &u32| (r, self.told(r, &transport.rows.ends(r as usize)));
        let mut asked: Vec<(u32, Told)> = alone.par_iter().map(of_row).collect();
        let (mut stats, mut rays, mut most) = (Stats::default(), transport.rays, ERROR * self.mean);
        for _ in 0..ROUNDS {
            if asked.is_empty() || rays >= MOST {
                break;
            }
            let more = rays..rays.saturating_mul(TIMES);
            rays = more.end;
            let receivers: Vec<u32> = asked.iter().map(|(r, _)| *r).collect();
            let of = |r, ends: Ends| self.told(r, &ends);
            let (told, of_round) = sample(&self.neighbours, &receivers, more, of, observer)?;
            stats += of_round;
            for ((r, sum), told) in asked.iter_mut().zip(told) {
                *sum = sum.and(told.unwrap_or_default());
                irradiance[*r as usize] = sum.mean().unwrap_or(irradiance[*r as usize]);
            }
            asked = uncertain(&asked, most);
            most *= 2.0;
        }
        Ok(stats)
    }

    fn told(&self, receiver: u32, ends: &Ends) -> Told {
        let eye = &self.neighbours.transport.eyes[receiver as usize];
        let mut told = Told::default();
        for (&column, &spot) in ends.columns.iter().zip(ends.spots).filter(|(column, _)| **column != UNKNOWN) {
            let light = self.met(eye, column, spot).radiosity;
            told.light += light;
            told.squares += luminance(light).powi(2);
            told.rays += 1.0;
        }
        told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One ray in a hundred meets a light of 100: of six who ask, five have met none with 16 rays.
    #[test]
    fn who_has_met_nothing_asks_with_those_beside() {
        let told = |k: usize| if k.is_multiple_of(6) { (100.0, 1e4) } else { (0.0, 0.0) };
        let asked = |k: usize| Told { light: Vec3::splat(told(k).0), squares: told(k).1, rays: 16.0 };
        let some: Vec<(u32, Told)> = (0..60).map(|k| (k as u32, asked(k))).collect();
        assert_eq!(uncertain(&some, 1.0).len(), 60);
        assert!(uncertain(&some, 100.0).is_empty());
        assert_eq!(uncertain(&some, 5.0).len(), 10);
    }
}
