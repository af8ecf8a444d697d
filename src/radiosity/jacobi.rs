//! Fixed-point iteration: x <- F (M + rho (D + P x)). Each step is one more bounce; the error shrinks by the
//! contraction.

use super::Method;
use glam::Vec4;

pub(super) struct Jacobi;

impl Method for Jacobi {
    fn next(&mut self, x: &mut Vec<Vec4>, mapped: &[Vec4]) {
        x.copy_from_slice(mapped);
    }
}
