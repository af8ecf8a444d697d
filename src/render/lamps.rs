//! Punctual lights drawn as an engine draws them, with shadows by rays: by the formulas of KHR_lights_punctual.

use super::ggx::Metal;
use crate::{
    audit::surface::Place,
    math::{Frame, Random, square_to_disc},
    scene::{Light, LightKind},
    trace::{Segment, Tracer},
};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Where a shadow ray ends before a lamp: its own surface may stand there.
const SHORT: f32 = 1.0 - 1e-4;

/// A lamp as it is seen from a place: a disc across the line of sight, whose extent softens shadows and highlights and
/// changes nothing else.
struct Disc {
    /// Unit direction of its centre.
    center: Vec3,
    /// Metres to its centre; infinite for a part of the sky.
    distance: f32,
    /// In metres, or on the unit sphere of the sky.
    radius: f32,
    /// Irradiance across the beam.
    across: Vec3,
}

/// A way to a lamp, and what arrives if nothing stands in it.
struct Aim {
    segment: Segment,
    light: Vec3,
}

/// Irradiance from `lamps` at a place.
pub(super) fn irradiance(tracer: &Tracer, place: &Place, lamps: &[&Light], random: &mut Random) -> Vec3 {
    let aim = |lamp: &&Light| {
        let disc = Disc::new(place, lamp)?;
        let light = disc.across * disc.center.dot(place.normal).max(0.0);
        Some(Aim { segment: disc.segment(place, disc.direction(random.pair())), light })
    };
    arriving(tracer, place, lamps.iter().filter_map(aim).collect())
}

/// Light of all the scene's lamps that metal mirrors to the eye, by a point of each disc and, where it meets one, by the
/// metal's own `sample`, a direction: the balance heuristic. The former see rough metal better, the latter smooth.
pub(super) fn mirrored(
    tracer: &Tracer,
    place: &Place,
    metal: &Metal,
    sample: Option<Vec3>,
    random: &mut Random,
) -> Vec3 {
    let mut aims = Vec::new();
    for disc in tracer.world.scene.lights.iter().filter_map(|lamp| Disc::new(place, lamp)) {
        let by_lamp = disc.direction(random.pair());
        let by_metal = sample.filter(|direction| disc.holds(*direction));
        for direction in [by_lamp].into_iter().chain(by_metal) {
            // Both ways to a direction give the same: what it sends over the sum of their densities.
            let light =
                disc.across * metal.shine(direction) / (1.0 + metal.density(direction) / disc.density(direction));
            aims.push(Aim { segment: disc.segment(place, direction), light });
        }
    }
    arriving(tracer, place, aims)
}

fn arriving(tracer: &Tracer, place: &Place, mut aims: Vec<Aim>) -> Vec3 {
    aims.retain(|aim| aim.light != Vec3::ZERO && aim.segment.direction.dot(place.face) > 0.0);
    let segments: Vec<Segment> = aims.iter().map(|aim| aim.segment).collect();
    let mut through = vec![Vec3::ZERO; aims.len()];
    tracer.transmittance_of_each(&segments, &mut through);
    aims.iter().zip(through).map(|(aim, through)| aim.light * through).sum()
}

impl Disc {
    /// `None` if nothing of it arrives.
    fn new(place: &Place, light: &Light) -> Option<Self> {
        let disc = match light.kind {
            LightKind::Directional { angle } => {
                let radius = libm::sinf(angle * 0.5);
                Disc { center: -light.direction, distance: f32::INFINITY, radius, across: light.intensity }
            }
            LightKind::Point { radius } | LightKind::Spot { radius, .. } => {
                let way = light.position - place.position;
                let distance = way.length();
                let center = way / distance;
                let window = (1.0 - libm::powf(distance / light.range, 4.0)).clamp(0.0, 1.0);
                let across = light.intensity * (window * cone(light, center) / (distance * distance));
                Disc { center, distance, radius, across }
            }
        };
        let lit = disc.across.is_finite() && disc.across != Vec3::ZERO;
        (lit && disc.center.dot(place.face) > 0.0).then_some(disc)
    }

    /// Of the point `u`, evenly over the disc, or over what it covers of the sky's plan.
    fn direction(&self, u: Vec2) -> Vec3 {
        let disc = square_to_disc(u) * self.radius;
        let up = if self.distance.is_finite() { self.distance } else { (1.0 - disc.length_squared()).max(0.0).sqrt() };
        Frame::around(self.center).to_world(disc.extend(up)).normalize()
    }

    /// Density of such directions, by solid angle; infinite without extent.
    fn density(&self, direction: Vec3) -> f32 {
        let cos = direction.dot(self.center);
        let area = PI * self.radius * self.radius;
        if self.distance.is_finite() { self.distance * self.distance / (cos * cos * cos * area) } else { cos / area }
    }

    /// True if the unit direction meets it.
    fn holds(&self, direction: Vec3) -> bool {
        let cos = direction.dot(self.center);
        let aside = (direction - self.center * cos).length();
        let reach = if self.distance.is_finite() { self.radius * cos / self.distance } else { self.radius };
        cos > 0.0 && aside < reach
    }

    /// The way to where the direction meets it.
    fn segment(&self, place: &Place, direction: Vec3) -> Segment {
        place.segment(direction, self.distance / direction.dot(self.center) * SHORT)
    }
}

fn cone(light: &Light, to_light: Vec3) -> f32 {
    let LightKind::Spot { cos_inner, cos_outer, .. } = light.kind else { return 1.0 };
    let scale = 1.0 / (cos_inner - cos_outer).max(1e-3);
    let share = ((light.direction.dot(-to_light) - cos_outer) * scale).clamp(0.0, 1.0);
    share * share
}
