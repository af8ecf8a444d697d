//! Rows in closed form: the double integral between two polygons (`contour`), times the share of segments between them
//! that nothing hinders. The slow truth of small scenes: every pair of patches is looked at.
//!
//! Rays find what polygons do not tell: backs, what is enclosed, and how the sky and what is dark share what patches leave
//! of the hemisphere. Where no ray meets either, the row is closed and scaled to sum 1: where patches hide each other,
//! visibility is sampled, and a row may sum to more or less. Elsewhere it is scaled if it sums to more.

use super::{
    FormFactors, Options, Stats, Transport,
    contour::{Polygon, factor},
    rays,
    rows::{BLOCK, Block, Row, Rows},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::{PointTable, hash},
    patches::{Faces, Footprint, Patches, SurfacePoint},
    progress::{Observer, check},
    trace::{NOWHERE, Segment, Tracer},
};
use glam::Vec3;
use rayon::prelude::*;

/// Most patches, as --help says: a minute, or two where all touch.
pub const MOST: usize = 2048;
/// Most polygons inside their texels, all together: each is looked at beside each.
const MOST_POLYGONS: usize = 3 * MOST / 2;
/// Segments between two patches.
const SEGMENTS: usize = 16;
/// Where they end, in their lengths: by rounding the second patch's own surface might lie before its end.
const END: f32 = 1.0 - 1e-5;
/// A row's sum may be off by so much before it is said that it was scaled: single precision, and the outer integral's end.
const SLACK: f64 = 1e-5;

/// Measures the receivers of `transport`, and the backs that rays meet.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &mut Patches,
    transport: &mut Transport,
    options: &Options,
    observer: &dyn Observer,
) -> Result<()> {
    refuse_smooth(tracer, coverage)?;
    rays::measure(tracer, coverage, patches, transport, options, observer)?;
    FormFactors::Analytic.check(patches.len())?;
    let shapes = shapes(tracer, coverage, patches);
    let polygons: usize = shapes.iter().map(|s| s.polygons.len()).sum();
    if polygons > MOST_POLYGONS {
        let most = MOST_POLYGONS;
        let problem = format!("{polygons} pieces of triangles in texels are more than the {most} whose pairs it takes");
        return Err(FormFactors::Analytic.refusal(&problem));
    }
    let pairs = Pairs { tracer, patches, shapes, rays: &transport.rows };
    let receivers = &transport.receivers;
    observer.begin("transport: pairs", receivers.len() as u64);
    let firsts: Vec<usize> = (0..receivers.len()).step_by(BLOCK).collect();
    let done: Vec<_> = firsts
        .into_par_iter()
        .map(|first| {
            let (mut block, mut stats) = (Block::default(), Stats::default());
            for (row, &patch) in (first..).zip(&receivers[first..]).take(BLOCK) {
                if observer.cancelled() {
                    break;
                }
                block.push_weighted(pairs.row(row, patch as usize, &mut stats));
                observer.advance(1);
            }
            (block, stats)
        })
        .collect();
    check(observer)?;
    let mut blocks = Vec::new();
    for (block, of_block) in done {
        blocks.push(block);
        transport.stats += of_block;
    }
    transport.rows = Rows::new(blocks);
    Ok(())
}

/// The integral is that of flat faces.
fn refuse_smooth(tracer: &Tracer, coverage: &Coverage) -> Result<()> {
    let (mut faces, mut footprint) = (Faces::new(&tracer.world, coverage), Footprint::default());
    for texel in 0..coverage.texels.len() {
        footprint.set(texel, &mut faces);
        if let Some(face) = footprint.faces().iter().find(|face| face.flat().is_none()) {
            let instance = tracer.world.locate(face.triangle).0;
            let name = &tracer.world.scene.instances[instance].name;
            return Err(FormFactors::Analytic
                .refusal(&format!("{name} is shaded with smooth normals, and closed forms are those of flat faces")));
        }
    }
    Ok(())
}

/// The surface of a patch.
struct Shape {
    polygons: Vec<Polygon>,
    area: f64,
    /// Beyond the rounding of its corners.
    rounding: f64,
    points: Vec<SurfacePoint>,
}

fn shapes(tracer: &Tracer, coverage: &Coverage, patches: &Patches) -> Vec<Shape> {
    let table = PointTable::of_places(SEGMENTS, 0x7061_6972);
    let shape = |faces: &mut Faces, patch: usize| {
        let (texel, back) = patches.texel(patch);
        let footprint = Footprint::of(texel, faces);
        let polygons: Vec<Polygon> = footprint.polygons().filter_map(|corners| polygon(&corners, back)).collect();
        let points = table.block(coverage.texels[texel].at.x, coverage.texels[texel].at.y, 0).iter();
        let side = |p: SurfacePoint| if back { p.reversed() } else { p };
        let points: Vec<SurfacePoint> = points.map(|p| side(footprint.point(p.place))).collect();
        let rounding = points.iter().map(|p| f64::from(p.offset)).fold(0.0, f64::max);
        let area = polygons.iter().map(|p| 0.5 * doubled(&p.corners).length()).sum();
        Shape { polygons, area, rounding, points }
    };
    let all = (0..patches.len()).into_par_iter();
    all.map_init(|| Faces::new(&tracer.world, coverage), shape).collect()
}

fn polygon(corners: &[Vec3], back: bool) -> Option<Polygon> {
    let mut corners: Vec<_> = corners.iter().map(|c| c.as_dvec3()).collect();
    if back {
        corners.reverse();
    }
    let normal = doubled(&corners).try_normalize()?;
    Some(Polygon { corners, normal })
}

/// Twice the area of a polygon, along its normal.
fn doubled(c: &[glam::DVec3]) -> glam::DVec3 {
    (1..c.len() - 1).map(|k| (c[k] - c[0]).cross(c[k + 1] - c[0])).sum()
}

struct Pairs<'a> {
    tracer: &'a Tracer<'a>,
    patches: &'a Patches,
    shapes: Vec<Shape>,
    rays: &'a Rows,
}

impl Pairs<'_> {
    /// Entries of row `row`, which is that of patch `i`.
    fn row(&self, row: usize, i: usize, stats: &mut Stats) -> Vec<(u32, f32)> {
        let drawn = self.rays.row(row);
        let as_drawn = |row: Row| row.entries().map(|(c, w)| (c, w as f32)).collect();
        let one = &self.shapes[i];
        let area = one.area * f64::from(self.patches.validity[i]);
        let share = |j: usize| {
            let exchanged = exchanged(one, &self.shapes[j]);
            if exchanged > 0.0 { exchanged * self.visibility(i, j, stats) / area } else { 0.0 }
        };
        let mut entries: Vec<(u32, f64)> =
            (0..self.patches.len()).map(share).enumerate().map(|(j, f)| (j as u32, f)).filter(|e| e.1 > 0.0).collect();
        let sum: f64 = entries.iter().map(|e| e.1).sum();
        if self.patches.buried[i] || sum == 0.0 {
            return as_drawn(drawn);
        }
        let [met, sky] = drawn.split(self.patches.len() as u32);
        let elsewhere = 1.0 - met.sum(|_| 1.0);
        let closed = elsewhere < 1e-6;
        if closed || sum > 1.0 {
            stats.rescale(sum, SLACK);
            entries.iter_mut().for_each(|e| e.1 /= sum);
        } else {
            // Of what patches leave, as much for each ray that met none.
            entries.extend(sky.entries().map(|(c, w)| (c, w * (1.0 - sum) / elsewhere)));
        }
        entries.into_iter().map(|(c, w)| (c, w as f32)).collect()
    }

    /// Share of segments between two patches that nothing hinders, of those that leave the front of one for that of the
    /// other, and of the second that rays meet; the same both ways.
    fn visibility(&self, i: usize, j: usize, stats: &mut Stats) -> f64 {
        let (low, high) = (i.min(j), i.max(j));
        let turn = hash(low as u32, high as u32) as usize;
        let mut segments = [Segment { origin: Vec3::ZERO, direction: Vec3::ZERO, t: END, from: NOWHERE }; SEGMENTS];
        let mut count = 0;
        for (k, a) in self.shapes[low].points.iter().enumerate() {
            // An odd factor takes every point once.
            let b = &self.shapes[high].points[(k * 5 + turn) % SEGMENTS];
            let direction = b.lifted() - a.lifted();
            if direction.dot(a.face) > 0.0 && direction.dot(b.face) < 0.0 {
                segments[count] = Segment { origin: a.lifted(), direction, t: END, from: a.triangle };
                count += 1;
            }
        }
        let mut through = [Vec3::ONE; SEGMENTS];
        self.tracer.transmittance_of_each(&segments[..count], &mut through[..count]);
        stats.traced += count as u64;
        // The corners of two that hardly face each other: nothing is said to hinder them.
        let count = if count > 0 { count } else { SEGMENTS };
        let seen: f64 = through[..count].iter().map(|t| f64::from(t.element_sum()) / 3.0).sum();
        let holes = f64::from(self.patches.area[j]) / self.shapes[j].area;
        // Areas without holes are the same but for rounding.
        seen / count as f64 * if holes > 1.0 - 1e-4 { 1.0 } else { holes }
    }
}

/// Area times the share that one sees of the other, unhindered.
fn exchanged(one: &Shape, other: &Shape) -> f64 {
    let rounding = one.rounding.max(other.rounding);
    let pairs = one.polygons.iter().flat_map(|a| other.polygons.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| factor(a, b, rounding)).sum()
}
