//! Algebra of vectors that have three channels, each for itself.

use glam::DVec3;
use rayon::prelude::*;

/// By channel; in parts of a fixed size, so that rounding does not depend on threads.
pub(super) fn dot<V: Copy + Sync + Into<DVec3>>(a: &[V], b: &[DVec3]) -> DVec3 {
    let part = |(a, b): (&[V], &[DVec3])| a.iter().zip(b).map(|(a, b)| (*a).into() * *b).sum::<DVec3>();
    a.par_chunks(4096).zip(b.par_chunks(4096)).map(part).collect::<Vec<_>>().into_iter().sum()
}

/// a - b.
pub(super) fn difference(a: &[DVec3], b: &[DVec3]) -> Vec<DVec3> {
    a.par_iter().zip(b).map(|(a, b)| *a - *b).collect()
}

/// to += factor * v.
pub(super) fn add<V: Copy + Sync + Into<DVec3>>(to: &mut [DVec3], factor: DVec3, v: &[V]) {
    to.par_iter_mut().zip(v).for_each(|(to, v)| *to += factor * (*v).into());
}
