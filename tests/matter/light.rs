//! What shines: skies, lights by their wish, emissive textures, the balance of power.

use crate::{
    PI, black, close,
    common::{
        bakes::{Shot, grey, options, shoot, shoot_with},
        exact,
        scenes::{Cuboid, FACES, Face, rectangle, unit_room},
        stage::{Chart, Stage},
    },
    corners, greys, mean, part, plane,
};
use glam::{DVec3, UVec2, Vec2, Vec3, dvec3, uvec2, vec2, vec3};
use luxel::{
    bake::Options,
    lightmaps::Content,
    scene::{Alpha, Bake, LightKind, Material, Sky, SkyMap},
};
use std::f64::consts::TAU;

const NORMALS: [DVec3; 6] = [DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y, DVec3::NEG_Z, DVec3::Z];

fn map(size: UVec2, rotation: f32, radiance: impl Fn(u32, u32) -> f32) -> SkyMap {
    let at = |i: u32| Vec3::splat(radiance(i % size.x, i / size.x));
    SkyMap { width: size.x, height: size.y, radiance: (0..size.x * size.y).map(at).collect(), rotation }
}

/// Mean irradiance of the six faces of a black block that floats in the sky.
fn block_under(map: SkyMap) -> [f64; 6] {
    let mut stage = Stage::new();
    let material = stage.add(black());
    let charts = Cuboid::block(Vec3::ZERO, Vec3::ONE).all(&mut stage, material, 4);
    stage.scene.sky = Sky::Map(map);
    let shot = shoot(stage, 1024);
    std::array::from_fn(|k| mean(&shot, charts[k]))
}

/// Integral of L cos over the picture, seen with normal `n`, by the midpoint rule in each of its texels. The directions
/// are written down here again: the picture's centre looks to -Z, its right to +X, +rotation turns -Z towards -X.
fn integral(map: &SkyMap, n: DVec3) -> f64 {
    const K: u32 = 8;
    let size = uvec2(map.width, map.height) * K;
    let of = |i: u32| {
        let (x, y) = (i % size.x, i / size.x);
        let u = (f64::from(x) + 0.5) / f64::from(size.x) - 0.5;
        let polar = PI * (f64::from(y) + 0.5) / f64::from(size.y);
        let azimuth = TAU * u - f64::from(map.rotation);
        let sin = libm::sin(polar);
        let d = dvec3(sin * libm::sin(azimuth), libm::cos(polar), -sin * libm::cos(azimuth));
        let solid = sin * PI / f64::from(size.y) * TAU / f64::from(size.x);
        grey(map.radiance[(y / K * map.width + x / K) as usize]) * d.dot(n).max(0.0) * solid
    };
    (0..size.x * size.y).map(of).sum()
}

#[test]
fn half_a_sky_gives_half_to_those_who_see_half() {
    half_a_sky(uvec2(256, 128));
}

#[test]
fn half_a_coarse_sky_gives_half_too() {
    half_a_sky(uvec2(64, 32));
}

fn half_a_sky(size: UVec2) {
    let l = 2.0;
    for degrees in [0.0, 90.0, 30.0, -45.0] {
        let r = f64::to_radians(degrees);
        // The left half of the picture is -X; a turn counter-clockwise, seen from above, moves it to +Z.
        let bright = dvec3(-libm::cos(r), 0.0, libm::sin(r));
        let got = block_under(map(size, r as f32, |x, _| if x < size.x / 2 { l } else { 0.0 }));
        for k in 0..6 {
            let expected = PI * f64::from(l) * (1.0 + NORMALS[k].dot(bright)) / 2.0;
            let off = (got[k] - expected).abs() / (PI * f64::from(l));
            assert!(off < 0.01, "{:?} turned by {degrees}: {} instead of {expected}", FACES[k], got[k]);
        }
    }
}

#[test]
fn a_peak_in_the_sky_is_radiance_times_solid_angle() {
    let size = uvec2(256, 128);
    let (l, row) = (20000.0, 34);
    let mut stage = Stage::new();
    let floor = plane(&mut stage, Vec3::ZERO, 4.0, 32);
    let shade = stage.add(black());
    Cuboid::block(vec3(-0.5, 1.0, -0.5), vec3(0.5, 1.1, 0.5)).all(&mut stage, shade, 2);
    // One texel just right of the picture's centre: towards -Z, 48 degrees from the zenith.
    stage.scene.sky = Sky::Map(map(size, 0.0, |x, y| if (x, y) == (128, row) { l } else { 0.0 }));
    let shot = shoot(stage, 256);
    let sin2 = |y: u32| {
        let s = libm::sin(PI * f64::from(y) / f64::from(size.y));
        s * s
    };
    let expected = f64::from(l) * TAU / f64::from(size.x) * (sin2(row + 1) - sin2(row)) / 2.0;
    let polar = PI * (f64::from(row) + 0.5) / f64::from(size.y);
    // The shadow of the block's middle falls to +Z.
    let away = libm::tan(polar) * 1.05;
    let (mut lit, mut dark) = (0, 0);
    for i in shot.texels(floor) {
        let p = shot.baked.patches.center[i].as_dvec3();
        let from_middle = (p.x + 0.01 * away).abs().max((p.z - away).abs());
        let e = grey(shot.baked.irradiance[i]);
        if from_middle > 0.95 {
            close("in the open", e, expected, 0.01);
            lit += 1;
        } else if from_middle < 0.25 {
            assert!(e < 0.01 * expected, "in the shadow at {p}: {e} of {expected}");
            dark += 1;
        }
    }
    assert!(lit > 500 && dark > 8, "{lit} lit and {dark} dark texels");
}

#[test]
fn peaks_and_smooth_sky_sum_to_the_picture() {
    let value = |x: u32, y: u32| match (x, y) {
        (40, 9) => 400.0,
        (3, 12) | (4, 12) => 60.0,
        (20, 25) => 90.0,
        _ => 1.0 + 0.7 * libm::sinf(x as f32 * 0.2) + 0.05 * (32.0 - y as f32),
    };
    for rotation in [0.0, 2.2] {
        let sky = map(uvec2(64, 32), rotation, value);
        let got = block_under(sky.clone());
        for k in 0..6 {
            close(&format!("{:?} turned by {rotation}", FACES[k]), got[k], integral(&sky, NORMALS[k]), 0.01);
        }
    }
}

/// One bright texel at the zenith, or above the horizon, of a picture of few rows.
#[test]
fn a_peak_in_a_coarse_sky_is_spread_evenly() {
    for (size, row) in [(uvec2(8, 4), 0), (uvec2(8, 4), 1), (uvec2(16, 8), 0)] {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 1.0, 4);
        let sky = map(size, 0.3, |x, y| if (x, y) == (1, row) { 64.0 } else { 0.0 });
        stage.scene.sky = Sky::Map(sky.clone());
        close(&format!("row {row} of {size}"), mean(&shoot(stage, 1024), floor), integral(&sky, DVec3::Y), 0.01);
    }
}

/// A room with two lights, of which the second is baked as `wish`; its map.
fn lamps(wish: Bake, content: Content) -> Vec<DVec3> {
    let mut stage = Stage::new();
    let wall = stage.rgb(vec3(0.6, 0.5, 0.3), Vec3::ZERO, false);
    let charts = unit_room().all(&mut stage, wall, 6);
    stage.light(LightKind::Point { radius: 0.0 }, vec3(0.3, 0.4, 0.5), Vec3::ZERO, 1.0);
    stage.light(LightKind::Point { radius: 0.0 }, vec3(0.7, 0.8, 0.4), Vec3::ZERO, 3.0);
    stage.scene.lights[1].bake = wish;
    let shot = shoot_with(stage, Options { content, ..options(256) });
    charts.iter().flat_map(|c| shot.mapped(*c)).map(Vec3::as_dvec3).collect()
}

#[test]
fn each_light_is_baked_as_it_wishes_and_full_is_direct_and_indirect() {
    use Content::{Direct, Full, Indirect};
    let same = |what: &str, a: &[DVec3], b: &[DVec3]| {
        for (a, b) in a.iter().zip(b) {
            assert!((*a - *b).abs().max_element() <= 2e-4 * b.max_element().max(1.0), "{what}: {a} instead of {b}");
        }
    };
    let sum = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a + *b).collect::<Vec<_>>();
    let [full, direct, indirect] = [Full, Direct, Indirect].map(|c| lamps(Bake::Full, c));
    same("both lights", &sum(&direct, &indirect), &full);
    let [hidden, hidden_direct, hidden_indirect] = [Full, Direct, Indirect].map(|c| lamps(Bake::Indirect, c));
    let [one, one_direct] = [Full, Direct].map(|c| lamps(Bake::None, c));
    same("bounces of a hidden light", &hidden_indirect, &indirect);
    same("direct light beside a hidden one", &hidden_direct, &one_direct);
    same("a hidden light in full", &hidden, &sum(&one_direct, &indirect));
    // The light that is not baked at all: the second one's share is far from nothing.
    assert!(one.iter().zip(&full).all(|(a, b)| a.x < 0.9 * b.x && a.x > 0.0), "a light without bake shines");
    assert!(direct.iter().zip(&one_direct).all(|(a, b)| a.x > b.x), "direct light lacks a light");
}

/// A panel of 1 m, `height` over the middle of a plane of edge `a`, emitting `l` times `picture`; the plane's chart.
fn panel(height: f32, a: f32, l: f32, size: UVec2, picture: impl Fn(u32, u32) -> u8) -> (Shot, Chart, [Vec3; 3]) {
    let mut stage = Stage::new();
    let floor = plane(&mut stage, Vec3::ZERO, a, 8);
    let [o, s, t] = corners(vec3(0.0, height, 0.0), 1.0);
    // It looks down: its chart has u along x and v along z.
    let down = [o + t, s, -t];
    let texture = stage.picture(size, |x, y| {
        let v = picture(x, y);
        [v, v, v, 255]
    });
    let glow = stage.add(Material { emission: Vec3::splat(l), emission_texture: Some(texture), ..black() });
    let lamp = rectangle(&mut stage, glow, down, UVec2::splat(8));
    stage.paint(lamp);
    (shoot(stage, 1024), floor, down)
}

/// Mean over the plane of edge `a` of the form factor to a polygon.
fn factor(a: f32, polygon: &[DVec3]) -> f64 {
    exact::mean_over(corners(Vec3::ZERO, a).map(|v| v.as_dvec3()), 32, |p| {
        exact::element_to_polygon(p, DVec3::Y, polygon)
    })
}

#[test]
fn half_a_panel_emits() {
    // A large plane: the emitter is sampled; a small one: the rows see it.
    for a in [2.0, 0.25] {
        let (shot, floor, at) = panel(1.0, a, 3.0, uvec2(2, 1), |x, _| if x == 0 { 255 } else { 0 });
        let expected = 3.0 * PI * factor(a, &part(at, [0.0, 0.5], [0.0, 1.0]));
        close(&format!("under half a panel, plane of {a}"), mean(&shot, floor), expected, 0.01);
    }
}

#[test]
fn a_bright_spot_of_a_texture_emits_its_power() {
    // 4 x 5 of 64 x 64 texels: .49 % of the panel.
    for at in [uvec2(30, 30), uvec2(37, 11), uvec2(1, 58)] {
        let spot = |x: u32, y: u32| (at.x..at.x + 4).contains(&x) && (at.y..at.y + 5).contains(&y);
        let (shot, floor, down) = panel(1.5, 1.0, 100.0, uvec2(64, 64), |x, y| if spot(x, y) { 255 } else { 0 });
        let range = |a: u32, n: u32| [a as f32 / 64.0, (a + n) as f32 / 64.0];
        let expected = 100.0 * PI * factor(1.0, &part(down, range(at.x, 4), range(at.y, 5)));
        close(&format!("spot at {at}"), mean(&shot, floor), expected, 0.05);
    }
}

/// A panel of 1 m, 1.5 m over a black plane of 2 m, whose texture coordinates are `uv` of those of its chart, beside
/// that of plain `emission`: mean irradiance of the planes.
fn panels(material: impl Fn(&mut Stage) -> Material, uv: impl Fn(Vec2) -> Vec2, emission: f32) -> [f64; 2] {
    [true, false].map(|wanted| {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 2.0, 8);
        let glow = if wanted { material(&mut stage) } else { Material { emission: Vec3::splat(emission), ..black() } };
        let glow = stage.add(glow);
        let lamp = rectangle(&mut stage, glow, [vec3(-0.5, 1.5, -0.5), Vec3::X, Vec3::Z], UVec2::splat(8));
        stage.paint(lamp);
        stage.scene.meshes[lamp].uvs[0].iter_mut().for_each(|p| *p = uv(*p));
        mean(&shoot(stage, 256), floor)
    })
}

#[test]
fn a_palettes_colour_is_what_shines() {
    let half = |stage: &mut Stage| {
        let half = stage.picture(uvec2(64, 1), |x, _| if x < 32 { [0, 0, 0, 255] } else { [255; 4] });
        Material { emission: Vec3::ONE, emission_texture: Some(half), ..black() }
    };
    // All of it reads one point of the dark or of the bright half, or one line across both.
    let [dark, _] = panels(half, |_| vec2(0.25, 0.5), 1.0);
    assert_eq!(dark, 0.0, "a black lamp");
    let [bright, plain] = panels(half, |_| vec2(0.75, 0.5), 1.0);
    close("a white lamp", bright, plain, 0.01);
    let [across, plain] = panels(half, |p| vec2(p.x, 0.5), 0.5);
    close("half a lamp", across, plain, 0.05);
}

#[test]
fn what_passes_through_a_lamp_is_not_emitted() {
    let base_color = Vec3::ONE.extend(0.25);
    let glow = || Material { emission: Vec3::ONE, ..black() };
    let veil = |_: &mut Stage| Material { base_color, alpha: Alpha::Blend, ..glow() };
    let [got, expected] = panels(veil, |p| p, 0.25);
    close("a veil", got, expected, 0.01);
    let cutout = |_: &mut Stage| Material { base_color, alpha: Alpha::Mask(0.5), ..glow() };
    assert_eq!(panels(cutout, |p| p, 1.0)[0], 0.0, "a hole shines");
    let glass = |_: &mut Stage| Material { base_color: Vec3::ONE.extend(1.0), transmission: 0.6, ..glow() };
    let [got, expected] = panels(glass, |p| p, 0.4);
    close("glass", got, expected, 0.01);
}

/// The edge of what half lets light through is an edge: as many rays as that of what lets none through.
#[test]
fn shadows_of_veils_have_edges() {
    let rays = |opacity: f32| {
        let mut stage = Stage::new();
        let base_color = Vec3::ONE.extend(opacity);
        let (floor, pane) = (stage.add(black()), stage.add(Material { base_color, alpha: Alpha::Blend, ..black() }));
        rectangle(&mut stage, floor, [Vec3::ZERO, Vec3::Z * 2.0, Vec3::X * 2.0], UVec2::splat(16));
        rectangle(&mut stage, pane, [vec3(0.53, 0.2, 0.53), Vec3::Z, Vec3::X], UVec2::splat(4));
        stage.light(LightKind::Directional { angle: 2.0 }, Vec3::ZERO, Vec3::NEG_Y, 1.0);
        shoot(stage, 32).baked.report.rays.shadow
    };
    let [nothing, veil, wall] = [0.0, 0.5, 1.0].map(rays);
    assert!(nothing * 4 < veil && veil < wall, "{veil} rays for a veil, {wall} for a wall, {nothing} for nothing");
}

/// A room with a window, furnished with a lamp; everything by face normals, one side.
#[test]
fn power_is_kept_with_lamp_light_and_sun() {
    for wanted in ["all", "lamp", "light", "sun"] {
        let has = |w: &str| wanted == "all" || wanted == w;
        let mut stage = Stage::new();
        let wall = stage.rgb(vec3(0.7, 0.6, 0.5), Vec3::ZERO, false);
        let lamp = stage.material(0.5, if has("lamp") { 10.0 } else { 0.0 });
        let room = Cuboid::room(Vec3::ZERO, vec3(2.0, 2.0, 3.0));
        for face in FACES.into_iter().filter(|f| *f != Face::Front) {
            room.face(&mut stage, face, wall, UVec2::ONE, UVec2::splat(16));
        }
        let cuts = [0.0, 0.5, 1.5, 2.0];
        room.cut(&mut stage, Face::Front, &cuts, &cuts, |i, j| ((i, j) != (1, 1)).then_some((wall, uvec2(4, 4))));
        Cuboid::block(vec3(0.5, 1.6, 0.6), vec3(0.8, 1.8, 1.2)).all(&mut stage, lamp, 4);
        if has("light") {
            stage.light(LightKind::Point { radius: 0.0 }, vec3(1.3, 1.1, 0.9), Vec3::ZERO, 5.0);
        }
        if has("sun") {
            stage.light(LightKind::Directional { angle: 0.01 }, Vec3::ZERO, vec3(0.1, -0.5, -1.0), 20.0);
        }
        let shot = shoot(stage, 1024);
        let e = &shot.baked.report.energy;
        assert!(e.emitted > 0.0 && e.escaped > 0.0 && e.imbalance.abs() < 0.01, "{wanted}: {e:?}");
        assert!(greys(&shot, 0).iter().all(|e| *e > 0.0), "{wanted}: the room is dark");
    }
}
