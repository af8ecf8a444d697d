//! Rows by rays: low-discrepancy points over the texel, cosine-distributed directions about the shading normal.
//!
//! A point that is enclosed by other geometry ([`Enclosure`]) leaves the row: a texel partly under a
//! box stands for its open part. A texel enclosed altogether keeps its row and is marked.

use super::{
    Eye, Options, REMEDY, Stats,
    draft::{Behind, Draft},
    receiver::Receiver,
    rows::{BLOCK, Block, DARK, Rows},
};
use crate::{
    atlas::Coverage,
    error,
    math::{CELLS, Point, PointTable, cell_of},
    memory,
    patches::{Enclosure, Patches, Seen, SurfacePoint, seen},
    progress::{Observer, check},
    trace::{Hit, Ray, Tracer},
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

pub(super) struct Measured {
    pub rows: Rows,
    pub eyes: Vec<Eye>,
    pub stats: Stats,
}

/// Entries before all backs are known: a texel's front, its back, or a cell of the sky.
const BACK: u32 = 1 << 30;
const SKY: u32 = 1 << 31;
/// In place of a column while it is not known whether the ray counts.
const OPEN: u32 = u32::MAX - 1;

/// Blocks of points that a partly buried texel may use up to reach its number of rays.
const PASSES: usize = 4;
/// Rays that escape end at this multiple of the longest way within the scene: for all texels in the same direction.
const FAR: f32 = 64.0;
/// Open points that meet backs before the others are taken for open, too.
const TRUST: usize = 8;
/// Fewer rays than this, all of which meet backs, do not yet say that all of the texel is enclosed.
const FEW: usize = 32;
/// Draws of a direction above the face before it is mirrored there.
const DRAWS: usize = 16;

/// Measures the fronts that are `receivers` first; the backs they met next; until no ray meets a new back.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &mut Patches,
    receivers: &[u32],
    options: &Options,
    observer: &dyn Observer,
) -> error::Result<Measured> {
    let texels = patches.fronts;
    let shooter = Shooter::new(tracer, coverage, options, options.shares(receivers.len()));
    let mut wave = receivers.to_vec();
    let (mut back, mut backs) = (false, Vec::new());
    let (mut validity, mut buried) = (Vec::with_capacity(wave.len()), Vec::with_capacity(wave.len()));
    let (mut blocks, mut eyes) = (Vec::new(), Vec::new());
    let mut stats = Stats::default();
    observer.begin("transport", wave.len() as u64);
    while !wave.is_empty() {
        let blocks_of = wave.par_chunks(BLOCK);
        let done: Vec<_> =
            blocks_of.map_init(Desk::default, |desk, texels| shooter.block(desk, texels, back, observer)).collect();
        check(observer)?;
        for done in done {
            blocks.push(done.block);
            eyes.extend(done.eyes);
            validity.extend(done.validity);
            buried.extend(done.buried);
            stats += done.stats;
        }
        wave = shooter.take_met(&backs);
        backs.extend_from_slice(&wave);
        patches.add_backs(&wave);
        back = true;
        if !wave.is_empty() {
            // Nobody knew how many backs would be met.
            memory::fits((4 * u64::from(options.rays) * wave.len() as u64) >> 20, memory::free_mb(), REMEDY)?;
            observer.begin("transport: backs", wave.len() as u64);
        }
    }
    renumber(&mut blocks, texels as u32, &backs, patches.len() as u32);
    let measured = receivers.iter().copied().chain(texels as u32..patches.len() as u32);
    for ((patch, validity), buried) in measured.zip(validity).zip(buried) {
        patches.validity[patch as usize] = validity;
        patches.buried[patch as usize] = buried;
    }
    Ok(Measured { rows: Rows::new(blocks), eyes, stats })
}

/// The rays of the fronts' rows, in the order in which [`Transport::measure`](super::Transport::measure) shoots them
/// first: for benchmarks.
pub fn rays_of_rows(tracer: &Tracer, coverage: &Coverage, rays: u32) -> Vec<Ray> {
    let shooter = Shooter::new(tracer, coverage, &Options::of(rays), false);
    let texels: Vec<u32> = (0..coverage.texels.len() as u32).collect();
    let (mut out, mut desk) = (Vec::with_capacity(texels.len() * shooter.rays), Desk::default());
    for texels in texels.chunks(BLOCK) {
        let (receivers, _) = desk.clear(&shooter, texels, false);
        for k in 0..shooter.rays {
            out.extend(receivers.iter().map(|r| shooter.ray(r, r.point(k), k)));
        }
    }
    out
}

struct Shooter<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    rays: usize,
    /// Whether the places at which rays of fronts end are kept.
    keep: bool,
    /// Where rays that escape end.
    far: f32,
    /// Points of every row, by direction.
    table: PointTable,
    /// Points for what they leave open.
    again: PointTable,
    enclosure: Enclosure<'a>,
    /// One bit a texel: a ray has met its back.
    met: Vec<AtomicU64>,
}

/// The end of a ray.
struct End {
    /// The column that it met, or what it saw if its point may be enclosed.
    column: Result<u32, Seen>,
    spot: Vec3,
}

/// Receivers whose rows are measured.
#[derive(Default)]
struct Done {
    block: Block,
    eyes: Vec<Eye>,
    validity: Vec<f32>,
    buried: Vec<bool>,
    stats: Stats,
}

/// Where a block is measured: its allocations serve one block after the other.
#[derive(Default)]
struct Desk<'a> {
    receivers: Vec<Receiver<'a>>,
    rows: Vec<Draft>,
}

impl<'a> Shooter<'a> {
    fn new(tracer: &'a Tracer<'a>, coverage: &'a Coverage, options: &Options, keep: bool) -> Self {
        let rays = options.rays;
        Shooter {
            tracer,
            coverage,
            rays: rays as usize,
            keep,
            far: FAR * tracer.reach(),
            table: PointTable::new(rays as usize, 0x7261_7973).by_direction(),
            again: PointTable::new(rays as usize, 0x6167_6169),
            enclosure: Enclosure::new(tracer, coverage),
            met: (0..coverage.texels.len().div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    #[inline(always)]
    fn ray(&self, receiver: &Receiver, point: &Point, k: usize) -> Ray {
        let key = receiver.key.wrapping_add(k as u32);
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

    fn block<'s>(&'s self, desk: &mut Desk<'s>, texels: &[u32], back: bool, observer: &dyn Observer) -> Done {
        let mut done = Done { block: Block::with_capacity(texels.len() * self.rays), ..Done::default() };
        if observer.cancelled() {
            return done;
        }
        let keep = self.keep && !back;
        let (receivers, rows) = desk.clear(self, texels, back);
        let (mut rays, mut hits) = (Vec::with_capacity(texels.len()), vec![None; texels.len()]);
        let mut ends = Vec::with_capacity(texels.len() * self.rays);
        // All receivers shoot into one direction before the next: rays beside each other meet the same boxes.
        for k in 0..self.rays {
            rays.clear();
            rays.extend(receivers.iter().map(|r| self.ray(r, r.point(k), k)));
            self.tracer.closest_of_each(&rays, &mut hits);
            for (i, (ray, hit)) in rays.iter().zip(&hits).enumerate() {
                let end = self.end(ray, hit, &mut done.stats);
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
        for (i, (receiver, row)) in receivers.iter().zip(rows).enumerate() {
            row.columns.extend(ends[i..].iter().step_by(texels.len()).filter(|&&column| column != OPEN));
            self.complete(receiver, row, &mut done);
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

    /// The column that a ray has met, or what it has seen if its point may be enclosed.
    #[inline(always)]
    fn end(&self, ray: &Ray, hit: &Option<Hit>, stats: &mut Stats) -> End {
        stats.traced += 1;
        let Some(hit) = hit else {
            stats.escaped += 1;
            let spot = ray.origin + ray.direction * self.far;
            return End { column: Ok(SKY | cell_of(ray.direction)), spot };
        };
        let seen = seen(self.coverage, hit);
        let column = if self.enclosure.may_enclose(hit) { Err(seen) } else { Ok(self.column(seen, stats)) };
        End { column, spot: ray.origin + ray.direction * hit.t }
    }

    #[inline(always)]
    fn column(&self, seen: Seen, stats: &mut Stats) -> u32 {
        match seen {
            Seen::Front(t) => t,
            Seen::Back(t) => {
                self.met[t as usize / 64].fetch_or(1 << (t % 64), Relaxed);
                BACK | t
            }
            Seen::Dark => {
                stats.dark += 1;
                DARK
            }
            Seen::Lost => {
                stats.lost += 1;
                DARK
            }
        }
    }

    /// Decides about the points that may be enclosed, and shoots more rays for those that are.
    fn complete(&self, receiver: &Receiver, row: &mut Draft, done: &mut Done) {
        // Few rays may all meet the backs of sheets: then one of their points is looked at.
        let some = if self.rays < FEW { &row.behind[..row.behind.len().min(1)] } else { &[] };
        let enclosed_all = row.behind.len() == self.rays && self.holds(receiver, some, &mut 0).iter().all(|e| *e);
        self.decide(receiver, row, enclosed_all, &mut done.stats);
        let valid = row.columns.len();
        let buried = enclosed_all || valid == 0;
        done.buried.push(buried);
        done.validity.push(if buried { 1.0 } else { valid as f32 / self.rays as f32 });
        let (mut rays, mut hits) = (Vec::new(), Vec::new());
        for pass in 1..PASSES {
            let valid = row.columns.len();
            if buried || valid >= self.rays {
                return;
            }
            let points = self.again.block(receiver.at.x, receiver.at.y, pass);
            let points = &points[..self.rays - valid];
            let key = |k: usize| pass * self.rays + k;
            rays.clear();
            rays.extend(points.iter().enumerate().map(|(k, point)| self.ray(receiver, point, key(k))));
            hits.resize(rays.len(), None);
            self.tracer.closest_of_each(&rays, &mut hits);
            for ((ray, hit), point) in rays.iter().zip(&hits).zip(points) {
                let End { column, spot } = self.end(ray, hit, &mut done.stats);
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
            self.decide(receiver, row, false, &mut done.stats);
        }
    }

    /// Settles what is left of rays that met backs.
    fn decide(&self, receiver: &Receiver, row: &mut Draft, enclosed_all: bool, stats: &mut Stats) {
        let behind = std::mem::take(&mut row.behind);
        // Where backs are those of sheets, the first few points say so; a box hides nearly all that meet backs.
        let few = if enclosed_all { 0 } else { behind.len().min(TRUST.saturating_sub(row.open)) };
        let mut enclosed = self.holds(receiver, &behind[..few], &mut row.enclosed);
        if row.enclosed > 0 {
            enclosed.extend(self.holds(receiver, &behind[few..], &mut row.enclosed));
        }
        enclosed.resize(behind.len(), false);
        for b in behind.iter().zip(enclosed).filter(|(_, enclosed)| !enclosed).map(|(b, _)| b) {
            row.open += 1;
            row.columns.push(self.column(b.seen, stats));
            if self.keep && !receiver.back {
                row.see(receiver.surface(b.place).lifted(), b.spot);
            }
        }
    }

    /// Which points are enclosed.
    fn holds(&self, receiver: &Receiver, behind: &[Behind], found: &mut usize) -> Vec<bool> {
        let points: Vec<SurfacePoint> = behind.iter().map(|b| receiver.surface(b.place)).collect();
        self.enclosure.holds(&points, receiver.at, receiver.turn, found)
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
        let (x, y, rays) = (receiver.at.x, receiver.at.y, self.rays);
        let draw = |draw: usize| receiver.turned(p, &self.again.block(x, y, k / rays + draw)[(k + draw * 7) % rays]);
        let above = (1..DRAWS).map(draw).find(|d| d.dot(p.face) > 0.0);
        above.unwrap_or_else(|| {
            let d = draw(0);
            d - 2.0 * d.dot(p.face).min(0.0) * p.face
        })
    }

    /// Texels whose backs were met and are not in `known`, ascending.
    fn take_met(&self, known: &[u32]) -> Vec<u32> {
        let known: std::collections::HashSet<u32> = known.iter().copied().collect();
        let bits = self.met.iter().enumerate().flat_map(|(w, bits)| {
            let bits = bits.load(Relaxed);
            (0..64u32).filter(move |b| bits >> b & 1 == 1).map(move |b| w as u32 * 64 + b)
        });
        bits.filter(|t| !known.contains(t)).collect()
    }
}

impl<'a> Desk<'a> {
    /// The receivers at `texels`, and a row for each that has met nothing yet.
    fn clear(&mut self, shooter: &'a Shooter, texels: &[u32], back: bool) -> (&[Receiver<'a>], &mut [Draft]) {
        let receiver = || Receiver::new(shooter.tracer, shooter.coverage);
        self.receivers.resize_with(self.receivers.len().max(texels.len()), receiver);
        self.rows.resize_with(self.receivers.len(), Draft::default);
        let (receivers, rows) = (&mut self.receivers[..texels.len()], &mut self.rows[..texels.len()]);
        receivers.iter_mut().zip(texels).for_each(|(r, &texel)| r.set(texel, back, &shooter.table));
        rows.iter_mut().for_each(Draft::clear);
        (receivers, rows)
    }
}

/// Gives backs and cells of the sky their columns: fronts, backs in order, then the sky.
fn renumber(blocks: &mut [Block], texels: u32, backs: &[u32], sky: u32) {
    let mut column_of = vec![0u32; if backs.is_empty() { 0 } else { texels as usize }];
    for (k, &t) in backs.iter().enumerate() {
        column_of[t as usize] = texels + k as u32;
    }
    blocks.par_iter_mut().for_each(|block| {
        for c in block.columns_mut() {
            if *c & SKY != 0 {
                debug_assert!(*c & !SKY < CELLS);
                *c = sky + (*c & !SKY);
            } else if *c & BACK != 0 {
                *c = column_of[(*c & !BACK) as usize];
            }
        }
    });
}
