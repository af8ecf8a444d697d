//! Punctual lights at a point: the formulas of KHR_lights_punctual, and where to aim a shadow ray.

use crate::{
    math::{Frame, cosine_hemisphere, square_to_disc},
    patches::SurfacePoint,
    scene::{Light, LightKind},
};
use glam::{Vec2, Vec3};

/// A shadow ray and what it carries if nothing is in its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    /// Unit direction.
    pub direction: Vec3,
    /// Distance to the source, metres; infinite for the sky.
    pub distance: f32,
    /// Unshadowed irradiance, W/m^2.
    pub irradiance: Vec3,
}

/// Unshadowed irradiance at `p`, I cos / d^2 with the shading normal and nothing below the face, and the shadow ray for
/// sample `u` of the light's extent. The extent softens shadows only.
#[inline]
pub(super) fn aim(light: &Light, p: &SurfacePoint, u: Vec2) -> Option<Aim> {
    let (to_light, distance, attenuation, radius) = match light.kind {
        LightKind::Directional { angle } => {
            let center = -light.direction;
            let direction = if angle > 0.0 { in_disc(center, angle, u) } else { center };
            return lit(p, center, light.intensity).filter(|_| direction.dot(p.face) > 0.0).map(|irradiance| Aim {
                direction,
                distance: f32::INFINITY,
                irradiance,
            });
        }
        LightKind::Point { radius } => {
            let (l, d) = towards(light.position, p.position)?;
            (l, d, 1.0, radius)
        }
        LightKind::Spot { cos_inner, cos_outer, radius } => {
            let (l, d) = towards(light.position, p.position)?;
            let scale = 1.0 / (cos_inner - cos_outer).max(1e-3);
            let cone = ((-l).dot(light.direction) - cos_outer) * scale;
            let cone = cone.clamp(0.0, 1.0);
            (l, d, cone * cone, radius)
        }
    };
    let window = if light.range.is_finite() {
        let r = distance / light.range;
        (1.0 - r * r * r * r).clamp(0.0, 1.0)
    } else {
        1.0
    };
    let irradiance = lit(p, to_light, light.intensity * (attenuation * window / (distance * distance)))?;
    if radius <= 0.0 {
        return Some(Aim { direction: to_light, distance, irradiance });
    }
    // The ball looks like a disc across the line of sight.
    let disc = square_to_disc(u) * radius;
    let target = light.position + Frame::around(to_light).to_world(disc.extend(0.0));
    let (direction, distance) = towards(target, p.position)?;
    (direction.dot(p.face) > 0.0).then_some(Aim { direction, distance, irradiance })
}

fn towards(target: Vec3, from: Vec3) -> Option<(Vec3, f32)> {
    let v = target - from;
    let d = v.length();
    (d > 0.0).then(|| (v / d, d))
}

fn lit(p: &SurfacePoint, to_light: Vec3, across: Vec3) -> Option<Vec3> {
    let cos = to_light.dot(p.normal);
    let irradiance = across * cos;
    (cos > 0.0 && to_light.dot(p.face) > 0.0 && irradiance != Vec3::ZERO).then_some(irradiance)
}

/// A direction in the disc of the sky with diameter `angle` (radians) around `center`, evenly in solid angle.
fn in_disc(center: Vec3, angle: f32, u: Vec2) -> Vec3 {
    let sin = libm::sinf(angle * 0.5);
    let d = cosine_hemisphere(u);
    let (x, y) = (d.x * sin, d.y * sin);
    Frame::around(center).to_world(Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt()))
}
