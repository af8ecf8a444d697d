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
        // The sum is negative for a ray from the front; both signs give positive barycentrics.
        let bary = Vec2::new(v / sum, w / sum);
        Some(Hit { t: hit.t, triangle: tri.id, bary, front: (sum < 0.0) != (tri.flags & MIRRORED != 0) })
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
    if triangles.is_empty() {
        return CwBvh::default();
    }
    build_cwbvh(&boxes(triangles), BvhBuildParams::medium_build(), &mut Duration::default())
}

/// A box for each triangle, and one more that keeps the tree sound.
///
/// obvhs 0.4 sorts a centroid on the scene's maximum plane to the opposite side, which ruins the tree of a room with
/// flat outer walls. An empty box beyond the maximum corner keeps every real centroid off that plane.
fn boxes(triangles: &[Triangle]) -> Vec<Aabb> {
    let of = |t: &Triangle| {
        let [a, b, c] = t.corners.map(Vec3A::from);
        Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
    };
    let mut boxes: Vec<Aabb> = triangles.iter().map(of).collect();
    let all = boxes.iter().fold(Aabb::empty(), |all, b| all.union(b));
    let beyond = all.max + (all.max - all.min) * 1e-3 + Vec3A::splat(1e-6);
    boxes.push(Aabb { min: beyond, max: beyond });
    boxes
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
        let triangles: Vec<_> = tracer.triangles.iter().filter(|t| t.id != u32::MAX).copied().collect();
        let cured = boxes(&triangles);
        let params = BvhBuildParams::medium_build();
        let tree = |boxes: &[Aabb]| sah(&build_bvh2(boxes, params, &mut Duration::default()));
        let (cured, plain) = (tree(&cured), tree(&cured[..triangles.len()]));
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
            let ray = Ray::new(origin.into(), d.into(), 0.0, f32::INFINITY);
            let brute = tracer.triangles.iter().map(|t| t.distance(&ray)).fold(f32::INFINITY, f32::min);
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
            let frame = Frame::around(direction(k), glam::Vec2::X);
            let hit = tracer.closest(Vec3::ZERO, frame.to_world(Vec3::Z), 0).expect("the room is closed");
            assert!(hit.front);
        }
    }
}
