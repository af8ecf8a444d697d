//! Chebyshev semi-iteration (Golub and Varga, 1961) on the fixed-point map, whose spectrum lies in [-c, c] with the
//! known contraction c: the error shrinks by c / (1 + sqrt(1 - c^2)) a step, against c for the plain iteration.

use super::{Method, System};
use glam::DVec3;
use rayon::prelude::*;

pub(super) struct Chebyshev {
    contraction: f64,
    omega: f64,
    before: Vec<DVec3>,
}

impl Chebyshev {
    /// `contraction`: bound on the map's spectral radius, below 1; with 0 it is the plain iteration.
    pub fn new(contraction: f64) -> Self {
        Chebyshev { contraction, omega: 0.0, before: Vec::new() }
    }
}

impl Method for Chebyshev {
    fn next(&mut self, _: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        if self.before.is_empty() {
            self.omega = 2.0;
            self.before = std::mem::replace(x, mapped.to_vec());
            return Some(0);
        }
        self.omega = 1.0 / (1.0 - 0.25 * self.contraction * self.contraction * self.omega);
        let omega = self.omega;
        self.before.par_iter_mut().zip(mapped).for_each(|(b, m)| *b += omega * (*m - *b));
        std::mem::swap(x, &mut self.before);
        Some(0)
    }
}
