//! [`Tracer`]: closest hit and transmittance.

mod forest;
mod place;
mod slab;
mod stack;
mod tree;
mod walk;

use crate::{
    math::{
        hash, luminance,
        simd::{self, LANES, Lanes, Level, Task},
        unit_float,
    },
    scene::{Scene, World},
};
use forest::Forest;
use glam::{Vec2, Vec3};
use stack::Stack;
use walk::{Candidates, Packet, Triangles, Visit, walk};

/// Rays against a scene.
pub struct Tracer<'s> {
    /// The triangles it sees.
    pub world: World<'s>,
    forest: Forest,
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
    /// The global triangle it starts on, which it does not meet again, or [`NOWHERE`].
    pub from: u32,
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
    /// The global triangle it starts on, which is not in its way, or [`NOWHERE`].
    pub from: u32,
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

/// Largest coordinate in the scene's tree, at most: products of coordinates neither overflow nor vanish.
const EXTENT: f32 = 2048.0;

/// Triangles that a [`Tracer`] of the scene stores: of meshes that are placed again and again only one instance's.
pub fn stored(scene: &Scene) -> usize {
    forest::stored(scene, &forest::worth_sharing(scene))
}

/// Flags beside a global triangle, of which there are fewer than 2^30: their texels would not fit a machine.
const HOLES: u32 = 1 << 30;
const MIRRORED: u32 = 1 << 31;
const TRIANGLE: u32 = HOLES - 1;

/// In place of the triangle that a ray starts on: on none.
pub const NOWHERE: u32 = u32::MAX;

impl<'s> Tracer<'s> {
    /// Builds the trees over all triangles that have area.
    pub fn new(world: World<'s>) -> Self {
        let shared = forest::worth_sharing(world.scene);
        Tracer { forest: Forest::new(&world, &shared), world, level: Level::best() }
    }

    /// Bytes held by nodes, triangles and instances.
    pub fn bytes(&self) -> usize {
        self.forest.bytes()
    }

    /// Longer than any way within the scene, metres.
    pub fn reach(&self) -> f32 {
        4.0 * EXTENT / self.forest.scale
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

    /// Whether more than half of the light comes through from one place to the other, of each two.
    pub fn are_open(&self, ways: &[[Vec3; 2]]) -> Vec<bool> {
        let segment = |&[origin, to]: &[Vec3; 2]| Segment { origin, direction: to - origin, t: 1.0, from: NOWHERE };
        let mut through = vec![Vec3::ZERO; ways.len()];
        self.transmittance_of_each(&ways.iter().map(segment).collect::<Vec<_>>(), &mut through);
        through.into_iter().map(|share| luminance(share) > 0.5).collect()
    }

    #[cold]
    fn through(&self, id: u32, bary: Vec2) -> Vec3 {
        let (instance, t) = self.world.locate(id & TRIANGLE);
        self.world.scene.transmittance(self.world.mesh(instance), t, bary)
    }

    #[cold]
    fn passes(&self, id: u32, bary: Vec2, key: u32) -> bool {
        let share = self.through(id, bary).element_sum() / 3.0;
        unit_float(hash(key, id & TRIANGLE)) < share
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
        let (tracer, mut stack) = (self.tracer, Stack::new());
        for (rays, hits) in self.rays.chunks(LANES).zip(self.hits.chunks_mut(LANES)) {
            hits.fill(None);
            let ray = |k: usize| (rays[k].origin * tracer.forest.scale, rays[k].direction, f32::INFINITY, rays[k].from);
            let packet = Packet::new(rays.len(), ray);
            walk::<S, _>(&tracer.forest, &packet, &mut stack, &mut Closest { tracer, rays, hits });
            hits.iter_mut().flatten().for_each(|h| h.t /= tracer.forest.scale);
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
            let triangle = id & TRIANGLE;
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
        let (tracer, mut stack) = (self.tracer, Stack::new());
        for (segments, through) in self.segments.chunks(LANES).zip(self.through.chunks_mut(LANES)) {
            through.fill(Vec3::ONE);
            let segment = |k: usize| {
                let s = &segments[k];
                (s.origin * tracer.forest.scale, s.direction, s.t * tracer.forest.scale, s.from)
            };
            let packet = Packet::new(segments.len(), segment);
            walk::<S, _>(&tracer.forest, &packet, &mut stack, &mut Through { tracer, segments, through });
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

#[cfg(test)]
mod tests;
