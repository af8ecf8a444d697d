//! Rays through a [`Forest`]: nearest boxes first, eight boxes or eight triangles at a time.
//!
//! Triangle tests are watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013): corners are
//! sheared to the plane across the ray; a difference of two rounded products has the exact sign or is zero, and what passes
//! is looked at again in double precision.

use super::{
    TRIANGLE,
    forest::Forest,
    place::Place,
    slab::{Slab, inverses},
    stack::Stack,
    tree::{LEAF, Node, PLACE},
};
use crate::math::simd::{Eight, LANES, Lanes};
use glam::{Vec2, Vec3};

/// Triangles of one leaf, at most eight; lanes without one hold NaN, which no ray meets.
#[derive(Clone)]
#[repr(C, align(32))]
pub struct Triangles {
    /// x, y, z of each corner.
    pub corners: [[Eight; 3]; 3],
    /// Global triangles, and flags.
    pub ids: [u32; LANES],
}

/// A ray as tests of triangles want it.
#[derive(Clone, Copy)]
pub struct Sheared {
    origin: [f32; 3],
    direction: Vec3,
    /// The two axes across the ray and the longest along it.
    axes: [usize; 3],
    /// Shear across the ray, and one over the longest component.
    slope: [f32; 3],
}

/// Triangles of a leaf that a ray seems to meet, as far as single precision can tell: those it meets are among them.
pub struct Candidates {
    /// Lanes, one bit each.
    pub lanes: u32,
    /// Across the ray, and unscaled along it, of each corner.
    corners: [[Eight; 3]; 3],
    scale: f32,
}

/// Where a ray meets a triangle.
pub struct Meeting {
    /// Distance along the ray, in the tree's units.
    pub t: f32,
    /// Barycentrics (1 - x - y, x, y).
    pub bary: Vec2,
    /// True if the corners run clockwise as the ray sees them.
    pub clockwise: bool,
}

impl Candidates {
    /// In double precision, in which the areas' products are exact: single precision would put hits on slivers before the
    /// start of a ray that leaves their plane, and meet triangles seen edge-on outside them.
    #[inline(always)]
    pub fn meet(&self, lane: usize) -> Option<Meeting> {
        let x = |c: usize| f64::from(self.corners[c][0].0[lane]);
        let y = |c: usize| f64::from(self.corners[c][1].0[lane]);
        let z = |c: usize| f64::from(self.corners[c][2].0[lane]);
        let u = x(1) * y(2) - y(1) * x(2);
        let v = x(2) * y(0) - y(2) * x(0);
        let w = x(0) * y(1) - y(0) * x(1);
        let part = 1.0 / (u + v + w);
        let t = ((u * z(0) + v * z(1) + w * z(2)) * part) as f32 * self.scale;
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        // Also false for the NaN of a ray in the triangle's plane.
        let ahead = t > 0.0;
        let bary = Vec2::new((v * part) as f32, (w * part) as f32);
        // Shearing along a negative axis mirrors the plane.
        (inside && ahead).then_some(Meeting { t, bary, clockwise: (part > 0.0) == (self.scale > 0.0) })
    }
}

impl Sheared {
    /// Of no ray.
    const NONE: Sheared = Sheared { origin: [0.0; 3], direction: Vec3::ZERO, axes: [0; 3], slope: [0.0; 3] };

    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3, inverse: Vec3) -> Self {
        let (d, a) = (direction.to_array(), direction.abs());
        let z = if a.y > a.x { 1 } else { 0 };
        let z = if a.z > a.x.max(a.y) { 2 } else { z };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let along = inverse[z];
        Sheared { origin: origin.to_array(), direction, axes, slope: [d[axes[0]] * along, d[axes[1]] * along, along] }
    }

    /// The triangles of a leaf that the line of the ray seems to meet, without the one it starts on: of those behind its
    /// start there are few others.
    #[inline(always)]
    fn triangles<S: Lanes>(&self, leaf: &Triangles, from: u32) -> Option<Candidates> {
        let a = self.corner::<S>(&leaf.corners[0]);
        let b = self.corner::<S>(&leaf.corners[1]);
        let c = self.corner::<S>(&leaf.corners[2]);
        let (u, v, w) = (area(b, c), area(c, a), area(a, b));
        let zero = S::splat(0.0);
        let lanes = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
        let lanes = lanes & !S::equal(&leaf.ids, TRIANGLE, from);
        if lanes == 0 {
            return None;
        }
        let corners = [stored(a), stored(b), stored(c)];
        Some(Candidates { lanes, corners, scale: self.slope[2] })
    }

    /// Eight corners across the ray and, unscaled, along it.
    #[inline(always)]
    fn corner<S: Lanes>(&self, p: &[Eight; 3]) -> (S, S, S) {
        let [x, y, z] = self.axes;
        let z = S::load(&p[z]).sub(S::splat(self.origin[z]));
        let x = S::load(&p[x]).sub(S::splat(self.origin[x])).sub(S::splat(self.slope[0]).mul(z));
        let y = S::load(&p[y]).sub(S::splat(self.origin[y])).sub(S::splat(self.slope[1]).mul(z));
        (x, y, z)
    }
}

#[inline(always)]
fn stored<S: Lanes>(p: (S, S, S)) -> [Eight; 3] {
    [p.0.store(), p.1.store(), p.2.store()]
}

/// Twice the signed area between the ray and two corners.
#[inline(always)]
fn area<S: Lanes>(p: (S, S, S), q: (S, S, S)) -> S {
    p.0.mul(q.1).sub(p.1.mul(q.0))
}

/// Rays that walk together, as many as a vector has lanes.
pub struct Packet {
    rays: [Sheared; LANES],
    slabs: [Slab; LANES],
    /// How far each still reaches; negative where there is none, or none any more.
    reach: Eight,
    /// The triangle that each starts on.
    from: [u32; LANES],
}

impl Packet {
    /// At most [`LANES`] rays, at least one: origin, direction, how far each reaches, the triangle it starts on.
    #[inline(always)]
    pub fn new(len: usize, ray: impl Fn(usize) -> (Vec3, Vec3, f32, u32)) -> Self {
        let none = Eight([-1.0; LANES]);
        let mut packet =
            Packet { rays: [Sheared::NONE; LANES], slabs: [Slab::NONE; LANES], reach: none, from: [0; LANES] };
        // A plain loop: a closure would not be compiled for the level.
        for k in 0..len {
            let (origin, direction, t, triangle) = ray(k);
            let inverse = inverses(direction);
            packet.rays[k] = Sheared::new(origin, direction, inverse);
            packet.slabs[k] = Slab::new(origin, inverse);
            (packet.reach.0[k], packet.from[k]) = (t, triangle);
        }
        packet
    }
}

/// What is done in a leaf.
pub trait Visit {
    /// Whether near leaves must come before far ones.
    const ORDERED: bool;

    /// Given the triangles of a leaf, those that a ray of the packet seems to meet and how far it reaches; returns how far
    /// it still reaches, less than zero ends it.
    fn visit(&mut self, ray: usize, leaf: &Triangles, candidates: &Candidates, reach: f32) -> f32;
}

/// Visits the leaves that rays meet before their reach. Those of like rays are mostly the same, and so are the decisions
/// on the way, which cost more than the arithmetic.
#[inline(always)]
pub fn walk<S: Lanes, V: Visit>(forest: &Forest, packet: &Packet, stack: &mut Stack, visitor: &mut V) {
    // Where there are no places, nothing is lost by asking for them.
    if forest.places.is_empty() {
        walk_among::<S, V, false>(forest, packet, stack, visitor);
    } else {
        walk_among::<S, V, true>(forest, packet, stack, visitor);
    }
}

#[inline(always)]
fn walk_among<S: Lanes, V: Visit, const PLACES: bool>(
    forest: &Forest,
    packet: &Packet,
    stack: &mut Stack,
    visitor: &mut V,
) {
    let (mut place, mut slabs): (Option<&Place>, _) = (None, &packet.slabs);
    let mut inner = if PLACES { [Slab::NONE; LANES] } else { packet.slabs };
    // In registers for all rays, and in memory for each: no load waits for a store of another width.
    let (mut reach, mut reaches) = (S::load(&packet.reach), packet.reach);
    let mut next = Step::new(0.0, u32::MAX, forest.root);
    loop {
        // Without those that have met something nearer since.
        let active = next.rays() & S::splat(next.enter()).le(reach);
        let child = next.child();
        if active == 0 {
        } else if child & LEAF != 0 {
            let mut placed = None;
            let leaf = placed_leaf::<S>(forest, child, place.filter(|_| PLACES), &mut placed);
            for r in lanes(active) {
                if let Some(candidates) = packet.rays[r].triangles::<S>(leaf, packet.from[r]) {
                    let t = visitor.visit(r, leaf, &candidates, reaches.0[r]);
                    (reach, reaches.0[r]) = (reach.with(r, t), t);
                }
            }
        } else if PLACES && child == WORLD {
            (place, slabs) = (None, &packet.slabs);
        } else if PLACES && child & PLACE != 0 {
            let p = &forest.places[(child & !PLACE) as usize];
            for r in lanes(active) {
                inner[r] = p.slab(packet.rays[r].origin.into(), packet.rays[r].direction);
            }
            (place, slabs) = (Some(p), &inner);
            // What lies below on the stack is not in this place.
            stack.reserve();
            stack.push(Step::new(0.0, u32::MAX, WORLD).0);
            next = Step::new(next.enter(), active, p.root);
            continue;
        } else if active.is_power_of_two() {
            // A ray that is alone stays so all the way down, and half of all visits are those of such rays.
            let r = active.trailing_zeros() as usize;
            let (ray, slab, mut t) = (&packet.rays[r], slabs[r], reaches.0[r]);
            let left = loop {
                let child = next.child();
                if child & LEAF != 0 {
                    let mut placed = None;
                    let leaf = placed_leaf::<S>(forest, child, place.filter(|_| PLACES), &mut placed);
                    if let Some(candidates) = ray.triangles::<S>(leaf, packet.from[r]) {
                        t = visitor.visit(r, leaf, &candidates, t);
                    }
                } else if PLACES && child & PLACE != 0 {
                    break Some(next);
                } else {
                    let node = &forest.nodes[child as usize];
                    let (children, enter) = slab.boxes::<S>(node, t);
                    if children != 0 {
                        let columns = u64::from(active) * 0x0101_0101_0101_0101;
                        next = descend::<S, V>(stack, node, children, enter, columns);
                        continue;
                    }
                }
                let mut below = stack.pop().map(Step);
                while below.is_some_and(|step| step.rays() == active && step.enter() > t) {
                    below = stack.pop().map(Step);
                }
                match below {
                    Some(step) if step.rays() == active => next = step,
                    other => break other,
                }
            };
            (reach, reaches.0[r]) = (reach.with(r, t), t);
            let Some(step) = left else { return };
            next = step;
            continue;
        } else {
            let node = &forest.nodes[child as usize];
            let (mut rows, mut children) = (0u64, 0u32);
            let mut enter = S::splat(f32::INFINITY);
            for r in lanes(active) {
                let (mask, from) = slabs[r].boxes::<S>(node, reaches.0[r]);
                enter = enter.min(from);
                rows |= u64::from(mask) << (8 * r);
                children |= mask;
            }
            if children != 0 {
                next = descend::<S, V>(stack, node, children, enter, transposed(rows));
                continue;
            }
        }
        let Some(word) = stack.pop() else { return };
        next = Step(word);
    }
}

/// The triangles of a leaf, which `placed` holds if they have to be put in a place first.
#[inline(always)]
fn placed_leaf<'a, S: Lanes>(
    forest: &'a Forest,
    child: u32,
    place: Option<&Place>,
    placed: &'a mut Option<Triangles>,
) -> &'a Triangles {
    let leaf = &forest.leaves[(child & !LEAF) as usize];
    match place {
        Some(place) => placed.insert(place.place::<S>(leaf)),
        None => leaf,
    }
}

/// Puts off all `children` of a node but the first to go to. `enter`: where the first of the rays enters each; `columns`:
/// the rays that do.
#[inline(always)]
fn descend<S: Lanes, V: Visit>(stack: &mut Stack, node: &Node, children: u32, enter: S, columns: u64) -> Step {
    let enter = if V::ORDERED { enter.store() } else { Eight([0.0; LANES]) };
    let step = |c: usize| Step::new(enter.0[c], (columns >> (8 * c)) as u32, node.children[c]);
    let mut next = step(children.trailing_zeros() as usize);
    let base = stack.reserve();
    for other in lanes(children & (children - 1)).map(step) {
        if V::ORDERED {
            stack.insert(base, other.0.max(next.0));
            next = Step(other.0.min(next.0));
        } else {
            stack.push(other.0);
        }
    }
    next
}

/// Leads back out of a place.
const WORLD: u32 = PLACE | (PLACE - 1);

/// Where to go: the distance at which the first of the rays enters (rounded down), the rays, the child. The order of these
/// words is that of distances, for they are not negative.
#[derive(Clone, Copy)]
struct Step(u64);

impl Step {
    #[inline(always)]
    fn new(enter: f32, rays: u32, child: u32) -> Self {
        Step(u64::from(enter.to_bits() >> 7) << 40 | u64::from(rays & 0xff) << 32 | u64::from(child))
    }

    #[inline(always)]
    fn enter(self) -> f32 {
        f32::from_bits((self.0 >> 40 << 7) as u32)
    }

    #[inline(always)]
    fn rays(self) -> u32 {
        (self.0 >> 32) as u32 & 0xff
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }
}

/// The bits that are set, lowest first.
#[inline(always)]
fn lanes(mask: u32) -> impl Iterator<Item = usize> {
    let mut mask = mask;
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            lane
        })
    })
}

/// Eight rows of eight bits as eight columns (Warren, "Hacker's Delight", 7-3).
#[inline(always)]
fn transposed(x: u64) -> u64 {
    let swap = |x: u64, by: u32, which: u64| {
        let t = (x ^ (x >> by)) & which;
        x ^ t ^ (t << by)
    };
    swap(swap(swap(x, 7, 0x00aa_00aa_00aa_00aa), 14, 0x0000_cccc_0000_cccc), 28, 0xf0f0_f0f0)
}
