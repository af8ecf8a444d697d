//! Adaptive receivers: where they are, and that nothing is read through a wall or round a corner.

mod common;

use common::{
    bakes::{Shot, grey, options, parts, shoot_with, worst},
    scenes::{Cuboid, FACES, furnished, rectangle, unit_room},
    stage::{Chart, Stage},
};
use glam::{DVec3, UVec2, Vec3, uvec2, vec3};
use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    bake,
    patches::Patches,
    progress::Silent,
    scene::{LightKind, Sky, World},
    trace::Tracer,
    transport::{self, Interpolation, Receivers, Transport},
};
use std::f64::consts::PI;

/// What is measured of a stage with adaptive receivers.
struct Measured {
    patches: Patches,
    transport: Transport,
    /// Of each texel the chart it lies in.
    charts: Vec<usize>,
}

impl Measured {
    fn new(mut stage: Stage, rays: u32) -> Self {
        let (edge, corners) = stage.lay_out();
        let layout = atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), page_size: 8192 };
        let scene = &stage.scene;
        let atlas = atlas::unwrap(scene, &layout, &scene.file, &Silent, &mut Vec::new()).expect("a layout");
        let coverage = Coverage::new(&World::new(scene), &atlas);
        let tracer = Tracer::new(World::new(scene));
        let mut patches = Patches::new(&tracer.world, &coverage, 0.98);
        let options = adaptive(rays);
        let transport = Transport::measure(&tracer, &coverage, &mut patches, &options, &Silent).expect("rows");
        transport.validate(&patches).expect("a sound transport");
        let holds = |chart: usize, at: UVec2| {
            at.cmpge(corners[chart]).all() && at.cmplt(corners[chart] + stage.sizes[chart]).all()
        };
        let chart = |at: UVec2| (0..corners.len()).find(|&c| holds(c, at)).expect("texels lie in charts");
        let charts = coverage.texels.iter().map(|t| chart(t.at)).collect();
        Measured { patches, transport, charts }
    }

    /// Receivers, as patches, that a patch reads, and their weights.
    fn read(&self, patch: usize) -> Vec<(usize, f32)> {
        let Interpolation::Convex { starts, entries } = &self.transport.interpolation else { panic!("not adaptive") };
        let row = &entries[starts[patch] as usize..starts[patch + 1] as usize];
        row.iter().map(|&(r, w)| (self.transport.receivers[r as usize] as usize, w)).collect()
    }

    /// Share of a chart's texels that are receivers.
    fn share(&self, chart: Chart) -> f64 {
        let texels: Vec<usize> = (0..self.patches.fronts).filter(|&t| self.charts[t] == chart).collect();
        let own = texels.iter().filter(|&&t| self.transport.receiver_at(t as u32).is_some()).count();
        own as f64 / texels.len() as f64
    }

    /// Asserts that a chart's texels read nothing across; that some read others at all.
    fn reads_none(&self, chart: Chart, across: impl Fn(Vec3, Vec3) -> bool) {
        let mut reading = 0;
        for t in (0..self.patches.fronts).filter(|&t| self.charts[t] == chart) {
            let read = self.read(t);
            reading += usize::from(read.len() > 1);
            for (other, weight) in read {
                let [p, q] = [t, other].map(|i| self.patches.center[i]);
                assert!(!across(p, q), "{p} reads {q} with weight {weight}");
            }
        }
        assert!(reading > 0, "nothing is interpolated");
    }
}

fn adaptive(rays: u32) -> transport::Options {
    transport::Options { receivers: Receivers::Auto, ..transport::Options::of(rays) }
}

fn shoot_adaptive(stage: Stage, rays: u32) -> Shot {
    shoot_with(stage, bake::Options { transport: adaptive(rays), ..options(rays) })
}

/// Walls of two rooms with a block, and a two-sided sheet.
fn rooms() -> Stage {
    let mut stage = Stage::new();
    let (white, block) = (stage.material(0.7, 0.0), stage.material(0.4, 1.0));
    furnished(&mut stage, white, block, 48);
    let sheet = stage.rgb(Vec3::splat(0.5), Vec3::ZERO, true);
    rectangle(&mut stage, sheet, [vec3(0.9, 0.1, 1.2), Vec3::X * 0.3, Vec3::Y * 0.5], UVec2::splat(12));
    stage
}

#[test]
fn weights_are_convex_and_whole() {
    let m = Measured::new(rooms(), 16);
    let (receivers, patches) = (m.transport.receivers.len(), m.patches.len());
    assert!(receivers * 3 < patches * 2, "{receivers} of {patches}");
    assert!(m.transport.receivers.is_sorted());
    for p in 0..patches {
        let read = m.read(p);
        assert!(read.iter().all(|e| e.1 > 0.0) && read.is_sorted_by(|a, b| a.0 < b.0), "{read:?}");
        assert_eq!(read.iter().map(|e| e.1).sum::<f32>(), 1.0, "{read:?}");
        assert_eq!(m.transport.receiver_at(p as u32).is_some(), read == [(p, 1.0)]);
    }
}

/// Backs of sheets are receivers of their own.
#[test]
fn backs_are_read_from_nobody() {
    let m = Measured::new(rooms(), 16);
    assert!(m.patches.backs.len() > 100);
    for p in 0..m.patches.len() {
        let back = p >= m.patches.fronts;
        assert!(m.read(p).iter().all(|e| if back { e.0 == p } else { e.0 < m.patches.fronts }));
    }
}

/// A plane under the sky, one under a far roof: few receivers.
#[test]
fn open_surfaces_have_few_receivers() {
    for roof in [false, true] {
        let mut stage = Stage::new();
        let white = stage.material(0.5, 0.0);
        let plane = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z * 8.0, Vec3::X * 8.0], UVec2::splat(128));
        if roof {
            rectangle(&mut stage, white, [vec3(0.0, 6.0, 0.0), Vec3::X * 8.0, Vec3::Z * 8.0], UVec2::splat(8));
        }
        let share = Measured::new(stage, 16).share(plane);
        println!("roof {roof}: {share}");
        assert!(share < 0.06, "{share}");
    }
}

/// Every texel within two of an edge of the box.
#[test]
fn corners_are_all_receivers() {
    let mut stage = Stage::new();
    let white = stage.material(0.5, 0.0);
    unit_room().all(&mut stage, white, 64);
    let m = Measured::new(stage, 16);
    let near = |p: Vec3| {
        let from_walls = p.min(1.0 - p).to_array();
        from_walls.iter().filter(|&&d| d < 1.0 / 64.0).count() >= 2
    };
    for t in 0..m.patches.fronts {
        assert!(!near(m.patches.center[t]) || m.transport.receiver_at(t as u32).is_some(), "{}", m.patches.center[t]);
    }
    assert!(m.share(2) < 0.5, "{}", m.share(2));
}

/// A sheet and a block stand on a floor; a kerb hardly more than half a texel high, of which a glance knows nothing.
#[test]
fn nothing_is_read_through_a_wall() {
    for (height, thick) in [(1.0f32, 0.0f32), (1.0, 0.04), (0.08, 0.0), (0.05, 0.0)] {
        for rays in [1, 16] {
            let mut stage = Stage::new();
            let white = stage.material(0.5, 0.0);
            let sheet = stage.rgb(Vec3::splat(0.5), Vec3::ZERO, true);
            let floor = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 4.0], UVec2::splat(64));
            let x = 2.02;
            if thick > 0.0 {
                let wall = Cuboid::block(vec3(x, 0.0, -0.5), vec3(x + thick, height, 4.5));
                wall.all(&mut stage, white, 32);
            } else {
                let corner = vec3(x, -0.01, -0.5);
                rectangle(&mut stage, sheet, [corner, Vec3::Z * 5.0, Vec3::Y * (height + 0.01)], uvec2(32, 4));
            }
            let m = Measured::new(stage, rays);
            m.reads_none(floor, |p, q| (p.x < x) != (q.x < x) && (p.x - x).abs() > 0.07 && (q.x - x).abs() > 0.07);
        }
    }
}

/// One chart over a fold, seen from its outer side, where nothing is near.
#[test]
fn nothing_is_read_round_a_corner() {
    for angle in [90f32, 60.0, 30.0, -90.0] {
        let mut stage = Stage::new();
        let white = stage.material(0.5, 0.0);
        let down = vec3(libm::cosf(angle.to_radians()), -libm::sinf(angle.to_radians()), 0.0);
        let position = |i: u32, j: u32| {
            let along = if i == 0 {
                Vec3::NEG_X
            } else if i == 1 {
                Vec3::ZERO
            } else {
                down
            };
            along + Vec3::Z * 2.0 * j as f32
        };
        let fold = stage.grid("fold", white, [uvec2(2, 1), uvec2(64, 64)], true, position, None);
        let m = Measured::new(stage, 16);
        let side = |p: Vec3| p.x < 0.0;
        m.reads_none(fold, |p, q| side(p) != side(q));
        assert!(m.share(fold) < 0.25, "{}", m.share(fold));
    }
}

/// What is the same everywhere stays so, to rounding: under a sky, and in a furnace whose receivers see it whole.
#[test]
fn constant_light_stays_constant() {
    let mut stage = Stage::new();
    let white = stage.material(0.5, 0.0);
    let plane = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(40));
    stage.scene.sky = Sky::Uniform(Vec3::ONE);
    let shot = shoot_adaptive(stage, 16);
    assert!(worst(shot.values(plane).into_iter().map(grey), PI) < 1e-6);
    let mut stage = Stage::new();
    let furnace = stage.material(0.8, 1.0);
    furnished(&mut stage, furnace, furnace, 48);
    let shot = shoot_adaptive(stage, 16);
    assert!(shot.baked.report.receivers * 3 < 2 * shot.baked.report.texels);
    assert!(worst(shot.baked.irradiance.iter().map(|e| grey(*e)), 5.0) < 1e-3);
}

/// What is put in is absorbed, and receivers agree with all texels.
#[test]
fn power_is_kept() {
    let shot = |receivers| {
        let mut stage = Stage::new();
        let (wall, block) = (stage.material(0.7, 0.0), stage.material(0.4, 0.0));
        furnished(&mut stage, wall, block, 48);
        stage.light(LightKind::Point { radius: 0.05 }, vec3(1.0, 0.8, 0.7), Vec3::ZERO, 3.0);
        let transport = transport::Options { receivers, ..transport::Options::of(64) };
        shoot_with(stage, bake::Options { transport, ..options(64) })
    };
    let [all, some] = Receivers::ALL.map(shot);
    let imbalance = some.baked.report.energy.imbalance;
    println!("{} of {} texels, imbalance {imbalance}", some.baked.report.receivers, all.baked.report.texels);
    assert!(imbalance.abs() < 0.005, "{imbalance}");
    let charts: Vec<Chart> = (0..FACES.len()).collect();
    let [a, b] = [all, some].map(|s| s.mean(&charts).1);
    assert!((a - b).abs().cmplt(a * 0.005).all(), "{a} {b}");
    assert!(a != DVec3::ZERO);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut stage = rooms();
    stage.lay_out();
    let mut options = bake::Options { transport: adaptive(16), ..options(16) };
    options.atlas.density = Density::Resolution(128);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let baked = pool.install(|| parts(&stage.scene, &options));
        assert!(baked.report.receivers < baked.report.texels);
        baked.irradiance.iter().flat_map(|e| e.to_array().map(f32::to_bits)).collect::<Vec<_>>()
    };
    let once = run(1);
    assert!(once == run(2) && once == run(3));
}
