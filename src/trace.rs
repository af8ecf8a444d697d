//! [`Tracer`]: closest hit and transmittance. The only place that knows the BVH crate.
//!
//! Triangle tests are watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013): corners are
//! sheared to the plane across the ray once, and which side of an edge the ray passes is then decided exactly.

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
    /// The tree's units a metre: a power of two, so that scaling rounds nothing.
    scale: f32,
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

/// Beyond the rounding of a point on a triangle: sixteen units in the last place of its largest coordinate, metres.
pub fn rounding(corners: &[Vec3; 3]) -> f32 {
    corners.iter().fold(0.0, |m, c| c.abs().max_element().max(m)) * 16.0 * f32::EPSILON
}

/// Largest coordinate in the tree, at most. obvhs' 8-wide traversal looks for boxes from a distance of 1e-4 on, whatever
/// the scene's size: at this extent that is one unit in the last place.
const EXTENT: f32 = 2048.0;

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
        let scale = if extent > 0.0 { libm::exp2f(libm::floorf(libm::log2f(EXTENT / extent))) } else { 1.0 };
        triangles.iter_mut().for_each(|t| t.corners = t.corners.map(|c| c * scale));
        let bvh = build(&triangles, scale * rounding(&[Vec3::splat(extent); 3]));
        let triangles: Vec<_> = bvh.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Tracer { world, bvh, triangles, scale }
    }

    /// The first surface along a ray. Alpha and transmission let it pass by chance, keyed by `key` and the triangle.
    #[inline]
    pub fn closest(&self, origin: Vec3, direction: Vec3, key: u32) -> Option<Hit> {
        let (shear, ray) = self.ray(origin, direction, f32::INFINITY);
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(ray, &mut hit, |ray, i| {
            let tri = &self.triangles[i];
            let t = shear.distance(&tri.corners);
            if t < ray.tmax && tri.flags & HOLES != 0 && self.passes(tri, &shear, key) { f32::INFINITY } else { t }
        });
        if hit.t == f32::INFINITY {
            return None;
        }
        let tri = &self.triangles[hit.primitive_id as usize];
        let (bary, turned) = shear.barycentrics(&tri.corners);
        Some(Hit { t: hit.t / self.scale, triangle: tri.id, bary, front: turned == (tri.flags & MIRRORED != 0) })
    }

    /// Share of light (rgb) that comes through from `origin` to distance `t` along `direction`.
    #[inline]
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, t: f32) -> Vec3 {
        let (shear, ray) = self.ray(origin, direction, t);
        let mut through = Vec3::ONE;
        self.bvh.ray_traverse_miss(ray, |ray, i| {
            let tri = &self.triangles[i];
            let t = shear.distance(&tri.corners);
            if t < ray.tmax {
                through *= if tri.flags & HOLES == 0 { Vec3::ZERO } else { self.through(tri, &shear) };
            }
            if through == Vec3::ZERO { t } else { f32::INFINITY }
        });
        through
    }

    #[inline]
    fn ray(&self, origin: Vec3, direction: Vec3, t: f32) -> (Shear, Ray) {
        let origin = origin * self.scale;
        // A component of -0 would make the tree's box test and its reciprocal disagree on the side; adding 0 clears it.
        let ray = Ray::new(origin.into(), (direction + 0.0).into(), 0.0, t * self.scale);
        (Shear::new(origin, direction), ray)
    }

    fn through(&self, tri: &Triangle, shear: &Shear) -> Vec3 {
        let (instance, t) = self.world.locate(tri.id);
        self.world.scene.transmittance(self.world.mesh(instance), t, shear.barycentrics(&tri.corners).0)
    }

    #[cold]
    fn passes(&self, tri: &Triangle, shear: &Shear, key: u32) -> bool {
        let share = self.through(tri, shear).element_sum() / 3.0;
        unit_float(hash(key, tri.id)) < share
    }
}

/// A ray as the map that takes it to the third axis.
struct Shear {
    axes: [usize; 3],
    origin: [f32; 3],
    slope: [f32; 3],
}

impl Shear {
    #[inline(always)]
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let z = direction.abs().max_position();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let d = direction.to_array();
        let slope = [d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]];
        let o = origin.to_array();
        Shear { axes, origin: [o[axes[0]], o[axes[1]], o[axes[2]]], slope }
    }

    /// A corner across the ray, and its distance along it.
    #[inline(always)]
    fn corner(&self, p: Vec3) -> [f32; 3] {
        let p = p.to_array();
        let at = |k: usize| p[self.axes[k]] - self.origin[k];
        let (x, y, z) = (at(0), at(1), at(2));
        [x - self.slope[0] * z, y - self.slope[1] * z, self.slope[2] * z]
    }

    /// All three; written out, since `map` over an array is not inlined here, and this is the innermost loop.
    #[inline(always)]
    fn corners(&self, c: &[Vec3; 3]) -> [[f32; 3]; 3] {
        [self.corner(c[0]), self.corner(c[1]), self.corner(c[2])]
    }

    /// Twice the areas that the ray makes with the edges opposite to corners 0, 1 and 2, their signs exact: products of
    /// single-precision numbers are exact in double precision.
    #[inline(always)]
    fn edges(c: &[[f32; 3]; 3]) -> [f64; 3] {
        let area = |p: [f32; 3], q: [f32; 3]| f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0]);
        [area(c[1], c[2]), area(c[2], c[0]), area(c[0], c[1])]
    }

    /// Distance along the ray, infinite if it passes by.
    #[inline(always)]
    fn distance(&self, corners: &[Vec3; 3]) -> f32 {
        let c = self.corners(corners);
        let [u, v, w] = Self::edges(&c);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return f32::INFINITY;
        }
        let t = (u * f64::from(c[0][2]) + v * f64::from(c[1][2]) + w * f64::from(c[2][2])) / (u + v + w);
        // Also false for the NaN of a ray in the triangle's plane.
        if t > 0.0 { t as f32 } else { f32::INFINITY }
    }

    /// Barycentrics (1 - x - y, x, y) of the hit, and whether the corners run clockwise as the ray sees them.
    fn barycentrics(&self, corners: &[Vec3; 3]) -> (Vec2, bool) {
        let [u, v, w] = Self::edges(&self.corners(corners));
        let sum = u + v + w;
        // Shearing along a negative axis mirrors the plane.
        (glam::DVec2::new(v / sum, w / sum).as_vec2(), (sum > 0.0) == (self.slope[2] > 0.0))
    }
}

fn build(triangles: &[Triangle], margin: f32) -> CwBvh {
    if triangles.is_empty() {
        return CwBvh::default();
    }
    build_cwbvh(&boxes(triangles, margin), BvhBuildParams::medium_build(), &mut Duration::default())
}

/// A box for each triangle, wider by a margin that serves twice. It covers the rounding of the box test, or rays would
/// slip through at edges between flat boxes. And it keeps centroids off the scene's maximum planes: obvhs 0.4 sorts one
/// that lies there to the opposite side, which ruins the tree of a room with flat outer walls.
fn boxes(triangles: &[Triangle], margin: f32) -> Vec<Aabb> {
    let of = |t: &Triangle| {
        let [a, b, c] = t.corners.map(Vec3A::from);
        Aabb { min: a.min(b).min(c) - margin, max: a.max(b).max(c) + margin }
    };
    triangles.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        math::Frame,
        scene::{Instance, Material, Mesh, Primitive, Scene},
    };
    use glam::DAffine3;
    use obvhs::bvh2::{Bvh2, builder::build_bvh2};

    /// A closed box around the origin, faces inward, each a grid of `n` x `n` quads; `clutter` random triangles inside.
    fn room(half: Vec3, n: u32, clutter: u32) -> Scene {
        let mut mesh = Mesh::default();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let base = mesh.positions.len() as u32;
                for j in 0..=n {
                    for i in 0..=n {
                        let mut p = Vec3::ZERO;
                        p[axis] = side;
                        p[u] = 2.0 * i as f32 / n as f32 - 1.0;
                        p[v] = 2.0 * j as f32 / n as f32 - 1.0;
                        mesh.positions.push(p * half);
                    }
                }
                for j in 0..n {
                    for i in 0..n {
                        let a = base + j * (n + 1) + i;
                        let [p, q, r, s] = [a, a + 1, a + n + 2, a + n + 1];
                        let quads = if side < 0.0 { [[p, q, r], [p, r, s]] } else { [[p, r, q], [p, s, r]] };
                        mesh.triangles.extend(quads);
                    }
                }
            }
        }
        for k in 0..clutter {
            let f = |i: u32| unit_float(hash(k, i)) * 1.8 - 0.9;
            let c = Vec3::new(f(0), f(1), f(2)) * half;
            let base = mesh.positions.len() as u32;
            mesh.positions.extend((0..3).map(|i| c + Vec3::new(f(3 + i), f(6 + i), f(9 + i)) * half * 0.1));
            mesh.triangles.push([base, base + 1, base + 2]);
        }
        let (vertices, triangles) = (0..mesh.positions.len() as u32, 0..mesh.triangles.len() as u32);
        mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
        mesh.primitives = vec![Primitive { vertices, triangles, ..Primitive::default() }];
        let instance =
            Instance { name: "room".into(), node: 0, mesh: 0, transform: DAffine3::IDENTITY, texels_per_meter: None };
        Scene {
            meshes: vec![mesh],
            instances: vec![instance],
            materials: vec![Material::default()],
            ..Scene::default()
        }
    }

    fn direction(k: u32) -> Vec3 {
        let z = 2.0 * unit_float(hash(k, 77)) - 1.0;
        let angle = std::f32::consts::TAU * unit_float(hash(k, 78));
        let s = (1.0 - z * z).sqrt();
        Vec3::new(s * libm::cosf(angle), s * libm::sinf(angle), z).normalize()
    }

    fn inside(k: u32, half: Vec3) -> Vec3 {
        let f = |i| unit_float(hash(k, i)) * 1.9 - 0.95;
        Vec3::new(f(1), f(2), f(3)) * half
    }

    /// Expected cost of a random ray: surface areas of nodes, leaves weighted by their triangles.
    fn sah(bvh: &Bvh2) -> f32 {
        let cost = |n: &obvhs::bvh2::node::Bvh2Node| {
            n.aabb().half_area() * if n.is_leaf() { n.prim_count as f32 } else { 1.0 }
        };
        bvh.nodes.iter().map(cost).sum::<f32>() / bvh.nodes[0].aabb().half_area()
    }

    #[test]
    fn flat_outer_walls_do_not_ruin_the_tree() {
        let scene = room(Vec3::new(4.0, 1.5, 3.0), 100, 0);
        let tracer = Tracer::new(World::new(&scene));
        let params = BvhBuildParams::medium_build();
        let tree = |margin: f32| {
            sah(&build_bvh2(&boxes(&tracer.triangles, margin * tracer.scale), params, &mut Duration::default()))
        };
        let (cured, plain) = (tree(1e-5), tree(0.0));
        assert!(cured < 0.3 * plain, "expected cost {cured} with the cure, {plain} without");
        assert!(cured < 120.0, "expected cost {cured}");
    }

    #[test]
    fn closest_and_occlusion_agree_with_brute_force() {
        let half = Vec3::new(2.0, 1.0, 3.0);
        let scene = room(half, 3, 400);
        let tracer = Tracer::new(World::new(&scene));
        for k in 0..20_000 {
            let (origin, d) = (inside(k, half), direction(k));
            let shear = Shear::new(origin * tracer.scale, d);
            let brute = tracer.triangles.iter().map(|t| shear.distance(&t.corners)).fold(f32::INFINITY, f32::min);
            let brute = brute / tracer.scale;
            let hit = tracer.closest(origin, d, 0).expect("the room is closed");
            assert_eq!(hit.t, brute, "ray {k}");
            let (a, b) = (tracer.transmittance(origin, d, brute * 1.001), tracer.transmittance(origin, d, brute));
            assert_eq!((a, b), (Vec3::ZERO, Vec3::ONE), "ray {k}");
            let [p, q, r] = tracer.world.corners(0, hit.triangle);
            let at = p + (q - p) * hit.bary.x + (r - p) * hit.bary.y;
            assert!(at.distance(origin + d * hit.t) < 1e-4, "ray {k}: barycentrics lead to {at}");
            let facing = tracer.world.cross(0, &[p, q, r]).dot(d) < 0.0;
            assert_eq!(hit.front, facing, "ray {k}");
        }
    }

    #[test]
    fn hits_close_by_and_along_axes_count() {
        let scene = room(Vec3::ONE, 1, 0);
        let tracer = Tracer::new(World::new(&scene));
        for exponent in 0..22 {
            let gap = libm::exp2f(-(exponent as f32));
            let origin = Vec3::new(1.0 - gap, 0.3, 0.2);
            for d in [Vec3::new(1.0, -0.0, 0.0), Vec3::new(1.0, -0.0, -0.0), Vec3::new(1.0, 0.1, 0.1)] {
                let hit = tracer.closest(origin, d, 0).expect("the room is closed");
                assert!((hit.t - gap).abs() <= 1e-6 * gap, "gap {gap} along {d}: {}", hit.t);
                assert_eq!(tracer.transmittance(origin, d, f32::INFINITY), Vec3::ZERO, "gap {gap} along {d}");
            }
        }
    }

    #[test]
    fn a_closed_mesh_lets_nothing_out() {
        // Rays aimed at shared edges and corners are where a test that is not watertight fails.
        let half = Vec3::new(1.0, 0.7, 1.3);
        let scene = room(half, 7, 0);
        let tracer = Tracer::new(World::new(&scene));
        let positions = &scene.meshes[0].positions;
        for k in 0..100_000u32 {
            let origin = inside(k, half);
            let [a, b] = [4, 5].map(|s| positions[hash(k, s) as usize % positions.len()]);
            let target = match k % 3 {
                0 => origin + direction(k),
                1 => a,
                _ => a + (b - a) * unit_float(hash(k, 6)),
            };
            let d = (target - origin).normalize();
            assert!(tracer.closest(origin, d, 0).is_some(), "ray {k} from {origin} along {d} escapes");
        }
    }

    #[test]
    fn mirrored_instances_keep_their_fronts() {
        let mut scene = room(Vec3::ONE, 1, 0);
        scene.instances[0].transform = DAffine3::from_scale(glam::DVec3::new(-1.0, 2.0, 0.5));
        let tracer = Tracer::new(World::new(&scene));
        for k in 0..100 {
            let frame = Frame::around(direction(k));
            let hit = tracer.closest(Vec3::ZERO, frame.to_world(Vec3::Z), 0).expect("the room is closed");
            assert!(hit.front);
        }
    }
}
