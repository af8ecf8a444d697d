//! [`Radiosity`]: irradiance after all bounces, E = D + P I with I = F (M + rho E).
//!
//! The map I -> F (M + rho (D + P I)) is a contraction in the max norm: rows are non-negative and sum to at most 1, and
//! reflectance is below 1. Any solver is stopped by its *true residual* r: |error| <= |r| times the largest row sum of
//! the inverse, which [`System::amplification`] bounds. Loop, bound and history live here, once for all solvers.

mod chebyshev;
mod jacobi;
mod system;

pub use system::System;

use crate::{
    direct::Direct,
    error::Result,
    patches::Patches,
    progress::{Observer, check},
    report::SolverReport,
    transport::Transport,
};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// The solution.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Irradiance that arrives after at least one row, at every patch, W/m^2.
    pub indirect: Vec<Vec3>,
    /// How it was found.
    pub report: SolverReport,
}

/// Ways to solve the system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// Chebyshev semi-iteration with the known bound on the spectrum.
    #[default]
    Chebyshev,
    /// One bounce after the other.
    Jacobi,
}

impl Solver {
    /// Every solver.
    pub const ALL: [Solver; 2] = [Solver::Chebyshev, Solver::Jacobi];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Solver::Chebyshev => "chebyshev",
            Solver::Jacobi => "jacobi",
        }
    }

    fn start(self, contraction: f32) -> Box<dyn Method> {
        match self {
            Solver::Chebyshev => Box::new(chebyshev::Chebyshev::new(contraction)),
            Solver::Jacobi => Box::new(jacobi::Jacobi),
        }
    }
}

/// One solver's mathematics: from x and the map's value there to the next x.
trait Method {
    fn next(&mut self, x: &mut Vec<Vec4>, mapped: &[Vec4]);
}

/// Truncation error that is allowed, relative to the mean of the darker half.
pub const TOLERANCE: f64 = 5e-4;
/// More iterations than any reflectance below .9999 needs.
const LIMIT: usize = 200_000;
/// Iterations without a smaller residual after which rounding has the last word.
const PATIENCE: usize = 50;

impl Radiosity {
    /// Solves for all bounces. `gathered`: rows carry the exitance of surfaces. `sky`: exitance of the sky's cells.
    pub fn solve(
        transport: &Transport,
        patches: &Patches,
        direct: &Direct,
        sky: &[Vec3],
        gathered: bool,
        solver: Solver,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let system = System::new(transport, patches, direct, sky, gathered);
        system.solve(solver, TOLERANCE, observer)
    }
}

impl System<'_> {
    /// Iterates until the bound on the error is below `tolerance` times the mean of the darker half.
    pub fn solve(&self, solver: Solver, tolerance: f64, observer: &dyn Observer) -> Result<Radiosity> {
        observer.begin("radiosity", 0);
        let (amplification, contraction, touched) = self.amplification();
        let mut method = solver.start(contraction);
        let mut report = SolverReport { name: solver.name(), entries: touched, ..SolverReport::default() };
        let mut x = vec![Vec4::ZERO; self.unknowns()];
        let mut mapped = x.clone();
        let (mut least, mut idle, mut dark) = (f64::INFINITY, 0, 0.0);
        while report.iterations < LIMIT {
            check(observer)?;
            report.entries += self.map(&x, &mut mapped);
            report.iterations += 1;
            let residual = x.par_iter().zip(&mapped).map(|(a, b)| (*a - *b).abs().max_element());
            let residual = f64::from(residual.reduce(|| 0.0, f32::max));
            report.residuals.push(residual);
            report.bound = residual * amplification;
            if report.iterations % 8 == 1 || report.bound <= 2.0 * tolerance * dark {
                dark = self.dark_mean(&mapped).max(1e-30);
            }
            report.relative_bound = report.bound / dark;
            report.converged = report.relative_bound <= tolerance || residual == 0.0;
            idle = if residual < least { 0 } else { idle + 1 };
            if report.converged || idle > PATIENCE {
                break;
            }
            if residual > 4.0 * least {
                // Rows of noisy counts are not quite symmetric: start the recurrence anew from here.
                method = solver.start(contraction);
            }
            least = least.min(residual);
            method.next(&mut x, &mapped);
        }
        if report.residuals.last() == Some(&0.0) {
            (report.bound, report.relative_bound) = (0.0, 0.0);
        }
        Ok(Radiosity { indirect: self.at_patches(&mapped), report })
    }
}
