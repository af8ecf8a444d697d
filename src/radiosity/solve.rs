//! The loop that every solver runs in: true residual, bound, stopping, history; and the truncated Neumann sum.

use super::{Amplification, Radiosity, Solver, System};
use crate::{
    error::Result,
    progress::{Observer, check},
    report::SolverReport,
    transport::Interpolation,
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// Truncation error that is allowed, relative to the mean of the darker half.
pub const TOLERANCE: f64 = 5e-4;
/// More iterations than reflectance .9999 needs, whatever the spectrum.
const LIMIT: usize = 1_000_000;
/// Iterations without a smaller residual after which a method is not trusted any more.
const PATIENCE: usize = 50;

/// In single precision.
pub(super) fn single(values: &[DVec3]) -> Vec<Vec3> {
    values.iter().map(|v| v.as_vec3()).collect()
}

impl System<'_> {
    /// Iterates until the bound on the error is below `tolerance` times the mean of the darker half. Refuses what the
    /// solver cannot do.
    pub fn solve(&self, solver: Solver, tolerance: f64, observer: &dyn Observer) -> Result<Radiosity> {
        self.watched(solver, tolerance, observer, &mut |_, _| ())
    }

    /// The same, and shows each iterate with the matrix entries touched until then.
    pub fn watched(
        &self,
        mut solver: Solver,
        tolerance: f64,
        observer: &dyn Observer,
        watch: &mut dyn FnMut(u64, &[DVec3]),
    ) -> Result<Radiosity> {
        solver.check(self.unknowns(), matches!(self.transport.interpolation, Interpolation::Identity))?;
        observer.begin("radiosity", 0);
        let start = Instant::now();
        let Amplification { inverse, mut contraction, powers, entries } = self.amplification();
        let mut method = solver.start(contraction, powers);
        let mut report = SolverReport { name: solver.name(), entries, ..SolverReport::default() };
        let mut x = vec![DVec3::ZERO; self.unknowns()];
        let mut mapped = x.clone();
        let (mut least, mut idle, mut dark) = (f64::INFINITY, 0, 0.0);
        while report.iterations < LIMIT {
            check(observer)?;
            report.entries += self.map(&x, &mut mapped);
            report.iterations += 1;
            let residual = largest_difference(&x, &mapped);
            report.residuals.push(residual);
            report.touched.push(report.entries);
            watch(report.entries, &mapped);
            let bound = if residual > 0.0 { residual * inverse } else { 0.0 };
            if report.iterations % 8 == 1 || bound <= 2.0 * tolerance * dark {
                dark = self.dark_mean(&mapped).max(1e-30);
            }
            let relative = if bound.is_finite() { bound / dark } else { bound };
            (report.bound, report.relative_bound) = (Some(bound), Some(relative));
            report.converged = relative <= tolerance;
            if report.converged || residual == f64::INFINITY {
                break;
            }
            (least, idle) = if residual < least { (residual, 0) } else { (least, idle + 1) };
            let lost = idle > PATIENCE || solver == Solver::Chebyshev && residual > 4.0 * least;
            let done = if lost { None } else { method.next(self, &mut x, &mapped) };
            if let Some(touched) = done {
                report.entries += touched;
                continue;
            }
            match solver.fallback() {
                Some(other) => (solver, report.fallback) = (other, Some(other.name())),
                // Counts of few rays are not symmetric, and their spectrum leaves the real axis: start anew with a
                // shorter interval, the plain iteration at last, which contracts whatever the spectrum. Others know no
                // interval, and have their patience renewed: a sweep may leave more at first than what there was.
                None if contraction > 0.0 => {
                    contraction = (1.0 - 4.0 * (1.0 - contraction)).max(0.0);
                }
                // Not even the plain iteration gains: rounding has the last word.
                None => break,
            }
            method = solver.start(contraction, Vec::new());
            (least, idle) = (residual, 0);
        }
        report.seconds = start.elapsed().as_secs_f64();
        Ok(Radiosity { indirect: self.at_patches(&mapped), gathered: single(&self.radiosity(&x)), report })
    }

    /// The light of the first `bounces` bounces: D + P I_N with I_0 = F M and I_n+1 = F (M + rho (D + P I_n)).
    pub fn truncated(&self, bounces: u32, observer: &dyn Observer) -> Result<Radiosity> {
        observer.begin("radiosity", u64::from(bounces));
        let mut report = SolverReport { name: "neumann", bounces: Some(bounces), ..SolverReport::default() };
        let mut x = vec![DVec3::ZERO; self.unknowns()];
        let mut mapped = x.clone();
        report.entries = self.emitted(&mut x);
        let mut gathered = self.emission().to_vec();
        for _ in 0..bounces {
            check(observer)?;
            gathered = single(&self.radiosity(&x));
            report.entries += self.map(&x, &mut mapped);
            report.iterations += 1;
            std::mem::swap(&mut x, &mut mapped);
            observer.advance(1);
        }
        Ok(Radiosity { indirect: self.at_patches(&x), gathered, report })
    }
}

/// In the max norm; infinite if anything is not finite.
fn largest_difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    let difference = |(a, b): (&DVec3, &DVec3)| {
        let d = (*a - *b).abs();
        if d.is_finite() { d.max_element() } else { f64::INFINITY }
    };
    a.par_iter().zip(b).map(difference).reduce(|| 0.0, f64::max)
}
