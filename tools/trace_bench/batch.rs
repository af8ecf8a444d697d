//! The rays of a benchmark, and what can be asked of whoever traces them.

use glam::Vec3;
use luxel::{
    math::hash,
    trace::{self, Tracer},
};
use rayon::prelude::*;
use std::hint::black_box;

/// Rays that a task takes.
const TASK: usize = 1 << 14;
/// Rays that luxel is asked for at once.
const DOZENS: usize = 64;
/// Lamps in the scene, and how many of them light a place.
const LAMPS: u32 = 64;
const NEAR: usize = 8;
/// Rays to one lamp before the next has its turn.
const RUN: usize = 32;

/// A ray, or a segment of one.
#[derive(Clone, Copy)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Where it ends, in lengths of the direction.
    pub t: f32,
    pub key: u32,
    /// Global triangle that it starts on.
    pub from: u32,
}

impl From<trace::Ray> for Ray {
    fn from(r: trace::Ray) -> Self {
        Ray { origin: r.origin, direction: r.direction, t: f32::INFINITY, key: r.key, from: r.from }
    }
}

impl Ray {
    fn whole(&self) -> trace::Ray {
        trace::Ray { origin: self.origin, direction: self.direction, key: self.key, from: self.from }
    }

    fn segment(&self) -> trace::Segment {
        trace::Segment { origin: self.origin, direction: self.direction, t: self.t, from: self.from }
    }
}

/// Distance and global triangle of a hit.
pub type Hit = Option<(f32, u32)>;

/// What is asked of a batch.
#[derive(Clone, Copy)]
pub enum Query {
    Closest,
    Any,
}

/// Someone who traces rays.
pub trait Caster: Sync {
    /// The closest hit on the whole ray.
    fn closest(&self, ray: &Ray) -> Hit;

    /// True if something is on the segment.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Rays that hit: the loop that is timed. One for each implementation, so that calls are inlined where they can be.
    fn hits(&self, rays: &[Ray], query: Query) -> usize {
        match query {
            Query::Closest => rays.iter().filter(|r| self.closest(r).is_some()).count(),
            Query::Any => rays.iter().filter(|r| self.occluded(r)).count(),
        }
    }
}

/// [`Caster::hits`] on all threads.
pub fn hits_on_all_threads(caster: &dyn Caster, rays: &[Ray], query: Query) -> usize {
    rays.par_chunks(TASK).map(|r| caster.hits(r, query)).sum()
}

impl Caster for Tracer<'_> {
    #[inline]
    fn closest(&self, ray: &Ray) -> Hit {
        Tracer::closest(self, &ray.whole()).map(|h| (h.t, h.triangle))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        let mut through = [Vec3::ZERO];
        self.transmittance_of_each(&[ray.segment()], &mut through);
        through[0] == Vec3::ZERO
    }

    /// As a bake asks: some dozens at once, for whole hits with barycentrics, for colours that come through.
    fn hits(&self, rays: &[Ray], query: Query) -> usize {
        let (mut whole, mut segments, mut count) = (Vec::new(), Vec::new(), 0);
        let (mut hits, mut through) = ([None; DOZENS], [Vec3::ZERO; DOZENS]);
        for rays in rays.chunks(DOZENS) {
            match query {
                Query::Closest => {
                    whole.clear();
                    whole.extend(rays.iter().map(Ray::whole));
                    let hits = &mut hits[..rays.len()];
                    self.closest_of_each(&whole, hits);
                    count += black_box(&*hits).iter().flatten().count();
                }
                Query::Any => {
                    segments.clear();
                    segments.extend(rays.iter().map(Ray::segment));
                    let through = &mut through[..rays.len()];
                    self.transmittance_of_each(&segments, through);
                    count += through.iter().filter(|t| **t == Vec3::ZERO).count();
                }
            }
        }
        count
    }
}

/// Shadow rays like those of the direct light: from the origin of each ray towards lamps that hang in the open, at the
/// middle of rays. Runs of neighbours go to the same lamp, one of the few nearest; what faces away is left out.
pub fn towards_lamps(tracer: &Tracer, rays: &[Ray]) -> Vec<Ray> {
    let lamps: Vec<Vec3> = (0..4 * LAMPS)
        .filter_map(|k| {
            let ray = rays.get(keyed(k, 0x6c61_6d70, rays.len()))?;
            Caster::closest(tracer, ray).map(|(t, _)| ray.origin + ray.direction * (0.5 * t))
        })
        .take(LAMPS as usize)
        .collect();
    if lamps.is_empty() {
        return Vec::new();
    }
    let run = |(k, rays): (usize, &[Ray])| {
        let mut near = lamps.clone();
        near.sort_by(|a, b| a.distance_squared(rays[0].origin).total_cmp(&b.distance_squared(rays[0].origin)));
        let lamp = near[k % NEAR.min(near.len())];
        let aim = move |r: &Ray| {
            let v = lamp - r.origin;
            let t = v.length();
            (t > 0.0 && above(tracer, r, v)).then(|| Ray { direction: v / t, t, ..*r })
        };
        rays.iter().filter_map(aim).collect::<Vec<_>>()
    };
    rays.par_chunks(RUN).enumerate().flat_map_iter(run).collect()
}

/// An index below `len`, by chance, the same at every run.
pub fn keyed(k: u32, salt: u32, len: usize) -> usize {
    ((u64::from(hash(k, salt)) * len as u64) >> 32) as usize
}

/// True if `v` points to the side of the face to which the ray goes.
fn above(tracer: &Tracer, ray: &Ray, v: Vec3) -> bool {
    let (instance, local) = tracer.world.locate(ray.from);
    let normal = tracer.world.cross(instance, &tracer.world.corners(instance, local));
    (normal.dot(v) > 0.0) == (normal.dot(ray.direction) > 0.0)
}
