//! [`Tracer`]: closest hit and transmittance.

mod stack;
mod tree;
mod walk;

use crate::{
    math::{
        hash,
        simd::{self, Eight, LANES, Lanes, Level, Task},
        unit_float,
    },
    scene::World,
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use tree::{Bounds, NOTHING, Node, Tree};
use walk::{Candidates, Packet, Triangles, Visit, walk};

/// Rays against a scene.
pub struct Tracer<'s> {
    /// The triangles it sees.
    pub world: World<'s>,
    nodes: Vec<Node>,
    leaves: Vec<Triangles>,
    /// The tree's units a metre: a power of two, so that scaling rounds nothing.
    scale: f32,
    level: Level,
}

/// Where a ray starts and where it goes.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// World position.
    pub origin: Vec3,
    /// Unit direction, or one by whose length distances are counted.
    pub direction: Vec3,
    /// Which chances it has to pass what lets light through.
    pub key: u32,
}

/// A way that light may take.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// World position.
    pub origin: Vec3,
    /// Unit direction, or one by whose length distances are counted.
    pub direction: Vec3,
    /// How far it goes, in lengths of the direction.
    pub t: f32,
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

/// Beyond the rounding of a point on a triangle: sixteen units in the last place of its largest coordinate, metres.
pub fn rounding(corners: &[Vec3; 3]) -> f32 {
    corners.iter().fold(0.0, |m, c| c.abs().max_element().max(m)) * 16.0 * f32::EPSILON
}

/// Largest coordinate in the tree, at most: products of coordinates neither overflow nor vanish.
const EXTENT: f32 = 2048.0;

/// Flags beside a global triangle, of which there are fewer than 2^30: their texels would not fit a machine.
const HOLES: u32 = 1 << 30;
const MIRRORED: u32 = 1 << 31;

struct Triangle {
    corners: [Vec3; 3],
    id: u32,
}

impl<'s> Tracer<'s> {
    /// Builds the tree over all triangles that have area.
    pub fn new(world: World<'s>) -> Self {
        let extent =
            (0..world.scene.instances.len()).into_par_iter().map(|i| extent(&world, i)).reduce(|| 0.0, f32::max);
        let scale = if extent > 0.0 { libm::exp2f(libm::floorf(libm::log2f(EXTENT / extent))) } else { 1.0 };
        let triangles: Vec<Triangle> =
            (0..world.scene.instances.len()).into_par_iter().flat_map_iter(|i| triangles(&world, i, scale)).collect();
        let boxes: Vec<Bounds> = triangles.par_iter().map(|t| Bounds::of(&t.corners)).collect();
        let tree = Tree::new(&boxes, scale * rounding(&[Vec3::splat(extent); 3]));
        let leaves = tree.leaves.par_iter().map(|leaf| Triangles::new(leaf, &triangles)).collect();
        Tracer { world, nodes: tree.nodes, leaves, scale, level: Level::best() }
    }

    /// Bytes held by nodes and triangles.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// Longer than any way within the scene, metres.
    pub fn reach(&self) -> f32 {
        4.0 * EXTENT / self.scale
    }

    /// The first surface along a ray. Alpha and transmission let it pass by chance, keyed by its key and the triangle.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = [None];
        self.closest_of_each(std::slice::from_ref(ray), &mut hit);
        hit[0]
    }

    /// The first surface along each ray, in less time than one by one. Neighbours with like directions take the least.
    pub fn closest_of_each(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "a hit for each ray");
        simd::run(self.level, Closest { tracer: self, rays, hits });
    }

    /// Share of light (rgb) that comes through each segment, likewise.
    pub fn transmittance_of_each(&self, segments: &[Segment], through: &mut [Vec3]) {
        assert_eq!(segments.len(), through.len(), "a share for each segment");
        simd::run(self.level, Through { tracer: self, segments, through });
    }

    #[cold]
    fn through(&self, id: u32, bary: Vec2) -> Vec3 {
        let (instance, t) = self.world.locate(id & !(HOLES | MIRRORED));
        self.world.scene.transmittance(self.world.mesh(instance), t, bary)
    }

    #[cold]
    fn passes(&self, id: u32, bary: Vec2, key: u32) -> bool {
        let share = self.through(id, bary).element_sum() / 3.0;
        unit_float(hash(key, id & !(HOLES | MIRRORED))) < share
    }
}

struct Closest<'a> {
    tracer: &'a Tracer<'a>,
    rays: &'a [Ray],
    /// Nearest so far, distances in the tree's units.
    hits: &'a mut [Option<Hit>],
}

impl Task for Closest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self) {
        let tracer = self.tracer;
        for (rays, hits) in self.rays.chunks(LANES).zip(self.hits.chunks_mut(LANES)) {
            hits.fill(None);
            let ray = |k: usize| (rays[k].origin * tracer.scale, rays[k].direction, f32::INFINITY);
            let mut packet = Packet::new(rays.len(), ray);
            walk::<S, _>(&tracer.nodes, &tracer.leaves, &mut packet, &mut Closest { tracer, rays, hits });
            hits.iter_mut().flatten().for_each(|h| h.t /= tracer.scale);
        }
    }
}

impl Visit for Closest<'_> {
    const ORDERED: bool = true;

    #[inline(always)]
    fn visit(&mut self, ray: usize, leaf: &Triangles, candidates: &Candidates, reach: f32) -> f32 {
        let (mut lanes, mut t) = (candidates.lanes, reach);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(m) = candidates.meet(lane).filter(|m| m.t <= t) else { continue };
            let id = leaf.ids[lane];
            let triangle = id & !(HOLES | MIRRORED);
            // Of two in one place the first, whichever is found first.
            if m.t == t && self.hits[ray].is_some_and(|h| h.triangle < triangle) {
                continue;
            }
            if id & HOLES == 0 || !self.tracer.passes(id, m.bary, self.rays[ray].key) {
                t = m.t;
                let front = m.clockwise == (id & MIRRORED != 0);
                self.hits[ray] = Some(Hit { t, triangle, bary: m.bary, front });
            }
        }
        t
    }
}

struct Through<'a> {
    tracer: &'a Tracer<'a>,
    segments: &'a [Segment],
    through: &'a mut [Vec3],
}

impl Task for Through<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self) {
        let tracer = self.tracer;
        for (segments, through) in self.segments.chunks(LANES).zip(self.through.chunks_mut(LANES)) {
            through.fill(Vec3::ONE);
            let segment = |k: usize| {
                let s = &segments[k];
                (s.origin * tracer.scale, s.direction, s.t * tracer.scale)
            };
            let mut packet = Packet::new(segments.len(), segment);
            walk::<S, _>(&tracer.nodes, &tracer.leaves, &mut packet, &mut Through { tracer, segments, through });
        }
    }
}

impl Visit for Through<'_> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn visit(&mut self, ray: usize, leaf: &Triangles, candidates: &Candidates, reach: f32) -> f32 {
        let mut lanes = candidates.lanes;
        let through = &mut self.through[ray];
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(m) = candidates.meet(lane).filter(|m| m.t < reach) else { continue };
            let id = leaf.ids[lane];
            *through *= if id & HOLES == 0 { Vec3::ZERO } else { self.tracer.through(id, m.bary) };
        }
        if *through == Vec3::ZERO { -1.0 } else { reach }
    }
}

impl Triangles {
    fn new(leaf: &[u32; LANES], triangles: &[Triangle]) -> Self {
        let mut block = Triangles { corners: [[Eight([f32::NAN; LANES]); 3]; 3], ids: [0; LANES] };
        for (lane, &i) in leaf.iter().enumerate().filter(|(_, i)| **i != NOTHING) {
            let t = &triangles[i as usize];
            for (c, p) in t.corners.iter().enumerate() {
                for axis in 0..3 {
                    block.corners[c][axis].0[lane] = p[axis];
                }
            }
            block.ids[lane] = t.id;
        }
        block
    }
}

/// Largest coordinate of an instance.
fn extent(world: &World, instance: usize) -> f32 {
    let corners = (0..world.mesh(instance).triangles.len() as u32).flat_map(|t| world.corners(instance, t));
    corners.fold(0.0, |m, c| m.max(c.abs().max_element()))
}

/// The triangles of an instance that have area, in the tree's units.
fn triangles<'a>(world: &'a World, instance: usize, scale: f32) -> impl Iterator<Item = Triangle> + 'a {
    let (mesh, first) = (world.mesh(instance), world.triangles_of(instance).start);
    let mirrored = if world.scene.instances[instance].mirrored() { MIRRORED } else { 0 };
    mesh.primitives.iter().flat_map(move |p| {
        let holes = if world.scene.materials[p.material as usize].has_holes() { HOLES } else { 0 };
        p.triangles.clone().filter_map(move |t| {
            let corners = world.corners(instance, t);
            let solid = world.cross(instance, &corners) != Vec3::ZERO;
            solid.then(|| Triangle { corners: corners.map(|c| c * scale), id: (first + t) | mirrored | holes })
        })
    })
}

#[cfg(test)]
mod tests;
