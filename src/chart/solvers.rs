//! All solvers on one system, with every surface as it is and painted anew.

use super::{Bench, Quiet};
use crate::{
    atlas::{self, Coverage, Density},
    direct::{Direct, Sources, sky_cells},
    error::Result,
    patches::Patches,
    radiosity::{Solver, System, TOLERANCE},
    scene::World,
    trace::Tracer,
    transport::{self, Transport},
};
use glam::{DVec3, Vec3};
use serde::Serialize;
use std::time::Instant;

/// How surfaces are painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reflectance {
    /// As the scene says.
    Own,
    /// .5 everywhere.
    Half,
    /// .9.
    Bright,
    /// .99.
    White,
    /// One texel of .99 among .5.
    Spot,
}

/// One solver on one painting.
#[derive(Clone, Debug, Serialize)]
pub struct SolverRun {
    /// The painting.
    pub reflectance: &'static str,
    /// Who solved.
    pub solver: &'static str,
    /// Who went on, where it could do no more.
    pub fallback: Option<&'static str>,
    /// Why it did not begin.
    pub refused: Option<String>,
    /// Unknowns.
    pub unknowns: usize,
    /// Stored entries: what one pass touches.
    pub matrix_entries: u64,
    /// Passes until the true error is below a thousandth.
    pub passes_to_error: Option<f64>,
    /// Passes until the solver is sure of the tolerance of a bake, and the seconds to there.
    pub passes_to_tolerance: Option<f64>,
    /// Seconds to there.
    pub seconds_to_tolerance: Option<f64>,
    /// Looks at the residual. All errors are those of the worst texel over the mean of the darker half.
    pub looks: Vec<Look>,
}

/// A look at the residual.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Look {
    /// Entries touched until then, preparations included.
    pub entries: u64,
    /// Wall seconds until then.
    pub seconds: f64,
    /// True residual.
    pub residual: f64,
    /// What the solver knows of its error.
    pub bound: f64,
    /// Its error.
    pub error: f64,
}

/// Largest page for the system: solvers that touch much take long.
const RESOLUTION: u32 = 256;
/// The true error to be reached, and how far the solvers go.
const ERROR: f64 = 1e-3;
const LAST: f64 = 1e-5;

impl Reflectance {
    /// Every painting.
    pub const ALL: [Reflectance; 5] =
        [Reflectance::Own, Reflectance::Half, Reflectance::Bright, Reflectance::White, Reflectance::Spot];

    /// Name in results.
    pub fn name(self) -> &'static str {
        match self {
            Reflectance::Own => "own",
            Reflectance::Half => ".5",
            Reflectance::Bright => ".9",
            Reflectance::White => ".99",
            Reflectance::Spot => "one .99 among .5",
        }
    }

    fn paint(self, patches: &mut Patches) {
        let rho = match self {
            Reflectance::Own => return,
            Reflectance::Half | Reflectance::Spot => 0.5,
            Reflectance::Bright => 0.9,
            Reflectance::White => 0.99,
        };
        patches.reflectance.fill(Vec3::splat(rho));
        let middle = patches.len() / 2;
        if let (Reflectance::Spot, Some(one)) = (self, patches.reflectance.get_mut(middle)) {
            *one = Vec3::splat(0.99);
        }
    }
}

pub(super) fn compare(bench: &Bench) -> Result<Vec<SolverRun>> {
    let (scene, base, quiet) = (bench.scene, &bench.options.bake, Quiet(bench.observer));
    let edge = super::resolution(base).unwrap_or(RESOLUTION).min(RESOLUTION);
    let options = atlas::Options { density: Density::Resolution(edge), ..base.atlas };
    let atlas = atlas::unwrap(scene, &options, &scene.file, &quiet, &mut Vec::new())?;
    let world = World::new(scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let mut plain = Patches::new(&tracer.world, &coverage, base.max_reflectance);
    let measuring = transport::Options { reuse: false, ..base.transport };
    let transport = Transport::measure(&tracer, &coverage, &mut plain, &measuring, &quiet)?;
    let sky = sky_cells(&scene.sky);
    let mut runs = Vec::new();
    for reflectance in Reflectance::ALL {
        // One painting is always shown.
        if !runs.is_empty() && !bench.fits(2.0) {
            break;
        }
        let mut patches = plain.clone();
        reflectance.paint(&mut patches);
        let sources = Sources::new(&tracer, &patches);
        let direct = Direct::measure(&tracer, &coverage, &patches, &sources, base.shadow_rays, &quiet)?;
        let system = System::new(&transport, &patches, &direct, &sky, sources.gathered);
        runs.extend(rank(bench, reflectance, &system)?);
    }
    Ok(runs)
}

/// Every solver against the dense solution, or a far more exact one.
fn rank(bench: &Bench, reflectance: Reflectance, system: &System) -> Result<Vec<SolverRun>> {
    let quiet = Quiet(bench.observer);
    let all_receive = bench.options.bake.transport.receivers == transport::Receivers::All;
    let dense = Solver::Direct.check(system.unknowns(), all_receive).is_ok();
    let reference = if dense { Solver::Direct } else { Solver::default() };
    let mut truth = Vec::new();
    system.watched(reference, 1e-9, &quiet, &mut |_, x| truth = x.to_vec())?;
    let (dark, inverse) = (system.dark_mean(&truth).max(1e-30), system.amplification().inverse);
    let error = |x: &[DVec3]| {
        let off = x.iter().zip(&truth).map(|(x, t)| (*x - *t).abs().max_element());
        off.fold(0.0, f64::max) / dark
    };
    let mut runs = Vec::new();
    for solver in Solver::ALL {
        let mut run = SolverRun {
            reflectance: reflectance.name(),
            solver: solver.name(),
            fallback: None,
            refused: None,
            unknowns: system.unknowns(),
            matrix_entries: system.entries(),
            passes_to_error: None,
            passes_to_tolerance: None,
            seconds_to_tolerance: None,
            looks: Vec::new(),
        };
        if let Err(why) = solver.check(system.unknowns(), all_receive) {
            run.refused = Some(why.to_string().lines().next().unwrap_or_default().into());
            runs.push(run);
            continue;
        }
        // Looking is not a part of solving.
        let (start, mut looking) = (Instant::now(), 0.0);
        let solved = system.watched(solver, LAST, &quiet, &mut |entries, x| {
            let before = start.elapsed().as_secs_f64();
            let seconds = before - looking;
            run.looks.push(Look { entries, seconds, residual: 0.0, bound: 0.0, error: error(x) });
            looking += start.elapsed().as_secs_f64() - before;
        })?;
        for (look, residual) in run.looks.iter_mut().zip(&solved.report.residuals) {
            (look.residual, look.bound) = (residual / dark, residual * inverse / dark);
        }
        run.fallback = solved.report.fallback;
        let passes = |look: &Look| look.entries as f64 / system.entries().max(1) as f64;
        let sure = run.looks.iter().find(|l| l.bound <= TOLERANCE);
        run.passes_to_error = run.looks.iter().find(|l| l.error <= ERROR).map(passes);
        run.passes_to_tolerance = sure.map(passes);
        run.seconds_to_tolerance = sure.map(|l| l.seconds);
        runs.push(run);
    }
    Ok(runs)
}
