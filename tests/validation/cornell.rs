//! Mitsuba's Cornell box without its boxes: [-1, 1]^3, open at the front (z = 1), a lamp just below the ceiling.

use crate::common::{
    scenes::{Cuboid, Face, rectangle},
    stage::Stage,
};
use crate::{Case, Check, Outcome, numbers};
use glam::{DVec3, UVec2, Vec3, vec3};
use std::f32::consts::PI;

/// The lamp and the walls look inwards; the lamp's back is dark. Faces have 32 x 32 texels, a cell 4 x 4 of them: means
/// over cells are exact, texels cost (1/32)^2 of the light's change over a face. The reference's own error counts with
/// 3 x se; the bake's, by channel, with what neighbouring texels show. A cell's se is that of the worst cell.
/// Ceiling behind the lamp counts as enclosed: dark, and not part of its texel's E.
pub fn cornell_no_boxes(case: &Case) -> Outcome {
    let mut stage = Stage::new();
    let mut paint = |r, g, b| stage.rgb(vec3(r, g, b), Vec3::ZERO, false);
    let white = paint(0.885809, 0.698859, 0.666422);
    let green = paint(0.105421, 0.37798, 0.076425);
    let red = paint(0.570068, 0.0430135, 0.0443706);
    let lamp = stage.rgb(vec3(0.885809, 0.698859, 0.666422), vec3(18.387, 13.9873, 6.75357) * PI, false);
    let room = Cuboid::room(Vec3::NEG_ONE, Vec3::ONE);
    let mut face = |f, material| room.face(&mut stage, f, material, UVec2::ONE, UVec2::splat(32));
    let faces = [
        ("floor", face(Face::Bottom, white)),
        ("ceiling", face(Face::Top, white)),
        ("back", face(Face::Back, white)),
        ("green_x1", face(Face::Right, green)),
        ("red_x-1", face(Face::Left, red)),
    ];
    let corner = vec3(-0.23, 0.99, 0.01 - 0.19);
    rectangle(&mut stage, lamp, [corner, Vec3::X * 0.46, Vec3::Z * 0.38], UVec2::splat(8));
    let shot = case.shoot(stage, 1024)?;
    let mut checks = Vec::new();
    for (name, chart) in faces {
        let face = &case.expected[name];
        let (want, se) = (DVec3::from_slice(&numbers(&face["mean_H"])?), DVec3::from_slice(&numbers(&face["se"])?));
        let se_cell = face["se_cell_max"].as_f64().ok_or("no se_cell_max")?;
        let (noise, rows, (_, mean)) = (shot.noise(chart), shot.rows(chart), shot.mean(&[chart]));
        let mut errors = Vec::new();
        for k in 0..3 {
            let (what, expected, got) = (format!("{name} mean, channel {k}"), want[k], mean[k]);
            let (tolerance, sigma) = (3.0 * se[k], noise[k] / 32.0);
            checks.push(Check {
                what,
                got,
                expected,
                tolerance,
                sigma,
                shape: expected / (32.0 * 32.0) + case.one_point(expected, 32),
            });
            let sigma = libm::hypot(noise[k] / 4.0, se_cell * want[k] / want[0]);
            for (v, row) in face["cells"].as_array().ok_or("no cells")?.iter().enumerate() {
                for (u, cell) in row.as_array().ok_or("no row of cells")?.iter().enumerate() {
                    let texels = (0..16).filter_map(|i| rows[4 * v + i / 4][4 * u + i % 4]);
                    let sum: f64 =
                        texels.map(|i| f64::from(shot.baked.irradiance[i][k] * shot.baked.patches.validity[i])).sum();
                    errors.push((sum / 16.0 - numbers(cell)?[k]) / sigma);
                }
            }
        }
        checks.push(Check::many(&format!("{name} cells"), &errors));
    }
    Ok(checks)
}
