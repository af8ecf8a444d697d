//! Rows by rays: low-discrepancy points over the texel, cosine-distributed directions about the shading normal.
//!
//! A point that is enclosed by other geometry ([`Enclosure`]) leaves the row: a texel partly under a
//! box stands for its open part. A texel enclosed altogether keeps its row and is marked.

use super::{
    Stats,
    rows::{BLOCK, Block, Rows},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{CELLS, Point, PointTable, cell_of, hash, unit_float},
    patches::{Enclosure, Footprint, Patches, Seen, SurfacePoint, seen},
    progress::{Observer, check},
    trace::Tracer,
};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

pub(super) struct Measured {
    pub rows: Rows,
    pub stats: Stats,
}

/// Entries before all backs are known: a texel's front, its back, or a cell of the sky.
const BACK: u32 = 1 << 30;
const SKY: u32 = 1 << 31;

/// Blocks of points that a partly buried texel may use up to reach its number of rays.
const PASSES: usize = 4;
/// Open points that meet backs before the others are taken for open, too.
const TRUST: usize = 8;
/// Draws of a direction above the face before it is mirrored there.
const DRAWS: usize = 16;

/// Measures fronts first; the backs they met next; until no ray meets a new back.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &mut Patches,
    rays: u32,
    observer: &dyn Observer,
) -> Result<Measured> {
    let texels = patches.fronts;
    let shooter = Shooter::new(tracer, coverage, rays);
    let mut wave: Vec<u32> = (0..texels as u32).collect();
    let (mut back, mut backs) = (false, Vec::new());
    let mut rows = Vec::with_capacity(texels);
    let mut blocks: Vec<Block> = Vec::new();
    let mut stats = Stats::default();
    observer.begin("transport", texels as u64);
    while !wave.is_empty() {
        let done: Vec<_> = wave.par_chunks(BLOCK).map(|texels| shooter.block(texels, back, observer)).collect();
        check(observer)?;
        for (block, outcomes) in done {
            blocks.push(block);
            rows.extend(outcomes);
        }
        wave = shooter.take_met(&backs);
        backs.extend_from_slice(&wave);
        patches.add_backs(&wave);
        back = true;
        if !wave.is_empty() {
            observer.begin("transport: backs", wave.len() as u64);
        }
    }
    renumber(&mut blocks, texels as u32, &backs, patches.len() as u32);
    for r in &rows {
        stats.traced += u64::from(r.traced);
        stats.escaped += u64::from(r.escaped);
        stats.dark += u64::from(r.dark);
        stats.lost += u64::from(r.lost);
    }
    patches.validity = rows.iter().map(|r| r.validity).collect();
    patches.buried = rows.iter().map(|r| r.buried).collect();
    Ok(Measured { rows: Rows::new(blocks), stats })
}

/// The rays of the fronts' rows as origin, direction and key: what [`Transport::measure`](super::Transport::measure) shoots first, for benchmarks.
pub fn rays_of_rows(tracer: &Tracer, coverage: &Coverage, rays: u32) -> Vec<(Vec3, Vec3, u32)> {
    let shooter = Shooter::new(tracer, coverage, rays);
    let mut footprint = Footprint::new(&tracer.world, coverage);
    let mut out = Vec::new();
    for texel in 0..coverage.texels.len() as u32 {
        footprint.set(texel as usize);
        let from = shooter.from(texel, false);
        for (k, point) in shooter.table.block(from.at.x, from.at.y, 0).iter().enumerate() {
            let shot = shooter.shot(&footprint, &from, 0, k, point);
            out.push((shot.origin, shot.direction, shot.key));
        }
    }
    out
}

struct Shooter<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    rays: usize,
    table: PointTable,
    enclosure: Enclosure<'a>,
    /// One bit a texel: a ray has met its back.
    met: Vec<AtomicU64>,
}

#[derive(Default)]
struct Outcome {
    validity: f32,
    buried: bool,
    traced: u32,
    escaped: u32,
    dark: u32,
    lost: u32,
}

/// The side of a texel that shoots.
struct From {
    at: UVec2,
    back: bool,
    key: u32,
    /// Cosine and sine of the angle by which its directions are turned.
    turn: Vec2,
}

/// A ray.
struct Shot {
    point: SurfacePoint,
    origin: Vec3,
    direction: Vec3,
    key: u32,
}

/// A ray's end before it is known whether its point is enclosed.
struct Behind {
    point: SurfacePoint,
    seen: Seen,
}

impl<'a> Shooter<'a> {
    fn new(tracer: &'a Tracer<'a>, coverage: &'a Coverage, rays: u32) -> Self {
        Shooter {
            tracer,
            coverage,
            rays: rays as usize,
            table: PointTable::new(rays as usize, 0x7261_7973),
            enclosure: Enclosure::new(tracer),
            met: (0..coverage.texels.len().div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    fn from(&self, texel: u32, back: bool) -> From {
        let key = hash(texel, u32::from(back));
        let angle = std::f32::consts::TAU * unit_float(hash(key, 0x7475_726e));
        let turn = Vec2::new(libm::cosf(angle), libm::sinf(angle));
        From { at: self.coverage.texels[texel as usize].at, back, key, turn }
    }

    #[inline]
    fn shot(&self, footprint: &Footprint, from: &From, pass: usize, k: usize, point: &Point) -> Shot {
        let p = footprint.point(point.place);
        let p = if from.back { p.reversed() } else { p };
        let direction = self.direction(&p, point, from, (pass, k));
        Shot { point: p, origin: p.lifted(), direction, key: hash(from.key, (pass * self.rays + k) as u32) }
    }

    fn block(&self, texels: &[u32], back: bool, observer: &dyn Observer) -> (Block, Vec<Outcome>) {
        let mut block = Block::with_capacity(texels.len() * self.rays);
        if observer.cancelled() {
            return (block, Vec::new());
        }
        let mut footprint = Footprint::new(&self.tracer.world, self.coverage);
        let (mut columns, mut behind) = (Vec::with_capacity(self.rays), Vec::new());
        let outcomes = texels
            .iter()
            .map(|&t| {
                footprint.set(t as usize);
                columns.clear();
                let (outcome, weight) = self.row(&footprint, t, back, &mut columns, &mut behind);
                block.push(&mut columns, weight);
                outcome
            })
            .collect();
        block.shrink();
        observer.advance(texels.len() as u64);
        (block, outcomes)
    }

    /// Fills `columns`; returns the weight of each entry.
    fn row(
        &self,
        footprint: &Footprint,
        texel: u32,
        back: bool,
        columns: &mut Vec<u32>,
        behind: &mut Vec<Behind>,
    ) -> (Outcome, f32) {
        let from = self.from(texel, back);
        let mut o = Outcome { validity: 1.0, ..Outcome::default() };
        let (mut valid, mut enclosed, mut open) = (0, 0, 0);
        for pass in 0..PASSES {
            behind.clear();
            for (k, point) in self.table.block(from.at.x, from.at.y, pass).iter().enumerate().take(self.rays - valid) {
                let shot = self.shot(footprint, &from, pass, k, point);
                o.traced += 1;
                match self.tracer.closest(shot.origin, shot.direction, shot.key) {
                    None => {
                        o.escaped += 1;
                        columns.push(SKY | cell_of(shot.direction));
                        valid += 1;
                    }
                    Some(hit) => {
                        let seen = seen(&self.tracer.world, self.coverage, &hit);
                        if self.enclosure.may_enclose(&hit) {
                            behind.push(Behind { point: shot.point, seen });
                        } else {
                            self.end(seen, columns, &mut o);
                            valid += 1;
                        }
                    }
                }
            }
            let enclosed_all = pass == 0 && behind.len() == self.rays;
            for b in behind.drain(..) {
                // Where backs are those of sheets, the first few points say so; a box hides nearly all that meet backs.
                let sheets = enclosed == 0 && open >= TRUST;
                if enclosed_all || sheets || !self.enclosure.holds(&b.point, from.at, from.turn, &mut enclosed) {
                    self.end(b.seen, columns, &mut o);
                    valid += 1;
                    open += 1;
                }
            }
            if pass == 0 {
                o.buried = enclosed_all || valid == 0;
                o.validity = if o.buried { 1.0 } else { valid as f32 / self.rays as f32 };
            }
            if o.buried || valid >= self.rays {
                break;
            }
        }
        (o, 1.0 / valid.max(1) as f32)
    }

    /// Books the end of a valid ray.
    fn end(&self, seen: Seen, columns: &mut Vec<u32>, o: &mut Outcome) {
        match seen {
            Seen::Front(t) => columns.push(t),
            Seen::Back(t) => {
                self.met[t as usize / 64].fetch_or(1 << (t % 64), Relaxed);
                columns.push(BACK | t);
            }
            Seen::Dark => o.dark += 1,
            Seen::Lost => o.lost += 1,
        }
    }

    /// A direction about the shading normal, drawn again while it lies below the face.
    #[inline]
    fn direction(&self, p: &SurfacePoint, point: &Point, from: &From, (pass, k): (usize, usize)) -> Vec3 {
        let turned = |d: Vec3| p.frame.to_world(from.turn.rotate(d.truncate()).extend(d.z));
        let d = turned(point.direction);
        if p.normal == p.face || d.dot(p.face) > 0.0 {
            return d;
        }
        let again =
            |draw: usize| self.table.block(from.at.x, from.at.y, pass + draw)[(k + draw * 7) % self.rays].direction;
        (1..DRAWS)
            .map(|draw| turned(again(draw)))
            .find(|d| d.dot(p.face) > 0.0)
            .unwrap_or(d - 2.0 * d.dot(p.face) * p.face)
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
