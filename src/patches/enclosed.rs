//! Whether a point lies inside other geometry: under a box, behind a wall's surface.

use super::SurfacePoint;
use crate::{
    atlas::Coverage,
    math::{Frame, Point, PointTable},
    trace::{Hit, Ray, Tracer},
};
use glam::{UVec2, Vec2};

/// Rays that decide, at most. Where most of the view is backs of sheets, few would mistake it for an enclosure.
const PROBES: usize = 32;
/// Those that may meet fronts, if all backs are dark: a pillar is often open where it meets the ceiling, a slab where it
/// leans on a wall.
const FRONTS: usize = 4;
/// Those that are traced at once.
const TOGETHER: usize = 8;

/// Looks around points. A point is enclosed if what it sees are backs, single-sided or not, that do not shine, but for a
/// few fronts.
pub struct Enclosure<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    probes: PointTable,
}

impl<'a> Enclosure<'a> {
    /// Points of a texel that must be found enclosed, by all probes from one of them or from some together, before one beside
    /// its ray is trusted for the others.
    const TRUST: usize = 2;

    /// Prepares the probes.
    pub fn new(tracer: &'a Tracer<'a>, coverage: &'a Coverage) -> Self {
        Enclosure { tracer, coverage, probes: PointTable::of_directions(0..PROBES, 0x7072_6f62) }
    }

    /// True if a hit may be part of an enclosure.
    #[inline]
    pub fn may_enclose(&self, hit: &Hit) -> bool {
        !hit.front && !self.coverage.charted[hit.triangle as usize].emits
    }

    /// Which of some points of the texel `at` are enclosed: the probes from there end on backs. `turn` turns them about
    /// the normal; `found` counts the points of this texel that were found enclosed.
    pub fn holds(&self, points: &[SurfacePoint], at: UVec2, turn: Vec2, found: &mut usize) -> Vec<bool> {
        if points.is_empty() {
            return Vec::new();
        }
        // That settles most points that are open.
        let mut enclosed = self.meet_backs(points, at, turn);
        let inside: Vec<&SurfacePoint> = points.iter().zip(&enclosed).filter(|(_, e)| **e).map(|(p, _)| p).collect();
        // They lie in one texel: what encloses most of them encloses all, but for what a few fronts are worth.
        if *found < Self::TRUST
            && inside.len() > 1
            && self.surround(&inside, self.probes.block(at.x, at.y, 1 + *found), turn)
        {
            *found += inside.len();
            return enclosed;
        }
        for (p, enclosed) in points.iter().zip(&mut enclosed).filter(|(_, enclosed)| **enclosed) {
            if *found < Self::TRUST {
                *enclosed = self.surround(&[p], self.probes.block(at.x, at.y, 1 + *found), turn);
            }
            *found += usize::from(*enclosed);
        }
        enclosed
    }

    /// Whether one probe each, from some points of the texel `at`, ends on a back.
    pub fn meet_backs(&self, points: &[SurfacePoint], at: UVec2, turn: Vec2) -> Vec<bool> {
        let probes = self.probes.block(at.x, at.y, 0).iter().cycle();
        let seen = self.look(points.iter().zip(probes), turn);
        seen.into_iter().map(|seen| matches!(seen, Seen::Back | Seen::Sheet)).collect()
    }

    /// True if no probe gets out, from one of the points after the other, and few meet fronts.
    fn surround(&self, points: &[&SurfacePoint], probes: &[Point], turn: Vec2) -> bool {
        let (mut fronts, mut sheets) = (0, 0);
        let probes: Vec<(&SurfacePoint, &Point)> = points.iter().copied().cycle().zip(probes).collect();
        probes.chunks(TOGETHER).all(|few| {
            let seen = self.look(few.iter().copied(), turn);
            let count = |what| seen.iter().filter(|s| **s == what).count();
            fronts += count(Seen::Front);
            sheets += count(Seen::Sheet);
            count(Seen::Out) == 0 && fronts <= if sheets > 0 { 0 } else { FRONTS }
        })
    }

    /// What probes end on.
    fn look<'p>(&self, probes: impl Iterator<Item = (&'p SurfacePoint, &'p Point)>, turn: Vec2) -> Vec<Seen> {
        let ray = |(k, (p, probe)): (usize, (&SurfacePoint, &Point))| {
            let direction = Frame::around(p.face).turned(turn).to_world(probe.direction);
            p.ray(direction, k as u32)
        };
        let rays: Vec<Ray> = probes.enumerate().map(ray).collect();
        let mut hits = vec![None; rays.len()];
        self.tracer.closest_of_each(&rays, &mut hits);
        let seen = |hit: Option<Hit>| {
            let Some(hit) = hit else { return Seen::Out };
            let surface = &self.coverage.charted[hit.triangle as usize];
            match hit.front {
                _ if surface.emits => Seen::Out,
                true => Seen::Front,
                false if surface.double_sided => Seen::Sheet,
                false => Seen::Back,
            }
        };
        hits.into_iter().map(seen).collect()
    }
}

/// What a probe ends on.
#[derive(Clone, Copy, PartialEq)]
enum Seen {
    /// A back that is dark.
    Back,
    /// One that may be lit.
    Sheet,
    Front,
    /// The sky, or what shines.
    Out,
}
