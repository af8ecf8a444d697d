//! Rays through a [`Tree`]: nearest boxes first, eight boxes or eight triangles at a time.
//!
//! Triangle tests are watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013): corners are
//! sheared to the plane across the ray; a difference of two rounded products has the exact sign or is zero, and what passes
//! is looked at again in double precision.

use super::{
    simd::{Eight, LANES, Lanes, Stack},
    tree::{LEAF, Node},
};
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

/// A ray as tests want it.
pub struct Sheared {
    origin: [f32; 3],
    /// One over the direction; large where a component is zero.
    inverse: [f32; 3],
    /// 1 where the direction points down an axis.
    down: [usize; 3],
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

/// A component nearer to zero than this counts as this: no product of its inverse with a distance is a NaN.
const SMALLEST: f32 = 1e-18;

impl Sheared {
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let d = direction.to_array();
        let a = [d[0].abs(), d[1].abs(), d[2].abs()];
        let z = if a[0] > a[1] {
            if a[0] > a[2] { 0 } else { 2 }
        } else if a[1] > a[2] {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let along = 1.0 / d[z];
        let clear = |k: usize| if a[k] < SMALLEST { SMALLEST } else { d[k] };
        let c = [clear(0), clear(1), clear(2)];
        Sheared {
            origin: origin.to_array(),
            inverse: [1.0 / c[0], 1.0 / c[1], 1.0 / c[2]],
            down: [usize::from(c[0] < 0.0), usize::from(c[1] < 0.0), usize::from(c[2] < 0.0)],
            axes,
            slope: [d[axes[0]] * along, d[axes[1]] * along, along],
        }
    }

    /// The boxes of a node that the ray meets before `t`, and where it enters each.
    #[inline(always)]
    fn boxes<S: Lanes>(&self, node: &Node, t: f32) -> (u32, S) {
        let [x, y, z] = self.down;
        let near = &node.bounds;
        let enter = self.slab::<S>(0, &near[x][0]).max(self.slab(1, &near[y][1])).max(self.slab(2, &near[z][2]));
        let leave =
            self.slab::<S>(0, &near[1 - x][0]).min(self.slab(1, &near[1 - y][1])).min(self.slab(2, &near[1 - z][2]));
        let enter = enter.max(S::splat(0.0));
        (enter.le(leave.min(S::splat(t))), enter)
    }

    #[inline(always)]
    fn slab<S: Lanes>(&self, axis: usize, plane: &Eight) -> S {
        S::load(plane).sub(S::splat(self.origin[axis])).mul(S::splat(self.inverse[axis]))
    }

    /// The triangles of a leaf that the ray seems to meet.
    #[inline(always)]
    fn triangles<S: Lanes>(&self, leaf: &Triangles) -> Option<Candidates> {
        let a = self.corner::<S>(&leaf.corners[0]);
        let b = self.corner::<S>(&leaf.corners[1]);
        let c = self.corner::<S>(&leaf.corners[2]);
        let (u, v, w) = (area(b, c), area(c, a), area(a, b));
        let zero = S::splat(0.0);
        let lanes = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
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

/// What is done in a leaf.
pub trait Visit {
    /// Whether near leaves must come before far ones.
    const ORDERED: bool;

    /// Given the triangles of a leaf, those that the ray seems to meet and how far it reaches; returns how far it still
    /// reaches, zero ends it.
    fn visit(&mut self, leaf: &Triangles, candidates: &Candidates, t: f32) -> f32;
}

/// Visits the leaves that the ray meets before `t`.
#[inline(always)]
pub fn walk<S: Lanes, V: Visit>(nodes: &[Node], leaves: &[Triangles], ray: &Sheared, t: f32, visitor: &mut V) {
    let mut t = t;
    // Entering distance above, node below: distances are not negative, so that the order of the words is theirs.
    let mut stack = Stack::new();
    let mut current = 0u32;
    loop {
        if current & LEAF != 0 {
            let leaf = &leaves[(current & !LEAF) as usize];
            if let Some(candidates) = ray.triangles::<S>(leaf) {
                t = visitor.visit(leaf, &candidates, t);
            }
        } else {
            let node = &nodes[current as usize];
            let (mut mask, enter) = ray.boxes::<S>(node, t);
            if mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                if mask == 0 {
                    current = node.children[lane];
                    continue;
                }
                let base = stack.reserve();
                if !V::ORDERED {
                    while mask != 0 {
                        stack.push(u64::from(node.children[mask.trailing_zeros() as usize]));
                        mask &= mask - 1;
                    }
                    current = node.children[lane];
                    continue;
                }
                let enter = enter.store();
                let mut nearest = word(&enter, node, lane);
                while mask != 0 {
                    let next = word(&enter, node, mask.trailing_zeros() as usize);
                    mask &= mask - 1;
                    stack.insert(base, next.max(nearest));
                    nearest = nearest.min(next);
                }
                current = nearest as u32;
                continue;
            }
        }
        loop {
            let Some(next) = stack.pop() else { return };
            if !V::ORDERED && t > 0.0 || f32::from_bits((next >> 32) as u32) < t {
                current = next as u32;
                break;
            }
        }
    }
}

#[inline(always)]
fn word(enter: &Eight, node: &Node, lane: usize) -> u64 {
    u64::from(enter.0[lane].to_bits()) << 32 | u64::from(node.children[lane])
}
