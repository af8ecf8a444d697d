//! What a ray sees that leaves the scene.

use glam::{Vec2, Vec3};

/// Radiance L from infinity, by direction.
#[derive(Clone, Debug, Default)]
pub enum Sky {
    /// No light.
    #[default]
    Black,
    /// The same radiance everywhere.
    Uniform(Vec3),
    /// An equirectangular picture.
    Map(SkyMap),
}

/// An equirectangular picture of the sky: +Y up, the centre looks to -Z, u grows to the right (+X).
#[derive(Clone, Debug)]
pub struct SkyMap {
    /// Texels in a row.
    pub width: u32,
    /// Rows, the first at the zenith.
    pub height: u32,
    /// Linear radiance, rows from the top, scale applied.
    pub radiance: Vec<Vec3>,
    /// Turn about +Y, radians, counter-clockwise seen from above.
    pub rotation: f32,
}

impl Sky {
    /// Radiance seen in unit direction `d`.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        match self {
            Sky::Black => Vec3::ZERO,
            Sky::Uniform(l) => *l,
            Sky::Map(map) => map.radiance[map.texel(d) as usize],
        }
    }

    /// True if it shines anywhere.
    pub fn shines(&self) -> bool {
        match self {
            Sky::Black => false,
            Sky::Uniform(l) => l.max_element() > 0.0,
            Sky::Map(map) => map.radiance.iter().any(|l| l.max_element() > 0.0),
        }
    }
}

impl SkyMap {
    /// Index of the texel seen in unit direction `d`.
    pub fn texel(&self, d: Vec3) -> u32 {
        let uv = self.uv(d);
        let x = ((uv.x * self.width as f32) as u32).min(self.width - 1);
        let y = ((uv.y * self.height as f32) as u32).min(self.height - 1);
        y * self.width + x
    }

    /// Picture coordinates in [0, 1), v down, of unit direction `d`.
    pub fn uv(&self, d: Vec3) -> Vec2 {
        use std::f32::consts::{PI, TAU};
        // Azimuth from -Z towards +X; turning the sky by +rotation about +Y moves its content from -Z towards -X.
        let azimuth = libm::atan2f(d.x, -d.z) + self.rotation;
        let u = 0.5 + azimuth / TAU;
        Vec2::new(u - u.floor(), libm::acosf(d.y.clamp(-1.0, 1.0)) / PI)
    }

    /// Unit direction of picture coordinates `uv`: the inverse of [`SkyMap::uv`].
    pub fn direction(&self, uv: Vec2) -> Vec3 {
        use std::f32::consts::{PI, TAU};
        let azimuth = (uv.x - 0.5) * TAU - self.rotation;
        let polar = uv.y * PI;
        let sin = libm::sinf(polar);
        Vec3::new(sin * libm::sinf(azimuth), libm::cosf(polar), -sin * libm::cosf(azimuth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    fn map(rotation: f32) -> SkyMap {
        SkyMap { width: 64, height: 32, radiance: vec![Vec3::ONE; 64 * 32], rotation }
    }

    #[test]
    fn the_centre_looks_to_minus_z_and_plus_x_is_right_of_it() {
        let uv = |d: Vec3| map(0.0).uv(d);
        assert!(uv(Vec3::NEG_Z).abs_diff_eq(Vec2::new(0.5, 0.5), 1e-6));
        assert!(uv(Vec3::X).abs_diff_eq(Vec2::new(0.75, 0.5), 1e-6));
        assert!(uv(Vec3::NEG_X).abs_diff_eq(Vec2::new(0.25, 0.5), 1e-6));
        assert!(uv(Vec3::Y).y.abs() < 1e-6);
    }

    #[test]
    fn a_quarter_turn_about_y_moves_the_centre_to_minus_x() {
        assert!(map(FRAC_PI_2).uv(Vec3::NEG_X).abs_diff_eq(Vec2::new(0.5, 0.5), 1e-6));
    }

    #[test]
    fn direction_is_the_inverse_of_uv() {
        for rotation in [0.0, 1.0, -2.5] {
            for i in 0..100 {
                let uv = Vec2::new((i as f32 * 0.618 + 0.01) % 1.0, (i as f32 + 0.5) / 100.0);
                let map = map(rotation);
                assert!(map.uv(map.direction(uv)).abs_diff_eq(uv, 1e-4), "{uv}");
            }
        }
    }
}
