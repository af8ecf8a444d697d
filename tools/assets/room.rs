//! A furnished room, 5 x 4 x 2.7 m inside walls of 0.2 m; a window looks out to -Z. Bake it with a sky and a sun:
//! it has a glowing globe and a spot besides, of the same order as a sky of radiance 1.

use super::{
    furniture as make,
    glb::{Glb, Node, rough},
    paint,
    shape::{Shape, side},
};
use glam::{Quat, Vec3, vec2, vec3};
use serde_json::json;

/// Grid lines of the room's inside. The window's edges cut every wall, so that no face has a T-junction.
const X: [f32; 4] = [-2.5, -1.2, 0.6, 2.5];
const Y: [f32; 4] = [0.0, 0.9, 2.2, 2.7];
const Z: [f32; 2] = [-2.0, 2.0];
const WALL: f32 = 0.2;

/// The room, its furniture, lights and cameras.
pub fn room() -> Glb {
    let mut glb = Glb::new("Room");
    shell(&mut glb);
    window(&mut glb);
    dining(&mut glb);
    lounge(&mut glb);
    shelf(&mut glb);
    plant(&mut glb);
    lamps(&mut glb);
    glb.camera("overview", 1.05, vec3(2.2, 1.6, 1.7), vec3(-1.0, 0.75, -1.0));
    glb.camera("window", 0.9, vec3(-1.6, 1.5, 1.7), vec3(0.2, 1.2, -2.0));
    glb
}

fn shell(glb: &mut Glb) {
    let plaster = glb.matte("plaster", [0.8, 0.78, 0.74]);
    let paint = glb.matte("ochre paint", [0.66, 0.42, 0.16]);
    let texture = glb.texture("boards", &paint::boards());
    let mut wood = json!({ "name": "boards", "pbrMetallicRoughness": rough([1.0; 3]) });
    wood["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
    let wood = glb.material(wood);
    let render = glb.matte("render", [0.6, 0.58, 0.55]);

    let [left, right, back, front] = [X[0], X[3], Z[0], Z[1]];
    let is_window = |i, j| (i, j) == (1, 1);
    let mut walls = Shape::default().grid_with_holes(&X, &Y, is_window, |x, y| vec3(x, y, back));
    walls = walls.grid(&Y, &X, |y, x| vec3(x, y, front)).grid(&Y, &Z, |y, z| vec3(left, y, z));
    // The window's reveal.
    let (wx, wy, wz) = ([X[1], X[2]], [Y[1], Y[2]], [back - WALL, back]);
    walls = walls.grid(&wy, &wz, |y, z| vec3(wx[0], y, z)).grid(&wz, &wy, |z, y| vec3(wx[1], y, z));
    walls = walls.grid(&wz, &wx, |z, x| vec3(x, wy[0], z)).grid(&wx, &wz, |x, z| vec3(x, wy[1], z));
    let accent = Shape::default().grid(&Z, &Y, |z, y| vec3(right, y, z));
    let ceiling = Shape::default().grid(&X, &Z, |x, z| vec3(x, Y[3], z));
    let floor = Shape::default().grid(&Z, &X, |z, x| vec3(x, Y[0], z)).mapped(|p| vec2(p.x, p.z) / 2.0);

    let outer = |lines: &[f32]| {
        let mut lines = lines.to_vec();
        lines[0] -= WALL;
        *lines.last_mut().unwrap() += WALL;
        lines
    };
    let (x, y, z) = (outer(&X), outer(&Y), outer(&Z));
    let mut outside = Shape::default().grid_with_holes(&y, &x, |j, i| is_window(i, j), |y, x| vec3(x, y, back - WALL));
    outside = outside.grid(&x, &y, |x, y| vec3(x, y, front + WALL));
    outside = outside.grid(&z, &y, |z, y| vec3(left - WALL, y, z)).grid(&y, &z, |y, z| vec3(right + WALL, y, z));
    outside = outside.grid(&x, &z, |x, z| vec3(x, Y[0] - WALL, z)).grid(&z, &x, |z, x| vec3(x, Y[3] + WALL, z));

    let mesh = glb.mesh("Walls", &[(&walls, plaster), (&accent, paint)]);
    glb.node(Node::of("Walls", mesh, Vec3::ZERO));
    let mesh = glb.mesh("Ceiling", &[(&ceiling, plaster)]);
    glb.node(Node::of("Ceiling", mesh, Vec3::ZERO));
    let mesh = glb.mesh("Floor", &[(&floor, wood)]);
    glb.node(Node::of("Floor", mesh, Vec3::ZERO));
    let mesh = glb.mesh("Outside", &[(&outside, render)]);
    let extras = json!({ "luxel.texels_per_meter": 4 });
    glb.node(Node { extras, ..Node::of("Outside", mesh, Vec3::ZERO) });
}

fn window(glb: &mut Glb) {
    // A frame with two panes: front, back and the panes' sides; its outer sides touch the reveal.
    let lacquer = glb.matte("white lacquer", [0.82, 0.82, 0.8]);
    let (middle, bar) = ((X[1] + X[2]) / 2.0, 0.06);
    let xs = [X[1], X[1] + bar, middle - bar / 2.0, middle + bar / 2.0, X[2] - bar, X[2]];
    let ys = [Y[1], Y[1] + bar, Y[2] - bar, Y[2]];
    let (z0, z1) = (Z[0] - 0.13, Z[0] - 0.07);
    let pane = |i, j| j == 1 && i % 2 == 1;
    let mut frame = Shape::default().grid_with_holes(&xs, &ys, pane, |x, y| vec3(x, y, z1));
    frame = frame.grid_with_holes(&ys, &xs, |j, i| pane(i, j), |y, x| vec3(x, y, z0));
    for x in [[xs[1], xs[2]], [xs[3], xs[4]]] {
        let (y, z) = ([ys[1], ys[2]], [z0, z1]);
        frame = frame.grid(&y, &z, |y, z| vec3(x[0], y, z)).grid(&z, &y, |z, y| vec3(x[1], y, z));
        frame = frame.grid(&z, &x, |z, x| vec3(x, y[0], z)).grid(&x, &z, |x, z| vec3(x, y[1], z));
    }
    let mesh = glb.mesh("Window frame", &[(&frame, lacquer)]);
    glb.node(Node::of("Window frame", mesh, Vec3::ZERO));

    let linen =
        glb.material(json!({ "name": "linen", "doubleSided": true, "pbrMetallicRoughness": rough([0.62, 0.6, 0.52]) }));
    let mesh = glb.mesh("Curtain", &[(&make::curtain(), linen)]);
    glb.node(Node::of("Curtain left", mesh, vec3(-1.5, 0.1, -1.88)));
    let mirrored = vec3(-1.0, 1.0, 1.0);
    glb.node(Node { scale: mirrored, ..Node::of("Curtain right", mesh, vec3(0.9, 0.1, -1.88)) });
    let iron = glb.matte("dark iron", [0.08, 0.08, 0.09]);
    let mesh = glb.mesh("Curtain rod", &[(&make::bar(0.015, 3.2), iron)]);
    let turn = Quat::from_xyzw(0.0, 0.0, -HALF, HALF);
    glb.node(Node { turn, ..Node::of("Curtain rod", mesh, vec3(-1.9, 2.43, -1.88)) });
}

fn dining(glb: &mut Glb) {
    let oak = glb.matte("oak", [0.5, 0.33, 0.18]);
    let beech = glb.matte("beech", [0.66, 0.48, 0.3]);
    let place = vec3(1.1, 0.0, 0.45);
    let mesh = glb.mesh("Table top", &[(&make::table_top(), oak)]);
    let mut children = vec![glb.node(Node::of("Table top", mesh, Vec3::ZERO))];
    let mesh = glb.mesh("Table leg", &[(&make::table_leg(), oak)]);
    for (name, x, z) in [("NW", -0.5, -0.3), ("NE", 0.5, -0.3), ("SW", -0.5, 0.3), ("SE", 0.5, 0.3)] {
        children.push(glb.node(Node::of(&format!("Table leg {name}"), mesh, vec3(x, 0.0, z))));
    }
    glb.node(Node { at: place, children, ..Node::named("Table") });

    let mesh = glb.mesh("Chair", &[(&make::chair(), beech)]);
    glb.node(Node::of("Chair", mesh, place - 0.55 * Vec3::Z));
    let scale = vec3(1.0, 1.0, -1.0);
    glb.node(Node { scale, ..Node::of("Chair mirrored", mesh, place + 0.55 * Vec3::Z) });

    let glaze = glb.matte("blue glaze", [0.08, 0.2, 0.42]);
    let top = place + make::TABLE_HEIGHT * Vec3::Y;
    let mesh = glb.mesh("Vase", &[(&make::vase(), glaze)]);
    glb.node(Node::of("Vase", mesh, top + vec3(-0.2, 0.0, -0.05)));
    let peel = glb.matte("orange peel", [0.8, 0.3, 0.04]);
    let mesh = glb.mesh("Orange", &[(&make::orange(), peel)]);
    glb.node(Node::of("Orange", mesh, top + vec3(0.2, 0.07, 0.1)));
}

fn lounge(glb: &mut Glb) {
    let wool = glb.matte("grey wool", [0.2, 0.27, 0.36]);
    let mesh = glb.mesh("Sofa", &[(&make::sofa(), wool)]);
    let turn = Quat::from_xyzw(0.0, HALF, 0.0, HALF);
    glb.node(Node { turn, ..Node::of("Sofa", mesh, vec3(-2.05, 0.0, 0.2)) });
    let pile = glb.matte("rug", [1.0; 3]);
    let mesh = glb.mesh("Rug", &[(&make::rug(), pile)]);
    glb.node(Node::of("Rug", mesh, vec3(-0.75, 0.0, 0.2)));
    let print = glb.matte("print", [0.1, 0.35, 0.4]);
    let picture = Shape::default().block(vec3(X[0], 1.3, -0.3), vec3(X[0] + 0.03, 1.9, 0.7), side::LEFT);
    let mesh = glb.mesh("Picture", &[(&picture, print)]);
    glb.node(Node::of("Picture", mesh, Vec3::ZERO));
}

fn shelf(glb: &mut Glb) {
    let birch = glb.matte("birch", [0.7, 0.6, 0.44]);
    let mesh = glb.mesh("Shelf", &[(&make::shelf(), birch)]);
    let mut children = vec![glb.node(Node::of("Shelf boards", mesh, Vec3::ZERO))];
    let colors = [("red", [0.5, 0.06, 0.05]), ("green", [0.08, 0.3, 0.12]), ("cream", [0.75, 0.7, 0.55])];
    let books = colors.map(|(name, color)| {
        let cloth = glb.matte(&format!("{name} cloth"), color);
        glb.mesh(&format!("Book {name}"), &[(&make::book(), cloth)])
    });
    // (board, first x, size of each book)
    let rows = [
        (1, -0.42, &[0.05, 0.04, 0.06, 0.05][..]),
        (2, 0.05, &[0.06, 0.05, 0.05, 0.04, 0.06]),
        (3, -0.3, &[0.04, 0.06, 0.05]),
    ];
    for (board, first, widths) in rows {
        let mut x = first;
        for (i, width) in widths.iter().enumerate() {
            let size = vec3(*width, 0.3 - 0.02 * (i * 7 % 5) as f32, 0.2 - 0.01 * (i * 3 % 4) as f32);
            let at = vec3(x + width / 2.0, make::SHELF_BOARDS[board] + make::SHELF_BOARD, 0.14);
            let name = format!("Book {board}.{i}");
            children.push(glb.node(Node { scale: size, ..Node::of(&name, books[(board + i) % 3], at) }));
            x += width + 0.01;
        }
    }
    glb.node(Node { at: vec3(1.8, 0.0, Z[0]), children, ..Node::named("Shelf") });
}

fn plant(glb: &mut Glb) {
    let clay = glb.matte("terracotta", [0.5, 0.22, 0.12]);
    let earth = glb.matte("soil", [0.06, 0.04, 0.03]);
    let mesh = glb.mesh("Pot", &[(&make::flower_pot(), clay), (&make::soil(), earth)]);
    let mut children = vec![glb.node(Node::of("Pot", mesh, Vec3::ZERO))];
    let texture = glb.texture("leaf", &paint::leaf());
    let mut leaf = json!({ "name": "leaf", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.5 });
    leaf["pbrMetallicRoughness"] = rough([1.0; 3]);
    leaf["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
    let leaf = glb.material(leaf);
    let mesh = glb.mesh("Leaf", &[(&make::leaf(), leaf)]);
    for (i, (angle, size)) in make::leaves().enumerate() {
        let turn = Quat::from_xyzw(0.0, libm::sinf(angle / 2.0), 0.0, libm::cosf(angle / 2.0));
        let name = format!("Leaf {i}");
        let node = Node { turn, scale: Vec3::splat(size), ..Node::of(&name, mesh, 0.25 * Vec3::Y) };
        children.push(glb.node(node));
    }
    glb.node(Node { at: vec3(-0.3, 0.0, -1.55), children, ..Node::named("Plant") });
}

fn lamps(glb: &mut Glb) {
    let iron = glb.matte("black iron", [0.05, 0.05, 0.05]);
    let opal = glb.glowing("opal glass", [0.8, 0.8, 0.8], [1.0, 0.82, 0.58], 6.0);
    let stand = glb.mesh("Lamp stand", &[(&make::lamp_stand(), iron)]);
    let globe = glb.mesh("Globe", &[(&Shape::ball(0.16, 28), opal)]);
    let stand = glb.node(Node::of("Lamp stand", stand, Vec3::ZERO));
    let globe = glb.node(Node::of("Globe", globe, 1.6 * Vec3::Y));
    glb.node(Node { at: vec3(-2.1, 0.0, -1.45), children: vec![stand, globe], ..Node::named("Floor lamp") });

    let enamel = glb
        .material(json!({ "name": "enamel", "doubleSided": true, "pbrMetallicRoughness": rough([0.75, 0.74, 0.7]) }));
    let rim = 1.7;
    let (shade, cord) = (make::shade(), make::bar(0.006, Y[3] - rim - 0.2));
    let shade = glb.mesh("Shade", &[(&shade, enamel)]);
    let cord = glb.mesh("Cord", &[(&cord, iron)]);
    let spot = glb.light(json!({
        "name": "Pendant", "type": "spot", "color": [1.0, 0.86, 0.66], "intensity": 8.0,
        "spot": { "innerConeAngle": 0.6, "outerConeAngle": 0.9 },
    }));
    let down = Quat::from_xyzw(-HALF, 0.0, 0.0, HALF);
    let light = Node { turn: down, light: Some(spot), at: 0.1 * Vec3::Y, ..Node::named("Pendant light") };
    let extras = json!({ "luxel.radius": 0.04 });
    let children = vec![
        glb.node(Node::of("Shade", shade, Vec3::ZERO)),
        glb.node(Node::of("Cord", cord, 0.2 * Vec3::Y)),
        glb.node(Node { extras, ..light }),
    ];
    glb.node(Node { at: vec3(1.1, rim, 0.45), children, ..Node::named("Pendant") });
}

/// Sine and cosine of an eighth of a turn: quarter turns as quaternions.
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
