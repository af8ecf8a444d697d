//! [`Surroundings`]: what a few rays say of a texel's surroundings.

use super::LEVELS;
use crate::{
    atlas::Coverage,
    math::{PointTable, hash, unit_float},
    patches::{Enclosure, Faces, Footprint, SMOOTH, SurfacePoint},
    progress::Observer,
    trace::{Hit, Ray, Tracer},
};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

/// Rays of a texel. It also asks those around it: eighteen rays in all.
const RAYS: usize = 2;
/// Points over which the normal is averaged.
const NORMALS: usize = 4;
/// Texels that are looked from together.
const CHUNK: usize = 64;

/// A texel and its surroundings.
#[derive(Clone, Copy)]
pub(super) struct Surroundings {
    /// A point near its middle, and the unit shading normal there.
    pub center: Vec3,
    pub normal: Vec3,
    /// One over the harmonic mean distance to what is seen, 1/m; 0 under the open sky.
    pub near: f32,
    /// Edge of the largest texel around, metres.
    pub size: f32,
    /// True if it stands for more than one smooth surface, or other geometry encloses part of it.
    pub odd: bool,
}

impl Surroundings {
    /// Texels over which surroundings like these allow for no more `variation`: 1, 2, 4 or 8.
    pub fn stride(&self, variation: f32) -> u8 {
        let fits = |level: &u32| !self.odd && (1u32 << level) as f32 * self.size * self.near <= variation;
        1 << (1..=LEVELS).rev().find(fits).unwrap_or(0)
    }
}

/// Looks from every texel.
pub(super) fn at_all(tracer: &Tracer, coverage: &Coverage, observer: &dyn Observer) -> Vec<Surroundings> {
    let table = PointTable::of_directions(0..RAYS, 0x676c_616e);
    let texels: Vec<u32> = (0..coverage.texels.len() as u32).collect();
    let chunks = texels.par_chunks(CHUNK).map(|texels| {
        if observer.cancelled() {
            return Vec::new();
        }
        observer.advance(texels.len() as u64);
        some(tracer, coverage, &table, texels)
    });
    let alone: Vec<Surroundings> = chunks.collect::<Vec<_>>().concat();
    if observer.cancelled() {
        alone
    } else {
        texels.par_iter().map(|&t| with_neighbours(coverage, &alone, t)).collect()
    }
}

fn some(tracer: &Tracer, coverage: &Coverage, table: &PointTable, texels: &[u32]) -> Vec<Surroundings> {
    let enclosure = Enclosure::new(tracer, coverage);
    let (mut faces, mut footprint) = (Faces::new(&tracer.world, coverage), Footprint::default());
    let mut surroundings = Vec::with_capacity(texels.len());
    let mut points: Vec<SurfacePoint> = Vec::with_capacity(texels.len() * RAYS);
    let mut rays: Vec<Ray> = Vec::with_capacity(texels.len() * RAYS);
    for &texel in texels {
        footprint.set(texel as usize, &mut faces);
        let at = coverage.texels[texel as usize].at;
        let turn = turn(texel);
        let middle = footprint.middle();
        let center = footprint.centroid();
        let size = footprint.area().sqrt();
        let mut odd = footprint.normals().any(|n| n.dot(middle.face) < SMOOTH);
        for point in table.block(at.x, at.y, 0) {
            let p = footprint.point(point.place);
            odd |= p.position.distance(center) > 2.0 * size;
            let direction = p.frame.turned(turn).to_world(point.direction);
            // Beside its use for light, a ray may as well fall on what the face hides.
            let direction = direction - 2.0 * direction.dot(p.face).min(0.0) * p.face;
            rays.push(p.ray(direction, hash(texel, rays.len() as u32)));
            points.push(p);
        }
        surroundings.push(Surroundings { center, normal: normal(&footprint), near: 0.0, size, odd });
    }
    let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
    tracer.closest_of_each(&rays, &mut hits);
    for (k, around) in surroundings.iter_mut().enumerate() {
        let own = k * RAYS..(k + 1) * RAYS;
        around.near = hits[own.clone()].iter().flatten().map(|h| 1.0 / h.t).sum::<f32>() / RAYS as f32;
        let behind = own.filter(|&k| hits[k].is_some_and(|h| enclosure.may_enclose(&h)));
        let behind: Vec<SurfacePoint> = behind.map(|k| points[k]).collect();
        let at = coverage.texels[texels[k] as usize].at;
        around.odd |= enclosure.holds(&behind, at, Vec2::X, &mut 0).contains(&true);
    }
    surroundings
}

/// The mean shading normal.
fn normal(footprint: &Footprint) -> Vec3 {
    let places = (0..NORMALS).map(|k| Vec2::new((k as f32 + 0.5) / NORMALS as f32, 0.5));
    places.map(|u| footprint.point(u).normal).sum::<Vec3>().normalize_or_zero()
}

/// Cosine and sine of the angle by which a texel's directions are turned.
fn turn(texel: u32) -> Vec2 {
    let angle = std::f32::consts::TAU * unit_float(hash(texel, 0x676c_616e));
    Vec2::new(libm::cosf(angle), libm::sinf(angle))
}

/// With the rays of the texels beside it on the page, and the size of the largest: those at borders are cut.
fn with_neighbours(coverage: &Coverage, alone: &[Surroundings], texel: u32) -> Surroundings {
    let at = coverage.texels[texel as usize];
    let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y)));
    let around = around.filter_map(|d| coverage.texel(at.page, at.at.as_ivec2() + d)).map(|t| &alone[t as usize]);
    let (mut near, mut size, mut count) = (0.0, 0f32, 0.0);
    for g in around {
        near += g.near;
        size = size.max(g.size);
        count += 1.0;
    }
    Surroundings { near: near / count, size, ..alone[texel as usize] }
}
