//! What is tried, in the order of its worth.

use super::LeftOut;
use crate::{
    atlas::Density,
    bake::{self, Quality, Target},
    radiosity::{self, Solver},
    transport::{self, FormFactors, Receivers},
};

/// Sets of trials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sweep {
    /// Rays a row, and every way to measure rows.
    Rays,
    /// Other ways to find form factors.
    FormFactors,
    /// Errors to reach.
    Quality,
    /// Solvers, in a bake and on one system by tolerance.
    Solvers,
    /// Texels.
    Density,
    /// Sizes of patches, constant and interpolated.
    Patches,
    /// Threads.
    Threads,
}

impl Sweep {
    /// Every sweep.
    pub const ALL: [Sweep; 7] = [
        Sweep::Rays,
        Sweep::FormFactors,
        Sweep::Quality,
        Sweep::Solvers,
        Sweep::Density,
        Sweep::Patches,
        Sweep::Threads,
    ];

    /// Name in options and results.
    pub fn name(self) -> &'static str {
        match self {
            Sweep::Rays => "rays",
            Sweep::FormFactors => "form-factors",
            Sweep::Quality => "quality",
            Sweep::Solvers => "solvers",
            Sweep::Density => "density",
            Sweep::Patches => "patches",
            Sweep::Threads => "threads",
        }
    }
}

/// One thing to try.
pub(super) struct Trial {
    pub sweep: Sweep,
    pub series: String,
    pub name: String,
    /// The effort of a bake without options.
    pub default: bool,
    /// As it is baked; the rays of a target are found on the way.
    pub options: bake::Options,
    pub effort: Effort,
    /// About so many times the first bake.
    pub cost: f64,
}

pub(super) enum Effort {
    /// One bake.
    Bake,
    /// To a target.
    Target(Target),
    /// All solvers on one system.
    Solvers,
    /// All estimators on one small layout.
    FormFactors,
    /// All sizes of patches.
    Patches,
    /// All numbers of threads.
    Threads,
}

/// Rays a row: what tells most first.
const RAYS: [u32; 3] = [16, 256, 4];
const MORE_RAYS: [u32; 5] = [64, 1024, 32, 128, 8];
/// What is held against rays.
const ESTIMATORS: [FormFactors; 5] = [
    FormFactors::Hemicube { resolution: 16 },
    FormFactors::Hemicube { resolution: 32 },
    FormFactors::Hemicube { resolution: 64 },
    FormFactors::Hemicube { resolution: 128 },
    FormFactors::Analytic,
];
/// Ways to measure rows with rays. A further closed set of methods is a further line.
fn ways(rays: u32) -> Vec<(&'static str, transport::Options)> {
    let plain = transport::Options::of(rays);
    vec![
        ("rays, used again", plain),
        ("rays, used once", transport::Options { reuse: false, ..plain }),
        ("rays, used again, receivers auto", transport::Options { receivers: Receivers::Auto, ..plain }),
    ]
}

/// The bake that all others are held against, `base` itself, and everything else there is to try.
pub(super) fn trials(base: &bake::Options) -> (Trial, Vec<Trial>) {
    let first = by_rays(base, base.transport.rays, 0);
    let mut all = vec![Trial { default: true, ..target(base, "default", Target::default()) }];
    let every = || 0..ways(1).len();
    all.extend(RAYS.iter().flat_map(|&rays| every().map(move |way| by_rays(base, rays, way))));
    all.extend(Quality::ALL.map(|q| target(base, q.name(), Target::typed(Some(q.error()), None))));
    all.push(of_all(base, Sweep::Solvers, "on one system", Effort::Solvers, 2.0));
    all.push(of_all(base, Sweep::FormFactors, "pairs of texels", Effort::FormFactors, 3.0));
    all.extend(edges(base).map(|edge| at_density(base, edge)));
    all.push(of_all(base, Sweep::Patches, "all sizes", Effort::Patches, 0.5));
    // One thread takes as many times as long as there are threads.
    let threads = 2.0 * rayon::current_num_threads() as f64;
    all.push(of_all(base, Sweep::Threads, "all numbers", Effort::Threads, threads));
    all.extend(MORE_RAYS.iter().flat_map(|&rays| every().map(move |way| by_rays(base, rays, way))));
    all.extend(ESTIMATORS.map(|form_factors| by_form_factors(base, form_factors)));
    all.extend(Solver::ALL.into_iter().map(|solver| by_solver(base, solver)));
    all.retain(|trial| trial.name != first.name);
    (first, all)
}

impl Trial {
    /// It is not charted; `why` if it was refused.
    pub fn left_out(&self, why: Option<String>) -> LeftOut {
        let refused = why.and_then(|text| text.lines().next().map(str::to_owned));
        LeftOut { sweep: self.sweep.name(), name: self.name.clone(), refused }
    }
}

fn by_rays(base: &bake::Options, rays: u32, way: usize) -> Trial {
    let (series, transport) = ways(rays)[way];
    let options = bake::Options { transport, ..base.clone() }.with_rays(rays);
    let cost = 1.3 * f64::from(rays) / f64::from(base.transport.rays) + 0.3;
    trial(Sweep::Rays, series, &format!("{series}, {rays}"), options, cost)
}

fn by_form_factors(base: &bake::Options, form_factors: FormFactors) -> Trial {
    let options = bake::Options { transport: transport::Options { form_factors, ..base.transport }, ..base.clone() };
    // Of hemicubes the pixels, three faces' worth; the other is refused where it would take long.
    let cost = match form_factors {
        FormFactors::Hemicube { resolution } => 0.05 * f64::from(resolution).powi(2),
        FormFactors::Rays | FormFactors::Analytic => 10.0,
    };
    trial(Sweep::FormFactors, form_factors.name(), &form_factors.to_string(), options, cost)
}

fn by_solver(base: &bake::Options, solver: Solver) -> Trial {
    let options = bake::Options { radiosity: radiosity::Options { solver, bounces: None }, ..base.clone() };
    trial(Sweep::Solvers, "solvers", solver.name(), options, 2.0)
}

/// Edges of pages beside the base's own.
fn edges(base: &bake::Options) -> impl Iterator<Item = u32> {
    let own = super::resolution(base);
    own.into_iter().flat_map(|n| [n / 2, n / 4, n * 2, n / 8]).filter(|n| (16..=8192).contains(n))
}

fn at_density(base: &bake::Options, edge: u32) -> Trial {
    let mut options = base.clone();
    options.atlas = crate::atlas::Options {
        density: Density::Resolution(edge),
        page_size: options.atlas.page_size.max(edge),
        ..options.atlas
    };
    let cost = super::resolution(base).map_or(1.0, |own| 2.0 * (f64::from(edge) / f64::from(own)).powi(2)) + 0.2;
    trial(Sweep::Density, "density", &format!("{edge} x {edge}"), options, cost)
}

fn target(base: &bake::Options, name: &str, target: Target) -> Trial {
    let name = name.to_owned();
    // How long it takes is not known before.
    let (effort, cost) = (Effort::Target(target), 3.0);
    Trial { sweep: Sweep::Quality, series: "quality".into(), name, default: false, options: base.clone(), effort, cost }
}

fn of_all(base: &bake::Options, sweep: Sweep, name: &str, effort: Effort, cost: f64) -> Trial {
    let (series, name) = (sweep.name().into(), name.into());
    Trial { sweep, series, name, default: false, options: base.clone(), effort, cost }
}

fn trial(sweep: Sweep, series: &str, name: &str, options: bake::Options, cost: f64) -> Trial {
    Trial { sweep, series: series.into(), name: name.into(), default: false, options, effort: Effort::Bake, cost }
}
