//! Punctual lights drawn as an engine draws them, with shadows by rays: by the formulas of KHR_lights_punctual.

use super::ggx::Metal;
use crate::{
    audit::surface::Place,
    math::{Frame, Random, square_to_disc},
    scene::{Light, LightKind},
    trace::{Segment, Tracer},
};
use glam::Vec3;

/// Where a shadow ray ends before a lamp: its own surface may stand there.
const SHORT: f32 = 1.0 - 1e-4;

/// A lamp from a place, if nothing stands between.
struct Aim {
    /// Unit direction of its centre.
    center: Vec3,
    /// To a point of its extent.
    segment: Segment,
    /// Irradiance across the beam.
    across: Vec3,
}

/// Irradiance from `lamps` at a place.
pub(super) fn irradiance(tracer: &Tracer, place: &Place, lamps: &[&Light], random: &mut Random) -> Vec3 {
    let aims = lamps.iter().filter_map(|lamp| aim(place, lamp, random));
    let of = |aim: &Aim| aim.across * aim.center.dot(place.normal).max(0.0);
    arriving(tracer, aims.collect(), of)
}

/// Light of all the scene's lamps that metal mirrors to the eye.
pub(super) fn mirrored(tracer: &Tracer, place: &Place, metal: &Metal, random: &mut Random) -> Vec3 {
    let aims = tracer.world.scene.lights.iter().filter_map(|lamp| aim(place, lamp, random));
    arriving(tracer, aims.collect(), |aim| aim.across * metal.shine(aim.segment.direction))
}

fn arriving(tracer: &Tracer, mut aims: Vec<Aim>, of: impl Fn(&Aim) -> Vec3) -> Vec3 {
    aims.retain(|aim| of(aim) != Vec3::ZERO);
    let segments: Vec<Segment> = aims.iter().map(|aim| aim.segment).collect();
    let mut through = vec![Vec3::ZERO; aims.len()];
    tracer.transmittance_of_each(&segments, &mut through);
    aims.iter().zip(through).map(|(aim, through)| of(aim) * through).sum()
}

fn aim(place: &Place, light: &Light, random: &mut Random) -> Option<Aim> {
    let (center, direction, t, across) = match light.kind {
        LightKind::Directional { angle } => {
            let center = -light.direction;
            let disc = square_to_disc(random.pair()) * libm::sinf(angle * 0.5);
            let z = (1.0 - disc.length_squared()).max(0.0).sqrt();
            (center, Frame::around(center).to_world(disc.extend(z)), f32::INFINITY, light.intensity)
        }
        LightKind::Point { radius } | LightKind::Spot { radius, .. } => {
            let way = light.position - place.position;
            let distance = way.length();
            let center = way / distance;
            let disc = square_to_disc(random.pair()) * radius;
            let way = way + Frame::around(center).to_world(disc.extend(0.0));
            let window = (1.0 - libm::powf(distance / light.range, 4.0)).clamp(0.0, 1.0);
            let across = light.intensity * (window * cone(light, center) / (distance * distance));
            (center, way / way.length(), way.length() * SHORT, across)
        }
    };
    let lit = across.is_finite() && across != Vec3::ZERO;
    let above = center.dot(place.face) > 0.0 && direction.dot(place.face) > 0.0;
    (lit && above).then(|| Aim { center, segment: place.segment(direction, t), across })
}

fn cone(light: &Light, to_light: Vec3) -> f32 {
    let LightKind::Spot { cos_inner, cos_outer, .. } = light.kind else { return 1.0 };
    let scale = 1.0 / (cos_inner - cos_outer).max(1e-3);
    let share = ((light.direction.dot(-to_light) - cos_outer) * scale).clamp(0.0, 1.0);
    share * share
}
