//! [`Draft`]: a row while it is measured.

use super::{
    Eye,
    rows::{Block, DARK},
};
use crate::patches::Seen;
use glam::{Vec2, Vec3};

/// What the rays of a row have met.
#[derive(Default)]
pub(super) struct Draft {
    /// One for each ray that counts.
    pub columns: Vec<u32>,
    /// In step with `columns`, if kept.
    pub spots: Vec<Vec3>,
    /// Sum of the places where the rays that count begin, if kept.
    pub origins: Vec3,
    /// Rays whose points may be enclosed.
    pub behind: Vec<Behind>,
    /// Points found enclosed, and open though they met a back.
    pub enclosed: usize,
    pub open: usize,
    /// Columns and their places, in the order of a block.
    ordered: (Vec<u32>, Vec<Vec3>),
}

/// The end of a ray whose point may be enclosed.
pub(super) struct Behind {
    pub place: Vec2,
    pub seen: Seen,
    pub spot: Vec3,
}

impl Draft {
    /// As if no ray had been shot; keeps the allocations.
    pub fn clear(&mut self) {
        self.columns.clear();
        self.spots.clear();
        self.behind.clear();
        (self.origins, self.enclosed, self.open) = (Vec3::ZERO, 0, 0);
    }

    /// Keeps where a ray that counts began and ended.
    #[inline(always)]
    pub fn see(&mut self, origin: Vec3, spot: Vec3) {
        self.origins += origin;
        self.spots.push(spot);
    }

    /// Adds the rays of row `k` of a block; their places, too, if the eye is there that they started from.
    pub fn join(&mut self, block: &Block, k: usize, eye: Option<&Eye>) {
        let ends = block.rays(k);
        let rays = (1.0 / block.row(k).weight).round() as usize;
        self.columns.extend_from_slice(ends.columns);
        // Without places, those that met nothing are not kept one by one.
        self.columns.resize(self.columns.len() + rays - ends.columns.len(), DARK);
        if let Some(eye) = eye {
            self.spots.extend_from_slice(ends.spots);
            self.origins += eye.position * rays as f32;
        }
    }

    /// Appends it to a block: patches, cells of the sky, what does not shine.
    pub fn push_to(&mut self, block: &mut Block) {
        let rank = |c: u32| (c >> 31) as usize + usize::from(c == DARK);
        let mut counts = [0; 3];
        self.columns.iter().for_each(|&c| counts[rank(c)] += 1);
        let lit = counts[0] + counts[1];
        let mut next = [0, counts[0], lit];
        let (columns, spots) = &mut self.ordered;
        columns.resize(self.columns.len(), 0);
        spots.resize(self.spots.len(), Vec3::ZERO);
        for (k, &c) in self.columns.iter().enumerate() {
            let to = &mut next[rank(c)];
            columns[*to] = c;
            if let Some(&spot) = self.spots.get(k) {
                spots[*to] = spot;
            }
            *to += 1;
        }
        block.push(columns, lit, 1.0 / self.columns.len().max(1) as f32, spots);
    }
}
