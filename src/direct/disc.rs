//! [`Disc`]: a bound on where a piece of surface lies and where it looks.

use crate::{
    patches::{Footprint, SurfacePoint},
    trace::rounding,
};
use glam::Vec3;

/// A flat cylinder around some surface, and how far its normals leave the cylinder's axis. The surface of one plane has
/// neither height nor spread: what lies in the same plane is known not to see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    /// Middle.
    pub center: Vec3,
    /// Largest distance from the middle.
    pub radius: f32,
    /// Axis, a unit vector.
    normal: Vec3,
    /// Largest distance from the middle along the axis.
    height: f32,
    /// Largest difference between a unit normal and the axis.
    spread: f32,
    /// Size of the coordinates' rounding, metres.
    rounding: f32,
    /// True if some of it looks to both sides.
    two_sided: bool,
}

/// Size over distance, and difference of normals, up to which the middle stands for all: what is left is of second order, up
/// to twice the square of this.
const POINT: f32 = 1.0 / 32.0;

impl Disc {
    /// Bounds of a texel around its middle.
    pub fn of_texel(footprint: &Footprint, middle: &SurfacePoint) -> Self {
        let mut disc = Disc::around(middle.position, middle.face);
        footprint.triangles().flatten().for_each(|c| disc.take_point(c));
        let side = 1f32.copysign(footprint.normal().dot(middle.face));
        footprint.normals().for_each(|n| disc.take_normal(n * side, false));
        disc
    }

    /// A point that looks along `normal`.
    pub fn around(center: Vec3, normal: Vec3) -> Self {
        let rounding = rounding(&[center; 3]);
        Disc { center, radius: 0.0, normal, height: 0.0, spread: 0.0, rounding, two_sided: false }
    }

    /// Grows to hold a point.
    pub fn take_point(&mut self, p: Vec3) {
        let v = p - self.center;
        self.radius = self.radius.max(v.length());
        self.height = self.height.max(v.dot(self.normal).abs());
        self.rounding = self.rounding.max(rounding(&[p; 3]));
    }

    /// Grows to hold a normal.
    pub fn take_normal(&mut self, normal: Vec3, two_sided: bool) {
        self.spread = self.spread.max(normal.distance(self.normal));
        self.two_sided |= two_sided;
    }

    /// True if this is small and flat enough to look like a point to all of `other`.
    pub fn is_point_to(&self, other: &Disc) -> bool {
        self.spread < POINT && self.radius < POINT * (self.center.distance(other.center) - other.radius)
    }

    /// The largest cosine at which any of this may see any of `other`, about; 0 only if it sees nothing of it.
    pub fn cosine(&self, other: &Disc) -> f32 {
        let v = other.center - self.center;
        let distance = v.length();
        let across = self.normal.cross(other.normal).length();
        let along = self.normal.dot(other.normal).abs();
        let tilt = self.spread * (distance + self.radius + other.radius);
        let reach = self.height + other.height * along + other.radius * across + tilt;
        let middle = v.dot(self.normal);
        let above = if self.two_sided { middle.abs() } else { middle } + reach;
        if above <= self.rounding + other.rounding { 0.0 } else { (above / distance.max(other.radius)).min(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(center: Vec3, normal: Vec3) -> Disc {
        let (x, y) = normal.any_orthonormal_pair();
        let mut disc = Disc::around(center, normal);
        [x, y, -x, -y].into_iter().for_each(|c| disc.take_point(center + c));
        disc.take_normal(normal, false);
        disc
    }

    #[test]
    fn squares_of_one_plane_do_not_see_each_other() {
        let n = Vec3::new(0.3, 0.8, -0.5).normalize();
        let (x, _) = n.any_orthonormal_pair();
        let (a, b) = (square(Vec3::new(7.0, 3.0, 5.0), n), square(Vec3::new(7.0, 3.0, 5.0) + x * 2.5, n));
        assert_eq!(a.cosine(&b) * b.cosine(&a), 0.0);
        // Nor does one see what lies behind it, however it is turned, but for a corner that stands out.
        let behind = |depth: f32| square(Vec3::new(7.0, 3.0, 5.0) - n * depth + x * 2.5, x);
        assert_eq!(a.cosine(&behind(1.01)), 0.0);
        assert!(a.cosine(&behind(0.99)) > 0.0);
    }

    #[test]
    fn squares_that_face_each_other_see_all() {
        let (a, b) = (square(Vec3::ZERO, Vec3::Y), square(Vec3::Y * 3.0, Vec3::NEG_Y));
        assert_eq!((a.cosine(&b), b.cosine(&a)), (1.0, 1.0));
        let away = square(Vec3::Y * 3.0, Vec3::Y);
        assert_eq!(away.cosine(&a), 0.0);
        let mut both = away;
        both.take_normal(Vec3::Y, true);
        assert_eq!(both.cosine(&a), 1.0);
    }
}
