//! The loop over texels: probes everywhere, many rays where probes disagree.

use super::{
    Direct, Sources,
    bright::mean_radiosity,
    disc::Disc,
    emitters::{Sample, Stratum},
    punctual::{self, Aim},
    received::Received,
    smooth::smooth,
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
/// Points at which closed forms are averaged over the texel, and over one where these differ.
const EXACT_POINTS: usize = 4;
const NEAR_POINTS: usize = 64;
/// Part of the noise that asks for more rays that may come from there.
const NEAR_NOISE: f32 = 0.25;
/// Blocks of points among which a partly enclosed texel looks for open ones.
const BLOCKS: usize = 8;
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
    let enclosure = Enclosure::new(tracer, coverage);
    let mut task = Task {
        tracer,
        coverage,
        patches,
        sources,
        enclosure,
        noise: NOISE / (rays as f32).sqrt(),
        faint: sources.faint,
    };
    let mut received = vec![Received::default(); patches.len()];
    let some =
        |holds: &dyn Fn(usize) -> bool| (0..patches.len() as u32).filter(|&i| holds(i as usize)).collect::<Vec<_>>();
    let table = |points: u32| PointTable::of_places(points.min(MOST) as usize, 0x6469_7265);

    observer.begin("direct", patches.len() as u64);
    let probes = (rays / 16).clamp(8, 64).min(rays);
    let mut shadow_rays = task.measure(&some(&|_| true), &table(probes), &|_| 1, &mut received, observer)?;
    if task.faint == 0.0 {
        let reflected: Vec<Vec3> = (0..patches.len()).map(|i| patches.reflectance[i] * received[i].total()).collect();
        task.faint = FAINT * mean_radiosity(patches, &reflected);
    }
    let mixed = some(&|i| task.is_mixed(&received, i));
    observer.begin("direct: shadows", mixed.len() as u64);
    let probed: Vec<Received> = mixed.iter().map(|&i| received[i as usize]).collect();
    shadow_rays += task.measure(&mixed, &table(rays), &|_| 1, &mut received, observer)?;
    mixed.iter().zip(&probed).for_each(|(&i, probed)| received[i as usize] = received[i as usize].after(probed));
    smooth(coverage, patches, &mixed, &mut received);
    let wishes: Vec<u8> = (0..patches.len()).into_par_iter().map(|i| task.wish(&received, i)).collect();
    let edges = some(&|i| wishes[i] > 0);
    observer.begin("direct: shadow edges", edges.len() as u64);
    shadow_rays += task.measure(&edges, &table(rays * MORE), &|i| usize::from(wishes[i]), &mut received, observer)?;
    smooth(coverage, patches, &edges, &mut received);
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
    /// Relative standard error that calls for more rays.
    noise: f32,
    /// What it is relative to, at least: luminance of irradiance. 0 until probes have told how much light there is.
    faint: f32,
}

impl Task<'_> {
    /// Measures some patches; returns the number of rays that took.
    fn measure(
        &self,
        which: &[u32],
        table: &PointTable,
        blocks: &(dyn Fn(usize) -> usize + Sync),
        received: &mut [Received],
        observer: &dyn Observer,
    ) -> Result<u64> {
        let measured = |chunk: &[u32]| {
            if observer.cancelled() {
                return Vec::new();
            }
            let footprint = Footprint::new(&self.tracer.world, self.coverage);
            let mut desk = Desk { footprint, cut: Vec::new(), few: Vec::new(), volley: Volley::default() };
            let out: Vec<Received> =
                chunk.iter().map(|&i| self.patch(i as usize, table, blocks(i as usize), &mut desk)).collect();
            observer.advance(chunk.len() as u64);
            out
        };
        let done: Vec<Vec<Received>> = which.par_chunks(CHUNK).map(measured).collect();
        check(observer)?;
        which.iter().zip(done.iter().flatten()).for_each(|(&i, r)| received[i as usize] = *r);
        Ok(done.iter().flatten().map(|r| u64::from(r.rays)).sum())
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

    /// Blocks of points that the noise which is left calls for, of the patch or a neighbour; 0: none.
    fn wish(&self, received: &[Received], patch: usize) -> u8 {
        // Where nothing reflects, there is no mean to hold it against.
        let glare = if self.faint > 0.0 { GLARE * self.faint } else { f32::INFINITY };
        let allowed = |light: f32| self.noise * light.max(self.faint).min(glare);
        let excess = |r: &Received| r.variance.sqrt() / allowed(luminance(r.total())).max(f32::MIN_POSITIVE);
        let most = self.around(patch).map(|n| excess(&received[n])).fold(0.0, f32::max);
        let blocks = libm::powf(most, 1.0 / EDGE_POWER) / MORE as f32;
        if most > 1.0 { blocks.ceil().min(MOST_BLOCKS as f32) as u8 } else { 0 }
    }

    fn patch(&self, patch: usize, table: &PointTable, most: usize, desk: &mut Desk) -> Received {
        let Desk { footprint, cut, few, volley } = desk;
        let (texel, back) = self.patches.texel(patch);
        let at = self.coverage.texels[texel].at;
        footprint.set(texel);
        let on_surface = |u: Vec2| {
            let p = footprint.point(u);
            if back { p.reversed() } else { p }
        };
        let open;
        let (points, most) = if self.patches.validity[patch] < 1.0 {
            open = self.open_points(table, at, &on_surface);
            (&open[..], 1)
        } else {
            (table.block(at.x, at.y, 0), most.min(table.blocks()))
        };
        let more = || (1..most).flat_map(|pass| table.block(at.x, at.y, pass));
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
            r.mixed |= tally.spread() > 0.0;
            // Errors of stratified points at an edge fall faster than with the root of their number.
            let n = tally.rays.max(1) as f32;
            r.variance += luminance(tally.sent).powi(2) * tally.spread() / (n * n.sqrt().sqrt());
            r.rays += tally.rays;
        };
        for light in self.sources.lights.iter().filter(|l| l.bake != Bake::None) {
            let aim = |p: &SurfacePoint, u| punctual::aim(light, p, wrapped(u + shift));
            let tally = self.punctual(points, more(), &on_surface, aim, volley);
            *(if light.bake == Bake::Full { &mut r.lights } else { &mut r.hidden }) += tally.arrived;
            book(tally, &mut r);
        }
        if let Some(peaks) = &self.sources.peaks {
            let aim = |p: &SurfacePoint, u| peaks.aim(p, wrapped(u + shift));
            let tally = self.punctual(points, more(), &on_surface, aim, volley);
            r.sky_peaks += tally.arrived;
            book(tally, &mut r);
        }
        self.sources.emitters.cut(&Disc::of_texel(footprint, &on_surface(Vec2::splat(0.5))), cut);
        let (near, far) = self.sources.emitters.divide(cut);
        // The same points for all leaves: what their closed forms share between them sums up.
        let mut exact_at = |n: usize| {
            few.clear();
            few.extend(points.iter().take(n).map(|p| on_surface(p.place)));
            self.exact(near, few)
        };
        let (mut exact, mut variance) = exact_at(EXACT_POINTS);
        let all: f32 = exact.iter().map(|e| luminance(*e)).sum();
        if points.len() > EXACT_POINTS && variance.sqrt() > NEAR_NOISE * self.noise * all.max(self.faint) {
            (exact, variance) = exact_at(NEAR_POINTS);
        }
        r.variance += variance;
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
            r.variance += noise * noise;
            r.mixed |= noise > self.noise * luminance(r.emitters).max(self.faint);
            // Its spread is in the noise.
            book(Tally { through: [0.0; 2], ..tally }, &mut r);
        }
        Received { sent, arrived, ..r }
    }

    /// Mean of each leaf's closed form over `points`, and the variance of what they sum up to.
    fn exact(&self, leaves: &[Stratum], points: &[SurfacePoint]) -> (Vec<Vec3>, f32) {
        let n = points.len() as f32;
        let mut at_points = vec![0.0; points.len()];
        let mean = |leaf| {
            let mut sum = Vec3::ZERO;
            for (p, all) in points.iter().zip(&mut at_points) {
                let light = self.sources.emitters.exact(leaf, p);
                sum += light;
                *all += luminance(light);
            }
            sum / n
        };
        let means = leaves.iter().map(mean).collect();
        let all = at_points.iter().sum::<f32>() / n;
        let squares: f32 = at_points.iter().map(|x| (x - all) * (x - all)).sum();
        (means, squares / (n * n * n.sqrt()))
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

    /// Mean over the texel's points of what arrives from a source that is one ray a point; over more if these disagree.
    fn punctual<'p>(
        &self,
        points: &[Point],
        more: impl Iterator<Item = &'p Point>,
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        aim: impl Fn(&SurfacePoint, Vec2) -> Option<Aim>,
        volley: &mut Volley,
    ) -> Tally {
        let take = |point: &Point, volley: &mut Volley| {
            let p = on_surface(point.place);
            if let Some(Aim { direction, distance, irradiance }) = aim(&p, point.extra) {
                // A hair short of the light: a lamp's own surface may stand at it.
                volley.aim(&p, direction, distance * (1.0 - 1e-4), irradiance, irradiance);
            }
        };
        volley.clear();
        points.iter().for_each(|point| take(point, volley));
        let first = volley.fire(self.tracer);
        if first.spread() == 0.0 {
            return first.scaled(1.0 / points.len() as f32);
        }
        volley.clear();
        let mut n = points.len();
        for point in more {
            n += 1;
            take(point, volley);
        }
        first.and(volley.fire(self.tracer)).scaled(1.0 / n as f32)
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

/// Each coordinate's fraction.
fn wrapped(u: Vec2) -> Vec2 {
    u - u.floor()
}
