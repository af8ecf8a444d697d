//! [`Neighbours`]: which receivers beside each other on a page lie on one smooth surface, with nothing between them.

use super::Transport;
use crate::{
    atlas::{Coverage, NO_TEXEL},
    patches::{Patches, continues},
    trace::Tracer,
};
use glam::UVec2;

/// Looks from one receiver to others; all of them have [`Transport::eyes`].
pub struct Neighbours<'a> {
    /// The receivers.
    pub transport: &'a Transport,
    /// What may stand between them.
    pub tracer: &'a Tracer<'a>,
    /// Where they lie on their pages.
    pub coverage: &'a Coverage,
    /// Their areas, and which are buried.
    pub patches: &'a Patches,
}

impl Neighbours<'_> {
    /// Receivers in a rectangle of the page that have rays, at every `step`-th column and row of the page.
    pub fn receivers(&self, page: usize, low: UVec2, high: UVec2, step: u32) -> Vec<u32> {
        let (grid, size) = (&self.coverage.grids[page], self.coverage.sizes[page]);
        let high = high.min(size);
        let columns = move || (low.x.next_multiple_of(step)..high.x).step_by(step as usize);
        let rows = (low.y.next_multiple_of(step)..high.y).step_by(step as usize);
        let cells = rows.flat_map(|y| columns().map(move |x| y * size.x + x));
        let texels = cells.map(|cell| grid[cell as usize]);
        let open = texels.filter(|&t| t != NO_TEXEL && !self.patches.buried[t as usize]);
        open.filter_map(|t| self.transport.receiver_at(t)).map(|r| r as u32).collect()
    }

    /// Those that lie on the same smooth surface as the leader, not more than about so many texels from it on the page,
    /// with nothing standing between; the leader is one of them.
    pub fn around(&self, leader: u32, receivers: &[u32], texels: u32) -> Vec<u32> {
        let some = receivers.iter().copied().filter(|&r| self.continues(leader, r, texels));
        let above = |r: u32| self.transport.eyes[r as usize].above(self.size(r));
        let origin = above(leader);
        let some: Vec<u32> = some.collect();
        let ways: Vec<_> = some.iter().map(|&r| [origin, above(r)]).collect();
        let joined = some.into_iter().zip(self.tracer.are_open(&ways)).filter(|&(r, open)| r == leader || open);
        joined.map(|(r, _)| r).collect()
    }

    /// True if the surface goes on smoothly from one receiver to the other.
    fn continues(&self, a: u32, b: u32, texels: u32) -> bool {
        let (p, q) = (&self.transport.eyes[a as usize], &self.transport.eyes[b as usize]);
        let size = self.size(a).max(self.size(b));
        // Texels of other charts may lie beside it on the page; half as far again allows for stretched ones.
        let apart = 1.5 * std::f32::consts::SQRT_2 * texels as f32 * size;
        a == b || continues([p.position, p.normal], [q.position, q.normal], apart)
    }

    /// Edge of a receiver's texel, metres.
    fn size(&self, receiver: u32) -> f32 {
        self.patches.area[self.transport.receivers[receiver as usize] as usize].sqrt()
    }
}
