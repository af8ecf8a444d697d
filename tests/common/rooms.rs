//! Small rooms by a seed: blocks, colours, lamps of every kind, a window to the sky in some.

use super::{
    scenes::{Cuboid, FACES, Face, texels},
    stage::Stage,
};
use glam::{UVec2, Vec2, Vec3, vec3};
use luxel::{
    math::{hash, unit_float},
    scene::{LightKind, Sky},
};

/// The room of `seed`, of some hundred texels.
pub fn seeded(seed: u32) -> Stage {
    let mut count = 0;
    let mut unit = || {
        count += 1;
        unit_float(hash(seed ^ 0x726f_6f6d, count))
    };
    let mut between = |low: f32, high: f32| low + (high - low) * unit();
    let mut stage = Stage::new();
    let size = vec3(between(2.0, 4.0), between(2.0, 3.0), between(2.0, 5.0));
    let room = Cuboid::room(Vec3::ZERO, size);
    let open = between(0.0, 1.0) < 0.4;
    let density = 3.0;
    for face in FACES.into_iter().filter(|f| !(open && *f == Face::Front)) {
        let colour = vec3(between(0.2, 0.85), between(0.2, 0.85), between(0.2, 0.85));
        let material = stage.rgb(colour, Vec3::ZERO, false);
        let wide = match face {
            Face::Left | Face::Right => Vec2::new(size.z, size.y),
            Face::Bottom | Face::Top => Vec2::new(size.x, size.z),
            _ => Vec2::new(size.x, size.y),
        };
        room.face(&mut stage, face, material, UVec2::ONE, texels(wide, density, 4));
    }
    for k in 0..2 {
        let low = vec3(size.x * between(0.1, 0.6), 0.0, size.z * (0.1 + 0.45 * k as f32));
        let edge = vec3(between(0.3, 0.8), between(0.3, 1.2), between(0.3, 0.7));
        let block = Cuboid::block(low + Vec3::Y * 0.1, low + edge);
        let material = stage.material(between(0.2, 0.8), 0.0);
        block.all(&mut stage, material, 4);
    }
    let ceiling = |x: f32, z: f32| vec3(size.x * x, size.y * 0.85, size.z * z);
    let at = ceiling(between(0.2, 0.8), between(0.2, 0.8));
    if between(0.0, 1.0) < 0.5 {
        let lamp = stage.material(0.5, between(5.0, 20.0));
        let panel = Cuboid::block(at - vec3(0.2, 0.02, 0.2), at + vec3(0.2, 0.02, 0.2));
        panel.all(&mut stage, lamp, 2);
    } else {
        let radius = if between(0.0, 1.0) < 0.5 { 0.0 } else { 0.1 };
        stage.light(LightKind::Point { radius }, at, Vec3::ZERO, between(1.0, 3.0));
    }
    let aim = vec3(between(-0.5, 0.5), -1.0, between(-0.5, 0.5));
    let spot = LightKind::Spot { cos_inner: 0.9, cos_outer: 0.7, radius: 0.05 };
    stage.light(spot, ceiling(between(0.3, 0.7), between(0.3, 0.7)), aim, between(0.0, 3.0));
    if open {
        stage.scene.sky = Sky::Uniform(vec3(0.6, 0.8, 1.0) * between(0.1, 1.0));
    }
    stage
}
