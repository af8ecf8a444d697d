//! The Cornell box, five times its size (a room of 2.78 x 2.74 x 2.80 m), open towards +Z.
//!
//! Proportions, blocks and lamp are those of <https://www.graphics.cornell.edu/online/box/data.html>, its walls made
//! straight; reflectances and radiance are the usual linear rgb fits of its spectra.

use super::{
    glb::{Glb, Node},
    shape::Shape,
};
use glam::{Vec3, vec3};

const WIDTH: f32 = 556.0;
const HEIGHT: f32 = 548.8;
const DEPTH: f32 = 559.2;
/// Edges of the lamp: x, then z.
const LAMP: [[f32; 2]; 2] = [[213.0, 343.0], [227.0, 332.0]];
/// The blocks: corners of the plan (x, z), and height.
const SHORT: ([[f32; 2]; 4], f32) = ([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]], 165.0);
const TALL: ([[f32; 2]; 4], f32) = ([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]], 330.0);

/// The box, and a camera that looks in through its open front.
pub fn cornell() -> Glb {
    let mut glb = Glb::new("Cornell box");
    let white = glb.matte("white", [0.725, 0.71, 0.68]);
    let red = glb.matte("red", [0.63, 0.065, 0.05]);
    let green = glb.matte("green", [0.14, 0.45, 0.091]);
    let glow = glb.glowing("lamp", [0.78, 0.78, 0.78], [1.0, 12.0 / 17.0, 4.0 / 17.0], 17.0);

    // The original's axes, turned half about +Y by `at`: x runs to the left, z away from the camera. The ceiling is
    // cut along the lamp's edges, so that the lamp fills its hole without T-junctions.
    let [lamp_x, lamp_z] = LAMP;
    let (xs, zs) = ([0.0, lamp_x[0], lamp_x[1], WIDTH], [0.0, lamp_z[0], lamp_z[1], DEPTH]);
    let (x, y, z) = ([0.0, WIDTH], [0.0, HEIGHT], [0.0, DEPTH]);
    let is_lamp = |i, j| (i, j) == (1, 1);
    let parts: [(&str, usize, Shape); 8] = [
        ("Floor", white, Shape::default().grid(&z, &x, |z, x| at(x, 0.0, z))),
        ("Ceiling", white, Shape::default().grid_with_holes(&xs, &zs, is_lamp, |x, z| at(x, HEIGHT, z))),
        ("Lamp", glow, Shape::default().grid(&lamp_x, &lamp_z, |x, z| at(x, HEIGHT, z))),
        ("Back wall", white, Shape::default().grid(&y, &x, |y, x| at(x, y, DEPTH))),
        ("Left wall", red, Shape::default().grid(&z, &y, |z, y| at(WIDTH, y, z))),
        ("Right wall", green, Shape::default().grid(&y, &z, |y, z| at(0.0, y, z))),
        ("Short block", white, block(SHORT)),
        ("Tall block", white, block(TALL)),
    ];
    for (name, material, shape) in parts {
        let mesh = glb.mesh(name, &[(&shape, material)]);
        glb.node(Node::of(name, mesh, Vec3::ZERO));
    }
    // The original camera: 25 mm of film at 35 mm.
    glb.camera("Camera", 0.686, at(278.0, 273.0, -800.0), at(278.0, 273.0, 0.0));
    glb
}

/// Metres, the box centred over the origin.
fn at(x: f32, y: f32, z: f32) -> Vec3 {
    vec3(WIDTH / 2.0 - x, y, DEPTH / 2.0 - z) * 0.005
}

/// Four walls and a top. There is no bottom: it would lie in the floor's plane.
fn block((plan, height): ([[f32; 2]; 4], f32)) -> Shape {
    let mut out = Shape::default();
    let low = plan.map(|[x, z]| at(x, 0.0, z));
    let high = plan.map(|[x, z]| at(x, height, z));
    for (i, j) in [(0, 1), (1, 2), (2, 3), (3, 0)] {
        out = out.quad([low[i], low[j], high[j], high[i]]);
    }
    out.quad(high)
}
