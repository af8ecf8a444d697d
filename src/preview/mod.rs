//! [`Picture`]: a baked scene seen by a camera, for the eye. [`frame`] finds a camera that shows it.
//!
//! Knows the scene only by what a ray sees ([`Cast`]), so it works with any tracer and any light. Backs of single-sided
//! surfaces are looked through: a room is seen from outside as in a doll's house.

mod baked;
mod frame;
mod paint;

pub use baked::flat;
pub use frame::{at, frame};
pub use paint::{Picture, auto_exposure, paint};

use glam::Vec3;

/// What a ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Metres from the ray's origin.
    pub distance: f32,
    /// True on a side that reflects; false on the back of a single-sided surface.
    pub front: bool,
    /// Radiance towards the ray: rho E / pi, what is mirrored and what is emitted.
    pub radiance: Vec3,
    /// True if `radiance` is a colour to be shown as it is, whatever the exposure.
    pub unlit: bool,
}

/// The nearest surface from an origin in a unit direction.
pub type Cast<'a> = dyn Fn(Vec3, Vec3) -> Option<Sight> + Sync + 'a;

/// The nearest front from `eye`, and whether backs were looked through.
fn see(cast: &Cast, eye: Vec3, direction: Vec3) -> Option<(Sight, bool)> {
    let mut passed = 0.0;
    for backs in 0..64 {
        let sight = cast(eye + direction * passed, direction)?;
        passed += sight.distance;
        if sight.front {
            return Some((Sight { distance: passed, ..sight }, backs > 0));
        }
        passed = passed * 1.0001 + 1e-5;
    }
    None
}

/// Tangents of half the horizontal and half the vertical field of view.
fn half_extent(yfov: f32, aspect: f32) -> (f32, f32) {
    let y = libm::tanf(0.5 * yfov.clamp(0.01, 3.0));
    (y * aspect, y)
}

/// Unit vectors to the right and up of a camera that looks `forward`.
fn axes(forward: Vec3, up: Vec3) -> (Vec3, Vec3) {
    let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    (right, right.cross(forward))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box room with inward fronts around the origin, `half` its half extents, lit alike; the wall at +Z is missing if
    /// `open`.
    pub fn room(half: Vec3, open: bool) -> impl Fn(Vec3, Vec3) -> Option<Sight> + Sync {
        move |origin, direction| {
            let mut nearest: Option<Sight> = None;
            for axis in 0..3 {
                for side in [-1.0f32, 1.0] {
                    if open && axis == 2 && side > 0.0 {
                        continue;
                    }
                    let distance = (side * half[axis] - origin[axis]) / direction[axis];
                    let at = origin + direction * distance;
                    let inside = (0..3).all(|i| i == axis || at[i].abs() <= half[i]);
                    if inside && distance > 1e-6 && nearest.is_none_or(|n| distance < n.distance) {
                        let front = direction[axis] * side > 0.0;
                        nearest = Some(Sight { distance, front, radiance: Vec3::ONE, unlit: false });
                    }
                }
            }
            nearest
        }
    }

    #[test]
    fn backs_are_looked_through() {
        let room = room(Vec3::ONE, false);
        let (sight, through) = see(&room, Vec3::new(0.1, 0.2, 5.0), Vec3::NEG_Z).unwrap();
        assert!(through && sight.front && (sight.distance - 6.0).abs() < 1e-3, "{sight:?}");
        assert!(see(&room, Vec3::splat(5.0), Vec3::Y).is_none());
    }

    #[test]
    fn an_open_box_is_seen_through_its_opening() {
        let room = room(Vec3::ONE, true);
        let camera = frame(&room, Vec3::NEG_ONE, Vec3::ONE, 16.0 / 9.0);
        assert!(camera.eye.z > 1.0 && camera.forward.z < -0.7, "{camera:?}");
    }

    #[test]
    fn a_closed_room_fills_the_picture() {
        for half in [Vec3::ONE, Vec3::new(6.0, 1.5, 2.0), Vec3::splat(280.0)] {
            let room = room(half, false);
            let camera = frame(&room, -half, half, 16.0 / 9.0);
            let picture = paint(&room, &crate::scene::Sky::Black, &camera, glam::UVec2::new(64, 36), 2, None);
            let dark = picture.rgb.iter().filter(|c| c[0] == 0).count();
            assert!(dark < picture.rgb.len() / 10, "{camera:?}: {dark}");
        }
    }

    #[test]
    fn axes_stand_upright_and_survive_a_vertical_view() {
        let (right, up) = axes(Vec3::NEG_Z, Vec3::Y);
        assert!((right - Vec3::X).length() < 1e-6 && (up - Vec3::Y).length() < 1e-6);
        let (right, up) = axes(Vec3::NEG_Y, Vec3::Y);
        assert!(right.is_normalized() && up.is_normalized());
    }
}
