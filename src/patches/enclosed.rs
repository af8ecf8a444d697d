//! Whether a point lies inside other geometry: under a box, behind a wall's surface.

use super::SurfacePoint;
use crate::{
    math::{Frame, PointTable},
    trace::{Hit, Ray, Tracer},
};
use glam::{UVec2, Vec2};

/// Rays that decide, at most: the first that sees anything else settles it. Where most of the view is backs of sheets,
/// few would mistake it for an enclosure.
const PROBES: usize = 32;
/// Points of a texel that must be found enclosed by all probes before [`FEW`] beside its ray are trusted for the others.
const TRUST: usize = 4;
const FEW: usize = 1;

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

    /// True if the probes from `p`, a point of the texel `at`, end on backs. `turn` turns them about the normal; `found`
    /// counts the points of this texel that were found enclosed.
    pub fn holds(&self, p: &SurfacePoint, at: UVec2, turn: Vec2, found: &mut usize) -> bool {
        let frame = Frame::around(p.face).turned(turn);
        let probes = if *found < TRUST { PROBES } else { FEW };
        let enclosed = self.probes.block(at.x, at.y, *found).iter().take(probes).enumerate().all(|(k, probe)| {
            let ray = Ray { origin: p.lifted(), direction: frame.to_world(probe.direction), key: k as u32 };
            let hit = self.tracer.closest(&ray);
            hit.is_some_and(|h| self.may_enclose(&h))
        });
        *found += usize::from(enclosed);
        enclosed
    }
}
