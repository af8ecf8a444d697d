//! The truth that paths find.

use crate::{
    Blank, both,
    common::{
        exact,
        scenes::{Cuboid, FACES, Face, rectangle, unit_room},
        score::{self, Truth},
        stage::Stage,
    },
    grey, laid_out, texels,
};
use glam::{DVec3, UVec2, Vec3, dvec3, vec3};
use luxel::{
    audit::{self, Options},
    lightmaps::Content,
    scene::{Alpha, Bake, LightKind, Material, Sky, SkyMap},
};
use std::{f64::consts::PI, path::PathBuf};

/// A square of edge 2 at the origin that looks up.
const FLOOR: [Vec3; 3] = [vec3(-1.0, 0.0, 1.0), vec3(2.0, 0.0, 0.0), vec3(0.0, 0.0, -2.0)];

fn floor(rho: f32, n: u32) -> Stage {
    let mut stage = Stage::new();
    let material = stage.material(rho, 0.0);
    rectangle(&mut stage, material, FLOOR, texels(n));
    stage
}

/// Texel (i, j) of the floor as a parallelogram.
fn cell(n: u32, i: u32, j: u32) -> [DVec3; 3] {
    let [o, s, t] = FLOOR.map(|v| v.as_dvec3());
    let n = f64::from(n);
    [o + s * (f64::from(i) / n) + t * (f64::from(j) / n), s / n, t / n]
}

/// Mean irradiance of every texel of a floor alone on its page, against `exact` of the texel.
fn assert_floor(stage: Stage, n: u32, paths: u32, tolerance: f64, exact: impl Fn([DVec3; 3]) -> f64) {
    let (scene, edge) = laid_out(stage);
    let blank = Blank::new(&scene, edge);
    let found = blank.truth(paths);
    let (mut squares, mut noise, mut seen) = (0.0, 0.0, 0);
    for (t, r) in blank.coverage.texels.iter().zip(&found) {
        let [f] = blank.coverage.fragments_of(blank.coverage.grids[0][(t.at.y * edge + t.at.x) as usize] as usize)[..1]
        else {
            unreachable!()
        };
        if blank.tracer.world.locate(f.triangle).0 > 0 {
            continue;
        }
        let (i, j) = (t.at.x - 2, t.at.y - 2);
        let expected = exact(cell(n, i, j));
        assert!((both(r) / expected - 1.0).abs() < tolerance, "texel {i}, {j}: {} instead of {expected}", both(r));
        squares += (both(r) - expected).powi(2);
        noise += grey(r.halves[0] - r.halves[1]).powi(2) / 4.0;
        seen += 1;
    }
    println!("{} standard errors", (squares / noise).sqrt());
    assert!(squares < 2.0 * noise + 1e-10, "{} standard errors", (squares / noise).sqrt());
    assert_eq!(seen, n * n);
}

#[test]
fn a_point_light_over_a_plane() {
    let mut stage = floor(0.5, 8);
    let at = dvec3(0.3, 0.8, -0.2);
    stage.light(LightKind::Point { radius: 0.0 }, at.as_vec3(), Vec3::ZERO, 3.0);
    assert_floor(stage, 8, 16, 0.01, |cell| {
        exact::mean_over(cell, 64, |p| 3.0 * (at - p).y / (at - p).length().powi(3))
    });
}

#[test]
fn a_uniform_sky_is_pi_l() {
    let mut stage = floor(0.5, 2);
    stage.scene.sky = Sky::Uniform(Vec3::splat(2.0));
    assert_floor(stage, 2, 16, 1e-5, |_| 2.0 * PI);
}

/// A picture of the sky, by its luminance and by cosine together.
#[test]
fn a_picture_of_the_sky() {
    let mut stage = floor(0.5, 2);
    // Bright in one texel, the rest dim: a band of rows 8 to 9 of 32, column 5 of 64.
    let radiance = |i: u32| if (i / 64, i % 64) == (8, 5) { 500.0 } else { 0.3 };
    let radiance = (0..64 * 32).map(|i| Vec3::splat(radiance(i))).collect();
    stage.scene.sky = Sky::Map(SkyMap { width: 64, height: 32, radiance, rotation: 0.4 });
    let square = |row: f64| libm::sin(PI * row / 32.0).powi(2);
    let peak = (500.0 - 0.3) * 2.0 * PI / 64.0 * (square(9.0) - square(8.0)) / 2.0;
    assert_floor(stage, 2, 64, 0.01, |_| 0.3 * PI + peak);
}

/// A square lamp over the floor, by Lambert's formula; the lamp reflects nothing.
#[test]
fn a_square_lamp_over_a_plane() {
    let mut stage = floor(0.0, 8);
    let lamp = stage.material(0.0, 8.0);
    let corner = vec3(-0.3, 0.5, -0.4);
    // Looks down.
    rectangle(&mut stage, lamp, [corner, vec3(0.7, 0.0, 0.0), vec3(0.0, 0.0, 0.7)], texels(2));
    let lamp = [(0.0, 0.0), (0.7, 0.0), (0.7, 0.7), (0.0, 0.7)].map(|(x, z)| corner.as_dvec3() + dvec3(x, 0.0, z));
    assert_floor(stage, 8, 64, 0.05, |cell| {
        exact::mean_over(cell, 32, |p| 8.0 * exact::element_to_polygon(p, DVec3::Y, &lamp))
    });
}

/// Half of the light comes through a sheet of opacity one half, whichever way it is counted.
#[test]
fn alpha_lets_light_through() {
    for sky in [true, false] {
        let mut stage = floor(0.0, 2);
        let glass =
            Material { base_color: vec3(0.0, 0.0, 0.0).extend(0.5), alpha: Alpha::Blend, ..Material::default() };
        let glass = stage.add(glass);
        rectangle(&mut stage, glass, [vec3(-50.0, 0.1, 50.0), Vec3::X * 100.0, Vec3::NEG_Z * 100.0], texels(2));
        let expected = if sky {
            stage.scene.sky = Sky::Uniform(Vec3::ONE);
            PI / 2.0
        } else {
            stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 3.0);
            1.5
        };
        assert_floor(stage, 2, 128, 0.02, |_| expected);
    }
}

/// Every face emits M and reflects rho: E = M / (1 - rho) everywhere, however long paths are.
#[test]
fn furnaces() {
    for rho in [0.5, 0.9] {
        let mut stage = Stage::new();
        let material = stage.material(rho, 1.0);
        unit_room().all(&mut stage, material, 2);
        let (scene, edge) = laid_out(stage);
        assert_furnace(&Blank::new(&scene, edge), 1.0 / (1.0 - f64::from(rho)));
    }
}

/// The same with vertex normals that lean away from the faces.
#[test]
fn smooth_furnace() {
    let mut stage = Stage::new();
    let material = stage.material(0.5, 1.0);
    unit_room().all(&mut stage, material, 2);
    let (mut scene, edge) = laid_out(stage);
    let middle = Vec3::splat(0.5);
    for mesh in &mut scene.meshes {
        mesh.normals = mesh.positions.iter().map(|p| (middle - *p).normalize()).collect();
    }
    let blank = Blank::new(&scene, edge);
    assert!(blank.tracer.world.smooth_normals(0, 0, Vec3::X).is_some());
    assert_furnace(&blank, 2.0);
}

fn assert_furnace(blank: &Blank, expected: f64) {
    let found = blank.truth(64);
    let mean = found.iter().map(both).sum::<f64>() / found.len() as f64;
    let noise =
        found.iter().map(|r| grey(r.halves[0] - r.halves[1]).powi(2) / 4.0).sum::<f64>().sqrt() / found.len() as f64;
    assert!((mean - expected).abs() < 4.0 * noise, "{mean} +- {noise}, not {expected}");
    assert!(noise < 0.01 * expected, "{noise}");
}

/// A furnace whose walls are capped reads as if they reflected that much.
#[test]
fn reflectance_is_capped() {
    let mut stage = Stage::new();
    let material = stage.material(1.0, 1.0);
    unit_room().all(&mut stage, material, 2);
    let (scene, edge) = laid_out(stage);
    let blank = Blank { max_reflectance: 0.75, ..Blank::new(&scene, edge) };
    assert_furnace(&blank, 4.0);
}

/// Whatever the map says, the mean of the paths is the same: a map that is wrong by half only adds noise.
#[test]
fn the_map_under_audit_does_not_move_the_truth() {
    let mut stage = Stage::new();
    let material = stage.material(0.5, 1.0);
    unit_room().all(&mut stage, material, 2);
    let (scene, edge) = laid_out(stage);
    for value in [0.0, 3.0, 2.0] {
        let mut blank = Blank::new(&scene, edge);
        blank.paint(|_| Vec3::splat(value));
        assert_furnace(&blank, 2.0);
    }
}

/// What maps of direct and of indirect light should hold sums up to all light.
#[test]
fn contents_sum_up() {
    let mut stage = Stage::new();
    let material = stage.material(0.5, 0.2);
    unit_room().all(&mut stage, material, 2);
    stage.light(LightKind::Point { radius: 0.1 }, Vec3::splat(0.4), Vec3::ZERO, 1.0);
    stage.light(LightKind::Point { radius: 0.0 }, Vec3::splat(0.6), Vec3::ZERO, 1.0);
    stage.scene.lights[1].bake = Bake::Indirect;
    let (scene, edge) = laid_out(stage);
    let mean = |content: Content| {
        let mut blank = Blank::new(&scene, edge);
        blank.lightmaps.content = content;
        let found = blank.truth(128);
        found.iter().map(both).sum::<f64>() / found.len() as f64
    };
    let [full, direct, indirect] = Content::ALL.map(mean);
    assert!((direct + indirect) / full - 1.0 < 0.01 && direct > 0.1 * full && indirect > 0.1 * full);
    assert!(((direct + indirect) / full - 1.0).abs() < 0.01, "{direct} + {indirect} = {full}");
}

/// A box that stands on the floor hides what is below it, a pillar that is open at the ceiling does, too.
#[test]
fn what_is_below_a_box_is_enclosed() {
    for pillar in [false, true] {
        let mut stage = floor(0.5, 8);
        let material = stage.material(0.5, 0.0);
        let (low, high) = (vec3(-0.25, -0.1, -0.25), vec3(0.25, 2.0, 0.25));
        for face in FACES.into_iter().filter(|f| !(pillar && *f == Face::Top)) {
            Cuboid::block(low, high).face(&mut stage, face, material, UVec2::ONE, UVec2::splat(4));
        }
        let room = Cuboid::room(vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0));
        room.face(&mut stage, Face::Top, material, UVec2::ONE, UVec2::splat(4));
        stage.scene.sky = Sky::Uniform(Vec3::ONE);
        let (scene, edge) = laid_out(stage);
        let blank = Blank::new(&scene, edge);
        let found = blank.truth(16);
        for j in 0..8 {
            for i in 0..8 {
                let texel = blank.coverage.grids[0][((j + 2) * edge + i + 2) as usize] as usize;
                let below = (3..5).contains(&i) && (3..5).contains(&j);
                // By chance a place meets the ceiling often.
                let off = (found[texel].enclosed - f64::from(u8::from(below))).abs();
                assert!(off <= if pillar && below { 0.05 } else { 0.0 }, "pillar: {pillar}, {i}, {j}");
            }
        }
    }
}

/// Mitsuba's irradiance at a few hundred texels, within the errors of both.
#[test]
fn another_path_tracer_agrees() {
    for name in ["cornell", "bright", "furnished", "window"] {
        let data = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
        let scene = score::read_scene(&data.join(name).with_extension("glb")).expect("the scene");
        let truth = Truth::read(&data.join(name).with_extension("npz")).expect("the truth");
        let mut blank = Blank::new(&scene, truth.resolution as u32);
        blank.max_reflectance = 0.98;
        // A rough guess at all of it keeps long paths from being noisy.
        let mean = truth.texels.iter().map(|t| t.irradiance).sum::<DVec3>() / truth.texels.len() as f64;
        blank.paint(|_| mean.as_vec3());
        let some: Vec<_> =
            truth.texels.iter().filter(|t| !t.buried).step_by(truth.texels.len().div_ceil(250)).collect();
        let texels: Vec<usize> = some.iter().map(|t| blank.coverage.grids[0][t.index] as usize).collect();
        let found = audit::reference(&blank.subject(), &texels, &Options::default());
        let (mut squares, mut noise, mut sums) = (0.0, 0.0, [0.0; 3]);
        for (t, r) in some.iter().zip(&found) {
            let [a, b] = r.halves;
            let off = (a + b) * 0.5 - t.irradiance;
            let own = ((a - b) * 0.5).length_squared() + t.error.length_squared();
            squares += off.length_squared();
            noise += own;
            sums[0] += grey(off);
            sums[1] += own / 3.0;
            sums[2] += grey(t.irradiance);
        }
        let (spread, bias, error) = ((squares / noise).sqrt(), sums[0] / sums[2], sums[1].sqrt() / sums[2]);
        println!("{name}: {spread:.3} standard errors, bias {bias:+.5} +- {error:.5}");
        assert!((0.85..1.2).contains(&spread), "{name}: {spread} standard errors");
        assert!(bias.abs() < 4.0 * error, "{name}: bias {bias} +- {error}");
    }
}
