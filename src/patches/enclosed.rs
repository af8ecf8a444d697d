//! Whether a point lies inside other geometry: under a box, behind a wall's surface.

use super::SurfacePoint;
use crate::{
    math::{Frame, PointTable},
    trace::{Hit, Tracer},
};
use glam::{UVec2, Vec2};

/// Rays that decide, at most: the first that sees anything else settles it.
const PROBES: usize = 32;

/// Looks around points. A point is enclosed if all it sees are backs, single-sided or not, that do not shine.
pub struct Enclosure<'a> {
    tracer: &'a Tracer<'a>,
    probes: PointTable,
}

impl<'a> Enclosure<'a> {
    /// Prepares the probes.
    pub fn new(tracer: &'a Tracer<'a>) -> Self {
        Enclosure { tracer, probes: PointTable::new(PROBES, 0x7072_6f62) }
    }

    /// True if a hit may be part of an enclosure.
    #[inline]
    pub fn may_enclose(&self, hit: &Hit) -> bool {
        !hit.front && !self.tracer.world.material(hit.triangle).emits()
    }

    /// True if every probe from `p`, a point of the texel `at`, ends on a back. `turn` turns them about the normal.
    pub fn holds(&self, p: &SurfacePoint, at: UVec2, turn: Vec2) -> bool {
        let frame = Frame::around(p.face, turn);
        self.probes.block(at.x, at.y, 0).iter().enumerate().all(|(k, probe)| {
            let hit = self.tracer.closest(p.lifted(), frame.to_world(probe.direction), k as u32);
            hit.is_some_and(|h| self.may_enclose(&h))
        })
    }
}
