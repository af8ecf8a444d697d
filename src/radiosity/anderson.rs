//! Anderson acceleration (1965) of the fixed-point map: of what the last steps did to the residual, as much as makes it
//! smallest, then a plain iteration. On a linear map these are the iterates of GMRES (Walker and Ni, 2011), here of the
//! last [`DEPTH`] directions, each for the price of one look. It needs no bound on the spectrum, nor a real one.
//!
//! The first directions are free: light that is the same everywhere, and what is left of it after one bounce, two, and
//! so on, which the bound has asked for. They are the ambient estimate of progressive refinement, and fade as spaces do.

use super::{
    Method, System,
    channels::{add, add_all, difference, dot, dots},
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Directions kept, at 24 bytes a receiver. Measured: fewer need more steps, more hardly fewer.
const DEPTH: usize = 10;
/// Square of the share of an image that rounding may leave of it: there are [`DEPTH`] in single precision, 2^-24 each.
const ROUNDING: f64 = 1e-12;

/// Held for each unknown.
pub const BYTES: u64 = (2 * DEPTH * size_of::<Vec3>() + 5 * size_of::<DVec3>()) as u64;

#[derive(Default)]
pub(super) struct Anderson {
    /// 1, K 1, K K 1 and so on, until the first step.
    powers: Vec<Vec<DVec3>>,
    /// Steps, and what each took off the residual; the latter are orthonormal, by channel. In single precision: what that
    /// rounds, the next look finds in the residual.
    steps: VecDeque<[Vec<Vec3>; 2]>,
    /// The last step, and the residual before it.
    last: Option<[Vec<DVec3>; 2]>,
}

impl Method for Anderson {
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        let mut powers = std::mem::take(&mut self.powers);
        let touched = if powers.is_empty() { 0 } else { system.where_lit(&mut powers, mapped) };
        powers.windows(2).for_each(|p| self.learn(p[0].clone(), difference(&p[0], &p[1])));
        let residual = difference(mapped, x);
        if let Some([step, mut before]) = self.last.take() {
            add(&mut before, DVec3::NEG_ONE, &residual);
            self.learn(step, before);
        }
        let [directions, images] = self.kept();
        let shares = dots(&images, &residual);
        let mut step = residual.clone();
        let factors: Vec<DVec3> = shares.iter().copied().chain(shares.iter().map(|s| -*s)).collect();
        add_all(&mut step, &factors, &[directions, images].concat());
        add(x, DVec3::ONE, &step);
        self.last = Some([step, residual]);
        Some(touched)
    }
}

impl Anderson {
    pub fn new(powers: Vec<Vec<DVec3>>) -> Self {
        Anderson { powers, ..Anderson::default() }
    }

    /// Keeps a step and its image, which is made orthogonal to those that are kept already (classical Gram-Schmidt: each
    /// vector is read once).
    fn learn(&mut self, mut step: Vec<DVec3>, mut image: Vec<DVec3>) {
        let all = dot(&image, &image);
        let [directions, images] = self.kept();
        let shares: Vec<DVec3> = dots(&images, &image).iter().map(|s| -*s).collect();
        add_all(&mut step, &shares, &directions);
        add_all(&mut image, &shares, &images);
        let square = dot(&image, &image);
        // What rounding left is no direction.
        let new = square.cmpgt(all * ROUNDING);
        if !new.any() {
            return;
        }
        let scale = DVec3::select(new, 1.0 / square.map(f64::sqrt), DVec3::ZERO);
        if self.steps.len() == DEPTH {
            self.steps.pop_front();
        }
        self.steps.push_back([step, image].map(|v| v.par_iter().map(|v| (*v * scale).as_vec3()).collect()));
    }

    /// Steps, and their images.
    fn kept(&self) -> [Vec<&[Vec3]>; 2] {
        [0, 1].map(|which| self.steps.iter().map(|pair| &pair[which][..]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a step that says nothing new, rounding would be blown up to a direction whose image is not its own.
    #[test]
    fn what_rounding_leaves_is_no_direction() {
        let vector = |seed: u32| -> Vec<DVec3> {
            let at = |i: u32| f64::from((i * 7919 + seed * 104_729) % 1009) / 1009.0;
            (0..1000).map(|i| DVec3::splat(at(i))).collect()
        };
        let mut anderson = Anderson::default();
        for seed in 0..3 {
            anderson.learn(vector(seed), vector(seed + 10));
        }
        assert_eq!(anderson.steps.len(), 3);
        // A sum of what is known.
        let sum = |a: u32, b: u32| vector(a).iter().zip(vector(b)).map(|(a, b)| *a + b).collect::<Vec<DVec3>>();
        anderson.learn(sum(0, 2), sum(10, 12));
        assert_eq!(anderson.steps.len(), 3);
    }
}
