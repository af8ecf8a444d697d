//! [`Slab`]: a ray against the boxes of nodes.

use super::tree::Node;
use crate::math::simd::{Eight, Lanes};
use glam::Vec3;

/// A ray as tests of boxes want it.
#[derive(Clone, Copy)]
pub struct Slab {
    origin: [f32; 3],
    /// One over the direction; large where a component is zero.
    inverse: [f32; 3],
    /// 1 where the direction points down an axis.
    down: [usize; 3],
}

/// A component nearer to zero than this counts as this: no product of its inverse with a distance is a NaN.
const SMALLEST: f32 = 1e-18;

impl Slab {
    /// Of no ray.
    pub const NONE: Slab = Slab { origin: [0.0; 3], inverse: [0.0; 3], down: [0; 3] };

    /// A ray in the space of the boxes.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let (o, d) = (origin, [clear(direction.x), clear(direction.y), clear(direction.z)]);
        Slab {
            origin: [o.x, o.y, o.z],
            inverse: [1.0 / d[0], 1.0 / d[1], 1.0 / d[2]],
            down: [usize::from(d[0] < 0.0), usize::from(d[1] < 0.0), usize::from(d[2] < 0.0)],
        }
    }

    /// The boxes of a node that the ray meets before `t`, and where it enters each.
    #[inline(always)]
    pub fn boxes<S: Lanes>(&self, node: &Node, t: f32) -> (u32, S) {
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
}

/// A component of a direction, clear of zero.
#[inline(always)]
pub fn clear(direction: f32) -> f32 {
    if direction.abs() < SMALLEST { SMALLEST } else { direction }
}
