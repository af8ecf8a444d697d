//! [`Tracer`]: closest hit and transmittance. The only place that knows the BVH crate.
//!
//! Triangle tests are watertight: both triangles at an edge compute the same number for it, up to sign (the Plücker
//! test of Embree, after Davidovič et al., "3D Rasterization", 2012).

use crate::{
    math::{hash, unit_float},
    scene::World,
};
use glam::{Vec2, Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    cwbvh::{CwBvh, builder::build_cwbvh},
    ray::{Ray, RayHit},
};
use std::time::Duration;

/// Rays against a scene.
pub struct Tracer<'s> {
    /// The triangles it sees.
    pub world: World<'s>,
    bvh: CwBvh,
    /// In the order of the tree's leaves.
    triangles: Vec<Triangle>,
    any_holes: bool,
    offset: f32,
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance, in lengths of the ray's direction.
    pub t: f32,
    /// Global triangle.
    pub triangle: u32,
    /// Barycentrics (1 - x - y, x, y).
    pub bary: Vec2,
    /// True if the ray comes from the front.
    pub front: bool,
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [Vec3; 3],
    id: u32,
    flags: u32,
}

const HOLES: u32 = 1;
const MIRRORED: u32 = 2;

impl<'s> Tracer<'s> {
    /// Builds the tree over all triangles that have area.
    pub fn new(world: World<'s>) -> Self {
        let mut triangles = Vec::with_capacity(world.len() as usize);
        for (i, instance) in world.scene.instances.iter().enumerate() {
            let mesh = world.mesh(i);
            let mirrored = if instance.mirrored() { MIRRORED } else { 0 };
            for p in &mesh.primitives {
                let holes = if world.scene.materials[p.material as usize].has_holes() { HOLES } else { 0 };
                for t in p.triangles.clone() {
                    let corners = world.corners(i, t);
                    if world.cross(i, &corners) != Vec3::ZERO {
                        let id = world.triangles_of(i).start + t;
                        triangles.push(Triangle { corners, id, flags: mirrored | holes });
                    }
                }
            }
        }
        let extent = triangles.iter().flat_map(|t| t.corners).fold(0f32, |m, c| m.max(c.abs().max_element()));
        let bvh = build(&triangles);
        let leaf = |&i: &u32| triangles.get(i as usize).copied().unwrap_or(Triangle::EMPTY);
        let triangles: Vec<_> = bvh.primitive_indices.iter().map(leaf).collect();
        let any_holes = triangles.iter().any(|t| t.flags & HOLES != 0);
        // Sixteen units in the last place of the largest coordinate: beyond the rounding of a computed surface point.
        Tracer { world, bvh, triangles, any_holes, offset: extent * 16.0 * f32::EPSILON }
    }

    /// How far from a face a ray starts so as not to meet the face itself, metres.
    pub fn offset(&self) -> f32 {
        self.offset
    }

    /// The first surface along a ray. Alpha and transmission let it pass by chance, keyed by `key` and the triangle.
    #[inline]
    pub fn closest(&self, origin: Vec3, direction: Vec3, key: u32) -> Option<Hit> {
        let ray = Ray::new(origin.into(), direction.into(), 0.0, f32::INFINITY);
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(ray, &mut hit, |ray, i| {
            let tri = &self.triangles[i];
            let t = tri.distance(ray);
            if t < ray.tmax && tri.flags & HOLES != 0 && self.passes(tri, ray, key) { f32::INFINITY } else { t }
        });
        if hit.t == f32::INFINITY {
            return None;
        }
        let tri = &self.triangles[hit.primitive_id as usize];
        let (u, v, w) = tri.edges(&ray);
        let sum = u + v + w;
        // u + v + w has the sign of the ray's side; both signs give positive barycentrics.
        let bary = Vec2::new(v / sum, w / sum);
        Some(Hit { t: hit.t, triangle: tri.id, bary, front: (sum > 0.0) != (tri.flags & MIRRORED != 0) })
    }

    /// Share of light (rgb) that comes through from `origin` to distance `t` along `direction`.
    #[inline]
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, t: f32) -> Vec3 {
        let ray = Ray::new(origin.into(), direction.into(), 0.0, t);
        if !self.any_holes {
            let miss = self.bvh.ray_traverse_miss(ray, |ray, i| self.triangles[i].distance(ray));
            return if miss { Vec3::ONE } else { Vec3::ZERO };
        }
        let mut through = Vec3::ONE;
        self.bvh.ray_traverse_miss(ray, |ray, i| {
            let tri = &self.triangles[i];
            let t = tri.distance(ray);
            if t < ray.tmax {
                through *= if tri.flags & HOLES == 0 { Vec3::ZERO } else { self.through(tri, ray) };
            }
            if through == Vec3::ZERO { t } else { f32::INFINITY }
        });
        through
    }

    fn through(&self, tri: &Triangle, ray: &Ray) -> Vec3 {
        let (u, v, w) = tri.edges(ray);
        let sum = u + v + w;
        let (instance, t) = self.world.locate(tri.id);
        self.world.scene.transmittance(self.world.mesh(instance), t, Vec2::new(v / sum, w / sum))
    }

    #[cold]
    fn passes(&self, tri: &Triangle, ray: &Ray, key: u32) -> bool {
        let share = self.through(tri, ray).element_sum() / 3.0;
        unit_float(hash(key, tri.id)) < share
    }
}

impl Triangle {
    /// Never hit: stands for the box that [`build`] adds.
    const EMPTY: Triangle = Triangle { corners: [Vec3::ZERO; 3], id: u32::MAX, flags: 0 };

    /// Signed volumes of the ray with the edges opposite to corners 0, 1 and 2.
    #[inline(always)]
    fn edges(&self, ray: &Ray) -> (f32, f32, f32) {
        let [a, b, c] = self.corners.map(|p| Vec3A::from(p) - ray.origin);
        let (ab, bc, ca) = (a - b, b - c, c - a);
        let w = ab.cross(a + b).dot(ray.direction);
        let u = bc.cross(b + c).dot(ray.direction);
        let v = ca.cross(c + a).dot(ray.direction);
        (u, v, w)
    }

    /// Distance along the ray, infinite if it passes by.
    #[inline(always)]
    fn distance(&self, ray: &Ray) -> f32 {
        let (u, v, w) = self.edges(ray);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        if least < 0.0 && most > 0.0 {
            return f32::INFINITY;
        }
        let [a, b, c] = self.corners.map(Vec3A::from);
        let n = (b - a).cross(c - a);
        let t = (a - ray.origin).dot(n) / ray.direction.dot(n);
        // Also false for the NaN of a ray in the triangle's plane.
        if t > ray.tmin { t } else { f32::INFINITY }
    }
}

fn build(triangles: &[Triangle]) -> CwBvh {
    let mut boxes: Vec<Aabb> = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.corners.map(Vec3A::from);
            Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
        })
        .collect();
    if boxes.is_empty() {
        return CwBvh::default();
    }
    // obvhs 0.4 sorts a centroid on the scene's maximum plane to the opposite side, which ruins the tree of a room with
    // flat outer walls. One empty box beyond the maximum corner keeps every real centroid off that plane.
    let all = boxes.iter().fold(Aabb::empty(), |all, b| all.union(b));
    let beyond = all.max + (all.max - all.min) * 1e-3 + Vec3A::splat(1e-6);
    boxes.push(Aabb { min: beyond, max: beyond });
    build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
}
