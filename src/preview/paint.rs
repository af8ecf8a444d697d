//! The picture: a grid of rays a pixel, exposed for what is seen, rolled off in the highlights, sRGB.

use super::{Cast, Sight, axes, half_extent, see};
use crate::{
    math::{luminance, srgb},
    scene::{Camera, Sky},
};
use glam::{UVec2, Vec3};
use rayon::prelude::*;

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width and height.
    pub size: UVec2,
    /// sRGB, rows from the top.
    pub rgb: Vec<[u8; 3]>,
    /// Mean radiance of each pixel, not exposed.
    pub radiance: Vec<Vec3>,
    /// Factor from radiance to the linear values shown.
    pub exposure: f32,
}

impl Picture {
    /// Memory for a pixel, whatever its rays.
    pub const BYTES_A_PIXEL: u64 = (size_of::<[u8; 3]>() + size_of::<Vec3>()) as u64;
}

/// Radiance along a ray, and the surface that it comes from, if any.
type Seen = (Vec3, Option<Sight>);

/// Rays by which the exposure is found, at most: of a picture's tens of millions not all need be kept.
const GLANCE: UVec2 = UVec2::new(480, 270);

/// What `camera` sees, by `grid` times `grid` rays a pixel, with an exposure that is given or found.
pub fn paint(cast: &Cast, sky: &Sky, camera: &Camera, size: UVec2, grid: u32, exposure: Option<f32>) -> Picture {
    let (tan_x, tan_y) = half_extent(camera.yfov, size.x as f32 / size.y as f32);
    let (right, up) = axes(camera.forward, camera.up);
    // Through the middle of a cell, where the picture has so many.
    let seen = |cell: UVec2, cells: UVec2| -> Seen {
        let at = (cell.as_vec2() + 0.5) / cells.as_vec2() * 2.0 - 1.0;
        let direction = (camera.forward + right * (at.x * tan_x) - up * (at.y * tan_y)).normalize();
        let sight = see(cast, camera.eye, direction).map(|(sight, _)| sight);
        (sight.map_or_else(|| sky.radiance(direction), |s| s.radiance), sight)
    };
    let exposure = exposure.unwrap_or_else(|| {
        let cells = size.min(GLANCE);
        let lit = |(radiance, sight): Seen| sight.filter(|s| !s.unlit).map(|_| luminance(radiance));
        auto_exposure(every(cells).filter_map(|cell| lit(seen(cell, cells))).collect())
    });
    let color = |(radiance, sight): Seen| match sight {
        Some(Sight { unlit: true, .. }) => radiance,
        _ => shown(radiance * exposure),
    };
    // Exposed ray by ray, so that edges of what is too bright stay smooth.
    let pixel = |at: UVec2| {
        let rays = grid * grid;
        let ray = |k: u32| seen(at * grid + UVec2::new(k % grid, k / grid), size * grid);
        let (shown, radiance) = (0..rays).map(ray).fold((Vec3::ZERO, Vec3::ZERO), |(c, r), s| (c + color(s), r + s.0));
        (srgb(shown / rays as f32), radiance / rays as f32)
    };
    let (mut rgb, mut radiance) = (Vec::new(), Vec::new());
    every(size).map(pixel).unzip_into_vecs(&mut rgb, &mut radiance);
    Picture { size, rgb, radiance, exposure }
}

/// The cells of a grid, row by row.
fn every(cells: UVec2) -> impl IndexedParallelIterator<Item = UVec2> {
    let width = cells.x as usize;
    (0..width * cells.y as usize).into_par_iter().map(move |i| UVec2::new((i % width) as u32, (i / width) as u32))
}

/// Factor that shows surfaces of these luminances well: the 95th percentile at .8, unless a few lights or patches of
/// sun are that bright and leave the rest in the dark; then their mean (logarithmic) at .18. 1 where all is black.
pub fn auto_exposure(mut luminances: Vec<f32>) -> f32 {
    luminances.retain(|l| *l > 0.0 && l.is_finite());
    if luminances.is_empty() {
        return 1.0;
    }
    let rank = (luminances.len() - 1) * 95 / 100;
    let bright = *luminances.select_nth_unstable_by(rank, f32::total_cmp).1;
    // In order, so that the sum is the same however the selection moved them.
    luminances.sort_unstable_by(f32::total_cmp);
    let log = |l: &f32| f64::from(libm::logf(l.max(bright * 1e-4)));
    let mean = libm::exp(luminances.iter().map(log).sum::<f64>() / luminances.len() as f64) as f32;
    // `shown` maps .877 to .8.
    let exposure = (0.18 / mean).clamp(0.877 / bright, 4.0 / bright);
    if exposure.is_finite() && exposure > 0.0 { exposure } else { 1.0 }
}

/// Linear up to .6, then a smooth shoulder to 1.
fn shown(c: Vec3) -> Vec3 {
    c.map(|x| if x <= 0.6 { x } else { 1.0 - 0.4 * libm::expf((0.6 - x) / 0.4) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_scales_inversely_with_the_light() {
        let lights = |scale: f32| (1..=1000).map(|i| i as f32 * scale).collect::<Vec<_>>();
        let (dim, bright) = (auto_exposure(lights(1e-3)), auto_exposure(lights(1e3)));
        assert!((dim / bright / 1e6 - 1.0).abs() < 1e-4);
        assert!((shown(Vec3::splat(950.0 * 1e-3 * dim)).x - 0.8).abs() < 0.02);
    }

    #[test]
    fn a_bright_tenth_does_not_leave_the_rest_in_the_dark() {
        let mut mixed = vec![1.0f32; 900];
        mixed.extend([100.0; 100]);
        assert!(auto_exposure(mixed) > 0.877 / 100.0 * 3.0);
    }

    #[test]
    fn darkness_and_nonsense_have_an_exposure() {
        for luminances in [vec![], vec![0.0; 9], vec![f32::NAN, -1.0], vec![f32::INFINITY], vec![1e-45]] {
            assert!(auto_exposure(luminances).is_finite());
        }
    }

    #[test]
    fn a_picture_has_its_top_first() {
        let sky = |_: Vec3, d: Vec3| {
            (d.y > 0.0).then_some(Sight { distance: 1.0, front: true, radiance: Vec3::ONE, unlit: false })
        };
        let camera = super::super::at(Vec3::ZERO, Vec3::NEG_Z, 1.0);
        let picture = paint(&sky, &Sky::Black, &camera, UVec2::new(4, 4), 2, None);
        assert_eq!((picture.rgb.len(), picture.rgb[15]), (16, [0; 3]));
        assert!(picture.rgb[0][0] > 200);
    }

    #[test]
    fn the_shoulder_is_smooth_and_stays_below_one() {
        assert!((shown(Vec3::splat(0.6001)).x - 0.6001).abs() < 1e-5);
        assert!(shown(Vec3::splat(100.0)).x <= 1.0);
    }
}
