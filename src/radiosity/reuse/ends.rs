//! [`Ends`]: where rays ended, eight by eight.

use crate::{
    math::simd::{Eight, LANES, Lanes},
    transport::Eye,
};
use glam::Vec3;

/// Where eight rays ended.
pub(super) struct Ends {
    pub spot: [Eight; 3],
    pub normal: [Eight; 3],
    pub radiosity: [Eight; 3],
    /// Whose ray it is, of the pool's members; nobody's in lanes without a ray.
    owner: [u32; LANES],
}

const ZERO: Eight = Eight([0.0; LANES]);
const NOBODY: u32 = u32::MAX;

/// Where any number of rays ended.
#[derive(Default)]
pub(super) struct List {
    eights: Vec<Ends>,
    rays: usize,
}

impl List {
    /// Adds a ray of the pool's member `owner`.
    #[inline(always)]
    pub fn push(&mut self, owner: u32, spot: Vec3, normal: Vec3, radiosity: Vec3) {
        let lane = self.rays % LANES;
        self.rays += 1;
        if lane == 0 {
            self.eights.push(Ends { spot: [ZERO; 3], normal: [ZERO; 3], radiosity: [ZERO; 3], owner: [NOBODY; LANES] });
        }
        let Some(ends) = self.eights.last_mut() else { return };
        for axis in 0..3 {
            ends.spot[axis].0[lane] = spot[axis];
            ends.normal[axis].0[lane] = normal[axis];
            ends.radiosity[axis].0[lane] = radiosity[axis];
        }
        ends.owner[lane] = owner;
    }

    /// Forgets all; keeps the allocation.
    pub fn clear(&mut self) {
        self.eights.clear();
        self.rays = 0;
    }

    /// All of them.
    #[inline(always)]
    pub fn eights(&self) -> &[Ends] {
        &self.eights
    }
}

impl Ends {
    /// 1 in lanes whose rays are of members that share, else 0.
    #[inline(always)]
    pub fn rays(&self, shares: &[bool]) -> Eight {
        let mut rays = ZERO;
        for (ray, &owner) in rays.0.iter_mut().zip(&self.owner) {
            if shares.get(owner as usize).is_some_and(|shares| *shares) {
                *ray = 1.0;
            }
        }
        rays
    }

    /// How densely so many rays of a receiver fall on each spot, times pi.
    #[inline(always)]
    pub fn density<S: Lanes>(&self, eye: &Eye, rays: f32) -> S {
        let Eye { position, normal } = eye;
        let ([x, y, z], [i, j, k]) = (&self.spot, &self.normal);
        let x = S::load(x).sub(S::splat(position.x));
        let y = S::load(y).sub(S::splat(position.y));
        let z = S::load(z).sub(S::splat(position.z));
        let squared = x.mul(x).add(y.mul(y)).add(z.mul(z));
        let here = x.mul(S::splat(normal.x)).add(y.mul(S::splat(normal.y))).add(z.mul(S::splat(normal.z)));
        let there = x.mul(S::load(i)).add(y.mul(S::load(j))).add(z.mul(S::load(k)));
        let zero = S::splat(0.0);
        let cosines = here.max(zero).mul(zero.sub(there).max(zero));
        // A spot at the receiver itself lies in no direction.
        cosines.mul(S::splat(rays)).div(squared.mul(squared).max(S::splat(f32::MIN_POSITIVE)))
    }
}
