//! Rows by rays: low-discrepancy points over the texel, cosine-distributed directions about the shading normal.
//!
//! A point that is enclosed by other geometry (every ray from it meets a back) leaves the row: a texel partly under a
//! box stands for its open part. A texel enclosed altogether keeps its row and is marked.

use super::{
    Stats,
    rows::{BLOCK, Block, Rows},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{CELLS, Frame, Point, PointTable, cell_of, hash, unit_float},
    patches::{Footprint, Patches, Seen, SurfacePoint, seen},
    progress::{Observer, check},
    trace::Tracer,
};
use glam::{Vec2, Vec3};
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
/// Rays that decide whether a point is enclosed.
const PROBES: usize = 8;
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
    let shooter = Shooter {
        tracer,
        coverage,
        rays: rays as usize,
        table: PointTable::new(rays as usize, 0x7261_7973),
        probes: PointTable::new(PROBES, 0x7072_6f62),
        met: (0..texels.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
    };
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
        observer.begin("transport: backs", wave.len() as u64);
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

struct Shooter<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    rays: usize,
    table: PointTable,
    probes: PointTable,
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

/// A ray's end before it is known whether its point is enclosed.
struct Behind {
    point: SurfacePoint,
    seen: Seen,
}

impl Shooter<'_> {
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
        let at = self.coverage.texels[texel as usize].at;
        let key = hash(texel, u32::from(back));
        let turn = turn(key);
        let mut o = Outcome { validity: 1.0, ..Outcome::default() };
        let mut valid = 0;
        for pass in 0..PASSES {
            behind.clear();
            for (k, point) in self.table.block(at.x, at.y, pass).iter().enumerate().take(self.rays - valid) {
                let p = footprint.point(point.place);
                let p = if back { p.reversed() } else { p };
                let d = self.direction(&p, point, (at.x, at.y, pass, k), turn);
                o.traced += 1;
                let origin = p.position + p.face * self.tracer.offset();
                match self.tracer.closest(origin, d, hash(key, (pass * self.rays + k) as u32)) {
                    None => {
                        o.escaped += 1;
                        columns.push(SKY | cell_of(d));
                        valid += 1;
                    }
                    Some(hit) => {
                        let seen = seen(&self.tracer.world, self.coverage, &hit);
                        if hit.front {
                            self.end(seen, columns, &mut o);
                            valid += 1;
                        } else {
                            behind.push(Behind { point: p, seen });
                        }
                    }
                }
            }
            let enclosed_all = pass == 0 && behind.len() == self.rays;
            for b in behind.drain(..) {
                if enclosed_all || !self.enclosed(&b.point, (at.x, at.y), turn) {
                    self.end(b.seen, columns, &mut o);
                    valid += 1;
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
    fn direction(&self, p: &SurfacePoint, point: &Point, at: (u32, u32, usize, usize), turn: Vec2) -> Vec3 {
        let frame = Frame::around(p.normal, turn);
        let d = frame.to_world(point.direction);
        if p.normal == p.face || d.dot(p.face) > 0.0 {
            return d;
        }
        let (x, y, pass, k) = at;
        (1..DRAWS)
            .map(|draw| frame.to_world(self.table.block(x, y, pass + draw)[(k + draw * 7) % self.rays].direction))
            .find(|d| d.dot(p.face) > 0.0)
            .unwrap_or(d - 2.0 * d.dot(p.face) * p.face)
    }

    /// True if every probe from the point meets a back: it lies inside other geometry.
    fn enclosed(&self, p: &SurfacePoint, at: (u32, u32), turn: Vec2) -> bool {
        let frame = Frame::around(p.face, turn);
        let origin = p.position + p.face * self.tracer.offset();
        self.probes.block(at.0, at.1, 0).iter().enumerate().all(|(k, probe)| {
            let hit = self.tracer.closest(origin, frame.to_world(probe.direction), k as u32);
            hit.is_some_and(|h| !h.front)
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

/// The angle by which a texel turns its directions, as cosine and sine.
fn turn(key: u32) -> Vec2 {
    let angle = std::f32::consts::TAU * unit_float(hash(key, 0x7475_726e));
    Vec2::new(libm::cosf(angle), libm::sinf(angle))
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
