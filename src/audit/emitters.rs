//! Emitting triangles in a binary tree: one is chosen on the way down by power over squared distance, and the chance of
//! any is found again on the way up (Conty and Kulla, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting", 2018, without the splitting).

use super::surface::{Place, in_triangle};
use crate::{
    math::luminance,
    scene::{Surface, World},
    trace::rounding,
};
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// All that emits.
pub(crate) struct Emitters {
    lamps: Vec<Lamp>,
    nodes: Vec<Node>,
    /// The leaf of each emitting global triangle.
    leaves: HashMap<u32, u32>,
}

struct Lamp {
    triangle: u32,
    corners: [Vec3; 3],
    normal: Vec3,
    area: f32,
    two_sided: bool,
    /// Mean luminance of exitance times area.
    power: f32,
}

struct Node {
    center: Vec3,
    /// Squared radius.
    radius: f32,
    power: f32,
    parent: u32,
    /// The children of an inner node; the lamp of a leaf, twice.
    children: [u32; 2],
    leaf: bool,
}

/// A point on an emitter as seen from a place.
pub(crate) struct Sample {
    /// Unit direction.
    pub direction: Vec3,
    /// Metres.
    pub distance: f32,
    /// Radiance times the share that rays meet.
    pub radiance: Vec3,
    /// Density by solid angle.
    pub density: f32,
}

/// Points at which an emitter's power is averaged.
const POINTS: u32 = 16;

impl Emitters {
    /// `None` if nothing emits.
    pub fn new(world: &World) -> Option<Self> {
        let mut lamps: Vec<Lamp> = (0..world.scene.instances.len())
            .flat_map(|i| world.mesh(i).primitives.iter().map(move |p| (i, p)))
            .filter(|(_, p)| world.scene.materials[p.material as usize].emits())
            .flat_map(|(i, p)| p.triangles.clone().map(move |t| (i, t)))
            .filter_map(|(i, t)| Lamp::new(world, i, t))
            .collect();
        if lamps.is_empty() {
            return None;
        }
        let mut nodes = Vec::new();
        grow(&mut lamps, 0, 0, &mut nodes);
        let leaf = |(n, node): (usize, &Node)| node.leaf.then(|| (lamps[node.children[0] as usize].triangle, n as u32));
        let leaves = nodes.iter().enumerate().filter_map(leaf).collect();
        Some(Emitters { lamps, nodes, leaves })
    }

    /// A point on an emitter; `None` if it sends nothing to `from`.
    pub fn sample(&self, world: &World, from: &Place, u: Vec2) -> Option<Sample> {
        let (mut node, mut chance, mut x) = (0usize, 1.0, u.x);
        while !self.nodes[node].leaf {
            let [a, b] = self.nodes[node].children;
            let first = self.share(a, b, from.position);
            if x < first {
                (node, chance, x) = (a as usize, chance * first, x / first);
            } else {
                (node, chance, x) = (b as usize, chance * (1.0 - first), (x - first) / (1.0 - first));
            }
        }
        let lamp = &self.lamps[self.nodes[node].children[0] as usize];
        let bary = in_triangle(Vec2::new(x.clamp(0.0, 1.0), u.y));
        let [a, b, c] = lamp.corners;
        let point = a + (b - a) * bary.x + (c - a) * bary.y;
        let side = if (from.position - point).dot(lamp.normal) >= 0.0 { 1.0 } else { -1.0 };
        if side < 0.0 && !lamp.two_sided {
            return None;
        }
        // Just before the emitter, so as not to be hidden by it.
        let way = point + lamp.normal * (side * rounding(&lamp.corners)) - from.lifted();
        let distance = way.length();
        let direction = way / distance;
        let cos = -direction.dot(lamp.normal) * side;
        if !(distance > 0.0 && cos > 0.0 && from.faces(direction)) {
            return None;
        }
        let density = chance * distance * distance / (lamp.area * cos);
        let radiance = shining(&surface(world, lamp.triangle, bary));
        (density.is_finite() && density > 0.0).then_some(Sample { direction, distance, radiance, density })
    }

    /// Density by solid angle with which the point of `triangle` that is met from `from` along `d` would be sampled.
    pub fn density(&self, triangle: u32, from: &Place, d: Vec3, distance: f32) -> f32 {
        let Some(&leaf) = self.leaves.get(&triangle) else { return 0.0 };
        let (mut node, mut chance) = (leaf, 1.0);
        while node != 0 {
            let parent = self.nodes[node as usize].parent;
            let [a, b] = self.nodes[parent as usize].children;
            let first = self.share(a, b, from.position);
            chance *= if node == a { first } else { 1.0 - first };
            node = parent;
        }
        let lamp = &self.lamps[self.nodes[leaf as usize].children[0] as usize];
        chance * distance * distance / (lamp.area * d.dot(lamp.normal).abs().max(1e-12))
    }

    /// The chance of `a` against `b` from a point.
    fn share(&self, a: u32, b: u32, from: Vec3) -> f32 {
        let weight = |n: u32| {
            let n = &self.nodes[n as usize];
            n.power / n.center.distance_squared(from).max(n.radius).max(1e-20)
        };
        let (a, b) = (weight(a), weight(b));
        if a + b > 0.0 { (a / (a + b)).clamp(1e-4, 1.0 - 1e-4) } else { 0.5 }
    }
}

impl Lamp {
    fn new(world: &World, instance: usize, local: u32) -> Option<Self> {
        let triangle = world.triangles_of(instance).start + local;
        let corners = world.corners(instance, local);
        let cross = world.cross(instance, &corners);
        let area = cross.length() * 0.5;
        let mean: f32 = (0..POINTS)
            .map(|i| {
                let [x, y, ..] = sobol_burley::sample_4d(i, 0, 0x6c61_6d70);
                luminance(shining(&surface(world, triangle, in_triangle(Vec2::new(x, y)))))
            })
            .sum::<f32>()
            / POINTS as f32;
        // What looks dark at these points may yet shine between them.
        let whole = luminance(world.material(triangle).emission);
        let (normal, two_sided) = (cross.normalize_or_zero(), world.material(triangle).double_sided);
        let power = mean.max(1e-3 * whole) * area;
        (area > 0.0).then_some(Lamp { triangle, corners, normal, area, two_sided, power })
    }
}

/// Surface properties at a point.
pub(super) fn surface(world: &World, triangle: u32, bary: Vec2) -> Surface {
    let (instance, local) = world.locate(triangle);
    world.scene.surface(world.mesh(instance), local, bary, 0.0)
}

/// Radiance times the chance that a ray meets the surface.
fn shining(s: &Surface) -> Vec3 {
    s.emission * (1.0 - s.transmittance.element_sum() / 3.0)
}

/// The tree over `lamps`, which are `first..` of all; children follow their parent.
fn grow(lamps: &mut [Lamp], first: u32, parent: u32, nodes: &mut Vec<Node>) -> u32 {
    let corners = || lamps.iter().flat_map(|l| l.corners);
    let (low, high) = corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
    let center = (low + high) * 0.5;
    let radius = corners().map(|c| c.distance_squared(center)).fold(0.0, f32::max);
    let power = lamps.iter().map(|l| l.power).sum();
    let me = nodes.len() as u32;
    nodes.push(Node { center, radius, power, parent, children: [first; 2], leaf: lamps.len() == 1 });
    if lamps.len() > 1 {
        let axis = (high - low).max_position();
        let along = |l: &Lamp| l.corners[0][axis] + l.corners[1][axis] + l.corners[2][axis];
        let middle = lamps.len() / 2;
        lamps.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)));
        let (a, b) = lamps.split_at_mut(middle);
        let children = [grow(a, first, me, nodes), grow(b, first + middle as u32, me, nodes)];
        nodes[me as usize].children = children;
    }
    me
}
