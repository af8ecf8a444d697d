//! Perspective cameras of the scene, for pictures.

use super::{nodes::Placed, source::Source};
use crate::{error::Result, scene::Camera};
use glam::DVec3;

/// The perspective cameras of `placed`, relative to `origin`; orthographic and degenerate ones are left out.
pub(super) fn read(source: &Source, placed: &[Placed], origin: DVec3) -> Result<Vec<Camera>> {
    let mut cameras = Vec::new();
    for p in placed {
        let Some(index) = source.nodes[p.node].camera.map(|c| c.value()) else { continue };
        let name = source.node_name(p.node);
        let from = source.part(&source.cameras, index, "camera", &name)?;
        let Some(perspective) = from.perspective.as_ref() else { continue };
        let m = p.world.matrix3;
        let forward = (-m.z_axis).normalize_or_zero();
        let up = m.y_axis.reject_from_normalized(forward).normalize_or_zero();
        let eye = (p.world.translation - origin).as_vec3();
        let yfov = perspective.yfov;
        if forward != DVec3::ZERO && up != DVec3::ZERO && eye.is_finite() && yfov > 0.0 && yfov < std::f32::consts::PI {
            let name = from.name.clone().or(source.nodes[p.node].name.clone()).unwrap_or(name);
            cameras.push(Camera { name, eye, forward: forward.as_vec3(), up: up.as_vec3(), yfov });
        }
    }
    Ok(cameras)
}
