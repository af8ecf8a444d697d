//! Punctual lights (KHR_lights_punctual) of nodes that stand still.

use super::{
    nodes::Placed,
    source::{Source, label},
    warnings::Warnings,
    wishes::Wishes,
};
use crate::{
    error::Result,
    scene::{Light, LightKind, MAX_LIGHT},
};
use glam::{DVec3, Vec3};
use gltf::json::{
    extensions::scene::khr_lights_punctual::{Light as Punctual, Spot, Type},
    validation::Checked,
};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

/// The lights of `placed`, relative to `origin`, their intensities times `scale`.
pub(super) fn read(
    source: &Source,
    placed: &[Placed],
    origin: DVec3,
    scale: f32,
    warnings: &mut Warnings,
) -> Result<Vec<Light>> {
    let mut lights = Vec::new();
    for p in placed {
        let extensions = source.nodes[p.node].extensions.as_ref();
        let Some(index) = extensions.and_then(|e| e.khr_lights_punctual.as_ref()).map(|l| l.light.value()) else {
            continue;
        };
        let node = source.node_name(p.node);
        let from = source.part(&source.lights, index, "light", &node)?;
        let Checked::Valid(kind) = from.type_ else {
            return Err(source.invalid(label("light", index, from.name.as_deref()), "its type is unknown"));
        };
        if p.moves {
            let sentence = "its light moves and is not baked; set extras luxel.static to true to bake it where it is";
            warnings.about(node, sentence);
            continue;
        }
        let intensity = (Vec3::from_array(from.color).as_dvec3() * f64::from(from.intensity)) * f64::from(scale);
        let position = (p.world.translation - origin).as_vec3();
        let direction = (-p.world.matrix3.z_axis).normalize_or_zero().as_vec3();
        let aimed = kind == Type::Point || direction != Vec3::ZERO;
        if !(!intensity.is_nan() && intensity.min_element() >= 0.0 && position.is_finite() && aimed) {
            warnings.about(node, "its light has no valid intensity, position or direction and is left out");
            continue;
        }
        if intensity.max_element() > f64::from(MAX_LIGHT) {
            warnings.about(&node, format!("its light is brighter than {MAX_LIGHT:e}: it is capped there"));
        }
        let intensity = intensity.as_vec3().min(Vec3::splat(MAX_LIGHT));
        let kind = shape(kind, from, &p.wishes, &node, warnings);
        let range = range(from, &node, warnings);
        let (name, bake) = (node, p.wishes.bake.unwrap_or_default());
        lights.push(Light { name, node: Some(p.node as u32), kind, position, direction, intensity, range, bake });
    }
    Ok(lights)
}

fn shape(kind: Type, from: &Punctual, wishes: &Wishes, node: &str, warnings: &mut Warnings) -> LightKind {
    let radius = wishes.radius.unwrap_or(0.0);
    match kind {
        Type::Point => LightKind::Point { radius },
        Type::Directional => LightKind::Directional { angle: wishes.angle.unwrap_or(0.0).to_radians() },
        Type::Spot => {
            let default = Spot { inner_cone_angle: 0.0, outer_cone_angle: FRAC_PI_4 };
            let Spot { inner_cone_angle: inner, outer_cone_angle: outer } =
                from.spot.clone().unwrap_or(default.clone());
            let (inner, outer) = if inner >= 0.0 && inner < outer && outer <= FRAC_PI_2 + 1e-6 {
                (inner, outer)
            } else {
                warnings.about(node, "its spot's cone angles are invalid: 0 and 45 degrees are used");
                (default.inner_cone_angle, default.outer_cone_angle)
            };
            LightKind::Spot { cos_inner: libm::cosf(inner), cos_outer: libm::cosf(outer).max(0.0), radius }
        }
    }
}

fn range(from: &Punctual, node: &str, warnings: &mut Warnings) -> f32 {
    match from.range {
        None => f32::INFINITY,
        Some(range) if range > 0.0 => range,
        Some(range) => {
            warnings.about(node, format!("its light's range is {range}: taken as infinite"));
            f32::INFINITY
        }
    }
}
