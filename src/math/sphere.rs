//! Equal-area cells of the sphere of directions (Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD",
//! 2008: an octahedron unfolded to a square).

use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_2_PI;

/// Cells along an edge of the unfolded square.
const SIDE: u32 = 64;

/// Number of cells, all of the same solid angle.
pub const CELLS: u32 = SIDE * SIDE;

/// The cell of a unit direction.
#[inline]
pub fn cell_of(d: Vec3) -> u32 {
    let a = d.abs();
    let r = (1.0 - a.z).max(0.0).sqrt();
    // Angle within the octant over a right angle.
    let phi = FRAC_2_PI * libm::atan2f(a.y, a.x);
    let (mut v, mut u) = (phi * r, r - phi * r);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    let s = Vec2::new(u.copysign(d.x), v.copysign(d.y)) * 0.5 + 0.5;
    let i = (s * SIDE as f32).as_uvec2().min(glam::UVec2::splat(SIDE - 1));
    i.y * SIDE + i.x
}

/// The direction in the middle of a cell.
pub fn cell_center(cell: u32) -> Vec3 {
    let s = (Vec2::new((cell % SIDE) as f32, (cell / SIDE) as f32) + 0.5) / SIDE as f32 * 2.0 - 1.0;
    let a = s.abs();
    let below = 1.0 - a.x - a.y;
    let r = 1.0 - below.abs();
    let phi = if r == 0.0 { 0.0 } else { ((a.y - a.x) / r + 1.0) / FRAC_2_PI * 0.5 };
    let z = (1.0 - r * r).copysign(below);
    let f = r * (2.0 - r * r).max(0.0).sqrt();
    Vec3::new((f * libm::cosf(phi)).copysign(s.x), (f * libm::sinf(phi)).copysign(s.y), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_know_their_centers() {
        for cell in 0..CELLS {
            let d = cell_center(cell);
            assert!((d.length() - 1.0).abs() < 1e-5, "{cell} {d}");
            assert_eq!(cell_of(d), cell);
        }
    }

    #[test]
    fn cells_have_equal_areas() {
        let n = 1024;
        let mut count = vec![0u32; CELLS as usize];
        for i in 0..n {
            for j in 0..n {
                let (z, phi) =
                    ((i as f32 + 0.5) / n as f32 * 2.0 - 1.0, (j as f32 + 0.5) / n as f32 * std::f32::consts::TAU);
                let s = (1.0 - z * z).sqrt();
                count[cell_of(Vec3::new(s * libm::cosf(phi), s * libm::sinf(phi), z)) as usize] += 1;
            }
        }
        let mean = (n * n) as f32 / CELLS as f32;
        assert!(count.iter().all(|&c| (c as f32 / mean - 1.0).abs() < 0.2), "{:?}", count.iter().max());
    }
}
