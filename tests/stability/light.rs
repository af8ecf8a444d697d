//! Small, far, narrow and very bright: where light is easily missed, or spilled.

use crate::{
    common::{
        bakes::{grey, options, shoot, shoot_with, spread, within_sigma, worst},
        exact,
        scenes::{Ball, Cuboid, FACES, Face, furnished, rectangle, unit_room},
        stage::{Chart, Stage},
    },
    scenes::{off_below_tiny_lamp, tiny_lamp},
};
use glam::{DVec3, UVec2, Vec3, uvec2, vec3};
use luxel::{
    bake::Options,
    scene::{LightKind, Sky},
};
use std::f64::consts::PI;

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
fn failure_tiny_emitter() {
    let mut stage = Stage::new();
    let foot = tiny_lamp(&mut stage);
    let off = off_below_tiny_lamp(&shoot(stage, 64), foot);
    assert!(off < 5e-4, "off by {off}");
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
        // Texels share sixteen blocks of points: no more than that many are independent.
        let independent = errors.len().min(16) as f64;
        assert!(mean.abs() < 3.0 / libm::sqrt(independent), "face {face}: {mean} sigma");
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
