//! The loop over texels: probes everywhere, many rays where probes disagree.

use super::{
    Direct, Sources,
    bright::mean_radiosity,
    parts::{Divided, Parts},
    received::Received,
    smooth::smooth,
    texel::{Desk, NEAR_POINTS},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{PointTable, luminance},
    patches::{Enclosure, Patches},
    progress::{Observer, check},
    trace::Tracer,
};
use glam::{IVec2, Vec3};
use rayon::prelude::*;

/// Texels that one task takes.
const CHUNK: usize = 256;
/// Times the shadow rays that texels get which no fit explains: edges.
const MORE: u32 = 4;
/// And how many times that at most, where one source's rays still disagree: edges of the sun's shadow are sharp.
const MOST_BLOCKS: usize = 16;
/// Shadow rays at most: there are no more points.
const MOST: u32 = 1 << 16;
/// Relative standard error that calls for more rays than `rays`, times the root of their number: as the error of rows
/// falls, so does this.
const NOISE: f32 = 0.12;
/// Standard errors at an edge fall with about this power of the number of stratified points, not with its root.
const EDGE_POWER: f32 = 0.625;
/// Noise is judged against this share of the scene's mean radiosity at least: less light is nowhere noticed.
const FAINT: f32 = 0.25;
/// And against so many times that at most: errors of a bright spot are far above the mean.
const GLARE: f32 = 16.0;
/// Difference of arriving shares between neighbours that calls for more rays.
const STEP: f32 = 0.02;

pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &Patches,
    sources: &Sources,
    rays: u32,
    observer: &dyn Observer,
) -> Result<Direct> {
    let enclosure = Enclosure::new(tracer, coverage);
    let mut task = Task {
        tracer,
        coverage,
        patches,
        sources,
        enclosure,
        many: PointTable::of_places(NEAR_POINTS, 0x6d61_6e79),
        noise: NOISE / (rays as f32).sqrt(),
        faint: sources.faint,
    };
    let mut received = vec![Received::default(); patches.len()];
    let some =
        |holds: &dyn Fn(usize) -> bool| (0..patches.len() as u32).filter(|&i| holds(i as usize)).collect::<Vec<_>>();
    let table = |points: u32| PointTable::of_places(points.min(MOST) as usize, 0x6469_7265);

    observer.begin("direct", patches.len() as u64);
    let probes = (rays / 16).clamp(sources.probes(), 64).min(rays.div_ceil(2));
    let mut shadow_rays = task.measure(&some(&|_| true), &table(probes), &|_| 1, &mut received, None, observer)?;
    if task.faint == 0.0 {
        let reflected: Vec<Vec3> = (0..patches.len()).map(|i| patches.reflectance[i] * received[i].total()).collect();
        task.faint = FAINT * mean_radiosity(patches, &reflected);
    }
    let mixed = some(&|i| task.is_mixed(&received, i));
    observer.begin("direct: shadows", mixed.len() as u64);
    if rays > probes {
        let probed: Vec<Received> = mixed.iter().map(|&i| received[i as usize]).collect();
        shadow_rays += task.measure(&mixed, &table(rays), &|_| 1, &mut received, None, observer)?;
        mixed.iter().zip(&probed).for_each(|(&i, probed)| received[i as usize] = received[i as usize].after(probed));
    }
    smooth(coverage, patches, &mixed, &mut received);
    let wishes = task.wishes(&received);
    let edges = some(&|i| wishes[i] > 0);
    observer.begin("direct: shadow edges", edges.len() as u64);
    let blocks = |i: usize| usize::from(wishes[i]);
    let (points, mut divided) = (table(rays * MORE), Vec::new());
    let divide = sources.are_punctual().then_some(&mut divided);
    shadow_rays += task.measure(&edges, &points, &blocks, &mut received, divide, observer)?;
    smooth(coverage, patches, &edges, &mut received);
    Ok(Direct {
        lights: received.iter().map(|r| r.lights).collect(),
        hidden_lights: received.iter().map(|r| r.hidden).collect(),
        emitters: received.iter().map(|r| r.emitters).collect(),
        sky_peaks: received.iter().map(|r| r.sky_peaks).collect(),
        parts: Parts::new(patches.len(), divided),
        shadow_rays,
        ..Direct::default()
    })
}

pub(super) struct Task<'a> {
    pub tracer: &'a Tracer<'a>,
    pub coverage: &'a Coverage,
    pub patches: &'a Patches,
    pub sources: &'a Sources<'a>,
    pub enclosure: Enclosure<'a>,
    /// Points for what costs no rays.
    pub many: PointTable,
    /// Relative standard error that calls for more rays.
    pub noise: f32,
    /// What it is relative to, at least: luminance of irradiance. 0 until probes have told how much light there is.
    pub faint: f32,
}

impl Task<'_> {
    /// Measures some patches, and their parts if these are wanted; returns the number of rays that took.
    fn measure(
        &self,
        which: &[u32],
        table: &PointTable,
        blocks: &(dyn Fn(usize) -> usize + Sync),
        received: &mut [Received],
        mut parts: Option<&mut Vec<(u32, Box<Divided>)>>,
        observer: &dyn Observer,
    ) -> Result<u64> {
        let divide = parts.is_some();
        let measured = |chunk: &[u32]| {
            if observer.cancelled() {
                return Vec::new();
            }
            let mut desk = Desk::new(self);
            let one = |&i: &u32| self.texel(i as usize, table, blocks(i as usize), divide, &mut desk);
            let out: Vec<(Received, Option<Box<Divided>>)> = chunk.iter().map(one).collect();
            observer.advance(chunk.len() as u64);
            out
        };
        let done: Vec<_> = which.par_chunks(CHUNK).map(measured).collect();
        check(observer)?;
        let mut rays = 0;
        for (&i, (one, divided)) in which.iter().zip(done.into_iter().flatten()) {
            rays += u64::from(one.rays);
            received[i as usize] = one;
            if let (Some(parts), Some(divided)) = (&mut parts, divided) {
                parts.push((i, divided));
            }
        }
        Ok(rays)
    }

    /// The patches whose texels lie around one's own on the page, and itself.
    fn around(&self, patch: usize) -> impl Iterator<Item = usize> {
        let (texel, back) = self.patches.texel(patch);
        let t = self.coverage.texels[texel];
        let others = (-1..=1).flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y))).filter(move |_| !back);
        let others = others.filter_map(move |d| self.coverage.texel(t.page, t.at.as_ivec2() + d));
        std::iter::once(patch).chain(others.map(|n| n as usize))
    }

    /// True if the patch's own rays or those of a neighbour disagree, or their shares of the light.
    fn is_mixed(&self, received: &[Received], patch: usize) -> bool {
        let share = |r: &Received| r.arrived / r.sent.max(self.faint).max(f32::MIN_POSITIVE);
        let own = share(&received[patch]);
        self.around(patch).any(|n| received[n].mixed || (share(&received[n]) - own).abs() > STEP)
    }

    /// Blocks of points that the noise which is left calls for, of each patch or a neighbour; 0: none.
    fn wishes(&self, received: &[Received]) -> Vec<u8> {
        // Where nothing reflects, there is no mean to hold it against.
        let glare = if self.faint > 0.0 { GLARE * self.faint } else { f32::INFINITY };
        let allowed = |light: f32| self.noise * light.max(self.faint).min(glare);
        let excess = |r: &Received| r.variance.sqrt() / allowed(luminance(r.total())).max(f32::MIN_POSITIVE);
        let mut wishes = vec![0; received.len()];
        for (patch, excess) in received.iter().map(excess).enumerate().filter(|(_, excess)| *excess > 1.0) {
            let blocks = (libm::powf(excess, 1.0 / EDGE_POWER) / MORE as f32).ceil().min(MOST_BLOCKS as f32) as u8;
            self.around(patch).for_each(|n| wishes[n] = blocks.max(wishes[n]));
        }
        wishes
    }
}
