//! Scenes on which bakers are known to fail (`failure_scenes` of tests/data/validation.json).
//!
//! `table` runs them over all estimators and solvers, and holds its outcome against the table in tests/README.md;
//! `asymmetric_matrix_cg` is a bare system, in tests/radiosity. The others look closer at the default: receivers' own rays
//! and their neighbours', at every texel and at some. `hdr_range`'s half floats are checked where EXRs are written.

#[path = "../common/mod.rs"]
mod common;
mod light;
mod rows;
mod scenes;
mod solvers;
mod table;

use common::{
    bakes::{Shot, grey, options, parts, shoot, shoot_with, worst},
    scenes::{Cuboid, FACES, Face, furnished, rectangle, unit_room},
    stage::{Chart, Stage, Surface},
};
use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3, uvec2, vec3};
use luxel::{
    bake::Options,
    scene::LightKind,
    transport::{self, Receivers},
};

/// Every texel reads `expected` to 1e-3.
fn reads(shot: &Shot, expected: f64) {
    let off = worst(shot.baked.irradiance.iter().map(|e| grey(*e)), expected);
    assert!(off < 1e-3, "off by {off}");
}

/// Every texel by its own rays, then with those of its neighbours; then the same with adaptive receivers.
fn each(rays: u32) -> [Options; 4] {
    let [all, adaptive] = Receivers::ALL;
    [(all, false), (all, true), (adaptive, false), (adaptive, true)].map(|(receivers, reuse)| {
        let transport = transport::Options { reuse, receivers, ..transport::Options::of(rays) };
        Options { transport, ..options(rays) }
    })
}

/// Furnace of `build` with reflectance .8, exitance 1: E = 5 everywhere.
fn furnace(rays: u32, build: impl Fn(&mut Stage, u32)) -> Shot {
    let [alone, ..] = each(rays).map(|options| {
        let mut stage = Stage::new();
        let m = stage.material(0.8, 1.0);
        build(&mut stage, m);
        let shot = shoot_with(stage, options);
        reads(&shot, 5.0);
        shot
    });
    alone
}

#[test]
fn failure_albedo_to_one() {
    let mut stage = Stage::new();
    let white = stage.material(0.999, 1.0);
    unit_room().all(&mut stage, white, 8);
    reads(&shoot(stage, 64), 1000.0);
    let mut stage = Stage::new();
    let white = stage.material(1.0, 1.0);
    unit_room().all(&mut stage, white, 8);
    let shot = shoot_with(stage, Options { transport: transport::Options::of(64), ..Options::default() });
    reads(&shot, 50.0);
    assert!(shot.baked.report.warnings.iter().any(|w| w.contains("capped")));
}

/// Shares below 1 and near the exact ones even where patches touch.
#[test]
fn failure_near_patch_1_over_r2() {
    let cases =
        [([Vec3::ZERO, Vec3::Y, Vec3::Z], 0.2000437761), ([vec3(0.0, 0.0, 0.1), Vec3::Y, Vec3::X], 0.8269945224)];
    for (two, expected) in cases {
        let mut stage = Stage::new();
        let (black, lamp) = (stage.material(0.0, 0.0), stage.material(0.0, 1.0));
        let chart = rectangle(&mut stage, black, [Vec3::ZERO, Vec3::X, Vec3::Y], UVec2::splat(16));
        rectangle(&mut stage, lamp, two, UVec2::splat(16));
        let shot = shoot(stage, 256);
        let sigma = libm::sqrt(0.25 / 65536.0);
        assert!((shot.mean(&[chart]).1.x - expected).abs() < 3.0 * sigma);
        assert!(shot.values(chart).iter().all(|e| e.x <= 1.0));
    }
}

#[test]
fn failure_row_sum_over_one() {
    for rays in [1, 2, 3, 7] {
        furnace(rays, |s, m| drop(unit_room().all(s, m, 8)));
    }
}

/// Sums of 65536 equal entries: one after the other in single precision they drift by 1e-3.
#[test]
fn failure_f32_accumulation() {
    furnace(65536, |s, m| drop(unit_room().all(s, m, 1)));
}

/// Two rooms, x in [0, 1] lit and x in [1 + t, 2 + t] dark; with t = 0 one two-sided sheet parts them.
#[test]
fn failure_thin_wall_leak() {
    let walls = [0.1f32, 0.01, 0.001, 0.0];
    for (t, options) in walls.into_iter().flat_map(|t| each(256).map(|options| (t, options))) {
        let mut stage = Stage::new();
        let white = stage.material(0.8, 0.0);
        let sheet = stage.rgb(Vec3::splat(0.8), Vec3::ZERO, true);
        let (lit, dark) = (unit_room(), Cuboid::room(vec3(1.0 + t, 0.0, 0.0), vec3(2.0 + t, 1.0, 1.0)));
        let mut faces = |room: Cuboid, without: Face| -> Vec<Chart> {
            let kept = FACES.iter().filter(|f| t > 0.0 || **f != without);
            kept.map(|f| room.face(&mut stage, *f, white, UVec2::ONE, UVec2::splat(16))).collect()
        };
        let (a, b) = (faces(lit, Face::Right), faces(dark, Face::Left));
        if t == 0.0 {
            lit.face(&mut stage, Face::Right, sheet, UVec2::ONE, UVec2::splat(16));
        }
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.9, 0.5, 0.5), Vec3::ZERO, 10.0);
        let shot = shoot_with(stage, options);
        let brightest = |e: Vec<Vec3>| e.iter().map(|e| e.max_element()).fold(0.0, f32::max);
        let values = b.iter().map(|c| brightest(shot.values(*c))).fold(0.0, f32::max);
        let lookups = b.iter().map(|c| brightest(shot.lookups(*c))).fold(0.0, f32::max);
        println!("wall of {t} m: brightest texel of the dark room {values}, brightest look-up {lookups}");
        assert!(shot.mean(&a).1.x > 1.0);
        assert_eq!((values, lookups), (0.0, 0.0), "wall of {t} m");
    }
}

#[test]
fn failure_texel_centre_outside() {
    furnace(32, |stage, m| {
        for f in FACES {
            unit_room().face(stage, f, m, uvec2(1000, 1), UVec2::splat(16));
        }
    });
}

#[test]
fn failure_coplanar_duplicate_faces() {
    furnace(64, |stage, m| {
        unit_room().all(stage, m, 8);
        unit_room().face(stage, Face::Bottom, m, UVec2::ONE, UVec2::splat(8));
    });
    // A block on the floor, with and without its bottom: the same light, none under it.
    let light_with = |bottom: bool| {
        let mut stage = Stage::new();
        let (white, lamp) = (stage.material(0.7, 0.0), stage.material(0.0, 4.0));
        let room = FACES.map(|f| {
            let m = if f == Face::Top { lamp } else { white };
            unit_room().face(&mut stage, f, m, UVec2::ONE, UVec2::splat(16))
        });
        let block = Cuboid::block(vec3(0.25, 0.0, 0.25), vec3(0.75, 0.5, 0.75));
        for f in FACES.into_iter().filter(|f| bottom || *f != Face::Bottom) {
            block.face(&mut stage, f, white, UVec2::ONE, UVec2::splat(8));
        }
        let shot = shoot(stage, 256);
        let hidden = shot.placed(room[2]).into_iter().filter(|(_, p)| (*p - 0.5).abs().max_element() < 0.24);
        assert!(hidden.clone().count() == 64);
        assert!(hidden.clone().all(|(i, _)| shot.baked.irradiance[i] == Vec3::ZERO), "light under the block");
        let sides = [room[0], room[1], room[4], room[5]];
        (shot.mean(&sides).1.x, libm::sqrt(4.0) / 2.0 * shot.error_of_mean(room[0]))
    };
    let (with, without) = (light_with(true), light_with(false));
    assert!((with.0 - without.0).abs() < 3.0 * (with.1 + without.1) / 0.3, "{with:?} {without:?}");
}

#[test]
fn failure_huge_offset() {
    let build = |stage: &mut Stage, m: u32| drop(furnished(stage, m, m, 8));
    let near = furnace(64, build);
    // A scene far from the world's origin is given relative to its own.
    let far = furnace(64, |stage, m| {
        build(stage, m);
        stage.scene.origin = DVec3::splat(1e6);
    });
    assert_eq!(near.baked.irradiance, far.baked.irradiance);
}

/// A half room and its mirror image make the room; a stretched cube makes the block it looks like.
#[test]
fn failure_mirror_negative_scale() {
    let half = |stage: &mut Stage, m: u32, lamp: u32| {
        for f in FACES.into_iter().filter(|f| *f != Face::Left) {
            unit_room().face(stage, f, if f == Face::Top { lamp } else { m }, UVec2::ONE, UVec2::splat(8));
        }
    };
    for (rho, m, lamp) in [(0.8f32, 1.0, 1.0), (0.5, 0.0, 2.0)] {
        let mut stage = Stage::new();
        let (wall, ceiling) = (stage.material(rho, m), stage.material(rho, lamp));
        half(&mut stage, wall, ceiling);
        let mut mirrored = stage.scene.instances.clone();
        for (k, i) in mirrored.iter_mut().enumerate() {
            i.transform = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
            i.node += 100 + k as u32;
        }
        stage.scene.instances.extend(mirrored);
        stage.lay_out();
        let mut o = options(256);
        o.atlas.density = luxel::atlas::Density::Resolution(128);
        let shared = parts(&stage.scene, &o);
        let p = &shared.patches;
        let area: f64 = p.area.iter().map(|a| f64::from(*a)).sum();
        assert!((area - 10.0).abs() < 1e-3, "{area}");
        assert_eq!((shared.report.rays.escaped, shared.report.rays.blocked), (0, 0));
        let mean = |side: f32| {
            let on = (0..p.area.len()).filter(|i| p.center[*i].x * side > 0.0);
            on.map(|i| f64::from(p.area[i]) * grey(shared.irradiance[i])).sum::<f64>() / 5.0
        };
        if m > 0.0 {
            assert!(worst(shared.irradiance.iter().map(|e| grey(*e)), 5.0) < 1e-3);
        }
        // One reflectance everywhere: the area mean of E is the power put in over (1 - rho) A.
        let expected = f64::from((8.0 * m + 2.0 * lamp) / (10.0 * (1.0 - rho)));
        assert!((mean(1.0) / mean(-1.0) - 1.0).abs() < 0.01, "{} {}", mean(1.0), mean(-1.0));
        assert!(((mean(1.0) + mean(-1.0)) / 2.0 / expected - 1.0).abs() < 0.01, "{expected}");
    }
    let scale = DVec3::new(1.0, 2.0, 0.5);
    let shot = furnace(64, |stage, m| {
        unit_room().all(stage, m, 8);
        stage.scene.instances.iter_mut().for_each(|i| i.transform = DAffine3::from_scale(scale));
    });
    let area: f64 = shot.baked.patches.area.iter().map(|a| f64::from(*a)).sum();
    assert!((area - 2.0 * (2.0 + 1.0 + 0.5)).abs() < 1e-4, "{area}");
}

#[test]
fn failure_t_junction_crack() {
    let shot = furnace(2048, |stage, m| {
        for f in FACES {
            let cells = if f == Face::Right { uvec2(7, 3) } else { UVec2::ONE };
            unit_room().face(stage, f, m, cells, UVec2::splat(10));
        }
    });
    let rays = &shot.baked.report.rays;
    assert!(rays.traced >= 1_000_000);
    assert_eq!((rays.escaped, rays.lost), (0, 0));
}

/// Triangles without area and a mesh without triangles change nothing; a chart without area is refused by name.
#[test]
fn failure_degenerate() {
    furnace(32, |stage, m| {
        unit_room().all(stage, m, 8);
        let point = |x: f32| vec3(0.25 + x, 0.5, 0.5);
        let uv = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
        let triangles = vec![[0, 1, 2]];
        let size = UVec2::ONE;
        let line = Surface {
            positions: vec![point(0.0), point(0.1), point(0.2)],
            uv: uv.clone(),
            triangles: triangles.clone(),
            size,
            ..Surface::default()
        };
        stage.surface("line", m, line);
        let spot =
            Surface { positions: vec![point(0.0); 3], uv, triangles: triangles.clone(), size, ..Surface::default() };
        stage.surface("spot", m, spot);
        stage.surface("empty", m, Surface { size, ..Surface::default() });
    });
    let mut stage = Stage::new();
    let m = stage.material(0.8, 1.0);
    unit_room().all(&mut stage, m, 8);
    let flat = Surface {
        positions: vec![vec3(0.4, 0.4, 0.4), vec3(0.6, 0.4, 0.4), vec3(0.4, 0.4, 0.6)],
        uv: vec![Vec2::splat(0.5); 3],
        triangles: vec![[0, 1, 2]],
        size: UVec2::ONE,
        ..Surface::default()
    };
    stage.surface("no chart", m, flat);
    let (edge, _) = stage.lay_out();
    let mut o = options(32);
    o.atlas.unwrap = luxel::atlas::Unwrap::Keep;
    o.atlas.density = luxel::atlas::Density::Resolution(edge);
    let refused = luxel::bake::bake(&stage.scene, &o, &luxel::progress::Silent);
    let message = refused.err().expect("a chart without area is refused").to_string();
    assert!(message.contains("no chart"), "{message}");
}
