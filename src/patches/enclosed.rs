//! Whether a point lies inside other geometry: under a box, behind a wall's surface.

use super::SurfacePoint;
use crate::{
    atlas::Coverage,
    math::{Frame, Point, PointTable},
    trace::{Hit, Ray, Tracer},
};
use glam::{UVec2, Vec2};

/// Rays that decide, at least. Where most of the view is backs of sheets, few would mistake it for an enclosure.
const PROBES: usize = 32;
/// Of so many those that may meet fronts, if all backs are dark: a pillar is often open where it meets the ceiling, a slab
/// where it leans on a wall.
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
        let hits = self.look(points.iter().zip(probes), turn);
        hits.iter().map(|hit| hit.as_ref().is_some_and(|hit| self.may_enclose(hit))).collect()
    }

    /// True if probes from one of the points after the other say so.
    fn surround(&self, points: &[&SurfacePoint], probes: &[Point], turn: Vec2) -> bool {
        let probes: Vec<(&SurfacePoint, &Point)> = points.iter().copied().cycle().zip(probes).collect();
        let mut met = Met::default();
        probes.chunks(TOGETHER).all(|few| {
            self.look(few.iter().copied(), turn).iter().for_each(|hit| met.add(self, hit));
            met.may_enclose()
        })
    }

    /// What probes end on.
    fn look<'p>(&self, probes: impl Iterator<Item = (&'p SurfacePoint, &'p Point)>, turn: Vec2) -> Vec<Option<Hit>> {
        let ray = |(k, (p, probe)): (usize, (&SurfacePoint, &Point))| {
            let direction = Frame::around(p.face).turned(turn).to_world(probe.direction);
            p.ray(direction, k as u32)
        };
        let rays: Vec<Ray> = probes.enumerate().map(ray).collect();
        let mut hits = vec![None; rays.len()];
        self.tracer.closest_of_each(&rays, &mut hits);
        hits
    }
}

/// What rays that begin about the same place have met.
#[derive(Clone, Copy, Debug, Default)]
pub struct Met {
    rays: usize,
    fronts: usize,
    /// Backs that may be lit.
    sheets: usize,
    /// The sky, or what shines.
    out: usize,
}

impl Met {
    /// Of a place that is known to be enclosed, where so many rays met backs, some of them `sheets`.
    pub fn enclosed(rays: usize, sheets: usize) -> Self {
        Met { rays, sheets, ..Met::default() }
    }

    /// Of a place that is known not to be.
    pub fn open(rays: usize) -> Self {
        Met { rays, out: rays, ..Met::default() }
    }

    /// Counts a ray.
    #[inline(always)]
    pub fn add(&mut self, enclosure: &Enclosure, hit: &Option<Hit>) {
        self.rays += 1;
        let surface = |hit: &Hit| &enclosure.coverage.charted[hit.triangle as usize];
        match hit.as_ref().map(|hit| (hit.front, surface(hit))).filter(|(_, surface)| !surface.emits) {
            Some((true, _)) => self.fronts += 1,
            Some((false, surface)) => self.sheets += usize::from(surface.double_sided),
            None => self.out += 1,
        }
    }

    /// Both together.
    pub fn and(self, o: Self) -> Self {
        let (rays, fronts, sheets) = (self.rays + o.rays, self.fronts + o.fronts, self.sheets + o.sheets);
        Met { rays, fronts, sheets, out: self.out + o.out }
    }

    /// True if the place is enclosed: by so many rays, or, if these are fewer than it takes and do not say otherwise, by
    /// those of all that is `around`.
    pub fn encloses(&self, around: impl FnOnce() -> Self) -> bool {
        let enough = |met: &Met| met.rays >= PROBES && met.may_enclose();
        let few = self.rays < PROBES && self.out == 0 && self.fronts <= 1 + self.rays * FRONTS / PROBES;
        enough(self) || few && enough(&around())
    }

    /// True if none has got out, and few have met fronts.
    fn may_enclose(&self) -> bool {
        let few = if self.sheets > 0 { 0 } else { FRONTS * self.rays.max(PROBES) };
        self.out == 0 && self.fronts * PROBES <= few
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_fronts_and_no_way_out_are_an_enclosure() {
        let met = |rays, fronts, sheets, out| Met { rays, fronts, sheets, out };
        let alone = |met: Met| met.encloses(|| met);
        assert!(alone(met(32, 0, 0, 0)) && !alone(met(31, 0, 0, 0)));
        assert!(alone(met(32, 4, 0, 0)) && !alone(met(32, 5, 0, 0)));
        assert!(alone(met(80, 10, 0, 0)) && !alone(met(80, 11, 0, 0)));
        assert!(alone(met(800, 0, 1, 0)) && !alone(met(800, 1, 1, 0)));
        assert!(!alone(met(800, 0, 0, 1)));
        // Probes go on as long as they may.
        assert!(met(8, 4, 0, 0).may_enclose() && !met(8, 5, 0, 0).may_enclose());
    }

    #[test]
    fn those_around_decide_only_for_who_has_few_rays() {
        let met = |rays, fronts, out| Met { rays, fronts, out, ..Met::default() };
        let around = |own: Met| own.encloses(|| own.and(Met::enclosed(200, 0)));
        assert!(around(met(6, 0, 0)) && around(met(6, 1, 0)) && !around(met(6, 2, 0)) && !around(met(6, 0, 1)));
        assert!(around(met(16, 3, 0)) && !around(met(16, 4, 0)));
        assert!(around(met(64, 8, 0)) && !around(met(64, 9, 0)));
        assert!(!met(6, 0, 0).encloses(|| met(6, 0, 0).and(Met::open(1)).and(Met::enclosed(200, 0))));
    }
}
