//! Orthonormal frames and maps from the unit square that keep areas in proportion.

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

/// A right-handed orthonormal frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Frame {
    /// The frame around unit vector `z` (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
    pub fn around(z: Vec3) -> Self {
        let sign = 1f32.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        let x = Vec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x);
        let y = Vec3::new(b, sign + z.y * z.y * a, -z.y);
        Frame { x, y, z }
    }

    /// The frame on the other side of the surface.
    pub fn reversed(&self) -> Self {
        Frame { x: self.y, y: self.x, z: -self.z }
    }

    /// The frame turned about its normal by the angle with this cosine and sine.
    pub fn turned(&self, angle: Vec2) -> Self {
        Frame { x: self.x * angle.x + self.y * angle.y, y: self.y * angle.x - self.x * angle.y, z: self.z }
    }

    /// A vector given in this frame, in world axes.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// The coordinates of a point in the plane across the normal.
    pub fn flat(&self, p: Vec3) -> Vec2 {
        Vec2::new(self.x.dot(p), self.y.dot(p))
    }
}

/// Point of the unit disc; equal areas stay equal (Shirley and Chiu, "A Low Distortion Map", 1997).
pub fn square_to_disc(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, angle) =
        if p.x.abs() > p.y.abs() { (p.x, FRAC_PI_4 * (p.y / p.x)) } else { (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y)) };
    r * Vec2::new(libm::cosf(angle), libm::sinf(angle))
}

/// Unit direction around +z with density cos / pi, from a point of the unit square (Malley's method).
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = square_to_disc(u);
    d.extend((1.0 - d.length_squared()).max(1e-7).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for i in 0..200u32 {
            let f = |k| crate::math::unit_float(crate::math::hash(i, k)) * 2.0 - 1.0;
            let z = Vec3::new(f(0), f(1), f(2)).normalize();
            let frame = if i % 2 == 0 { Frame::around(z) } else { Frame::around(-z).reversed() };
            let (x, y) = (frame.to_world(Vec3::X), frame.to_world(Vec3::Y));
            assert!((x.cross(y) - z).length() < 1e-5 && (x.length() - 1.0).abs() < 1e-5, "{z}");
        }
    }

    #[test]
    fn cosine_hemisphere_has_mean_two_thirds() {
        let n = 512;
        let mean: f32 = (0..n * n)
            .map(|i| cosine_hemisphere(Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32).z)
            .sum::<f32>()
            / (n * n) as f32;
        assert!((mean - 2.0 / 3.0).abs() < 1e-4, "{mean}");
    }
}
