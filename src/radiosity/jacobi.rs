//! Fixed-point iteration: x <- F (M + rho (D + P x)). Each step is one more bounce; the error shrinks by the
//! contraction.

use super::{Method, System};
use glam::DVec3;

pub(super) struct Jacobi;

impl Method for Jacobi {
    fn next(&mut self, _: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        x.copy_from_slice(mapped);
        Some(0)
    }
}
