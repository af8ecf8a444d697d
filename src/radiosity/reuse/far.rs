//! What is far away from a pool, for all its receivers at once.
//!
//! Seen from a receiver at d from the pool's middle, with normal n, a spot at v of normal N has the density
//! (n . (v - d)) (-N . (v - d)) / |v - d|^4. Where d is small against v this is, but for squares of d / v,
//! ((n . v) (t + g . d) - (n . d) t) / |v|^4 with t = -N . v and g = N + 4 t v / |v|^2: a sum of products of what belongs
//! to the spot and what belongs to the receiver. So sums over all spots are taken once, not for every receiver (the
//! moments of a multipole expansion: Greengard and Rokhlin, "A Fast Algorithm for Particle Simulations", 1987).

use super::{
    ends::{Ends, List},
    pool::{NOBODY, total},
};
use crate::{math::simd::Lanes, transport::Eye};
use glam::{Vec3, Vec4};

/// Distances that are far, in radii of the pool. Measured: from 8 on, results do not change.
const FAR: f32 = 8.0;
/// Height above the horizon, in radii, below which the linear part of a density may be negative.
const GRAZING: f32 = 4.0;
/// Products: n, n d, n . d.
const TERMS: usize = 13;

/// What a spot must be above to be seen by all receivers.
pub(super) struct Horizon {
    normal: Vec3,
    radius: f32,
    /// Furthest that a normal is from the mean one.
    spread: f32,
}

impl Horizon {
    /// Of receivers about a middle.
    pub fn of(eyes: impl Iterator<Item = Eye> + Clone, center: Vec3) -> Self {
        let normal = eyes.clone().map(|eye| eye.normal).sum::<Vec3>().normalize_or_zero();
        let furthest = |of: &dyn Fn(&Eye) -> f32| eyes.clone().map(|eye| of(&eye)).fold(0.0, f32::max);
        let radius = furthest(&|eye| eye.position.distance(center));
        let spread = furthest(&|eye| eye.normal.distance(normal));
        Horizon { normal, radius, spread }
    }

    /// True of a spot at `v`, `distance` from the middle, that is far away and faces all receivers, as they face it.
    pub fn is_far(&self, v: Vec3, distance: f32, normal: Vec3) -> bool {
        let height = GRAZING * self.radius;
        let above = self.normal.dot(v) > height + self.spread * (distance + self.radius);
        distance > FAR * self.radius && above && -normal.dot(v) > height
    }
}

/// What belongs to a receiver, times its rays.
pub(super) struct Basis([f32; TERMS]);

impl Basis {
    pub fn of(eye: &Eye, rays: f32, center: Vec3) -> Self {
        let (d, n) = (eye.position - center, eye.normal * rays);
        let [x, y, z] = n.to_array().map(|n| d * n);
        Basis([n.x, n.y, n.z, x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z, -n.dot(d)])
    }
}

/// Light by channel, and weight, that comes from far away: what is to be multiplied with each term of a receiver.
pub(super) struct Moments([Vec4; TERMS]);

impl Moments {
    /// Of rays of the members that share.
    #[inline(always)]
    pub fn of<S: Lanes>(far: &List, shares: &[bool], bases: &[Basis], center: Vec3) -> Self {
        let mut all = [0.0; TERMS];
        for (basis, _) in bases.iter().zip(shares).filter(|(_, shares)| **shares) {
            all.iter_mut().zip(basis.0).for_each(|(all, term)| *all += term);
        }
        let mut moments = [[S::splat(0.0); 4]; TERMS];
        for ends in far.eights() {
            let terms = terms::<S>(ends, center);
            let mut sum = S::splat(NOBODY);
            for k in 0..TERMS {
                sum = sum.add(terms[k].mul(S::splat(all[k])));
            }
            let inverse = S::load(&ends.rays(shares)).div(sum);
            let [r, g, b] = &ends.radiosity;
            let light = [S::load(r).mul(inverse), S::load(g).mul(inverse), S::load(b).mul(inverse), inverse];
            for k in 0..TERMS {
                for channel in 0..4 {
                    moments[k][channel] = moments[k][channel].add(terms[k].mul(light[channel]));
                }
            }
        }
        let mut sums = [Vec4::ZERO; TERMS];
        for k in 0..TERMS {
            let [r, g, b, weight] = moments[k];
            sums[k] = Vec4::new(total(r), total(g), total(b), total(weight));
        }
        Moments(sums)
    }

    /// What a receiver has of it.
    pub fn at(&self, basis: &Basis) -> Vec4 {
        self.0.iter().zip(basis.0).map(|(moment, term)| *moment * term).sum()
    }
}

/// What belongs to a spot.
#[inline(always)]
fn terms<S: Lanes>(ends: &Ends, center: Vec3) -> [S; TERMS] {
    let ([x, y, z], [i, j, k]) = (&ends.spot, &ends.normal);
    let x = S::load(x).sub(S::splat(center.x));
    let y = S::load(y).sub(S::splat(center.y));
    let z = S::load(z).sub(S::splat(center.z));
    let (i, j, k) = (S::load(i), S::load(j), S::load(k));
    let zero = S::splat(0.0);
    let squared = x.mul(x).add(y.mul(y)).add(z.mul(z)).max(S::splat(f32::MIN_POSITIVE));
    let there = zero.sub(x.mul(i).add(y.mul(j)).add(z.mul(k)));
    let inverse = S::splat(1.0).div(squared);
    let fall = inverse.mul(inverse);
    let steep = S::splat(4.0).mul(there).mul(inverse);
    let (gx, gy, gz) = (i.add(steep.mul(x)), j.add(steep.mul(y)), k.add(steep.mul(z)));
    let (x, y, z) = (x.mul(fall), y.mul(fall), z.mul(fall));
    [
        x.mul(there),
        y.mul(there),
        z.mul(there),
        x.mul(gx),
        x.mul(gy),
        x.mul(gz),
        y.mul(gx),
        y.mul(gy),
        y.mul(gz),
        z.mul(gx),
        z.mul(gy),
        z.mul(gz),
        there.mul(fall),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{
        hash,
        simd::{self, Level, Task},
        unit_float,
    };

    /// Of the first ray of a list.
    struct Terms<'l>(&'l List, Vec3);

    impl Task for Terms<'_> {
        type Output = [f32; TERMS];

        fn run<S: Lanes>(self) -> Self::Output {
            terms::<S>(&self.0.eights()[0], self.1).map(|term| term.store().0[0])
        }
    }

    /// Of three rays of a receiver at the first spot of a list.
    struct Density<'l>(&'l List, &'l Eye);

    impl Task for Density<'_> {
        type Output = f32;

        fn run<S: Lanes>(self) -> Self::Output {
            self.0.eights()[0].density::<S>(self.1, 3.0).store().0[0]
        }
    }

    fn unit(key: u32, axis: u32) -> f32 {
        2.0 * unit_float(hash(key, axis)) - 1.0
    }

    fn random(key: u32) -> Vec3 {
        Vec3::new(unit(key, 0), unit(key, 1), unit(key, 2))
    }

    /// Receivers within a metre of one place, on a surface that bends.
    fn eyes() -> Vec<Eye> {
        let eye = |k: u32| {
            let (x, z) = (unit(k, 0), unit(k, 1));
            let position = Vec3::new(5.0 + x, -0.05 * (x * x + z * z), z - 3.0);
            Eye { position, normal: Vec3::new(0.1 * x, 1.0, 0.1 * z).normalize() }
        };
        (0..40).map(eye).collect()
    }

    /// Against the densities themselves, in units of that face to face: off by few squares of d / v.
    #[test]
    fn far_spots_are_seen_alike() {
        let eyes = eyes();
        let center = eyes.iter().map(|eye| eye.position).sum::<Vec3>() / 40.0;
        let horizon = Horizon::of(eyes.iter().copied(), center);
        let (mut checked, mut worst) = (0, 0f32);
        for key in 100..5000 {
            // Far away, and just far enough; facing anywhere, and nearly edge on.
            let just = key % 2 == 0;
            let chance = unit_float(hash(key, 3));
            let v = random(key).normalize() * if just { 8.1 * horizon.radius } else { 4.0 + 100.0 * chance };
            let side = v.cross(random(key + 5000)).normalize();
            let normal = if just {
                (side - v.normalize() * (0.12 + 0.5 * chance * chance)).normalize()
            } else {
                random(key + 5000).normalize()
            };
            if !horizon.is_far(v, v.length(), normal) {
                continue;
            }
            let mut list = List::default();
            list.push(0, center + v, normal, Vec3::ONE);
            let terms = simd::run(Level::Portable, Terms(&list, center));
            for eye in &eyes {
                let exact = simd::run(Level::Portable, Density(&list, eye));
                let sum: f32 = terms.iter().zip(Basis::of(eye, 3.0, center).0).map(|(a, b)| a * b).sum();
                let square = (horizon.radius / v.length()).powi(2);
                assert!(sum > 0.0, "{sum} for {exact}");
                let unit = 3.0 / v.length_squared();
                worst = worst.max((sum - exact).abs() / unit / square);
                checked += 1;
            }
        }
        assert!(checked > 4000 && worst < 4.0, "{worst} squares of {checked}");
    }

    #[test]
    fn what_some_do_not_see_is_not_far() {
        let eyes = eyes();
        let horizon = Horizon::of(eyes.into_iter(), Vec3::new(5.0, 0.0, -3.0));
        assert!(horizon.is_far(Vec3::Y * 50.0, 50.0, Vec3::NEG_Y));
        assert!(!horizon.is_far(Vec3::Y * 5.0, 5.0, Vec3::NEG_Y), "near");
        assert!(!horizon.is_far(Vec3::X * 50.0, 50.0, Vec3::NEG_X), "on the horizon");
        assert!(!horizon.is_far(Vec3::Y * 50.0, 50.0, Vec3::X), "edge on");
    }
}
