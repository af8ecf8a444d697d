//! [`Radiosity`]: irradiance after all bounces, E = D + P I with I = F (M + rho E).
//!
//! The map I -> F (M + rho (D + P I)) is a contraction in the max norm: rows are non-negative and sum to at most 1, and
//! reflectance is below 1. Any solver is stopped by its *true residual* r: |error| <= |r| times the largest row sum of
//! the inverse, which [`System::amplification`] bounds. Loop, bound and history live here, once for all solvers. A
//! given number of bounces is the truncated Neumann sum instead, which no solver changes and no bound describes.

mod chebyshev;
mod jacobi;
mod reuse;
mod system;

pub use system::System;

use crate::{
    atlas::Coverage,
    direct::Direct,
    error::Result,
    patches::Patches,
    progress::{Observer, check},
    report::SolverReport,
    trace::Tracer,
    transport::{Interpolation, Transport},
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The solution.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Irradiance that arrives after at least one row, at every patch, W/m^2.
    pub indirect: Vec<Vec3>,
    /// What the last rows carried: the radiosity of every column that was gathered, W/m^2.
    pub gathered: Vec<Vec3>,
    /// How it was found.
    pub report: SolverReport,
}

/// Which light is followed, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Solver for the light of all bounces. Default: chebyshev.
    pub solver: Solver,
    /// Bounces after which light is dropped, whatever the solver; 0: direct light only. Default: none, all bounces.
    pub bounces: Option<u32>,
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

    /// Name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Solver::Chebyshev => "chebyshev",
            Solver::Jacobi => "jacobi",
        }
    }

    fn start(self, contraction: f64) -> Box<dyn Method> {
        match self {
            Solver::Chebyshev => Box::new(chebyshev::Chebyshev::new(contraction)),
            Solver::Jacobi => Box::new(jacobi::Jacobi),
        }
    }
}

/// One solver's mathematics: from x and the map's value there to the next x.
trait Method {
    fn next(&mut self, x: &mut Vec<DVec3>, mapped: &[DVec3]);
}

/// Truncation error that is allowed, relative to the mean of the darker half.
pub const TOLERANCE: f64 = 5e-4;
/// More iterations than reflectance .9999 needs, whatever the spectrum.
const LIMIT: usize = 1_000_000;
/// Iterations without a smaller residual after which a method is not trusted any more.
const PATIENCE: usize = 50;

impl Radiosity {
    /// Follows the light. `gathered`: rows carry the exitance of surfaces. `sky`: exitance of the sky's cells.
    pub fn solve(
        transport: &Transport,
        patches: &Patches,
        direct: &Direct,
        sky: &[Vec3],
        gathered: bool,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let system = System::new(transport, patches, direct, sky, gathered);
        let mut solved = match options.bounces {
            None => system.solve(options.solver, TOLERANCE, observer),
            Some(bounces) => system.truncated(bounces, observer),
        }?;
        // The system interpolates what is sampled, too; it is there at every patch.
        let extra = solved.sampled(direct);
        if !extra.is_empty() && !matches!(transport.interpolation, Interpolation::Identity) {
            let by_rows = solved.by_rows(transport, extra);
            solved.spread(transport, &by_rows, extra);
        }
        Ok(solved)
    }

    /// Gathers once more: fronts also use the rays of their neighbours, where [`Options::shares`](crate::transport::Options::shares).
    pub fn reuse(
        &mut self,
        transport: &Transport,
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &Patches,
        direct: &Direct,
        observer: &dyn Observer,
    ) -> Result<()> {
        let extra = self.sampled(direct);
        let mut own = self.by_rows(transport, extra);
        let gather = reuse::Gather { transport, tracer, coverage, patches, radiosity: &self.gathered };
        gather.run(&mut own, observer)?;
        self.spread(transport, &own, extra);
        Ok(())
    }

    /// What is sampled of the first bounce is none of the rows', and not there without a bounce.
    fn sampled<'d>(&self, direct: &'d Direct) -> &'d [Vec3] {
        if self.report.bounces == Some(0) { &[] } else { &direct.bounce.irradiance }
    }

    /// What rows say, at the receivers: without what is sampled at each patch.
    fn by_rows(&self, transport: &Transport, extra: &[Vec3]) -> Vec<Vec3> {
        let at = |&p: &u32| self.indirect[p as usize] - extra.get(p as usize).copied().unwrap_or_default();
        transport.receivers.iter().map(at).collect()
    }

    /// Spreads what rows say to all patches, and adds what is sampled there.
    fn spread(&mut self, transport: &Transport, by_rows: &[Vec3], extra: &[Vec3]) {
        let at_receivers: Vec<DVec3> = by_rows.iter().map(|e| e.as_dvec3()).collect();
        let mut at_patches = vec![DVec3::ZERO; transport.patches];
        transport.interpolate(&at_receivers, &mut at_patches);
        self.indirect = single(&at_patches);
        self.indirect.iter_mut().zip(extra).for_each(|(e, extra)| *e += *extra);
    }
}

fn single(values: &[DVec3]) -> Vec<Vec3> {
    values.iter().map(|v| v.as_vec3()).collect()
}

impl System<'_> {
    /// Iterates until the bound on the error is below `tolerance` times the mean of the darker half.
    pub fn solve(&self, solver: Solver, tolerance: f64, observer: &dyn Observer) -> Result<Radiosity> {
        observer.begin("radiosity", 0);
        let (amplification, mut contraction, touched) = self.amplification();
        let mut method = solver.start(contraction);
        let mut report = SolverReport { name: solver.name(), entries: touched, ..SolverReport::default() };
        let mut x = vec![DVec3::ZERO; self.unknowns()];
        let mut mapped = x.clone();
        let (mut least, mut idle, mut dark) = (f64::INFINITY, 0, 0.0);
        while report.iterations < LIMIT {
            check(observer)?;
            report.entries += self.map(&x, &mut mapped);
            report.iterations += 1;
            let residual = largest_difference(&x, &mapped);
            report.residuals.push(residual);
            let bound = if residual > 0.0 { residual * amplification } else { 0.0 };
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
            if idle > PATIENCE && contraction == 0.0 {
                break; // Not even the plain iteration gains: rounding has the last word.
            }
            if (idle > PATIENCE || residual > 4.0 * least) && contraction > 0.0 {
                // Counts of few rays are not symmetric, and their spectrum leaves the real axis: start anew with a
                // shorter interval, the plain iteration at last, which contracts whatever the spectrum.
                contraction = (1.0 - 4.0 * (1.0 - contraction)).max(0.0);
                method = solver.start(contraction);
                (least, idle) = (residual, 0);
            }
            method.next(&mut x, &mapped);
        }
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
