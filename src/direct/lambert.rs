//! Lambert's closed form (1760): the integral of cos over the solid angle of a polygon.

use glam::Vec3;

/// A clipped triangle around the origin.
pub(super) struct Corners {
    at: [Vec3; 6],
    count: usize,
}

impl Corners {
    /// The corners as seen from the origin.
    pub fn new(t: [Vec3; 3]) -> Self {
        let mut at = [Vec3::ZERO; 6];
        at[..3].copy_from_slice(&t);
        Corners { at, count: 3 }
    }

    /// Keeps what lies on the positive side of the plane through the origin.
    pub fn clip(&mut self, normal: Vec3) {
        let mut out = Corners { at: [Vec3::ZERO; 6], count: 0 };
        let mut push = |c: Vec3| {
            if out.count < 6 {
                out.at[out.count] = c;
                out.count += 1;
            }
        };
        for i in 0..self.count {
            let (a, b) = (self.at[(i + self.count - 1) % self.count], self.at[i]);
            let (da, db) = (a.dot(normal), b.dot(normal));
            if (da > 0.0) != (db > 0.0) {
                push(a + (b - a) * (da / (da - db)));
            }
            if db > 0.0 {
                push(b);
            }
        }
        *self = out;
    }

    /// Half the sum over the edges of the angle they span times the cosine of its plane, seen from the origin.
    pub fn edge_sum(&self, normal: Vec3) -> f32 {
        let mut sum = 0.0;
        for i in 0..self.count {
            let (a, b) = (self.at[i].as_dvec3(), self.at[(i + 1) % self.count].as_dvec3());
            let cross = a.cross(b);
            let sin = cross.length();
            if sin > 0.0 {
                // The arctangent stays exact where the arccosine of nearly parallel edges does not.
                sum += f64::from(libm::atan2f(sin as f32, a.dot(b) as f32)) * cross.dot(normal.as_dvec3()) / sin;
            }
        }
        (0.5 * sum) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_square_over_its_corner() {
        // Howell B-3: corner of a unit square at distance 1.
        let z = |x: f32, y: f32| Vec3::new(x, y, 1.0);
        let half = |t: [Vec3; 3]| {
            let mut c = Corners::new(t);
            c.clip(Vec3::Z);
            c.edge_sum(Vec3::Z).abs()
        };
        let f = half([z(0., 0.), z(1., 0.), z(1., 1.)]) + half([z(0., 0.), z(1., 1.), z(0., 1.)]);
        assert!((f / std::f32::consts::PI - 0.138_531_6).abs() < 1e-6, "{f}");
    }
}
