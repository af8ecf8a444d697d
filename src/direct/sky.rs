//! The sky in two parts: a smooth one that the rows see in cells, and bright peaks that are sampled here.

use super::punctual::Aim;
use crate::{
    math::{CELLS, cell_center, cell_of, luminance},
    patches::SurfacePoint,
    scene::{Sky, SkyMap},
};
use glam::{Vec2, Vec3};

/// Radiance above this multiple of the sky's mean is a peak.
const PEAK: f32 = 4.0;

/// Exitance pi L of every cell of the smooth part of the sky.
pub fn sky_cells(sky: &Sky) -> Vec<Vec3> {
    use std::f32::consts::PI;
    match sky {
        Sky::Black => vec![Vec3::ZERO; CELLS as usize],
        Sky::Uniform(l) => vec![*l * PI; CELLS as usize],
        Sky::Map(map) => {
            let level = peak_level(map);
            let mut sum = vec![(Vec3::ZERO, 0f32); CELLS as usize];
            each_texel(map, |direction, solid_angle, radiance| {
                let cell = &mut sum[cell_of(direction) as usize];
                cell.0 += smooth(radiance, level) * solid_angle;
                cell.1 += solid_angle;
            });
            // A coarse picture leaves cells without a texel's centre: they look the picture up.
            let of = |(i, &(l, w)): (usize, &(Vec3, f32))| {
                if w > 0.0 { l / w } else { smooth(sky.radiance(cell_center(i as u32)), level) }
            };
            sum.iter().enumerate().map(|c| of(c) * PI).collect()
        }
    }
}

/// The part of an HDR sky that is brighter than its surroundings, as a distribution over its texels.
pub(super) struct Peaks {
    /// Texels that have a peak: picture coordinates of the corner, size, radiance of the peak.
    texels: Vec<(Vec2, Vec3)>,
    /// Running sum of each texel's luminous power.
    cumulative: Vec<f64>,
    size: Vec2,
    map: SkyMap,
}

impl Peaks {
    /// `None` for a sky without peaks.
    pub fn new(sky: &Sky) -> Option<Self> {
        let Sky::Map(map) = sky else { return None };
        let level = peak_level(map);
        let (mut texels, mut cumulative, mut sum) = (Vec::new(), Vec::new(), 0f64);
        let size = Vec2::new(1.0 / map.width as f32, 1.0 / map.height as f32);
        for (i, &l) in map.radiance.iter().enumerate() {
            let peak = l - smooth(l, level);
            if peak.max_element() > 0.0 {
                let (x, y) = (i as u32 % map.width, i as u32 / map.width);
                sum += f64::from(luminance(peak).max(1e-20) * solid_angle(map, y));
                texels.push((Vec2::new(x as f32, y as f32) * size, peak));
                cumulative.push(sum);
            }
        }
        let map = SkyMap { radiance: Vec::new(), ..*map };
        (!texels.is_empty()).then_some(Peaks { texels, cumulative, size, map })
    }

    /// A direction by the peaks' power, with its radiance over its probability, times cos over the kept share.
    pub fn aim(&self, p: &SurfacePoint, u: Vec2) -> Option<Aim> {
        let total = self.cumulative[self.cumulative.len() - 1];
        let at = f64::from(u.x) * total;
        let k = self.cumulative.partition_point(|&c| c <= at).min(self.texels.len() - 1);
        let (corner, radiance) = self.texels[k];
        let before = if k == 0 { 0.0 } else { self.cumulative[k - 1] };
        let power = self.cumulative[k] - before;
        let inside = (((at - before) / power) as f32).clamp(0.0, 1.0);
        let direction = self.map.direction(Vec2::new(corner.x + inside * self.size.x, self.row(corner.y, u.y)));
        let cos = direction.dot(p.normal);
        if cos <= 0.0 || direction.dot(p.face) <= 0.0 {
            return None;
        }
        // The texel is chosen by luminance times solid angle, the direction evenly inside it.
        let irradiance = radiance / luminance(radiance).max(1e-20) * (total as f32 * cos / p.kept());
        Some(Aim { direction, distance: f32::INFINITY, irradiance })
    }

    /// Picture coordinate inside the row at `top`, evenly in solid angle: the height is linear in the share.
    fn row(&self, top: f32, share: f32) -> f32 {
        use std::f64::consts::PI;
        let height = |v: f32| libm::cos(PI * f64::from(v));
        let (a, b) = (height(top), height(top + self.size.y));
        (libm::acos((a + (b - a) * f64::from(share)).clamp(-1.0, 1.0)) / PI) as f32
    }
}

fn peak_level(map: &SkyMap) -> f32 {
    let (mut sum, mut weight) = (0f64, 0f64);
    each_texel(map, |_, solid_angle, radiance| {
        sum += f64::from(luminance(radiance)) * f64::from(solid_angle);
        weight += f64::from(solid_angle);
    });
    PEAK * (sum / weight.max(1e-30)) as f32
}

/// The part of `radiance` up to the level, its colour kept.
fn smooth(radiance: Vec3, level: f32) -> Vec3 {
    let l = luminance(radiance);
    if l > level { radiance * (level / l) } else { radiance }
}

fn solid_angle(map: &SkyMap, row: u32) -> f32 {
    let theta = |y: u32| libm::cosf(std::f32::consts::PI * y as f32 / map.height as f32);
    std::f32::consts::TAU / map.width as f32 * (theta(row) - theta(row + 1))
}

fn each_texel(map: &SkyMap, mut f: impl FnMut(Vec3, f32, Vec3)) {
    // Parts of a texel: several to each cell, however coarse the picture is.
    let parts = (1024 / map.width.max(1)).clamp(1, 64);
    let (width, height) = (map.width * parts, map.height * parts);
    let share = |y: u32| {
        let theta = |y: u32| libm::cosf(std::f32::consts::PI * y as f32 / height as f32);
        std::f32::consts::TAU / width as f32 * (theta(y) - theta(y + 1))
    };
    for y in 0..height {
        let solid = share(y);
        for x in 0..width {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            f(map.direction(uv), solid, map.radiance[(y / parts * map.width + x / parts) as usize]);
        }
    }
}
