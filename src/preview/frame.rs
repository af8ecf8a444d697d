//! A view of any scene: of many candidates the one that sees most of its lit surface.
//!
//! Candidates stand around the scene, looking at its middle, and inside its closed places, in front of a wall, looking
//! across. Each casts a coarse grid of rays; what counts is the area of lit surface they meet.

use super::{Cast, axes, half_extent, see};
use crate::{math::luminance, scene::Camera};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Rays of a candidate's grid.
const GRID: (u32, u32) = (32, 18);
/// Vertical fields of view, radians: outside, and inside where one cannot step back.
const OUTSIDE_FOV: f32 = 0.7;
const INSIDE_FOV: f32 = 1.0;
/// Worth of what is seen through a wall's back, against what is seen through an opening.
const THROUGH: f32 = 0.3;
/// Worth of a view from inside: it fills the picture anyway, but shows less of the shape.
const INSIDE: f32 = 0.7;

/// A camera at `eye` that looks `forward` (unit), upright.
pub fn at(eye: Vec3, forward: Vec3, yfov: f32) -> Camera {
    let up = if forward.y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
    Camera { name: String::new(), eye, forward, up, yfov }
}

/// The best view of what lies between `low` and `high`, for pictures of this aspect (width by height).
pub fn frame(cast: &Cast, low: Vec3, high: Vec3, aspect: f32) -> Camera {
    let diagonal = (high - low).length().max(1e-6);
    let mut candidates = outside(low, high, aspect);
    candidates.extend(inside(cast, low, high));
    let seen: Vec<_> = candidates.par_iter().map(|(c, _)| views(cast, c, aspect, diagonal)).collect();
    let mut lights: Vec<f32> = seen.iter().flat_map(|s| s.iter().map(|v| v.0)).filter(|l| *l > 0.0).collect();
    lights.sort_unstable_by(f32::total_cmp);
    let typical = lights.get(lights.len() / 2).copied().unwrap_or(1.0);
    // Brightness counts, but little: a lit surface is worth about one, a black one a tenth.
    let worth = |&(light, weight): &(f32, f32)| weight * (0.1 + 0.9 * light / (light + 0.2 * typical));
    let score = |i: usize| seen[i].iter().map(worth).sum::<f32>() * candidates[i].1;
    let best = (0..candidates.len()).max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a)));
    best.map(|i| candidates[i].0.clone()).unwrap_or_else(|| at(high, Vec3::NEG_Z, OUTSIDE_FOV))
}

/// Cameras around the box with their preference; the box just fits the picture.
fn outside(low: Vec3, high: Vec3, aspect: f32) -> Vec<(Camera, f32)> {
    let middle = (low + high) * 0.5;
    let corners = (0..8).map(|k| Vec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), high, low) - middle);
    let corners: Vec<_> = corners.collect();
    let (tan_x, tan_y) = half_extent(OUTSIDE_FOV, aspect);
    let mut cameras = Vec::new();
    for (elevation, preference) in [(0.12, 1.0), (0.45, 1.05), (0.85, 0.95)] {
        for k in 0..16 {
            let forward = -direction(k as f32 / 16.0 * TAU, elevation);
            let (right, up) = axes(forward, Vec3::Y);
            let distance = |c: &Vec3| (c.dot(right).abs() / tan_x).max(c.dot(up).abs() / tan_y) - c.dot(forward);
            let distance = corners.iter().map(distance).fold(0.0, f32::max) * 1.04 + 1e-3;
            cameras.push((at(middle - forward * distance, forward, OUTSIDE_FOV), preference));
        }
    }
    cameras
}

/// Cameras in closed places, each in front of a wall or in a corner, looking across.
fn inside(cast: &Cast, low: Vec3, high: Vec3) -> Vec<(Camera, f32)> {
    let mut cameras = Vec::new();
    for k in 0..9 {
        let share = Vec3::new((1 + 2 * (k % 3)) as f32 / 6.0, 0.5, (1 + 2 * (k / 3)) as f32 / 6.0);
        let seed = low + (high - low) * share;
        if !enclosed(cast, seed) {
            continue;
        }
        let free = |direction: Vec3| cast(seed, direction).map_or(0.0, |s| s.distance);
        let (down, up) = (free(Vec3::NEG_Y), free(Vec3::Y));
        let height = 1.6f32.max(0.35 * (down + up)).min(0.6 * (down + up));
        let seed = seed + Vec3::Y * (height - down);
        for k in 0..8 {
            let away = direction(k as f32 / 8.0 * TAU, 0.0);
            if let Some(wall) = cast(seed, away) {
                let forward = (-away - 0.12 * Vec3::Y).normalize();
                cameras.push((at(seed + away * wall.distance * 0.88, forward, INSIDE_FOV), INSIDE));
            }
        }
    }
    cameras
}

/// True if nine in ten rays from `point` meet a front: it is in a room, not in a wall, under the sky or in an open box.
fn enclosed(cast: &Cast, point: Vec3) -> bool {
    let rays = 64;
    let fronts = (0..rays).filter(|&k| {
        let y = (2.0 * k as f32 + 1.0) / rays as f32 - 1.0;
        cast(point, direction(k as f32 * 2.399_963_2, libm::asinf(y))).is_some_and(|s| s.front)
    });
    fronts.count() * 10 >= rays * 9
}

/// What each ray of a camera's grid sees: the light there, and the area it stands for times its worth.
fn views(cast: &Cast, camera: &Camera, aspect: f32, diagonal: f32) -> Vec<(f32, f32)> {
    let (tan_x, tan_y) = half_extent(camera.yfov, aspect);
    let (right, up) = axes(camera.forward, camera.up);
    let (width, height) = (GRID.0 as usize, GRID.1 as usize);
    let hit = |k: usize| {
        let x = ((k % width) as f32 + 0.5) / width as f32 * 2.0 - 1.0;
        let y = ((k / width) as f32 + 0.5) / height as f32 * 2.0 - 1.0;
        let direction = (camera.forward + right * (x * tan_x) - up * (y * tan_y)).normalize();
        let (sight, through) = see(cast, camera.eye, direction)?;
        let near = sight.distance < 0.01 * diagonal;
        (!near).then_some((camera.eye + direction * sight.distance, sight, through))
    };
    let hits: Vec<_> = (0..width * height).map(hit).collect();
    let cell = 4.0 * tan_x * tan_y / (width * height) as f32;
    let view = |k: usize| {
        let (at, sight, through) = hits[k]?;
        let beside = hits.get(k + 1).copied().flatten().filter(|_| k % width + 1 < width);
        let below = hits.get(k + width).copied().flatten();
        // Squarely seen; a slanted surface shows more, which its neighbours tell, but an edge must not tell too much.
        let square = sight.distance * sight.distance * cell;
        let slanted = beside.zip(below).map_or(square, |(b, c)| (b.0 - at).cross(c.0 - at).length());
        let area = slanted.min(6.0 * square).min(0.01 * diagonal * diagonal);
        let light = if sight.unlit { 0.0 } else { luminance(sight.radiance) };
        Some((light, area * if through { THROUGH } else { 1.0 }))
    };
    (0..hits.len()).filter_map(view).collect()
}

/// Unit vector by azimuth from +Z towards +X and elevation, radians.
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    let flat = libm::cosf(elevation);
    Vec3::new(flat * libm::sinf(azimuth), libm::sinf(elevation), flat * libm::cosf(azimuth))
}
