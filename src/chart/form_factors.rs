//! How far form factors are off, by estimator and its parameter, where closed forms can tell.

use super::{Bench, LeftOut, Sweep};
use crate::{
    atlas::{self, Coverage, Density, Unwrap},
    error::{Error, Result},
    patches::Patches,
    scene::World,
    trace::Tracer,
    transport::{FormFactors, Options, Transport},
};
use serde::Serialize;
use std::time::Instant;

/// Estimators on one small layout.
#[derive(Clone, Debug, Serialize)]
pub struct Factors {
    /// Texels of the layout.
    pub texels: usize,
    /// Wall seconds of the closed forms that all are held against.
    pub seconds: f64,
    /// Every estimator and parameter.
    pub runs: Vec<FactorRun>,
}

/// One estimator with one parameter.
#[derive(Clone, Debug, Serialize)]
pub struct FactorRun {
    /// Its name.
    pub form_factors: &'static str,
    /// Rays a row, or pixels of a hemicube's edge.
    pub effort: u32,
    /// Wall seconds to measure all rows, the fastest of three: too few for the clock of processors.
    pub seconds: f64,
    /// Root mean square error of the form factors between all pairs of texels, over their root mean square.
    pub error: f64,
}

/// Edges of the page: the first whose pairs closed forms take.
const EDGES: [u32; 2] = [32, 16];
const RAYS: [u32; 5] = [16, 64, 256, 1024, 4096];
const PIXELS: [u32; 5] = [8, 16, 32, 64, 128];

/// The layout is luxel's own: that of an author cannot be so small.
pub(super) fn measure(bench: &Bench, left_out: &mut Vec<LeftOut>) -> Result<Option<Factors>> {
    let base = &bench.options.bake;
    let unwrap = if base.atlas.unwrap == Unwrap::Keep { Unwrap::default() } else { base.atlas.unwrap };
    let mut refused = None;
    for edge in EDGES {
        let options = atlas::Options { unwrap, density: Density::Resolution(edge), ..base.atlas };
        match on(bench, &options) {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => refused = why.to_string().lines().next().map(str::to_owned),
            Ok(found) => return Ok(Some(found)),
        }
    }
    left_out.push(LeftOut { sweep: Sweep::FormFactors.name(), name: "pairs of texels".into(), refused });
    Ok(None)
}

fn on(bench: &Bench, options: &atlas::Options) -> Result<Factors> {
    let (scene, base) = (bench.scene, &bench.options.bake);
    let quiet = &super::Quiet(bench.observer);
    let atlas = atlas::unwrap(scene, options, &scene.file, quiet, &mut Vec::new())?;
    let world = World::new(scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let plain = Patches::new(&tracer.world, &coverage, base.max_reflectance);
    let rows = |form_factors: FormFactors, rays: u32| -> Result<(Transport, f64)> {
        let options = Options { form_factors, reuse: false, ..Options::of(rays) };
        let start = Instant::now();
        let transport = Transport::measure(&tracer, &coverage, &mut plain.clone(), &options, quiet)?;
        Ok((transport, start.elapsed().as_secs_f64()))
    };
    FormFactors::Analytic.check(coverage.texels.len())?;
    let (closed, seconds) = rows(FormFactors::Analytic, RAYS[2])?;
    let truth = dense(&closed, plain.fronts);
    let all = norm(&truth, &[]);
    if all == 0.0 {
        return Err(Error::Usage("no texel sees another".into()));
    }
    let by_rays = RAYS.map(|rays| (FormFactors::Rays, rays, rays));
    let by_pixels = PIXELS.map(|resolution| (FormFactors::Hemicube { resolution }, 1, resolution));
    let mut runs = Vec::new();
    for (form_factors, rays, effort) in by_rays.into_iter().chain(by_pixels) {
        let (found, first) = rows(form_factors, rays)?;
        let seconds = (1..3).try_fold(first, |least, _| Ok::<f64, Error>(rows(form_factors, rays)?.1.min(least)))?;
        let error = norm(&truth, &dense(&found, plain.fronts)) / all;
        runs.push(FactorRun { form_factors: form_factors.name(), effort, seconds, error });
    }
    Ok(Factors { texels: coverage.texels.len(), seconds, runs })
}

/// The form factors between fronts: backs, whose number differs, and the sky are not looked at.
fn dense(transport: &Transport, fronts: usize) -> Vec<Vec<f64>> {
    let row = |i: usize| {
        let mut row = vec![0.0; fronts];
        let entries = transport.rows.row(i).entries().filter(|e| (e.0 as usize) < fronts);
        entries.for_each(|(column, weight)| row[column as usize] += weight);
        row
    };
    (0..fronts).map(row).collect()
}

/// Root of the sum of squared differences; what one of them lacks counts as nothing.
fn norm(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let at = |rows: &[Vec<f64>], i: usize, j: usize| rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
    let square = |i: usize, j: usize| (at(a, i, j) - at(b, i, j)) * (at(a, i, j) - at(b, i, j));
    (0..a.len()).map(|i| (0..a.len()).map(|j| square(i, j)).sum::<f64>()).sum::<f64>().sqrt()
}
