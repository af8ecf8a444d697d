//! [`Receiver`]: the side of a texel from which the rays of a row start.

use crate::{
    atlas::Coverage,
    math::{Frame, Point, PointTable, hash, unit_float},
    patches::{Face, Faces, Footprint, SurfacePoint},
};
use glam::{UVec2, Vec2, Vec3};

/// The side of a texel that shoots. Reused: [`Receiver::set`] keeps the allocations.
pub(super) struct Receiver<'a> {
    coverage: &'a Coverage,
    pub footprint: Footprint,
    /// One for each of its faces, unless that is shaded smoothly.
    pub facets: Vec<Option<Facet>>,
    pub at: UVec2,
    pub back: bool,
    pub key: u32,
    /// Cosine and sine of the angle by which its directions are turned, and those of its square of texels.
    pub turn: Vec2,
    /// The points of its first pass, and the one at which it begins, so that those beside it shoot into the same direction
    /// at the same time.
    points: &'a [Point],
    first: usize,
}

/// What all rays from a flat face share.
pub(super) struct Facet {
    /// Global triangle.
    pub triangle: u32,
    /// From the face to where rays start.
    pub lift: Vec3,
    /// The axes of their directions, turned.
    pub frame: Frame,
}

impl<'a> Receiver<'a> {
    /// At no texel yet.
    pub fn new(coverage: &'a Coverage) -> Self {
        Receiver {
            coverage,
            footprint: Footprint::default(),
            facets: Vec::new(),
            at: UVec2::ZERO,
            back: false,
            key: 0,
            turn: Vec2::X,
            points: &[],
            first: 0,
        }
    }

    /// Moves to the front or back of a texel; its points are those of `table`.
    pub fn set(&mut self, texel: u32, back: bool, table: &'a PointTable, faces: &mut Faces) {
        self.footprint.set(texel as usize, faces);
        (self.at, self.back) = (self.coverage.texels[texel as usize].at, back);
        self.key = hash(texel, u32::from(back));
        let share = unit_float(hash(table.square(self.at), TURN));
        self.turn = turn(share);
        (self.points, self.first) = (table.block(self.at.x, self.at.y, 0), table.turned(share));
        let facet = |face: &Face| {
            let (lift, frame) = face.flat()?;
            let (lift, frame) = if back { (-lift, frame.reversed()) } else { (lift, frame) };
            Some(Facet { triangle: face.triangle, lift, frame: frame.turned(self.turn) })
        };
        self.facets.clear();
        self.facets.extend(self.footprint.faces().iter().map(facet));
    }

    /// Cosine and sine of an angle that is no other receiver's: where all have the same directions.
    pub fn turn_of_its_own(&self) -> Vec2 {
        turn(unit_float(hash(self.key, TURN)))
    }

    /// The `k`-th point of the first pass.
    #[inline(always)]
    pub fn point(&self, k: usize) -> &Point {
        let k = self.first + k;
        &self.points[if k < self.points.len() { k } else { k - self.points.len() }]
    }

    /// The point at a place of the unit square, on the side that shoots.
    #[inline(always)]
    pub fn surface(&self, place: Vec2) -> SurfacePoint {
        let p = self.footprint.point(place);
        if self.back { p.reversed() } else { p }
    }

    /// The point in the middle, on the side that shoots.
    pub fn middle(&self) -> SurfacePoint {
        let p = self.footprint.middle();
        if self.back { p.reversed() } else { p }
    }

    /// A direction about the shading normal, turned.
    #[inline(always)]
    pub fn turned(&self, p: &SurfacePoint, point: &Point) -> Vec3 {
        p.frame.turned(self.turn).to_world(point.direction)
    }
}

/// What keys angles.
const TURN: u32 = 0x7475_7261;

/// Cosine and sine of a share of the circle.
fn turn(share: f32) -> Vec2 {
    let angle = std::f32::consts::TAU * share;
    Vec2::new(libm::cosf(angle), libm::sinf(angle))
}
