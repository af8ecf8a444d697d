//! How errors fall with the size of patches: one value for each, and interpolated between.

use super::{Bench, LeftOut, Sweep, fit::power, subject};
use crate::{
    atlas::{self, Density, Unwrap},
    audit::{Interval, Truth},
    bake,
    error::{Error, Result},
    lightmaps::Reading,
    transport,
};
use serde::Serialize;

/// All sizes, and the power of the edge with which errors fall.
#[derive(Clone, Debug, Serialize)]
pub struct Patchwork {
    /// Points of the audit that they are held against.
    pub points: usize,
    /// From coarse to fine.
    pub levels: Vec<Level>,
    /// By reading: power of the patches' edge with which the error falls, over all levels whose error can be told from noise.
    pub order: Vec<(&'static str, Option<f64>)>,
}

/// One size.
#[derive(Clone, Debug, Serialize)]
pub struct Level {
    /// Edge of the page.
    pub resolution: u32,
    /// Patches.
    pub texels: usize,
    /// Root of the mean area of a patch, metres.
    pub edge: f64,
    /// Rays a row.
    pub rays: u32,
    /// Error at points of the surface, by reading.
    pub errors: Vec<(&'static str, Option<Interval>)>,
}

/// The coarsest page.
const COARSEST: u32 = 16;
/// Rays a row: what is left of their noise is small, and for as many texels neighbours still share them.
const RAYS: u32 = 1024;
const RAYS_IN_ALL: u64 = 1 << 26;

/// Bakes from coarse to fine. The layouts are luxel's own: those of an author cannot be coarse.
pub(super) fn measure(bench: &Bench, truth: &Truth, left_out: &mut Vec<LeftOut>) -> Result<Patchwork> {
    let base = &bench.options.bake;
    let own = super::resolution(base).unwrap_or(1024);
    let mut levels = Vec::new();
    for edge in std::iter::successors(Some(COARSEST), |n| Some(2 * n)).take_while(|n| *n <= own.max(COARSEST)) {
        let texels = u64::from(edge).pow(2);
        let rays = (RAYS_IN_ALL / texels).next_power_of_two().clamp(64, u64::from(RAYS)) as u32;
        let share = texels as f64 / f64::from(own).powi(2);
        if !bench.fits(0.3 + share * 1.5 * f64::from(rays) / f64::from(base.transport.rays)) {
            left_out.push(missing(edge, None));
            break;
        }
        let unwrap = if base.atlas.unwrap == Unwrap::Keep { Unwrap::default() } else { base.atlas.unwrap };
        let atlas = atlas::Options { unwrap, density: Density::Resolution(edge), ..base.atlas };
        let transport = transport::Options { rays, ..base.transport };
        let options = bake::Options { atlas, transport, shadow_rays: 256, ..base.clone() };
        let (baked, _) = match bench.timed(|quiet| bake::bake(bench.scene, &options, quiet)) {
            Err(Error::Usage(why)) => {
                left_out.push(missing(edge, Some(why)));
                continue;
            }
            other => other?,
        };
        let subject = subject(&baked, &options);
        let errors = Reading::ALL.map(|r| (r.name(), truth.look_ups(subject.coverage, subject.lightmaps, r)));
        let area: f64 = baked.patches.area[..baked.patches.fronts].iter().map(|a| f64::from(*a)).sum();
        let texels = baked.report.texels;
        levels.push(Level {
            resolution: edge,
            texels,
            edge: (area / texels as f64).sqrt(),
            rays,
            errors: errors.to_vec(),
        });
    }
    let order = Reading::ALL.iter().enumerate().map(|(i, r)| (r.name(), order(&levels, i))).collect();
    Ok(Patchwork { points: truth.points(), levels, order })
}

fn missing(edge: u32, refused: Option<String>) -> LeftOut {
    LeftOut { sweep: Sweep::Patches.name(), name: format!("{edge} x {edge}"), refused }
}

/// Over the levels whose interval is no wider than the error itself.
fn order(levels: &[Level], reading: usize) -> Option<f64> {
    let sure = levels.iter().filter_map(|level| {
        let error = level.errors[reading].1.filter(|e| e.high - e.low < e.value)?;
        Some((level.edge, error.value))
    });
    power(&sure.collect::<Vec<_>>())
}
