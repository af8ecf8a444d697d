//! [`FormFactors`]: the closed set of estimators of rows, and what each needs.

use super::{Options, Transport, analytic, hemicube, rays};
use crate::{
    atlas::Coverage,
    error::{Error, Result},
    math::CELLS,
    patches::Patches,
    progress::Observer,
    trace::Tracer,
};
use std::fmt;

/// Ways to measure how much a receiver sees of everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FormFactors {
    /// The share of its cosine-distributed rays that meet a patch.
    #[default]
    Rays,
    /// What the pixels of half a cube about one of its points see, each with its delta form factor.
    Hemicube {
        /// Pixels along an edge of the cube, even, 4..=512. Default: 64.
        resolution: u32,
    },
    /// Closed forms between polygons, times sampled visibility. The slow truth of small scenes.
    Analytic,
}

impl FormFactors {
    /// Every estimator, with its default parameters.
    pub const ALL: [FormFactors; 3] =
        [FormFactors::Rays, FormFactors::Hemicube { resolution: 64 }, FormFactors::Analytic];

    /// Name in options and reports, without parameters.
    pub fn name(self) -> &'static str {
        match self {
            FormFactors::Rays => "rays",
            FormFactors::Hemicube { .. } => "hemicube",
            FormFactors::Analytic => "analytic",
        }
    }

    /// Refuses what it cannot measure: so many texels.
    pub fn check(self, texels: usize) -> Result<()> {
        match self {
            FormFactors::Analytic if texels > analytic::MOST => {
                let most = analytic::MOST;
                Err(self.refusal(&format!("{texels} patches are more than the {most} whose pairs it takes")))
            }
            _ => Ok(()),
        }
    }

    /// Wrong usage, and what does the same.
    pub(super) fn refusal(self, problem: &str) -> Error {
        let (name, other) = (self.name(), FormFactors::default().name());
        Error::Usage(format!("--form-factors {name}: {problem}\n  use --form-factors {other}, or lower --resolution"))
    }

    /// Rays a row.
    pub(super) fn rays(self, rays: u32) -> u64 {
        match self {
            FormFactors::Rays | FormFactors::Analytic => rays.into(),
            FormFactors::Hemicube { resolution } => 3 * u64::from(resolution).pow(2),
        }
    }

    /// Entries of a row, at most, over so many columns that are patches. Rays leave one each, the others one a column.
    pub(super) fn entries(self, rays: u32, patches: u64) -> u64 {
        match self {
            FormFactors::Rays => rays.into(),
            FormFactors::Hemicube { .. } => self.rays(rays).min(patches + u64::from(CELLS)),
            FormFactors::Analytic => patches + u64::from(rays),
        }
    }

    /// Measures the rows of the receivers of `transport`, and of the backs that are met.
    pub(super) fn measure(
        self,
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &mut Patches,
        transport: &mut Transport,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<()> {
        match self {
            FormFactors::Rays => rays::measure(tracer, coverage, patches, transport, options, observer),
            FormFactors::Hemicube { resolution } => {
                hemicube::measure(tracer, coverage, patches, transport, resolution, options, observer)
            }
            FormFactors::Analytic => analytic::measure(tracer, coverage, patches, transport, options, observer),
        }
    }
}

/// As it is typed.
impl fmt::Display for FormFactors {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FormFactors::Hemicube { resolution } => write!(f, "{},{resolution}", self.name()),
            FormFactors::Rays | FormFactors::Analytic => f.write_str(self.name()),
        }
    }
}
