//! What stands in the room. Each function gives one mesh in its own space: origin on the floor, front towards +Z.
//!
//! Faces that would lie in another face's plane are left out.

use super::shape::{
    Shape,
    side::{BACK, BOTTOM, LEFT, RIGHT, TOP},
};
use glam::{Vec2, Vec3, vec2, vec3};
use std::f32::consts::{PI, TAU};

/// Height of the table's top.
pub const TABLE_HEIGHT: f32 = 0.75;
const TABLE_BOARD: f32 = 0.04;

pub fn table_top() -> Shape {
    block(vec3(-0.6, TABLE_HEIGHT - TABLE_BOARD, -0.4), vec3(0.6, TABLE_HEIGHT, 0.4), 0)
}

/// A leg between floor and board, centred.
pub fn table_leg() -> Shape {
    block(vec3(-0.03, 0.0, -0.03), vec3(0.03, TABLE_HEIGHT - TABLE_BOARD, 0.03), TOP | BOTTOM)
}

/// A chair with one arm, so that its mirror image is another chair.
pub fn chair() -> Shape {
    let mut out = block(vec3(-0.21, 0.42, -0.21), vec3(0.21, 0.46, 0.21), 0);
    for (x, z) in [(-0.21, -0.21), (0.17, -0.21), (-0.21, 0.17), (0.17, 0.17)] {
        out = out.block(vec3(x, 0.0, z), vec3(x + 0.04, 0.42, z + 0.04), TOP | BOTTOM);
    }
    for x in [-0.21, 0.17] {
        out = out.block(vec3(x, 0.46, -0.21), vec3(x + 0.04, 0.9, -0.17), BOTTOM);
    }
    out = out.block(vec3(-0.17, 0.6, -0.2), vec3(0.17, 0.88, -0.18), LEFT | RIGHT);
    out = out.block(vec3(0.17, 0.46, 0.12), vec3(0.21, 0.64, 0.16), TOP | BOTTOM);
    out = out.block(vec3(0.17, 0.64, -0.17), vec3(0.21, 0.67, 0.2), BACK);
    out
}

pub fn sofa() -> Shape {
    let mut out = block(vec3(-0.75, 0.0, -0.25), vec3(0.75, 0.4, 0.425), LEFT | RIGHT | BACK | BOTTOM);
    for x in [-0.95, 0.75] {
        out = out.block(vec3(x, 0.0, -0.425), vec3(x + 0.2, 0.6, 0.425), BOTTOM);
    }
    out = out.block(vec3(-0.75, 0.0, -0.425), vec3(0.75, 0.6, -0.25), LEFT | RIGHT | TOP | BOTTOM);
    out = out.block(vec3(-0.95, 0.6, -0.425), vec3(0.95, 0.85, -0.25), BOTTOM);
    for x in [-0.74, 0.01] {
        out = out.block(vec3(x, 0.4, -0.25), vec3(x + 0.73, 0.53, 0.44), BACK | BOTTOM);
    }
    out
}

/// Boards of the shelf, from the floor: their lower faces.
pub const SHELF_BOARDS: [f32; 5] = [0.08, 0.5, 0.92, 1.34, 1.76];
pub const SHELF_BOARD: f32 = 0.03;

/// A shelf whose back is the wall (z = 0).
pub fn shelf() -> Shape {
    let mut out = Shape::default();
    for x in [-0.5, 0.5 - SHELF_BOARD] {
        out = out.block(vec3(x, 0.0, 0.0), vec3(x + SHELF_BOARD, 1.82, 0.28), BACK | BOTTOM);
    }
    for y in SHELF_BOARDS {
        let half = 0.5 - SHELF_BOARD;
        out = out.block(vec3(-half, y, 0.0), vec3(half, y + SHELF_BOARD, 0.27), LEFT | RIGHT | BACK);
    }
    out
}

/// A book of 1 m x 1 m x 1 m, to be scaled.
pub fn book() -> Shape {
    block(vec3(-0.5, 0.0, -0.5), vec3(0.5, 1.0, 0.5), BOTTOM)
}

/// A rug striped by its vertex colours, 1.6 m x 2.2 m.
pub fn rug() -> Shape {
    const STRIPES: usize = 11;
    const THICK: f32 = 0.012;
    let x = [-0.8, 0.8];
    let z: Vec<f32> = (0..=STRIPES).map(|i| -1.1 + 2.2 * i as f32 / STRIPES as f32).collect();
    let mut out = Shape::default().grid(&z, &x, |z, x| vec3(x, THICK, z));
    let stripe = |i: usize| if i.is_multiple_of(2) { vec3(0.55, 0.16, 0.12) } else { vec3(0.72, 0.62, 0.44) };
    out.colors = (0..STRIPES).flat_map(|i| [stripe(i); 4]).collect();
    out = out.block(vec3(-0.8, 0.0, -1.1), vec3(0.8, THICK, 1.1), TOP | BOTTOM);
    out.colors.resize(out.positions.len(), stripe(0));
    out
}

/// A curtain 0.7 m wide and 2.3 m long in even folds.
pub fn curtain() -> Shape {
    const FOLDS: f32 = 4.0;
    Shape::sheet(40, 1, |s, t| {
        let phase = TAU * FOLDS * s;
        let slope = 0.04 * TAU * FOLDS / 0.7 * libm::cosf(phase);
        (vec3(0.7 * (s - 0.5), 2.3 * t, 0.04 * libm::sinf(phase)), vec3(-slope, 0.0, 1.0))
    })
    .plain()
}

/// A vase, hollow; smooth but for its lip.
pub fn vase() -> Shape {
    let outside = |y: f32| vec2(0.06 + 0.03 * libm::sinf(TAU * (y / 0.3 * 0.85)), y);
    let rows = (0..=14).map(|i| outside(0.3 * i as f32 / 14.0));
    let mut profile: Vec<Vec2> = rows.clone().collect();
    let lip = outside(0.3);
    let inner = vec2(lip.x - 0.008, lip.y);
    profile.extend([lip, inner]);
    profile.extend(rows.rev().filter(|p| p.y > 0.02).map(|p| vec2(p.x - 0.008, p.y)));
    profile.extend([vec2(0.052, 0.012), vec2(0.0, 0.012)]);
    Shape::turned(&profile, 28)
}

pub fn flower_pot() -> Shape {
    let [rim, inner, soil] = [vec2(0.16, 0.3), vec2(0.14, 0.3), vec2(0.135, 0.26)];
    Shape::turned(&[vec2(0.11, 0.0), rim, rim, inner, inner, soil], 24)
}

pub fn soil() -> Shape {
    Shape::turned(&[vec2(0.135, 0.26), vec2(0.0, 0.26)], 24)
}

/// A leaf that bends towards +Z; its outline is in the texture's alpha.
pub fn leaf() -> Shape {
    Shape::sheet(1, 5, |s, t| {
        let (rise, lean) = (0.5 - 0.5 * t, 0.7 * t);
        (vec3(0.16 * (s - 0.5), 0.5 * t - 0.25 * t * t, 0.35 * t * t + 0.02), vec3(0.0, -lean, rise.max(1e-3)))
    })
}

/// Foot and pole of the floor lamp.
pub fn lamp_stand() -> Shape {
    let (edge, foot) = (vec2(0.15, 0.02), vec2(0.012, 0.03));
    Shape::turned(&[vec2(0.15, 0.0), edge, edge, foot, foot, vec2(0.012, 1.45)], 24)
}

/// Shade of the pendant, rim at y = 0.
pub fn shade() -> Shape {
    let neck = vec2(0.03, 0.2);
    Shape::turned(&[vec2(0.22, 0.0), neck, neck, vec2(0.0, 0.2)], 32)
}

/// A round bar along +Y, without ends.
pub fn bar(radius: f32, length: f32) -> Shape {
    Shape::turned(&[vec2(radius, 0.0), vec2(radius, length)], 10)
}

/// A ball of fruit.
pub fn orange() -> Shape {
    Shape::ball(0.07, 24)
}

/// Turns and sizes of the plant's leaves.
pub fn leaves() -> impl Iterator<Item = (f32, f32)> {
    (0..9u32).map(|i| (TAU * i as f32 * 0.381_966 + PI / 7.0, 0.8 + 0.08 * (i % 5) as f32))
}

fn block(min: Vec3, max: Vec3, without: u8) -> Shape {
    Shape::default().block(min, max, without)
}
