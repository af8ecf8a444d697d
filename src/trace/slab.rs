//! [`Slab`]: a ray against the boxes of nodes.

use super::tree::Node;
use crate::math::simd::{Eight, Lanes};
use glam::Vec3;

/// A ray as tests of boxes want it.
#[derive(Clone, Copy)]
pub struct Slab {
    /// One over the direction; large where a component is zero.
    inverse: [f32; 3],
    /// The origin, by these.
    origin: [f32; 3],
    /// 1 where the direction points down an axis.
    down: [bool; 3],
}

/// A component nearer to zero than this counts as this: no product of its inverse with a distance is a NaN.
const SMALLEST: f32 = 1e-18;

impl Slab {
    /// Of no ray.
    pub const NONE: Slab = Slab { inverse: [0.0; 3], origin: [0.0; 3], down: [false; 3] };

    /// A ray in the space of the boxes: where it starts, and the inverse of its direction.
    #[inline(always)]
    pub fn new(origin: Vec3, inverse: Vec3) -> Self {
        Slab {
            inverse: inverse.to_array(),
            origin: (origin * inverse).to_array(),
            down: inverse.cmplt(Vec3::ZERO).into(),
        }
    }

    /// The boxes of a node that the ray meets before `t`, and where it enters each.
    #[inline(always)]
    pub fn boxes<S: Lanes>(&self, node: &Node, t: f32) -> (u32, S) {
        let [x, y, z] = self.down.map(usize::from);
        let near = &node.bounds;
        let enter = self.slab::<S>(0, &near[x][0]).max(self.slab(1, &near[y][1])).max(self.slab(2, &near[z][2]));
        let leave =
            self.slab::<S>(0, &near[1 - x][0]).min(self.slab(1, &near[1 - y][1])).min(self.slab(2, &near[1 - z][2]));
        let enter = enter.max(S::splat(0.0));
        (enter.le(leave.min(S::splat(t))), enter)
    }

    #[inline(always)]
    fn slab<S: Lanes>(&self, axis: usize, plane: &Eight) -> S {
        S::load(plane).mul_sub(S::splat(self.inverse[axis]), S::splat(self.origin[axis]))
    }
}

/// One over the components of a direction, which are kept clear of zero.
#[inline(always)]
pub fn inverses(direction: Vec3) -> Vec3 {
    1.0 / Vec3::select(direction.abs().cmplt(Vec3::splat(SMALLEST)), Vec3::splat(SMALLEST), direction)
}
