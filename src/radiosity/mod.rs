//! [`Radiosity`]: irradiance after all bounces, E = D + P I with I = F (M + rho E).
//!
//! The map I -> F (M + rho (D + P I)) is a contraction in the max norm: rows are non-negative and sum to at most 1, and
//! reflectance is below 1. Any solver is stopped by its *true residual* r: |error| <= |r| times the largest row sum of
//! the inverse, which [`System::amplification`] bounds. Where neighbours share rays, this is the system of their groups
//! (`grouped`), and every patch gathers twice from its solution. Loop, bound and history live here, once for all solvers. A
//! given number of bounces is the truncated Neumann sum instead, which no solver changes and no bound describes.

mod anderson;
mod channels;
mod chebyshev;
mod columns;
mod conjugate;
mod dense;
mod gauss_seidel;
mod grouped;
mod jacobi;
mod reuse;
mod shooting;
mod solve;
mod solver;
mod system;

pub use reuse::{bytes_of_pool, pools};
pub use solve::TOLERANCE;
pub use solver::Solver;
pub use system::{Amplification, System};

use crate::{
    atlas::Coverage,
    direct::{Direct, Parts},
    error::Result,
    math::luminance,
    patches::Patches,
    progress::Observer,
    report::SolverReport,
    trace::Tracer,
    transport::{Interpolation, Neighbours, Stats, Transport},
};
use glam::{DVec3, Vec3};
use solve::single;
use solver::Method;

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
    /// Solver for the light of all bounces. Default: anderson.
    pub solver: Solver,
    /// Bounces after which light is dropped, whatever the solver; 0: direct light only. Default: none, all bounces.
    pub bounces: Option<u32>,
}

impl Options {
    /// Refuses a solver that cannot solve for so many unknowns, or unless every patch is a receiver; the first bounces
    /// need none.
    pub fn check(&self, unknowns: usize, all_receive: bool) -> Result<()> {
        if self.bounces.is_some() { Ok(()) } else { self.solver.check(unknowns, all_receive) }
    }
}

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
        let mut solved = match (options.bounces, &transport.groups) {
            (None, None) => system.solve(options.solver, TOLERANCE, observer),
            (None, Some(groups)) => system.solve_between(groups, options.solver, TOLERANCE, observer),
            (Some(bounces), _) => system.truncated(bounces, observer),
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
    ) -> Result<Stats> {
        let extra = self.sampled(direct);
        let mut own = self.by_rows(transport, extra);
        let neighbours = Neighbours { transport, tracer, coverage, patches };
        let parts = if self.report.bounces == Some(0) { &Parts::default() } else { &direct.parts };
        let open = || (0..patches.fronts).filter(|&p| !patches.buried[p]);
        let mapped = |p: usize| direct.lights[p] + direct.surroundings(p) + self.indirect[p];
        let all: f64 = open().map(|p| f64::from(luminance(mapped(p)))).sum();
        let mean = (all / f64::max(open().count() as f64, 1.0)) as f32;
        let stats = reuse::Gather::new(neighbours, &self.gathered, parts, mean).run(&mut own, observer)?;
        self.spread(transport, &own, extra);
        Ok(stats)
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
        // Where a part of a bright patch is dark, rows take back what was sampled as if all of it were bright.
        self.indirect.iter_mut().for_each(|e| *e = e.max(Vec3::ZERO));
    }
}
