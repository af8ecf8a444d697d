//! The tests' own scenes: areas, orientation and charts, checked without a bake.

mod common;

use common::{
    exact,
    scenes::{Ball, Cuboid, FACES, cuts_about, disc, furnished, polygon, rectangle, unit_room},
    stage::Stage,
};
use glam::{DVec3, UVec2, Vec2, Vec3, uvec2, vec3};
use std::f64::consts::PI;

/// Signed volume that a stage's triangles enclose: negative if they look inwards.
fn volume(stage: &Stage) -> f64 {
    let triangles = stage.scene.meshes.iter().flat_map(|m| {
        m.triangles
            .iter()
            .map(|t| t.map(|v| m.positions[v as usize].as_dvec3()))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
    });
    triangles.sum()
}

#[test]
fn boxes_and_balls_are_closed_and_look_the_right_way() {
    let mut stage = Stage::new();
    let grey = stage.material(0.5, 0.0);
    Cuboid::room(vec3(1.0, 2.0, 3.0), vec3(2.0, 4.0, 6.0)).all(&mut stage, grey, 4);
    assert!((volume(&stage) + 6.0).abs() < 1e-5);
    Cuboid::block(vec3(1.0, 2.0, 3.0), vec3(2.0, 4.0, 6.0)).all(&mut stage, grey, 4);
    assert!(volume(&stage).abs() < 1e-5);
    for inwards in [false, true] {
        let mut stage = Stage::new();
        let ball = Ball::whole(Vec3::ZERO, 1.0, uvec2(64, 32), inwards).build(&mut stage, grey);
        let sign = if inwards { -1.0 } else { 1.0 };
        assert!((volume(&stage) * sign / (4.0 / 3.0 * PI) - 1.0).abs() < 5e-3);
        assert!((stage.area(ball) / (4.0 * PI) - 1.0).abs() < 2.5e-3);
    }
}

#[test]
fn bowls_keep_their_share() {
    for f in [0.1379310345, 0.5, 0.99] {
        let mut stage = Stage::new();
        let bowl = Ball::bowl(f, uvec2(64, 32), 1);
        let chart = bowl.build(&mut stage, 0);
        assert!((stage.area(chart) / (4.0 * PI * f) - 1.0).abs() < 3e-3);
        let own = 1.0 - bowl.opening() / stage.area(chart);
        assert!((own / f - 1.0).abs() < 5e-3, "{own} {f}");
    }
}

#[test]
fn flat_shapes_have_their_area_and_front() {
    let mut stage = Stage::new();
    let d = disc(&mut stage, 0, [Vec3::ZERO, Vec3::X, Vec3::Z], 2.0, 64, 32);
    assert!((stage.area(d) - 4.0 * PI).abs() < 1e-5);
    let p = polygon(&mut stage, 0, &[Vec3::ZERO, Vec3::Z * 2.0, Vec3::new(1.0, 0.0, 0.0)], 8);
    assert!((stage.area(p) - 1.0).abs() < 1e-6);
    let r = rectangle(&mut stage, 0, [Vec3::ONE, Vec3::Z * 3.0, Vec3::X], uvec2(6, 2));
    for (chart, up) in [(d, -1.0), (p, 1.0), (r, 1.0)] {
        let m = &stage.scene.meshes[chart];
        for [a, b, c] in m.triangles.iter().map(|t| t.map(|v| m.positions[v as usize])) {
            assert!((b - a).cross(c - a).y * up > 0.0);
        }
    }
}

#[test]
fn cut_faces_tile_the_face() {
    let mut stage = Stage::new();
    let cuts = cuts_about(0.0, 1.0, &[0.5], 0.02);
    for face in FACES {
        let charts = unit_room().cut(&mut stage, face, &cuts, &cuts, |_, _| Some((0, UVec2::splat(4))));
        let area: f64 = charts.iter().flatten().flatten().map(|c| stage.area(*c)).sum();
        assert!((area - 1.0).abs() < 1e-6);
    }
    assert!((volume(&stage) + 1.0).abs() < 1e-5);
}

#[test]
fn charts_are_apart_and_on_the_page() {
    let mut stage = Stage::new();
    let grey = stage.material(0.5, 1.0);
    furnished(&mut stage, grey, grey, 24);
    Ball::whole(Vec3::ZERO, 1.0, uvec2(32, 16), true).build(&mut stage, grey);
    let (edge, _) = stage.lay_out();
    let mut owner = vec![None; (edge * edge) as usize];
    for (chart, mesh) in stage.scene.meshes.iter().enumerate() {
        let uv = &mesh.uvs[1];
        let low = uv.iter().copied().reduce(Vec2::min).expect("a mesh has vertices") * edge as f32;
        let high = uv.iter().copied().reduce(Vec2::max).expect("a mesh has vertices") * edge as f32;
        assert_eq!(low, low.round(), "charts begin on texel borders");
        assert_eq!((high - low).as_uvec2(), stage.sizes[chart]);
        for y in low.y as u32 - 2..high.y as u32 + 2 {
            for x in low.x as u32 - 2..high.x as u32 + 2 {
                let place = &mut owner[(y * edge + x) as usize];
                assert_eq!(*place, None, "two charts within their gutters");
                *place = Some(chart);
            }
        }
    }
}

#[test]
fn lambert_agrees_with_howell() {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 1.0));
    assert!((exact::element_to_polygon(DVec3::ZERO, DVec3::Z, &square) - 0.138531606).abs() < 1e-9);
    let floor = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mean = exact::mean_over(floor, 64, |p| exact::element_to_polygon(p, DVec3::Z, &square));
    assert!((mean - 0.1998248957).abs() < 1e-4);
    // A wall that begins below the horizon counts from the horizon.
    let wall = [[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(0.0, y, z));
    let edge = exact::mean_over(floor, 256, |p| exact::element_to_polygon(p, DVec3::Z, &wall));
    assert!((edge - 0.2000437761).abs() < 1e-3, "{edge}");
}
