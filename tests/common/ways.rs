//! [`Way`]: how a scene is baked, for suites that run over all estimators and all solvers.

use luxel::{bake::Options, radiosity::Solver, transport::FormFactors};

/// An estimator and a solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Way {
    pub form_factors: FormFactors,
    pub solver: Solver,
}

impl Way {
    /// Every estimator, with the default solver.
    pub fn estimators() -> Vec<Way> {
        FormFactors::ALL.map(|form_factors| Way { form_factors, ..Way::default() }).to_vec()
    }

    /// Every estimator with the default solver, and every other solver with the default estimator.
    pub fn all() -> Vec<Way> {
        let solvers = Solver::ALL.into_iter().map(|solver| Way { solver, ..Way::default() });
        Way::estimators().into_iter().chain(solvers.filter(|way| *way != Way::default())).collect()
    }

    /// What it differs in from the default.
    pub fn name(self) -> &'static str {
        if self.solver == Solver::default() { self.form_factors.name() } else { self.solver.name() }
    }

    /// Options, but by this way.
    pub fn of(self, mut options: Options) -> Options {
        options.transport.form_factors = self.form_factors;
        options.radiosity.solver = self.solver;
        options
    }
}
