//! Places on surfaces: where a path begins, and where its rays arrive.

use crate::{
    atlas::Coverage,
    math::{Frame, Polygon},
    scene::{World, shading_normal},
    trace::{Hit, Ray, Segment, rounding},
};
use glam::{DVec2, Vec2, Vec3};

/// A place on a surface, seen from the side that receives light.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    /// World position, on the face.
    pub position: Vec3,
    /// Unit face normal.
    pub face: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Global triangle.
    pub triangle: u32,
    /// Barycentrics (1 - x - y, x, y).
    pub bary: Vec2,
    /// How far above the face rays start, metres.
    offset: f32,
}

impl Place {
    /// On the front of a triangle, or on its back.
    pub fn on(world: &World, triangle: u32, bary: Vec2, front: bool) -> Self {
        let (instance, local) = world.locate(triangle);
        let corners = world.corners(instance, local);
        let [a, b, c] = corners;
        let face = world.cross(instance, &corners).normalize_or_zero();
        let corner_normals = world.smooth_normals(instance, local, face);
        let normal = corner_normals.map_or(face, |corners| shading_normal(&corners, bary, face));
        let side = if front { 1.0 } else { -1.0 };
        let position = a + (b - a) * bary.x + (c - a) * bary.y;
        Place { position, face: face * side, normal: normal * side, triangle, bary, offset: rounding(&corners) }
    }

    /// Where a ray has ended.
    pub fn of(world: &World, hit: &Hit) -> Self {
        Self::on(world, hit.triangle, hit.bary, hit.front)
    }

    /// Where rays from here start.
    pub fn lifted(&self) -> Vec3 {
        self.position + self.face * self.offset
    }

    /// A ray from here.
    pub fn ray(&self, direction: Vec3, key: u32) -> Ray {
        Ray { origin: self.lifted(), direction, key, from: self.triangle }
    }

    /// The way from here as far as `t` lengths of the direction.
    pub fn segment(&self, direction: Vec3, t: f32) -> Segment {
        Segment { origin: self.lifted(), direction, t, from: self.triangle }
    }

    /// Axes around the shading normal.
    pub fn frame(&self) -> Frame {
        Frame::around(self.normal)
    }

    /// True if light from unit direction `d` arrives at the receiving side.
    pub fn faces(&self, d: Vec3) -> bool {
        d.dot(self.normal) > 0.0 && d.dot(self.face) > 0.0
    }

    /// Density, by solid angle, of cosine-distributed directions that are drawn again below the face.
    pub fn density(&self, d: Vec3) -> f32 {
        d.dot(self.normal).max(0.0) / (std::f32::consts::PI * self.kept())
    }

    /// Share of the cosine-weighted hemisphere about the shading normal that lies above the face.
    pub fn kept(&self) -> f32 {
        0.5 * (1.0 + self.normal.dot(self.face))
    }
}

/// The surface inside one texel as triangles, by their running sum of world area.
pub(super) struct Footprint {
    pieces: Vec<Piece>,
}

struct Piece {
    triangle: u32,
    bary: [Vec2; 3],
    until: f64,
}

impl Footprint {
    /// The pieces of `texel`.
    pub fn new(coverage: &Coverage, texel: usize) -> Self {
        let at = coverage.texels[texel].at.as_dvec2();
        let (mut pieces, mut sum) = (Vec::new(), 0.0);
        for fragment in coverage.fragments_of(texel) {
            let uv = coverage.charted[fragment.triangle as usize].exact();
            let polygon = Polygon::triangle(uv).clipped_to_cell(at);
            let (corners, area) = (polygon.corners(), polygon.area());
            for k in 1..corners.len().saturating_sub(1) {
                let [a, b, c] = [corners[0], corners[k], corners[k + 1]];
                let share = (b - a).perp_dot(c - a).abs() * 0.5 / area;
                if share > 0.0 {
                    sum += f64::from(fragment.area) * share;
                    let bary = [a, b, c].map(|p| barycentrics(uv, p));
                    pieces.push(Piece { triangle: fragment.triangle, bary, until: sum });
                }
            }
        }
        Footprint { pieces }
    }

    /// The triangle and the place on it for `u` of the unit square, evenly by world area; `None` if there is no area.
    pub fn at(&self, u: Vec2) -> Option<(u32, Vec2)> {
        let along = f64::from(u.x) * self.pieces.last()?.until;
        let k = self.pieces.partition_point(|p| p.until <= along).min(self.pieces.len() - 1);
        let before = if k == 0 { 0.0 } else { self.pieces[k - 1].until };
        let piece = &self.pieces[k];
        let inside = ((along - before) / (piece.until - before)).clamp(0.0, 1.0) as f32;
        let [a, b, c] = piece.bary;
        let w = in_triangle(Vec2::new(inside, u.y));
        Some((piece.triangle, (a + (b - a) * w.x + (c - a) * w.y).max(Vec2::ZERO)))
    }
}

/// Barycentrics, even by area, from the unit square.
pub(super) fn in_triangle(u: Vec2) -> Vec2 {
    let root = u.x.sqrt();
    Vec2::new(root * (1.0 - u.y), root * u.y)
}

fn barycentrics([p, q, r]: [DVec2; 3], at: DVec2) -> Vec2 {
    let (e1, e2, d) = (q - p, r - p, at - p);
    (DVec2::new(d.perp_dot(e2), e1.perp_dot(d)) / e1.perp_dot(e2)).as_vec2()
}
