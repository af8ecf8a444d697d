//! Algebra of vectors that have three channels, each for itself.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Length of the parts that one task takes: fixed, so that rounding does not depend on threads.
const PART: usize = 4096;

/// By channel.
pub(super) fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    let part = |(a, b): (&[DVec3], &[DVec3])| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
    a.par_chunks(PART).zip(b.par_chunks(PART)).map(part).collect::<Vec<_>>().into_iter().sum()
}

/// Of each of some vectors with another, which is read once.
pub(super) fn dots(a: &[&[Vec3]], b: &[DVec3]) -> Vec<DVec3> {
    let part = |(k, b): (usize, &[DVec3])| -> Vec<DVec3> {
        let first = k * PART;
        let of = |a: &&[Vec3]| a[first..first + b.len()].iter().zip(b).map(|(a, b)| a.as_dvec3() * *b).sum();
        a.iter().map(of).collect()
    };
    let parts: Vec<Vec<DVec3>> = b.par_chunks(PART).enumerate().map(part).collect();
    (0..a.len()).map(|k| parts.iter().map(|part| part[k]).sum()).collect()
}

/// to += the sum of factor * v, written once.
pub(super) fn add_all(to: &mut [DVec3], factors: &[DVec3], v: &[&[Vec3]]) {
    to.par_chunks_mut(PART).enumerate().for_each(|(k, to)| {
        let first = k * PART;
        for (factor, v) in factors.iter().zip(v) {
            let v = &v[first..first + to.len()];
            to.iter_mut().zip(v).for_each(|(to, v)| *to += *factor * v.as_dvec3());
        }
    });
}

/// a - b.
pub(super) fn difference(a: &[DVec3], b: &[DVec3]) -> Vec<DVec3> {
    a.par_iter().zip(b).map(|(a, b)| *a - *b).collect()
}

/// to += factor * v.
pub(super) fn add(to: &mut [DVec3], factor: DVec3, v: &[DVec3]) {
    to.par_iter_mut().zip(v).for_each(|(to, v)| *to += factor * *v);
}
