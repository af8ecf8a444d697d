//! The loop over texels: probes everywhere, many rays where probes disagree.

use super::{
    Direct, Sources,
    disc::Disc,
    emitters::{Sample, Stratum},
    punctual::{self, Aim},
    volley::{Tally, Volley},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{Point, PointTable, hash, luminance, unit_float},
    patches::{Enclosure, Footprint, Patches, SurfacePoint},
    progress::{Observer, check},
    scene::Bake,
    trace::Tracer,
};
use glam::{IVec2, UVec2, Vec2, Vec3};
use rayon::prelude::*;

/// Texels that one task takes.
const CHUNK: usize = 256;
/// Points at which a closed form is averaged over the texel.
const EXACT_POINTS: usize = 8;
/// Blocks of points among which a partly enclosed texel looks for open ones.
const BLOCKS: usize = 8;
/// Blocks of points for lamps, the sun and peaks of the sky where their shadow's edge may cross a texel.
const EDGE: usize = 4;
/// Relative standard error of a sampled cut that calls for more rays.
const NOISE: f32 = 0.01;
/// Difference of arriving shares between neighbours that calls for more rays.
const STEP: f32 = 0.02;

/// What a texel receives from all sources.
#[derive(Clone, Copy, Default)]
struct Received {
    lights: Vec3,
    hidden: Vec3,
    emitters: Vec3,
    sky_peaks: Vec3,
    /// Share of the unshadowed light that arrives.
    share: f32,
    /// True if some rays to one source arrive and others do not.
    mixed: bool,
    rays: u32,
}

/// What a task keeps at hand.
struct Desk<'a> {
    footprint: Footprint<'a>,
    cut: Vec<Stratum>,
    few: Vec<SurfacePoint>,
    volley: Volley,
}

pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &Patches,
    sources: &Sources,
    rays: u32,
    observer: &dyn Observer,
) -> Result<Direct> {
    let probes = (rays / 16).clamp(8, 64).min(rays) as usize;
    let all: Vec<u32> = (0..patches.len() as u32).collect();
    let task = Task { tracer, coverage, patches, sources, enclosure: Enclosure::new(tracer, coverage) };
    observer.begin("direct", all.len() as u64);
    let mut received = task.run(&all, &PointTable::new(probes, 0x6469_7265), 1, observer)?;
    let again: Vec<u32> = (0..patches.len() as u32).filter(|&i| task.is_mixed(&received, i as usize)).collect();
    observer.begin("direct: shadow edges", again.len() as u64);
    let mut shadow_rays: u64 = received.iter().map(|r| u64::from(r.rays)).sum();
    for (&i, r) in again.iter().zip(task.run(&again, &PointTable::new(rays as usize, 0x7368_6164), EDGE, observer)?) {
        shadow_rays += u64::from(r.rays);
        received[i as usize] = r;
    }
    Ok(Direct {
        lights: received.iter().map(|r| r.lights).collect(),
        hidden_lights: received.iter().map(|r| r.hidden).collect(),
        emitters: received.iter().map(|r| r.emitters).collect(),
        sky_peaks: received.iter().map(|r| r.sky_peaks).collect(),
        shadow_rays,
        ..Direct::default()
    })
}

struct Task<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    patches: &'a Patches,
    sources: &'a Sources<'a>,
    enclosure: Enclosure<'a>,
}

impl Task<'_> {
    fn run(&self, which: &[u32], table: &PointTable, edge: usize, observer: &dyn Observer) -> Result<Vec<Received>> {
        let done: Vec<Vec<Received>> = which
            .par_chunks(CHUNK)
            .map(|chunk| {
                if observer.cancelled() {
                    return Vec::new();
                }
                let footprint = Footprint::new(&self.tracer.world, self.coverage);
                let mut desk = Desk { footprint, cut: Vec::new(), few: Vec::new(), volley: Volley::default() };
                let out = chunk.iter().map(|&i| self.patch(i as usize, table, edge, &mut desk)).collect();
                observer.advance(chunk.len() as u64);
                out
            })
            .collect();
        check(observer)?;
        Ok(done.concat())
    }

    /// True if the texel's own rays disagree, or its share differs from a neighbour's on the page.
    fn is_mixed(&self, received: &[Received], patch: usize) -> bool {
        let me = &received[patch];
        let (texel, back) = self.patches.texel(patch);
        if me.mixed || back {
            return me.mixed;
        }
        let t = self.coverage.texels[texel];
        let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y)));
        around.filter_map(|d| self.coverage.texel_at(t.page, (t.at.as_ivec2() + d).as_vec2() + 0.5)).any(|n| {
            let n = &received[n as usize];
            n.mixed || (n.share - me.share).abs() > STEP
        })
    }

    fn patch(&self, patch: usize, table: &PointTable, edge: usize, desk: &mut Desk) -> Received {
        let Desk { footprint, cut, few, volley } = desk;
        let (texel, back) = self.patches.texel(patch);
        let at = self.coverage.texels[texel].at;
        footprint.set(texel);
        let on_surface = |u: Vec2| {
            let p = footprint.point(u);
            if back { p.reversed() } else { p }
        };
        let open;
        let (points, more) = if self.patches.validity[patch] < 1.0 {
            open = self.open_points(table, at, &on_surface);
            (&open[..], 1..1)
        } else {
            (table.block(at.x, at.y, 0), 1..edge.min(table.blocks()))
        };
        let edge_points = points.iter().chain(more.flat_map(|pass| table.block(at.x, at.y, pass)));
        if points.is_empty() {
            return Received::default();
        }
        // Shifts of their own keep the table's period out of the picture.
        let key = hash(patch as u32, points.len() as u32);
        let shift = Vec2::new(unit_float(key), unit_float(hash(key, 1)));
        let mut r = Received::default();
        let (mut sent, mut arrived) = (0.0, 0.0);
        let mut book = |tally: Tally, r: &mut Received| {
            sent += luminance(tally.sent);
            arrived += luminance(tally.arrived);
            r.mixed |= tally.hits > 0 && tally.hits < tally.rays;
            r.rays += tally.rays;
        };
        for light in self.sources.lights.iter().filter(|l| l.bake != Bake::None) {
            let aim = |p: &SurfacePoint, u| punctual::aim(light, p, wrapped(u + shift));
            let tally = self.punctual(edge_points.clone(), &on_surface, aim, volley);
            *(if light.bake == Bake::Full { &mut r.lights } else { &mut r.hidden }) += tally.arrived;
            book(tally, &mut r);
        }
        if let Some(peaks) = &self.sources.peaks {
            let aim = |p: &SurfacePoint, u| peaks.aim(p, wrapped(u + shift));
            let tally = self.punctual(edge_points.clone(), &on_surface, aim, volley);
            r.sky_peaks += tally.arrived;
            book(tally, &mut r);
        }
        self.sources.emitters.cut(&seen_from(footprint, on_surface(Vec2::splat(0.5))), cut);
        let (near, far) = self.sources.emitters.divide(cut);
        // The same points for all leaves: what their closed forms share between them sums up.
        few.clear();
        few.extend(points.iter().take(EXACT_POINTS).map(|p| on_surface(p.place)));
        let exact: Vec<Vec3> = near.iter().map(|s| self.sources.emitters.exact(s, few)).collect();
        let near_weight: f32 = exact.iter().map(|e| luminance(*e)).sum();
        let far_weight: f32 = far.iter().map(|s| s.weight).sum();
        let samples = |part: f32| {
            let wish = points.len() as f32 * part / (near_weight + far_weight);
            (wish.round() as usize).clamp(1, points.len())
        };
        let mut next = 0;
        for (stratum, exact) in near.iter().zip(exact).filter(|(_, exact)| *exact != Vec3::ZERO) {
            let n = samples(luminance(exact));
            let tally = self.leaf(stratum, points, next..next + n, &on_surface, shift, volley).of(exact);
            next += n;
            r.emitters += tally.arrived;
            book(tally, &mut r);
        }
        if !far.is_empty() {
            let (tally, noise) =
                self.pooled(far, far_weight, &points[..samples(far_weight)], &on_surface, shift, volley);
            r.emitters += tally.arrived;
            r.mixed |= noise > NOISE * luminance(r.emitters).max(self.sources.faint);
            book(Tally { hits: tally.rays, ..tally }, &mut r);
        }
        let sent = sent.max(self.sources.faint);
        r.share = if sent > 0.0 { arrived / sent } else { 0.0 };
        r
    }

    /// As many points as a block has, or all that few blocks give, that other geometry does not enclose.
    fn open_points(&self, table: &PointTable, at: UVec2, on_surface: &impl Fn(Vec2) -> SurfacePoint) -> Vec<Point> {
        let (mut open, mut enclosed, wish) = (Vec::new(), 0, table.block(at.x, at.y, 0).len());
        for points in (0..BLOCKS.min(table.blocks())).map(|pass| table.block(at.x, at.y, pass)) {
            let on_surface: Vec<SurfacePoint> = points.iter().map(|p| on_surface(p.place)).collect();
            let holds = self.enclosure.holds(&on_surface, at, Vec2::X, &mut enclosed);
            open.extend(points.iter().zip(holds).filter(|(_, enclosed)| !enclosed).map(|(p, _)| *p));
            if open.len() >= wish {
                break;
            }
        }
        open.truncate(wish);
        open
    }

    /// Mean over the texel's points of what arrives from a source that is one ray a point.
    fn punctual<'p>(
        &self,
        points: impl Iterator<Item = &'p Point>,
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        aim: impl Fn(&SurfacePoint, Vec2) -> Option<Aim>,
        volley: &mut Volley,
    ) -> Tally {
        let mut n = 0;
        volley.clear();
        for point in points {
            n += 1;
            let p = on_surface(point.place);
            if let Some(Aim { direction, distance, irradiance }) = aim(&p, point.extra) {
                // A hair short of the light: a lamp's own surface may stand at it.
                volley.aim(&p, direction, distance * (1.0 - 1e-4), irradiance, irradiance);
            }
        }
        volley.fire(self.tracer).scaled(1.0 / n as f32)
    }

    /// What arrives from points of a leaf.
    fn leaf(
        &self,
        leaf: &Stratum,
        points: &[Point],
        samples: std::ops::Range<usize>,
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        shift: Vec2,
        volley: &mut Volley,
    ) -> Tally {
        volley.clear();
        for k in samples {
            let point = &points[k % points.len()];
            self.to_emitter(leaf, &on_surface(point.place), wrapped(point.extra + shift), 1.0, volley);
        }
        volley.fire(self.tracer)
    }

    /// The mean of samples over the whole cut, and its standard error (luminance).
    fn pooled(
        &self,
        cut: &[Stratum],
        total: f32,
        points: &[Point],
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        shift: Vec2,
        volley: &mut Volley,
    ) -> (Tally, f32) {
        let mut sum = 0.0;
        let cumulative: Vec<f32> = cut
            .iter()
            .map(|s| {
                sum += s.weight;
                sum
            })
            .collect();
        volley.clear();
        for point in points {
            let p = on_surface(point.place);
            let u = wrapped(point.extra + shift);
            let at = u.x * total;
            let k = cumulative.partition_point(|&c| c <= at).min(cut.len() - 1);
            let stratum = &cut[k];
            let inside = 1.0 - (cumulative[k] - at) / stratum.weight;
            let u = Vec2::new(inside.clamp(0.0, 1.0), u.y);
            self.to_emitter(stratum, &p, u, total / stratum.weight, volley);
        }
        let tally = volley.fire(self.tracer);
        // Samples without a ray are zero.
        let squares: f32 = volley.arrivals().map(|x| luminance(x) * luminance(x)).sum();
        let (n, sum) = (points.len() as f32, luminance(tally.arrived));
        let variance = (squares / n - (sum / n) * (sum / n)).max(0.0);
        (tally.scaled(1.0 / n), (variance / n).sqrt())
    }

    /// Aims at a point of the stratum; what comes from there is worth `weight`.
    fn to_emitter(&self, stratum: &Stratum, p: &SurfacePoint, u: Vec2, weight: f32, volley: &mut Volley) {
        let sample = self.sources.emitters.sample(self.sources.scene, stratum, p, u);
        if let Some(Sample { direction, distance, irradiance, mean }) = sample {
            volley.aim(p, direction, distance * (1.0 - 1e-5), mean * weight, irradiance * weight);
        }
    }
}

/// Bounds of a texel around its middle.
fn seen_from(footprint: &Footprint, middle: SurfacePoint) -> Disc {
    let mut disc = Disc::around(middle.position, middle.face);
    footprint.triangles().flatten().for_each(|c| disc.take_point(c));
    let side = 1f32.copysign(footprint.normal().dot(middle.face));
    footprint.normals().for_each(|n| disc.take_normal(n * side, false));
    disc
}

/// Each coordinate's fraction.
fn wrapped(u: Vec2) -> Vec2 {
    u - u.floor()
}
