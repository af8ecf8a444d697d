//! Directions to a picture of the sky, by its luminance.

use crate::{
    math::luminance,
    scene::{Sky, SkyMap},
};
use glam::{Vec2, Vec3};
use std::f64::consts::{PI, TAU};

/// The texels of a sky as a distribution of directions.
pub(super) struct Bright<'s> {
    map: &'s SkyMap,
    /// Running sum of luminance times solid angle.
    until: Vec<f64>,
}

impl<'s> Bright<'s> {
    /// `None` for a sky that is the same everywhere, or black.
    pub fn new(sky: &'s Sky) -> Option<Self> {
        let Sky::Map(map) = sky else { return None };
        let mut sum = 0.0;
        let rows = map.radiance.chunks(map.width as usize).zip(0..);
        let until: Vec<f64> = rows
            .flat_map(|(row, y)| row.iter().map(move |l| f64::from(luminance(*l)) * solid_angle(map, y)))
            .map(|power| {
                sum += power;
                sum
            })
            .collect();
        (sum > 0.0).then_some(Bright { map, until })
    }

    /// A unit direction.
    pub fn direction(&self, u: Vec2) -> Vec3 {
        let along = f64::from(u.x) * self.total();
        let k = self.until.partition_point(|s| *s <= along).min(self.until.len() - 1);
        let before = if k == 0 { 0.0 } else { self.until[k - 1] };
        let inside = ((along - before) / (self.until[k] - before).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let (x, y) = (k as u32 % self.map.width, k as u32 / self.map.width);
        // Heights are even in solid angle.
        let [top, bottom] = [y, y + 1].map(|y| height(self.map, y));
        let v = libm::acos((top + (bottom - top) * f64::from(u.y)).clamp(-1.0, 1.0)) / PI;
        self.map.direction(Vec2::new((x as f32 + inside as f32) / self.map.width as f32, v as f32))
    }

    /// Density of `d` by solid angle.
    pub fn density(&self, d: Vec3) -> f32 {
        (f64::from(luminance(self.map.radiance[self.map.texel(d) as usize])) / self.total()) as f32
    }

    fn total(&self) -> f64 {
        self.until[self.until.len() - 1]
    }
}

fn solid_angle(map: &SkyMap, row: u32) -> f64 {
    TAU / f64::from(map.width) * (height(map, row) - height(map, row + 1))
}

fn height(map: &SkyMap, row: u32) -> f64 {
    libm::cos(PI * f64::from(row) / f64::from(map.height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_their_density() {
        let radiance = (0..8 * 4).map(|i| Vec3::splat((i * 7 % 5) as f32)).collect();
        let sky = Sky::Map(SkyMap { width: 8, height: 4, radiance, rotation: 0.7 });
        let bright = Bright::new(&sky).unwrap();
        // The mean of radiance over density is the flux through a sphere, by whatever texel.
        let n = 1 << 14;
        let sum: f64 = (0..n)
            .map(|i| {
                let [a, b, ..] = sobol_burley::sample_4d(i, 0, 1);
                let d = bright.direction(Vec2::new(a, b));
                f64::from(luminance(sky.radiance(d)) * d.y.max(0.0) / bright.density(d))
            })
            .sum();
        let Sky::Map(map) = &sky else { unreachable!() };
        let exact: f64 = (0..32u32)
            .map(|i| {
                let [top, bottom] = [i / 8, i / 8 + 1].map(|y| height(map, y).max(0.0));
                f64::from(map.radiance[i as usize].x) * TAU / 8.0 * (top * top - bottom * bottom) * 0.5
            })
            .sum();
        assert!((sum / f64::from(n) / exact - 1.0).abs() < 1e-3, "{} {exact}", sum / f64::from(n));
    }
}
