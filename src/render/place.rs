//! Places on surfaces, on the side that is seen.

use crate::{
    math::Frame,
    scene::{World, shading_normal},
    trace::{Hit, Ray, Segment, rounding},
};
use glam::Vec3;

/// A place on a surface.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// World position, on the face.
    pub position: Vec3,
    /// Unit face normal.
    pub face: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    triangle: u32,
    /// How far above the face rays start, metres.
    offset: f32,
}

impl Place {
    /// Where a ray ended.
    pub fn of(world: &World, hit: &Hit) -> Self {
        let (instance, local) = world.locate(hit.triangle);
        let corners = world.corners(instance, local);
        let [a, b, c] = corners;
        let face = world.cross(instance, &corners).normalize_or_zero();
        let smooth = world.smooth_normals(instance, local, face);
        let normal = smooth.map_or(face, |corners| shading_normal(&corners, hit.bary, face));
        let side = if hit.front { 1.0 } else { -1.0 };
        let position = a + (b - a) * hit.bary.x + (c - a) * hit.bary.y;
        let (face, normal) = (face * side, normal * side);
        Place { position, face, normal, triangle: hit.triangle, offset: rounding(&corners) }
    }

    /// Axes around the shading normal.
    pub fn frame(&self) -> Frame {
        Frame::around(self.normal)
    }

    /// A ray from here.
    pub fn ray(&self, direction: Vec3, key: u32) -> Ray {
        Ray { origin: self.lifted(), direction, key, from: self.triangle }
    }

    /// The way from here as far as `t` metres.
    pub fn segment(&self, direction: Vec3, t: f32) -> Segment {
        Segment { origin: self.lifted(), direction, t, from: self.triangle }
    }

    fn lifted(&self) -> Vec3 {
        self.position + self.face * self.offset
    }
}
