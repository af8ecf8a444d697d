//! Punctual lights: one of them a vertex, chosen by what it would send if nothing stood in its way.

use super::surface::Place;
use crate::{
    math::{Frame, luminance, square_to_disc},
    scene::{Light, LightKind},
    trace::Segment,
};
use glam::{Vec2, Vec3};

/// A way to a light, and the irradiance that it stands for.
pub(super) struct Aim {
    pub segment: Segment,
    pub irradiance: Vec3,
}

/// Where a shadow ray ends before a lamp: its own surface may stand there.
const SHORT: f32 = 1.0 - 1e-4;

/// One of `lights` for `choice`, seen from `place`; its disc is sampled by `u`. `shares` is room to work in.
pub(super) fn aim(place: &Place, lights: &[&Light], choice: f32, u: Vec2, shares: &mut Vec<f32>) -> Option<Aim> {
    shares.clear();
    let mut total = 0.0;
    for light in lights {
        total += towards(place, light).map_or(0.0, |(.., e)| luminance(e));
        shares.push(total);
    }
    if total <= 0.0 {
        return None;
    }
    let k = shares.partition_point(|s| *s <= choice * total).min(lights.len() - 1);
    let (to_light, distance, irradiance) = towards(place, lights[k])?;
    let irradiance = irradiance * (total / luminance(irradiance).max(f32::MIN_POSITIVE));
    let (direction, t) = match lights[k].kind {
        LightKind::Directional { angle } => (in_disc(to_light, angle, u), f32::INFINITY),
        LightKind::Point { radius } | LightKind::Spot { radius, .. } if radius > 0.0 => {
            let disc = square_to_disc(u) * radius;
            let target = lights[k].position + Frame::around(to_light).to_world(disc.extend(0.0));
            let way = target - place.position;
            (way / way.length(), way.length() * SHORT)
        }
        _ => (to_light, distance * SHORT),
    };
    let segment = place.segment(direction, t);
    (direction.dot(place.face) > 0.0).then_some(Aim { segment, irradiance })
}

/// Direction, distance and unshadowed irradiance of a light's centre, by KHR_lights_punctual: its extent softens shadows
/// and changes nothing else.
fn towards(place: &Place, light: &Light) -> Option<(Vec3, f32, Vec3)> {
    let (direction, distance, share) = match light.kind {
        LightKind::Directional { .. } => (-light.direction, f32::INFINITY, 1.0),
        LightKind::Point { .. } | LightKind::Spot { .. } => {
            let way = light.position - place.position;
            let distance = way.length();
            let direction = way / distance;
            let window = 1.0 - libm::powf(distance / light.range, 4.0);
            (direction, distance, window.clamp(0.0, 1.0) * cone(light, direction) / (distance * distance))
        }
    };
    let irradiance = light.intensity * (share * direction.dot(place.normal));
    let lit = place.faces(direction) && irradiance.is_finite() && luminance(irradiance) > 0.0;
    lit.then_some((direction, distance, irradiance))
}

fn cone(light: &Light, to_light: Vec3) -> f32 {
    let LightKind::Spot { cos_inner, cos_outer, .. } = light.kind else { return 1.0 };
    let scale = 1.0 / (cos_inner - cos_outer).max(1e-3);
    let share = ((light.direction.dot(-to_light) - cos_outer) * scale).clamp(0.0, 1.0);
    share * share
}

/// A direction in the disc of `diameter` (radians) around `center`, even in projected area.
fn in_disc(center: Vec3, diameter: f32, u: Vec2) -> Vec3 {
    if diameter <= 0.0 {
        return center;
    }
    let d = square_to_disc(u) * libm::sinf(diameter * 0.5);
    Frame::around(center).to_world(d.extend((1.0 - d.length_squared()).max(0.0).sqrt()))
}
