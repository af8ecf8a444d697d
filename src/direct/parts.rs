//! [`Parts`]: which part of a patch lamps and sun light, where the edge of a shadow crosses it.
//!
//! A patch reflects as one value. That is enough for whoever is far away; who is close to it, below a ledge, sees the lit
//! part only, or the shaded one.

use crate::patches::Footprint;
use glam::{Vec2, Vec3};

/// Parts along a side. Measured: 8 are hardly better.
const SIDE: usize = 4;
const COUNT: usize = SIDE * SIDE;
/// In place of an index: all parts are alike.
const NONE: u32 = u32::MAX;

/// How irradiance differs from part to part, of the patches at edges of shadows, whose noise has called for more rays.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Of each patch; empty if none has parts.
    index: Vec<u32>,
    divided: Vec<Divided>,
}

impl Parts {
    /// Adds what of one of so many patches is known, to what is known already.
    pub(super) fn add(&mut self, patches: usize, patch: u32, divided: Divided) {
        self.index.resize(patches, NONE);
        match self.divided.get_mut(self.index[patch as usize] as usize) {
            Some(known) => known.add(&divided),
            None => {
                self.index[patch as usize] = self.divided.len() as u32;
                self.divided.push(divided);
            }
        }
    }

    /// Notes that as many points have told that the parts of a patch are alike.
    pub(super) fn agree(&mut self, patch: u32, points: u32) {
        if let Some(&k) = self.index.get(patch as usize).filter(|&&k| k != NONE) {
            let known = &mut self.divided[k as usize];
            known.add(&Divided { beyond: [Vec3::ZERO; COUNT], points, ..known.clone() });
        }
    }

    /// Forgets a patch.
    pub(super) fn forget(&mut self, patch: usize) {
        self.index.get_mut(patch).into_iter().for_each(|k| *k = NONE);
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (self.index.capacity() * size_of::<u32>() + self.divided.capacity() * size_of::<Divided>()) as u64
    }

    /// True if the parts of a patch differ.
    pub fn divide(&self, patch: usize) -> bool {
        self.index.get(patch).is_some_and(|&k| k != NONE)
    }

    /// Irradiance of the part of a patch in which `spot` lies, beyond that of all of it, W/m^2: 0 on average. `None` if its
    /// parts are alike.
    #[inline]
    pub fn beyond(&self, patch: usize, spot: Vec3) -> Option<Vec3> {
        let divided = self.divided.get(*self.index.get(patch)? as usize)?;
        Some(divided.beyond[divided.grid.part(spot)])
    }
}

/// A patch cut into parts.
#[derive(Clone, Debug)]
pub(super) struct Divided {
    grid: Grid,
    beyond: [Vec3; COUNT],
    /// Of the source that needed most.
    points: u32,
}

impl Divided {
    /// Adds what points of their own have told of the same patch.
    fn add(&mut self, o: &Self) {
        let share = o.points as f32 / (self.points + o.points).max(1) as f32;
        self.beyond.iter_mut().zip(&o.beyond).for_each(|(beyond, other)| *beyond = beyond.lerp(*other, share));
        self.points += o.points;
    }
}

/// Squares over a patch, projected onto its plane.
#[derive(Clone, Debug)]
struct Grid {
    corner: Vec3,
    /// To coordinates in which parts are unit squares.
    axes: [Vec3; 2],
}

impl Grid {
    fn over(footprint: &Footprint) -> Self {
        let normal = footprint.normal();
        let edges = footprint.triangles().map(|[a, b, _]| (b - a).reject_from_normalized(normal));
        let longest = edges.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let x = longest.and_then(Vec3::try_normalize).unwrap_or_else(|| normal.any_orthonormal_vector());
        let y = normal.cross(x);
        let flat = |p: Vec3| Vec2::new(p.dot(x), p.dot(y));
        let corners = || footprint.triangles().flatten().map(flat);
        let (low, high) = (corners().fold(Vec2::INFINITY, Vec2::min), corners().fold(Vec2::NEG_INFINITY, Vec2::max));
        let scale = SIDE as f32 / (high - low).max(Vec2::splat(f32::MIN_POSITIVE));
        Grid { corner: x * low.x + y * low.y, axes: [x * scale.x, y * scale.y] }
    }

    /// The part nearest to a spot.
    #[inline]
    fn part(&self, spot: Vec3) -> usize {
        let [x, y] = self.axes.map(|axis| ((spot - self.corner).dot(axis) as usize).min(SIDE - 1));
        y * SIDE + x
    }
}

/// [`Divided`] while it is measured, one source after the other.
pub(super) struct Division {
    divided: Divided,
    /// Points of each part, and what arrived there.
    points: [u32; COUNT],
    arrived: [Vec3; COUNT],
}

impl Division {
    pub fn of(footprint: &Footprint) -> Self {
        let divided = Divided { grid: Grid::over(footprint), beyond: [Vec3::ZERO; COUNT], points: 0 };
        Division { divided, points: [0; COUNT], arrived: [Vec3::ZERO; COUNT] }
    }

    /// A point at which the source is looked for.
    pub fn visit(&mut self, spot: Vec3) {
        self.points[self.divided.grid.part(spot)] += 1;
    }

    /// What arrives at one of them.
    pub fn receive(&mut self, spot: Vec3, light: Vec3) {
        self.arrived[self.divided.grid.part(spot)] += light;
    }

    /// The source is done; an edge of its light crosses the patch, or it does not count. Parts without a point are taken to be
    /// like all.
    pub fn end_source(&mut self, edge: bool) {
        let points = self.points.iter().sum::<u32>();
        self.divided.points = self.divided.points.max(points);
        let mean = self.arrived.iter().sum::<Vec3>() / points.max(1) as f32;
        let parts = self.divided.beyond.iter_mut().zip(&self.points).zip(&self.arrived);
        parts
            .filter(|((_, n), _)| edge && **n > 0)
            .for_each(|((beyond, n), arrived)| *beyond += *arrived / *n as f32 - mean);
        (self.points, self.arrived) = ([0; COUNT], [Vec3::ZERO; COUNT]);
    }

    /// The parts; `None` if they are alike.
    pub fn finish(self) -> Option<Box<Divided>> {
        self.divided.beyond.iter().any(|beyond| *beyond != Vec3::ZERO).then(|| Box::new(self.divided))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn division() -> Division {
        let grid = Grid { corner: Vec3::ZERO, axes: [Vec3::X * 4.0, Vec3::Y * 4.0] };
        let divided = Divided { grid, beyond: [Vec3::ZERO; COUNT], points: 0 };
        Division { divided, points: [0; COUNT], arrived: [Vec3::ZERO; COUNT] }
    }

    /// The left half of a unit square is lit by 2, and sources add.
    #[test]
    fn parts_differ_from_the_mean_that_the_patch_has() {
        let mut division = division();
        for _ in 0..2 {
            for k in 0..64 {
                let spot = Vec3::new((k % 8) as f32 + 0.5, (k / 8) as f32 + 0.5, 0.0) / 8.0;
                division.visit(spot);
                if spot.x < 0.5 {
                    division.receive(spot, Vec3::splat(2.0));
                }
            }
            division.end_source(true);
        }
        let mut parts = Parts::default();
        parts.add(2, 1, *division.finish().expect("parts"));
        let at = |x: f32| parts.beyond(1, Vec3::new(x, 0.3, 0.1)).map(|e| e.x);
        assert_eq!([at(0.1), at(0.4), at(0.6), at(-1.0), at(7.0)], [2.0, 2.0, -2.0, 2.0, -2.0].map(Some));
        assert!(parts.beyond(0, Vec3::ZERO).is_none());
        // As many points that find them alike halve what differs; what is forgotten is gone.
        parts.agree(1, 64);
        parts.agree(0, 64);
        assert_eq!(parts.beyond(1, Vec3::new(0.1, 0.3, 0.1)).map(|e| e.x), Some(1.0));
        parts.forget(1);
        assert!(parts.beyond(1, Vec3::ZERO).is_none() && parts.beyond(0, Vec3::ZERO).is_none());
    }

    #[test]
    fn where_nothing_differs_there_are_no_parts() {
        let mut division = division();
        division.visit(Vec3::ZERO);
        division.receive(Vec3::ZERO, Vec3::ONE);
        division.end_source(false);
        assert!(division.finish().is_none());
    }
}
