//! Scenes on which bakers are known to fail (`failure_scenes` of tests/data/validation.json), each as small as it gets.
//!
//! Not here yet, since they belong to methods to come: `asymmetric_matrix_cg` (conjugate gradients on noisy rows) and
//! the hemicube's side of `hemicube_alias`. `hdr_range`'s half floats are checked where EXRs are written.

mod common;

use common::{
    bakes::{Shot, grey, options, parts, shoot, shoot_with, spread, within_sigma, worst},
    exact,
    scenes::{Ball, Cuboid, FACES, Face, furnished, rectangle, unit_room},
    stage::{Chart, Stage, Surface},
};
use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3, uvec2, vec3};
use luxel::{
    bake::Options,
    scene::{LightKind, Sky},
};
use std::f64::consts::PI;

/// Every texel reads `expected` to 1e-3.
fn reads(shot: &Shot, expected: f64) {
    let off = worst(shot.baked.irradiance.iter().map(|e| grey(*e)), expected);
    assert!(off < 1e-3, "off by {off}");
}

/// Furnace of `build` with reflectance .8, exitance 1: E = 5 everywhere.
fn furnace(rays: u32, build: impl Fn(&mut Stage, u32)) -> Shot {
    let mut stage = Stage::new();
    let m = stage.material(0.8, 1.0);
    build(&mut stage, m);
    let shot = shoot(stage, rays);
    reads(&shot, 5.0);
    shot
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
    let shot = shoot_with(stage, Options { rays: 64, ..Options::default() });
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
    let shot = furnace(65536, |s, m| drop(unit_room().all(s, m, 1)));
    assert!(worst(shot.baked.irradiance.iter().map(|e| grey(*e)), 5.0) < 1e-4);
}

/// Two rooms, x in [0, 1] lit and x in [1 + t, 2 + t] dark; with t = 0 one two-sided sheet parts them.
#[test]
fn failure_thin_wall_leak() {
    for t in [0.1f32, 0.01, 0.001, 0.0] {
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
        let shot = shoot(stage, 256);
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
fn failure_chart_border_filter() {
    let mut stage = Stage::new();
    let (bright, black) = (stage.material(0.5, 1.0), stage.material(0.5, 0.0));
    let dark_room = Cuboid::room(vec3(1.1, 0.0, 0.0), vec3(2.1, 1.0, 1.0));
    // Charts of both rooms alternate on the page.
    let pairs = FACES.map(|f| {
        let face = |room: Cuboid, stage: &mut Stage, m| room.face(stage, f, m, UVec2::ONE, UVec2::splat(7));
        (face(unit_room(), &mut stage, bright), face(dark_room, &mut stage, black))
    });
    let shot = shoot(stage, 64);
    for (a, b) in pairs {
        assert!(worst(shot.lookups(a).iter().map(|e| grey(*e)), 2.0) < 1e-3);
        assert!(shot.lookups(b).iter().all(|e| *e == Vec3::ZERO));
    }
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

#[test]
fn failure_tiny_emitter() {
    let mut stage = Stage::new();
    let (black, lamp) = (stage.material(0.0, 0.0), stage.material(0.0, 1.0));
    let side = 0.01;
    let corner = vec3(-0.5 * side, 1.0, -0.5 * side);
    rectangle(&mut stage, lamp, [corner, Vec3::X * side, Vec3::Z * side], UVec2::splat(2));
    let foot = rectangle(&mut stage, black, [vec3(-0.02, 0.0, -0.02), Vec3::Z * 0.04, Vec3::X * 0.04], UVec2::splat(4));
    rectangle(&mut stage, black, [vec3(1.0, 0.0, 1.0), Vec3::Z, Vec3::X], UVec2::splat(4));
    let shot = shoot(stage, 64);
    // Texels at .0141 m from the foot: cos^4 = 1 - 4e-4.
    let off = worst(shot.values(foot).iter().map(|e| grey(*e)), 0.0000318299);
    assert!(off < 1e-3, "off by {off}");
}

#[test]
fn failure_sun_through_hole() {
    let mut stage = Stage::new();
    let grey_wall = stage.material(0.5, 0.0);
    let room = Cuboid::room(Vec3::ZERO, Vec3::splat(4.0));
    // The hole's square lies on [1, 1.1]^2; the light lands 4 / tan 60 further along x.
    let (hole, land) = ([0.0, 1.0, 1.1, 4.0], (1.0 + 4.0 / libm::sqrt(3.0)) as f32);
    let spot = [0.0, land - 0.05, land, land + 0.1, land + 0.15, 4.0];
    let across = [0.0, 0.95, 1.0, 1.1, 1.15, 4.0];
    let mut floor = Vec::new();
    for f in FACES {
        match f {
            Face::Top => {
                drop(room.cut(&mut stage, f, &hole, &hole, |i, j| {
                    ((i, j) != (1, 1)).then_some((grey_wall, UVec2::splat(8)))
                }))
            }
            Face::Bottom => floor = room.cut(&mut stage, f, &spot, &across, |_, _| Some((grey_wall, UVec2::splat(8)))),
            _ => drop(room.face(&mut stage, f, grey_wall, UVec2::ONE, UVec2::splat(16))),
        }
    }
    let sun = vec3(0.5, -libm::sqrtf(0.75), 0.0);
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, 1.0);
    let (content, rays) = (luxel::lightmaps::Content::Direct, 2048);
    let shot = shoot_with(stage, Options { content, ..options(rays) });
    let chart = |i: usize, j: usize| floor[j][i].expect("the floor is whole");
    let direct = |c: Chart| shot.mapped(c).into_iter().map(grey).collect::<Vec<_>>();
    // Rays start a hair above the floor: the border of the spot moves by up to 1e-5 m in texels of .0125 m.
    assert!(worst(direct(chart(2, 2)), 0.8660254) < 1e-3, "inside: {:?}", spread(&direct(chart(2, 2))));
    for (i, j) in [(1, 2), (3, 2), (2, 1), (2, 3)] {
        // Rounding of the square's border touches the first row of texels at most.
        let (mean, _) = spread(&direct(chart(i, j)));
        assert!(mean < 1e-3, "outside ({i}, {j}): {mean}");
    }
    // What leaves through the hole again is below 2 x .01 / 96 of the light. Half the light is scattered once more, and
    // is found by those rays that hit the spot: rays x .01 / (mean area of a texel).
    let [absorbed, _] = shot.power();
    let hits = f64::from(rays) * 0.01 * shot.baked.report.texels as f64 / 96.0;
    let sigma = 0.5 / libm::sqrt(hits);
    assert!((absorbed / 0.00866025 - 1.0).abs() < 3.0 * sigma + 2e-4, "{absorbed}, sigma {sigma}");
}

#[test]
fn failure_narrow_aperture() {
    let (f, rho, rays) = (0.997, 0.9, 4096);
    let bowl = Ball::bowl(f, uvec2(48, 24), 1);
    let mut stage = Stage::new();
    stage.scene.sky = Sky::Uniform(Vec3::ONE);
    let material = stage.material(rho as f32, 0.0);
    let chart = bowl.build(&mut stage, material);
    let own = 1.0 - bowl.opening() / stage.area(chart);
    let shot = shoot(stage, rays);
    let h: Vec<f64> = shot.values(chart).iter().map(|e| grey(*e) / PI).collect();
    let (_, sd) = spread(&h);
    let (mean, law) = (shot.mean(&[chart]).1.x / PI, |f: f64| (1.0 - f) / (1.0 - rho * f));
    let texel = libm::sqrt(f * (1.0 - f) / f64::from(rays));
    let sigma = texel / libm::sqrt(h.len() as f64) / (1.0 - rho * f);
    println!("aperture {:.4}: mean {mean:.5}, sd {sd:.5}, expected {:.5}", 1.0 - f, law(f));
    assert!((mean - law(f)).abs() < 3.0 * sigma + (law(own) - law(f)).abs(), "{mean} {} {sigma}", law(f));
    assert!(sd < 3.0 * texel, "{sd} {texel}");
}

/// One small square over 100 texels stands for a square at 100 places.
#[test]
fn failure_hemicube_alias() {
    let mut stage = Stage::new();
    let (black, lamp) = (stage.material(0.0, 0.0), stage.material(0.0, 1.0));
    let corners = [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]].map(|[x, z]| DVec3::new(x, 1.0, z));
    rectangle(&mut stage, lamp, [vec3(0.0, 1.0, 0.0), Vec3::X * 0.01, Vec3::Z * 0.01], UVec2::splat(2));
    let plane = rectangle(&mut stage, black, [vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0], UVec2::splat(10));
    let shot = shoot(stage, 64);
    for (i, place) in shot.placed(plane) {
        let c = DVec3::new(place.y * 2.0 - 1.0, 0.0, place.x * 2.0 - 1.0);
        let square = [c - DVec3::new(0.1, 0.0, 0.1), DVec3::X * 0.2, DVec3::Z * 0.2];
        let expected = exact::mean_over(square, 16, |p| exact::element_to_polygon(p, DVec3::Y, &corners));
        let got = grey(shot.baked.irradiance[i]);
        // Four stratified points a texel, over which the value varies by up to a fifth.
        assert!((got / expected - 1.0).abs() < 0.03, "{c}: {got} {expected}");
    }
}

/// The same light from one emitter, left to the rows or in closed form, and from 20 000 triangles, sampled.
#[test]
fn failure_many_small_emitters() {
    let lit = |cells: u32| {
        let mut stage = Stage::new();
        let (white, lamp) = (stage.material(0.5, 0.0), stage.material(0.0, 1.0));
        let faces = FACES.map(|f| match f {
            Face::Top => unit_room().face(&mut stage, f, lamp, UVec2::splat(cells), UVec2::splat(20)),
            _ => unit_room().face(&mut stage, f, white, UVec2::ONE, UVec2::splat(12)),
        });
        (shoot(stage, 256), faces)
    };
    let (one, many) = (lit(1), lit(100));
    for face in 0..6 {
        let [(a, sa), (b, sb)] =
            [&one, &many].map(|(shot, faces)| (shot.values(faces[face]), shot.noise(faces[face]).x));
        // Half the light is scattered on: noise by 1 / (1 - rho).
        let sigma = libm::hypot(sa, sb) * 2.0;
        let errors: Vec<f64> = a.iter().zip(&b).map(|(a, b)| f64::from(a.x - b.x) / sigma).collect();
        if let Err(e) = within_sigma(&errors) {
            let k = (0..errors.len()).max_by(|a, b| errors[*a].abs().total_cmp(&errors[*b].abs())).unwrap_or(0);
            panic!("face {face}: {e}; texel {k}: {} and {}", a[k], b[k]);
        }
        let (mean, _) = spread(&errors);
        assert!(mean.abs() < 3.0 / libm::sqrt(errors.len() as f64), "face {face}: {mean} sigma");
    }
}

#[test]
fn failure_open_scene_sky() {
    let mut stage = Stage::new();
    let white = stage.material(0.8, 0.0);
    let plane = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(4));
    stage.scene.sky = Sky::Uniform(vec3(1.0, 2.0, 3.0));
    let shot = shoot(stage, 1);
    for e in shot.values(plane) {
        assert!((e / vec3(1.0, 2.0, 3.0) - std::f32::consts::PI).abs().max_element() < 1e-5, "{e}");
    }
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
    let refused = luxel::bake::bake(&stage.scene, &o, std::path::Path::new("x.glb"), &luxel::progress::Silent);
    let message = refused.err().expect("a chart without area is refused").to_string();
    assert!(message.contains("no chart"), "{message}");
}

/// Scaled by a power of two, every product is the same number but for its exponent.
#[test]
fn failure_hdr_range() {
    let values = |m: f32| {
        let mut stage = Stage::new();
        let (wall, lamp) = (stage.material(0.5, 0.0), stage.material(0.5, m));
        furnished(&mut stage, wall, lamp, 8);
        shoot(stage, 64).baked.irradiance
    };
    let million = f32::from(1024u16) * 1024.0;
    let (one, bright) = (values(1.0), values(million));
    for (a, b) in one.iter().zip(&bright) {
        assert!((b.x - million * a.x).abs() <= 1e-6 * b.x, "{a} {b}");
    }
}
