//! The loop over texels: probes everywhere, many rays where probes disagree.

use super::{
    Direct, Sources,
    bright::mean_radiosity,
    parts::Parts,
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
use glam::IVec2;
use rayon::prelude::*;
use std::collections::BTreeMap;

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
/// Lots of points that are shot one after the other, at most.
const LOTS: u32 = 8;
/// Of the points.
const SEED: u32 = 0x6469_7265;
/// Difference of arriving shares between neighbours that calls for more rays.
const STEP: f32 = 0.02;

/// What shadow rays have told of every patch, before neighbours smooth it; more of them may join.
#[derive(Default)]
pub(super) struct Known {
    received: Vec<Received>,
    parts: Parts,
    /// Of the patches, when the rays were shot.
    validity: Vec<f32>,
    shadow_rays: u64,
    /// Times that rays were shot.
    times: u32,
}

impl Known {
    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let patches = self.received.capacity() * size_of::<Received>() + self.validity.capacity() * size_of::<f32>();
        patches as u64 + self.parts.bytes()
    }
}

/// The light of `sources`, from as many points as `rays` call for, with those that are `known`.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &Patches,
    sources: &Sources,
    rays: u32,
    known: &mut Known,
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
    let some = |holds: &(dyn Fn(usize) -> bool + Sync)| -> Vec<u32> {
        (0..patches.len() as u32).into_par_iter().filter(|&i| holds(i as usize)).collect()
    };
    let mut looks = Looks::begin(known, patches);

    observer.begin("direct", patches.len() as u64);
    let probes = sources.probes(rays);
    looks.look(&task, &some(&|_| true), probes, observer)?;
    if task.faint == 0.0 {
        let reflected = |i: usize| patches.reflectance[i] * looks.received[i].total();
        task.faint =
            FAINT * mean_radiosity(patches, &(0..patches.len()).into_par_iter().map(reflected).collect::<Vec<_>>());
    }
    let mixed = some(&|i| task.is_mixed(&looks.received, i));
    observer.begin("direct: shadows", mixed.len() as u64);
    if rays > probes {
        looks.look(&task, &mixed, rays, observer)?;
    }
    smooth(coverage, patches, &mixed, &mut looks.received);
    let block = rays.saturating_mul(MORE).min(MOST);
    let wishes = task.wishes(&looks.received, block);
    let edges = some(&|i| wishes[i] > 0);
    observer.begin("direct: shadow edges", edges.len() as u64);
    looks.look_at_edges(&task, &edges, block, &wishes, observer)?;
    smooth(coverage, patches, &edges, &mut looks.received);
    Ok(looks.end())
}

/// Looks at patches, one closer than the other.
struct Looks<'k> {
    /// What was known before.
    known: &'k mut Known,
    /// What the last look at each patch has told.
    last: Vec<Received>,
    /// Both together, or what neighbours make of it.
    received: Vec<Received>,
}

impl<'k> Looks<'k> {
    /// Nothing is known of new patches, nor of those that have turned out to be partly enclosed.
    fn begin(known: &'k mut Known, patches: &Patches) -> Self {
        if known.times > 0 {
            known.received.resize(patches.len(), Received::default());
        }
        let open = |validity: &f32| *validity == 1.0;
        let changed = known.validity.iter().zip(&patches.validity).map(|(a, b)| open(a) != open(b));
        for (i, _) in changed.enumerate().filter(|(_, changed)| *changed) {
            known.received[i] = Received::default();
            known.parts.forget(i);
        }
        known.validity.clone_from(&patches.validity);
        let nothing = || rayon::iter::repeat_n(Received::default(), patches.len()).collect();
        let received = if known.times > 0 { known.received.clone() } else { nothing() };
        Looks { known, last: nothing(), received }
    }

    /// What was known of a patch before.
    fn before(&self, patch: u32) -> Received {
        self.known.received.get(patch as usize).copied().unwrap_or_default()
    }

    /// Looks at some patches from as many points, with those from which they were looked at before.
    fn look(&mut self, task: &Task, which: &[u32], points: u32, observer: &dyn Observer) -> Result<()> {
        // Of texels that are partly enclosed as many points as are open are known: rounded up, they come in few lots.
        let lacks = |i: u32| points.saturating_sub(self.before(i).points).next_multiple_of(points.div_ceil(LOTS));
        let mut lots: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
        which.iter().for_each(|&i| lots.entry(lacks(i)).or_default().push((i, 1)));
        lots.remove(&0);
        lots.into_iter().try_for_each(|(lacks, which)| self.add(task, &which, lacks, false, observer))
    }

    /// The same from as many blocks of points as each wishes; at the parts of patches, too, if a source is one ray a point.
    fn look_at_edges(
        &mut self,
        task: &Task,
        edges: &[u32],
        block: u32,
        wishes: &[u8],
        observer: &dyn Observer,
    ) -> Result<()> {
        let lacks = |i: u32| u32::from(wishes[i as usize]).saturating_sub(self.before(i).points / block);
        let (which, enough): (Vec<_>, Vec<_>) = edges.iter().map(|&i| (i, lacks(i))).partition(|(_, n)| *n > 0);
        for (i, _) in enough {
            self.received[i as usize] = joined(&self.known.received, i, &self.last[i as usize]);
        }
        self.add(task, &which, block, task.sources.are_punctual(), observer)
    }

    /// Looks at some patches, in their order, from so many blocks of points each; at their parts, too, if it is to `divide` them.
    fn add(
        &mut self,
        task: &Task,
        which: &[(u32, u32)],
        block: u32,
        divide: bool,
        observer: &dyn Observer,
    ) -> Result<()> {
        let table = PointTable::of_places(block as usize, SEED.wrapping_add(self.known.times));
        let known = &self.known.received;
        let chunks: Vec<&[(u32, u32)]> = which.chunks(CHUNK).collect();
        let told = spans(&chunks, &mut self.last).into_par_iter().zip(spans(&chunks, &mut self.received));
        let looks = chunks.par_iter().zip(told).map(|(chunk, (last, received))| {
            check(observer)?;
            let (mut desk, mut rays, mut parts) = (Desk::new(task), 0, Vec::new());
            for &(i, blocks) in *chunk {
                let (one, divided) = task.texel(i as usize, &table, blocks as usize, divide, &mut desk);
                let at = (i - chunk[0].0) as usize;
                // Blocks of neighbours are nets together: a closer look takes the place of another.
                last[at] = one.after(&last[at]);
                received[at] = joined(known, i, &last[at]);
                rays += u64::from(one.rays);
                if divide {
                    parts.push((i, one.points, divided));
                }
            }
            observer.advance(chunk.len() as u64);
            Ok((rays, parts))
        });
        for (rays, parts) in looks.collect::<Result<Vec<_>>>()? {
            self.known.shadow_rays += rays;
            for (i, points, divided) in parts {
                match divided {
                    Some(divided) => self.known.parts.add(self.received.len(), i, *divided),
                    None => self.known.parts.agree(i, points),
                }
            }
        }
        Ok(())
    }

    /// The light that was found. All looks are known from now on.
    fn end(self) -> Direct {
        let Looks { known, last, received } = self;
        known.times += 1;
        match known.received.is_empty() {
            true => known.received = last,
            false => known.received.par_iter_mut().zip(&last).for_each(|(known, last)| *known = known.and(last)),
        }
        Direct {
            lights: received.par_iter().map(|r| r.lights).collect(),
            hidden_lights: received.par_iter().map(|r| r.hidden).collect(),
            emitters: received.par_iter().map(|r| r.emitters).collect(),
            sky_peaks: received.par_iter().map(|r| r.sky_peaks).collect(),
            parts: known.parts.clone(),
            shadow_rays: known.shadow_rays,
            ..Direct::default()
        }
    }
}

/// What was known of a patch with what the last look has told.
fn joined(known: &[Received], patch: u32, last: &Received) -> Received {
    known.get(patch as usize).map_or(*last, |before| before.and(last))
}

/// Cuts what is told of all patches: for each chunk of them, which ascend, from its first patch to its last.
fn spans<'t, T>(chunks: &[&[(u32, u32)]], mut rest: &'t mut [T]) -> Vec<&'t mut [T]> {
    let mut begin = 0;
    let span = |chunk: &&[(u32, u32)]| {
        let [first, last] = [chunk[0], chunk[chunk.len() - 1]].map(|(patch, _)| patch as usize);
        let (span, tail) = std::mem::take(&mut rest)[first - begin..].split_at_mut(last + 1 - first);
        (rest, begin) = (tail, last + 1);
        span
    };
    chunks.iter().map(span).collect()
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

    /// Blocks of so many points that the noise which is left calls for in all, of each patch or a neighbour; 0: none.
    fn wishes(&self, received: &[Received], block: u32) -> Vec<u8> {
        // Where nothing reflects, there is no mean to hold it against.
        let glare = if self.faint > 0.0 { GLARE * self.faint } else { f32::INFINITY };
        let allowed = |light: f32| self.noise * light.max(self.faint).min(glare);
        let excess = |r: &Received| r.variance.sqrt() / allowed(luminance(r.total())).max(f32::MIN_POSITIVE);
        let mut wishes = vec![0; received.len()];
        for (patch, excess) in received.iter().map(excess).enumerate().filter(|(_, excess)| *excess > 1.0) {
            let points = libm::powf(excess, 1.0 / EDGE_POWER) * received[patch].points as f32;
            let blocks = (points / block as f32).ceil().min(MOST_BLOCKS as f32) as u8;
            self.around(patch).for_each(|n| wishes[n] = blocks.max(wishes[n]));
        }
        wishes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_of_patches_have_spans_of_their_own() {
        let mut told: Vec<u32> = (0..10).collect();
        let which = [1, 2, 4, 5, 9].map(|patch| (patch, 1));
        let chunks: Vec<&[(u32, u32)]> = which.chunks(2).collect();
        let spans = spans(&chunks, &mut told);
        assert_eq!(spans, [&[1, 2][..], &[4, 5], &[9]]);
        assert!(super::spans(&[], &mut told).is_empty());
    }
}
