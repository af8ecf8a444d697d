//! [`Solver`]: the closed set of methods, what each needs, and which of them goes on where one gives up.

use super::{
    System, anderson, anderson::Anderson, chebyshev::Chebyshev, conjugate::Conjugate, dense, dense::Dense,
    gauss_seidel::GaussSeidel, jacobi::Jacobi, shooting::Shooting, system,
};
use crate::error::{Error, Result};
use glam::DVec3;

/// Ways to solve the system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// Anderson acceleration of the plain iteration, which is a truncated GMRES.
    #[default]
    Anderson,
    /// Chebyshev semi-iteration with the known bound on the spectrum.
    Chebyshev,
    /// One bounce after the other.
    Jacobi,
    /// Gathering, each receiver with what the ones before it have just received.
    GaussSeidel,
    /// Southwell's relaxation with the ambient estimate: light is sent on by those who have most.
    Shooting,
    /// Conjugate gradients on the symmetric part of the system.
    ConjugateGradient,
    /// Dense LU.
    Direct,
}

/// One solver's mathematics.
pub(super) trait Method {
    /// From x and the map's value there to the next x; the matrix entries touched, or none if the method can do no more.
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64>;
}

impl Solver {
    /// Every solver.
    pub const ALL: [Solver; 7] = [
        Solver::Anderson,
        Solver::Chebyshev,
        Solver::Jacobi,
        Solver::GaussSeidel,
        Solver::Shooting,
        Solver::ConjugateGradient,
        Solver::Direct,
    ];

    /// Name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Solver::Anderson => "anderson",
            Solver::Chebyshev => "chebyshev",
            Solver::Jacobi => "jacobi",
            Solver::GaussSeidel => "gauss-seidel",
            Solver::Shooting => "shooting",
            Solver::ConjugateGradient => "conjugate-gradient",
            Solver::Direct => "direct",
        }
    }

    /// Refuses what it cannot solve: so many unknowns, and whether every patch is a receiver.
    pub fn check(self, unknowns: usize, all_receive: bool) -> Result<()> {
        let problem = match self {
            Solver::Direct if unknowns > dense::MOST => {
                format!("{unknowns} unknowns are more than the {} that dense LU takes", dense::MOST)
            }
            Solver::ConjugateGradient if !all_receive => {
                "the system has no symmetric form where light is received at some texels and interpolated between"
                    .into()
            }
            _ => return Ok(()),
        };
        let name = self.name();
        Err(Error::Usage(format!("--solver {name}: {problem}\n  use --solver {}", Solver::default().name())))
    }

    /// Bytes held at once beside the rows, of so many unknowns, where the rows' entries take `entries` bytes.
    pub fn bytes(self, unknowns: u64, entries: u64) -> u64 {
        let own = match self {
            Solver::Shooting | Solver::ConjugateGradient => entries,
            Solver::Direct => 8 * unknowns.min(dense::MOST as u64).pow(2),
            Solver::Anderson => anderson::BYTES * unknowns,
            Solver::Chebyshev | Solver::Jacobi | Solver::GaussSeidel => 0,
        };
        own.max(system::BYTES * unknowns)
    }

    /// Who goes on where it can do no more. The plain iteration, to which chebyshev comes in the end, always can.
    pub(super) fn fallback(self) -> Option<Solver> {
        match self {
            Solver::Anderson => Some(Solver::Chebyshev),
            Solver::Shooting | Solver::ConjugateGradient | Solver::Direct => Some(Solver::Anderson),
            Solver::Chebyshev | Solver::Jacobi | Solver::GaussSeidel => None,
        }
    }

    /// `powers` as in [`Amplification`](super::Amplification); none where another has begun.
    pub(super) fn start(self, contraction: f64, powers: Vec<Vec<DVec3>>) -> Box<dyn Method> {
        match self {
            Solver::Anderson => Box::new(Anderson::new(powers)),
            Solver::Chebyshev => Box::new(Chebyshev::new(contraction)),
            Solver::Jacobi => Box::new(Jacobi),
            Solver::GaussSeidel => Box::new(GaussSeidel::default()),
            Solver::Shooting => Box::new(Shooting::new(powers)),
            Solver::ConjugateGradient => Box::new(Conjugate::default()),
            Solver::Direct => Box::new(Dense::default()),
        }
    }
}
