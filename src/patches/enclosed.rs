//! Whether a point lies inside other geometry: under a box, behind a wall's surface.

use super::{SMOOTH, SurfacePoint};
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
/// Those that are traced at once, and that suffice if the point also sees another that all of them have proved enclosed.
const TOGETHER: usize = 8;
/// Texels from there, at most.
const BESIDE: u32 = 2;

/// Looks around points. A point is enclosed if what it sees are backs, single-sided or not, that do not shine, but for a
/// few fronts.
pub struct Enclosure<'a> {
    tracer: &'a Tracer<'a>,
    coverage: &'a Coverage,
    probes: PointTable,
}

/// Points of some texels that all probes have proved enclosed, by themselves or together with others of their texel.
pub type Proved = Vec<(UVec2, SurfacePoint)>;

impl<'a> Enclosure<'a> {
    /// Points of a texel that must be found enclosed, each or together, before one probe beside its ray is trusted for the
    /// others.
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
    /// the normal; `found` counts the points of this texel that were found enclosed, `proved` are those of it and of others.
    pub fn holds(
        &self,
        points: &[SurfacePoint],
        at: UVec2,
        turn: Vec2,
        found: &mut usize,
        proved: &mut Proved,
    ) -> Vec<bool> {
        if points.is_empty() {
            return Vec::new();
        }
        // That settles most points that are open.
        let mut enclosed = self.meet_backs(points, at, turn);
        let inside: Vec<&SurfacePoint> = points.iter().zip(&enclosed).filter(|(_, e)| **e).map(|(p, _)| p).collect();
        // They lie in one texel: what encloses most of them encloses all, but for what a few fronts are worth.
        if *found < Self::TRUST
            && inside.len() > 1
            && self.surround(&inside, self.probes.block(at.x, at.y, 1 + *found), at, turn, proved)
        {
            *found += inside.len();
            return enclosed;
        }
        for (p, enclosed) in points.iter().zip(&mut enclosed).filter(|(_, enclosed)| **enclosed) {
            if *found < Self::TRUST {
                *enclosed = self.surround(&[p], self.probes.block(at.x, at.y, 1 + *found), at, turn, proved);
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

    /// True if no probe gets out, from one of the points after the other, and few meet fronts; the first few suffice where all
    /// points see one that is proved.
    fn surround(&self, points: &[&SurfacePoint], probes: &[Point], at: UVec2, turn: Vec2, proved: &mut Proved) -> bool {
        let (mut fronts, mut sheets) = (0, 0);
        let probes: Vec<(&SurfacePoint, &Point)> = points.iter().copied().cycle().zip(probes).collect();
        for (k, few) in probes.chunks(TOGETHER).enumerate() {
            let seen = self.look(few.iter().copied(), turn);
            let count = |what| seen.iter().filter(|s| **s == what).count();
            fronts += count(Seen::Front);
            sheets += count(Seen::Sheet);
            if count(Seen::Out) > 0 || fronts > if sheets > 0 { 0 } else { FRONTS } {
                return false;
            }
            // Lit sheets all around may be the walls of a room.
            let dark = sheets == 0 && fronts <= FRONTS * TOGETHER / PROBES;
            if k == 0 && dark && points.iter().all(|p| self.sees_one(p, at, proved)) {
                return true;
            }
        }
        proved.push((at, *points[0]));
        true
    }

    /// True if nothing stands between a point and one near it that was proved enclosed, on the same side of a surface.
    fn sees_one(&self, point: &SurfacePoint, at: UVec2, proved: &Proved) -> bool {
        let near = |&(other, p): &(UVec2, SurfacePoint)| {
            at.as_ivec2().chebyshev_distance(other.as_ivec2()) <= BESIDE && point.face.dot(p.face) > SMOOTH
        };
        let beside = proved.iter().rev().find(|p| near(p));
        beside.is_some_and(|(_, p)| self.tracer.are_open(&[[point.lifted(), p.lifted()]])[0])
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
