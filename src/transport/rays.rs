//! Rows by rays: low-discrepancy points over the texel, cosine-distributed directions about the shading normal.
//!
//! A point that is enclosed by other geometry ([`Enclosure`]) leaves the row: a texel partly under a
//! box stands for its open part. A texel enclosed altogether keeps its row and is marked.
//!
//! A row that is there is kept, and the rays that it lacks join it, through points of their own. Which of these are enclosed
//! is asked anew; a texel is enclosed altogether if it was to all lots of rays, and its row is the last lot's then.

use super::{
    Ends, Eye, Neighbours, Options, Stats, Transport,
    draft::{Behind, Draft},
    receiver::Receiver,
    rows::{BLOCK, Block},
    sight::{End, Numbering, Sight},
    waves::{self, Desk, Done, Method, Task},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{Point, PointTable, hash},
    patches::{Met, Patches, SurfacePoint},
    progress::{Observer, check},
    trace::{NOWHERE, Ray, Tracer},
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// In place of a column while it is not known whether the ray counts.
const OPEN: u32 = u32::MAX - 1;

/// Blocks of points that a partly buried texel may use up to reach its number of rays.
const PASSES: usize = 4;
/// Open points that meet backs before the others are taken for open, too; enclosed ones before they are for enclosed.
const TRUST: usize = 8;
const SURE: usize = 32;
/// Rays of texels so far around, along both axes of the page, tell whether all of a place is enclosed.
const BESIDE: u32 = 2;
/// Rays of a texel that are made at once: the points of its neighbours lie far away in memory.
const TOGETHER: usize = 8;
/// Rays of a block of rows that are not kept, about.
const AT_ONCE: usize = 1 << 16;
/// Draws of a direction above the face before it is mirrored there.
const DRAWS: usize = 16;

/// Measures the receivers of `transport`, beyond the rays that their rows have, and the backs that are met.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &mut Patches,
    transport: &mut Transport,
    options: &Options,
    observer: &dyn Observer,
) -> Result<()> {
    let fronts = transport.receivers.partition_point(|&patch| (patch as usize) < patches.fronts);
    let more = (transport.rays > 0).then(|| Lot::new(transport.rays..options.rays));
    let (first, keep) = (Lot::new(0..options.rays), options.shares(fronts));
    let shooter = Shooter { sight: Sight::new(tracer, coverage), keep, first, more };
    waves::measure(&shooter, patches, transport, options, observer)
}

/// What `of` makes of other rays of some fronts, `part` of a row that grows; `None` where all of them begin enclosed. In place of
/// backs for which no row stands is [`UNKNOWN`](super::UNKNOWN).
pub fn sample<T: Send>(
    neighbours: &Neighbours,
    fronts: &[u32],
    part: Range<u32>,
    of: impl Fn(u32, Ends) -> T + Sync,
    observer: &dyn Observer,
) -> Result<(Vec<Option<T>>, Stats)> {
    let Neighbours { transport, tracer, coverage, patches } = *neighbours;
    let texels: Vec<u32> = fronts.iter().map(|&r| transport.receivers[r as usize]).collect();
    let shooter = Shooter { sight: Sight::new(tracer, coverage), keep: true, first: Lot::new(part), more: None };
    let columns = Numbering::new(patches.fronts as u32, &patches.backs);
    observer.begin("reuse: more rays", texels.len() as u64);
    let run = |desk: &mut _, (texels, fronts): (&[u32], &[u32])| {
        let task = Task { texels: texels.to_vec(), back: false, before: Done::default() };
        let mut done = shooter.block(desk, &task, observer);
        columns.settle(&mut done.block);
        let rows = fronts.iter().zip(&done.buried).enumerate();
        let told = rows.map(|(k, (&r, buried))| (!buried).then(|| of(r, done.block.rays(k)))).collect();
        (told, done.stats)
    };
    // Long rows take much memory.
    let together = (AT_ONCE / shooter.first.rays().max(1)).clamp(1, BLOCK);
    let tasks = texels.par_chunks(together).zip(fronts.par_chunks(together));
    let done: Vec<(Vec<Option<T>>, Stats)> = tasks.map_init(|| Desk::new(&shooter.sight), run).collect();
    check(observer)?;
    let (mut out, mut stats) = (Vec::with_capacity(texels.len()), Stats::default());
    for (some, of_some) in done {
        out.extend(some);
        stats += of_some;
    }
    Ok((out, stats))
}

/// The rays of the fronts' rows, in the order in which [`Transport::measure`](super::Transport::measure) shoots them
/// first: for benchmarks.
pub fn rays_of_rows(tracer: &Tracer, coverage: &Coverage, rays: u32) -> Vec<Ray> {
    let (sight, lot) = (Sight::new(tracer, coverage), Lot::new(0..rays));
    let texels: Vec<u32> = (0..coverage.texels.len() as u32).collect();
    let (mut out, mut desk) = (Vec::with_capacity(texels.len() * lot.rays()), Desk::new(&sight));
    for texels in texels.chunks(BLOCK) {
        let (receivers, _) = desk.clear(&lot.table, texels, false);
        for k in 0..lot.rays() {
            out.extend(receivers.iter().map(|r| lot.ray(r, r.point(k), k)));
        }
    }
    out
}

struct Shooter<'a> {
    sight: Sight<'a>,
    /// Whether the places at which rays of fronts end are kept.
    keep: bool,
    /// Rays of rows that have none yet, and those that the others lack.
    first: Lot,
    more: Option<Lot>,
}

/// Rays of a row that are shot together.
struct Lot {
    /// Which of the row's.
    part: Range<usize>,
    /// Points of every row, by direction.
    table: PointTable,
    /// Points for what they leave open, pass by pass.
    again: [PointTable; PASSES],
}

impl Lot {
    fn new(part: Range<u32>) -> Self {
        let part = part.start as usize..part.end as usize;
        let table = |seed: u32| PointTable::of_directions(part.clone(), seed);
        let again = std::array::from_fn(|pass| table(0x6167_6169 + pass as u32));
        Lot { table: table(0x7261_7973).by_direction(), again, part }
    }

    fn rays(&self) -> usize {
        self.part.len()
    }

    /// The ray through the `k`-th point of the lot.
    #[inline(always)]
    fn ray(&self, receiver: &Receiver, point: &Point, k: usize) -> Ray {
        let key = receiver.key.wrapping_add((PASSES * self.part.start + k) as u32);
        let (cell, at) = receiver.footprint.cell(point.place);
        match &receiver.facets[cell.face as usize] {
            Some(facet) => {
                let direction = facet.frame.to_world(point.direction);
                Ray { origin: cell.position(at) + facet.lift, direction, key, from: facet.triangle }
            }
            None => {
                let p = receiver.surface(point.place);
                p.ray(self.direction(&p, point, receiver, k), key)
            }
        }
    }

    /// A direction about the shading normal, drawn again while it lies below the face.
    #[inline(always)]
    fn direction(&self, p: &SurfacePoint, point: &Point, receiver: &Receiver, k: usize) -> Vec3 {
        let d = receiver.turned(p, point);
        if p.normal == p.face || d.dot(p.face) > 0.0 {
            return d;
        }
        self.direction_above(p, receiver, k)
    }

    #[cold]
    fn direction_above(&self, p: &SurfacePoint, receiver: &Receiver, k: usize) -> Vec3 {
        let (x, y, rays) = (receiver.at.x, receiver.at.y, self.rays());
        let draw = |draw: usize| receiver.turned(p, &self.again[k / rays].block(x, y, draw)[(k + draw * 7) % rays]);
        let above = (1..DRAWS).map(draw).find(|d| d.dot(p.face) > 0.0);
        above.unwrap_or_else(|| {
            let d = draw(0);
            d - 2.0 * d.dot(p.face).min(0.0) * p.face
        })
    }
}

impl Shooter<'_> {
    /// Decides about the points that may be enclosed, and shoots more rays for those that are. `around`: true if rays of its
    /// own or those of texels beside it have told that the place is enclosed; `open`: of the rays before, how many began
    /// outside, if the texel was not enclosed.
    fn complete(
        &self,
        lot: &Lot,
        receiver: &Receiver,
        row: &mut Draft,
        around: bool,
        open: Option<f32>,
        done: &mut Done,
    ) {
        let behind_all = open.is_none() && row.behind.len() == lot.rays();
        // Few rays may all meet the backs of sheets: then one of their points is looked at.
        let enclosed_all = behind_all && (around || self.holds(receiver, &row.behind[..1], &mut 0) == [true]);
        self.settle(receiver, row, around, enclosed_all, &mut done.stats);
        let valid = row.columns.len();
        let buried = enclosed_all || open.is_none() && valid == 0;
        done.buried.push(buried);
        done.validity.push(if buried { 1.0 } else { (open.unwrap_or(0.0) + valid as f32) / lot.part.end as f32 });
        let (mut rays, mut hits) = (Vec::new(), Vec::new());
        for pass in 1..PASSES {
            let valid = row.columns.len();
            if buried || valid >= lot.rays() {
                return;
            }
            let points = lot.again[pass].block(receiver.at.x, receiver.at.y, 0);
            let points = &points[..lot.rays() - valid];
            let key = |k: usize| pass * lot.rays() + k;
            rays.clear();
            rays.extend(points.iter().enumerate().map(|(k, point)| lot.ray(receiver, point, key(k))));
            hits.resize(rays.len(), None);
            self.sight.tracer.closest_of_each(&rays, &mut hits);
            for ((ray, hit), point) in rays.iter().zip(&hits).zip(points) {
                let End { column, spot } = self.sight.end(ray, hit, &mut done.stats);
                match column {
                    Ok(column) => {
                        row.columns.push(column);
                        if self.keep && !receiver.back {
                            row.see(ray.origin, spot);
                        }
                    }
                    Err(seen) => row.behind.push(Behind { place: point.place, seen, spot }),
                }
            }
            self.settle(receiver, row, around, false, &mut done.stats);
        }
    }

    /// Settles what is left of rays that met backs; the row of what is `enclosed_all` together is kept.
    fn settle(&self, receiver: &Receiver, row: &mut Draft, around: bool, enclosed_all: bool, stats: &mut Stats) {
        if around && !enclosed_all {
            row.behind.clear();
            return;
        }
        let mut behind = std::mem::take(&mut row.behind);
        // They come sorted by direction: the first to be looked at are to stand for all.
        let by_chance = |b: &Behind| hash(b.place.x.to_bits(), b.place.y.to_bits());
        let first = behind.len().min(SURE);
        if first < behind.len() {
            behind.select_nth_unstable_by_key(first, by_chance);
        }
        behind[..first].sort_unstable_by_key(by_chance);
        let mut enclosed = Vec::with_capacity(behind.len());
        for until in [TRUST, SURE, usize::MAX] {
            // Where backs are those of sheets, the first few points say so; a box hides nearly all that meet backs.
            let settled = row.enclosed == 0 && row.open >= TRUST || row.open == 0 && row.enclosed >= SURE;
            if enclosed_all || settled {
                break;
            }
            let some = &behind[enclosed.len()..until.min(behind.len())];
            let found = self.holds(receiver, some, &mut row.enclosed);
            row.open += found.iter().filter(|enclosed| !**enclosed).count();
            enclosed.extend(found);
        }
        enclosed.resize(behind.len(), row.open == 0 && row.enclosed > 0);
        for b in behind.iter().zip(enclosed).filter(|(_, enclosed)| !enclosed).map(|(b, _)| b) {
            row.columns.push(self.sight.column(b.seen, stats));
            if self.keep && !receiver.back {
                row.see(receiver.surface(b.place).lifted(), b.spot);
            }
        }
    }

    /// Which points are enclosed.
    fn holds(&self, receiver: &Receiver, behind: &[Behind], found: &mut usize) -> Vec<bool> {
        let points: Vec<SurfacePoint> = behind.iter().map(|b| receiver.surface(b.place)).collect();
        self.sight.holds(receiver, &points, found)
    }
}

impl Method for Shooter<'_> {
    fn sight(&self) -> &Sight<'_> {
        &self.sight
    }

    fn block<'s>(&'s self, desk: &mut Desk<'s>, task: &Task, observer: &dyn Observer) -> Done {
        let Task { texels, back, before } = task;
        let n = texels.len();
        let mut done = Done { block: Block::with_capacity(n * self.first.rays()), ..Done::default() };
        if observer.cancelled() {
            return done;
        }
        let keep = self.keep && !back;
        let lot = self.more.as_ref().filter(|_| !before.block.is_empty()).unwrap_or(&self.first);
        let (receivers, rows) = desk.clear(&lot.table, texels, *back);
        let nowhere = Ray { origin: Vec3::ZERO, direction: Vec3::Z, key: 0, from: NOWHERE };
        let (mut rays, mut hits) = (vec![nowhere; n * TOGETHER], vec![None; n * TOGETHER]);
        let mut ends = Vec::with_capacity(n * lot.rays());
        let known = |i: usize| match before.buried.get(i) {
            Some(true) => Met::enclosed(lot.part.start, before.block.row(i).columns.len()),
            Some(false) => Met::open(lot.part.start),
            None => Met::default(),
        };
        let mut met: Vec<Met> = (0..n).map(known).collect();
        for first in (0..lot.rays()).step_by(TOGETHER) {
            let directions = first..(first + TOGETHER).min(lot.rays());
            let count = n * directions.len();
            for (i, r) in receivers.iter().enumerate() {
                for (ray, k) in rays[i..count].iter_mut().step_by(n).zip(directions.clone()) {
                    *ray = lot.ray(r, r.point(k), k);
                }
            }
            // All receivers shoot into one direction before the next: rays beside each other meet the same boxes.
            self.sight.tracer.closest_of_each(&rays[..count], &mut hits[..count]);
            for (at, (ray, hit)) in rays[..count].iter().zip(&hits).enumerate() {
                let (k, i) = (first + at / n, at % n);
                self.sight.count(&mut met[i], hit);
                let end = self.sight.end(ray, hit, &mut done.stats);
                ends.push(end.column.unwrap_or(OPEN));
                match end.column {
                    Ok(_) if keep => rows[i].see(ray.origin, end.spot),
                    Ok(_) => {}
                    Err(seen) => {
                        rows[i].behind.push(Behind { place: receivers[i].point(k).place, seen, spot: end.spot })
                    }
                }
            }
        }
        let open = |i: usize| before.buried.get(i).is_some_and(|buried| !buried);
        let place = |i: usize| self.sight.coverage.texels[texels[i] as usize];
        let around = |i: usize| {
            let here = place(i);
            let beside = |k: &usize| {
                place(*k).page == here.page && place(*k).at.as_ivec2().chebyshev_distance(here.at.as_ivec2()) <= BESIDE
            };
            met[i].encloses(|| (0..n).filter(beside).map(|k| met[k]).fold(Met::default(), Met::and))
        };
        let around: Vec<bool> = (0..n).map(|i| !rows[i].behind.is_empty() && around(i)).collect();
        for (i, (receiver, row)) in receivers.iter().zip(rows).enumerate() {
            row.columns.extend(ends[i..].iter().step_by(n).filter(|&&column| column != OPEN));
            let open = open(i);
            let of_before = open.then(|| before.validity[i] * lot.part.start as f32);
            self.complete(lot, receiver, row, around[i], of_before, &mut done);
            if open {
                row.join(&before.block, i, before.eyes.get(i).filter(|_| keep));
            }
            row.push_to(&mut done.block);
            if keep {
                let normal = receiver.surface(Vec2::splat(0.5)).normal;
                done.eyes.push(Eye { position: row.origins / row.columns.len().max(1) as f32, normal });
            }
        }
        done.block.shrink();
        observer.advance(texels.len() as u64);
        done
    }
}
