//! Physics before pixels: lights by their formulas, furnaces, the balance of power, the same bytes on any threads.

mod common;

use common::{
    bakes::{Shot, grey, options, parts, shoot, shoot_with, spread, unwrapped, within_sigma, worst},
    exact,
    scenes::{Ball, Cuboid, FACES, Face, furnished, rectangle, unit_room},
    stage::{Chart, Stage},
};
use glam::{DVec3, UVec2, Vec3, uvec2, vec3};
use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    bake,
    direct::{Bounce, Direct, Sources, sky_cells},
    lightmaps::Content,
    patches::Patches,
    progress::Silent,
    radiosity::{self, Radiosity, Solver},
    scene::{LightKind, Material, Sky, World},
    trace::Tracer,
    transport::{self, Transport},
};
use std::f64::consts::PI;

/// A black floor [-2, 2]^2 at y = 0 that looks up, of n x n texels, under one light.
fn floor(n: u32, kind: LightKind, position: Vec3, direction: Vec3, range: f32) -> (Shot, Chart) {
    let mut stage = Stage::new();
    let black = stage.material(0.0, 0.0);
    let corner = vec3(-2.0, 0.0, -2.0);
    let chart = rectangle(&mut stage, black, [corner, Vec3::Z * 4.0, Vec3::X * 4.0], UVec2::splat(n));
    stage.light(kind, position, direction, 10.0);
    stage.scene.lights[0].range = range;
    (shoot(stage, 256), chart)
}

/// Every texel is a mean over points inside it: between the law's extremes there; and their mean is the law's.
fn follows(shot: &Shot, chart: Chart, law: impl Fn(DVec3) -> f64) {
    let n = shot.rows(chart).len();
    let side = 4.0 / n as f64;
    let (mut sum, mut expected) = (0.0, 0.0);
    for (i, place) in shot.placed(chart) {
        let c = DVec3::new(place.y * 4.0 - 2.0, 0.0, place.x * 4.0 - 2.0);
        let e = grey(shot.baked.irradiance[i]);
        let at = |k: i32| law(c + DVec3::new(f64::from(k / 9 - 4), 0.0, f64::from(k % 9 - 4)) * (side / 8.0));
        let (low, high) = (0..81).map(at).fold((f64::INFINITY, 0f64), |(l, h), v| (l.min(v), h.max(v)));
        assert!(e >= low * (1.0 - 1e-4) - 1e-6 && e <= high * (1.0 + 1e-4) + 1e-6, "{c}: {e} outside {low}..{high}");
        sum += e;
        let square = [c - DVec3::new(side, 0.0, side) / 2.0, DVec3::X * side, DVec3::Z * side];
        expected += exact::mean_over(square, 8, &law);
    }
    // Points of a texel are stratified: their mean is off by far less than the law's range in it.
    assert!((sum / expected - 1.0).abs() < 1e-3, "mean {sum} instead of {expected}");
}

/// Patches near the lamp are bright enough to be sampled as sources themselves, which is their light's first bounce.
#[test]
fn no_bounce_is_direct_light_alone() {
    let bake = |reuse, receivers| {
        let mut stage = Stage::new();
        let (white, lamp) = (stage.material(0.8, 0.0), LightKind::Point { radius: 0.0 });
        unit_room().all(&mut stage, white, 24);
        stage.light(lamp, vec3(0.5, 0.95, 0.5), Vec3::ZERO, 1.0);
        let radiosity = radiosity::Options { bounces: Some(0), ..Default::default() };
        let transport = transport::Options { reuse, receivers, ..transport::Options::of(32) };
        shoot_with(stage, bake::Options { transport, radiosity, ..options(32) }).baked.irradiance
    };
    let [all, adaptive] = transport::Receivers::ALL;
    let alone = bake(false, all);
    assert!(alone == bake(true, all) && alone == bake(false, adaptive) && alone == bake(true, adaptive));
}

#[test]
fn point_light_falls_with_the_square() {
    let light = vec3(0.3, 1.0, -0.2);
    let (shot, chart) = floor(64, LightKind::Point { radius: 0.0 }, light, Vec3::ZERO, f32::INFINITY);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        10.0 * v.y / v.length().powi(3)
    });
}

#[test]
fn range_ends_a_light() {
    let light = vec3(0.3, 1.0, -0.2);
    let (shot, chart) = floor(64, LightKind::Point { radius: 0.0 }, light, Vec3::ZERO, 1.5);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        let d = v.length();
        10.0 * v.y / d.powi(3) * (1.0 - (d / 1.5).powi(4)).clamp(0.0, 1.0)
    });
}

#[test]
fn spot_has_the_cone_of_the_extension() {
    let (cos_inner, cos_outer) = (libm::cos(0.3), libm::cos(0.7));
    let kind = LightKind::Spot { cos_inner: cos_inner as f32, cos_outer: cos_outer as f32, radius: 0.0 };
    let (light, axis) = (vec3(0.3, 1.5, -0.2), vec3(0.3, -1.0, 0.1).normalize());
    let (shot, chart) = floor(64, kind, light, axis, f32::INFINITY);
    follows(&shot, chart, |p| {
        let v = light.as_dvec3() - p;
        let d = v.length();
        let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
        let cone = (-v.dot(axis.as_dvec3()) / d * scale - cos_outer * scale).clamp(0.0, 1.0);
        10.0 * v.y / d.powi(3) * cone * cone
    });
}

#[test]
fn directional_light_is_lux_times_cosine() {
    let sun = vec3(0.5, -0.8, 0.2).normalize();
    let (shot, chart) = floor(16, LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, f32::INFINITY);
    let e = shot.values(chart);
    assert!(worst(e.iter().map(|e| grey(*e)), -10.0 * f64::from(sun.y)) < 1e-5);
}

/// A wall shadows whatever the signs of the zeros in the sun's direction.
#[test]
fn a_sun_along_an_axis_plane_casts_shadows() {
    for sun in [vec3(1.0, -1.0, 0.0), vec3(1.0, -1.0, -0.0), vec3(0.0, -1.0, 1.0), vec3(-0.0, -1.0, 1.0)] {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let bowl = Ball::bowl(0.5, uvec2(64, 16), 1).build(&mut stage, black);
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, 1.0);
        let shot = shoot(stage, 64);
        // All that enters the opening of pi m^2 lands on 2 pi m^2; facets and shadow edges: 2 %.
        let got = shot.mean(&[bowl]).1.x;
        assert!((got / (0.5 * libm::sqrt(0.5)) - 1.0).abs() < 0.02, "{sun}: {got}");
    }
}

#[test]
fn uniform_sky_over_a_plane_is_pi_l() {
    let mut stage = Stage::new();
    let white = stage.material(0.9, 0.0);
    let plane = rectangle(&mut stage, white, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(8));
    stage.scene.sky = Sky::Uniform(Vec3::splat(2.0));
    let shot = shoot(stage, 64);
    assert!(worst(shot.values(plane).iter().map(|e| grey(*e)), 2.0 * PI) < 1e-5);
}

/// A half plane 1 m above the floor under a sun in the zenith of 10 degrees across: the share of the disc beside the
/// edge. sin for tan and the cosine over the disc cost (sin 5 deg)^2; texels are a sixteenth of the disc's radius.
#[test]
fn penumbra_is_the_share_of_the_disc() {
    let (mut stage, rays, angle) = (Stage::new(), 1024, 10f64.to_radians());
    let black = stage.material(0.0, 0.0);
    let r = libm::sin(angle / 2.0);
    let n = 48u32;
    let half = 1.5 * r;
    let corner = vec3(-half as f32, 0.0, -0.1);
    let edges = [corner, Vec3::Z * 0.2, Vec3::X * (2.0 * half) as f32];
    let chart = rectangle(&mut stage, black, edges, uvec2(8, n));
    rectangle(&mut stage, black, [vec3(-9.0, 1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 9.0], UVec2::splat(4));
    stage.light(LightKind::Directional { angle: angle as f32 }, Vec3::ZERO, -Vec3::Y, 1.0);
    let shot = shoot(stage, rays);
    let share = |x: f64| {
        let u = (x / r).clamp(-1.0, 1.0);
        0.5 + (u * libm::sqrt(1.0 - u * u) + libm::asin(u)) / PI
    };
    let side = 2.0 * half / f64::from(n);
    let errors: Vec<f64> = shot
        .placed(chart)
        .into_iter()
        .map(|(i, place)| {
            let x = (place.y - 0.5) * 2.0 * half;
            let expected = (share(x - side / 4.0) + share(x + side / 4.0)) / 2.0;
            let sigma = libm::sqrt(expected * (1.0 - expected) / f64::from(rays)) + r * r;
            (grey(shot.baked.irradiance[i]) - expected) / sigma
        })
        .collect();
    within_sigma(&errors).unwrap();
}

#[test]
fn furnaces_read_their_value_at_every_texel() {
    let ball = |smooth| Ball { smooth, ..Ball::whole(Vec3::ZERO, 1.0, uvec2(24, 12), true) };
    for (rho, m) in [(0.5, 1.0), (0.9, 0.25), (0.97, 1.0), (0.99, 1.0), (0.9999, 1.0)] {
        for which in 0..4 {
            let mut stage = Stage::new();
            let grey_wall = stage.material(rho, m);
            match which {
                0 => drop(unit_room().all(&mut stage, grey_wall, 12)),
                1 => drop(furnished(&mut stage, grey_wall, grey_wall, 12)),
                _ => drop(vec![ball(which == 3).build(&mut stage, grey_wall)]),
            }
            let expected = f64::from(m) / (1.0 - f64::from(rho));
            let baked = unwrapped(stage, 128, 32);
            let off = worst(baked.irradiance.iter().map(|e| grey(*e)), expected);
            // Reflectance and the weights of rows are single precision.
            let rounding = f64::from(f32::EPSILON) / (1.0 - f64::from(rho));
            assert!(off < radiosity::TOLERANCE + rounding, "scene {which}, rho {rho}: off by {off}");
            assert_eq!((baked.report.rays.lost, baked.report.rays.escaped), (0, 0), "scene {which}");
            assert!(
                baked.report.solver.converged,
                "scene {which}, rho {rho}: {:?}",
                baked.report.solver.relative_bound
            );
        }
    }
}

#[test]
fn bounces_of_a_furnace_are_the_geometric_sum() {
    let (rho, m) = (0.75f32, 2.0);
    for bounces in [0, 1, 2, 7] {
        let mut stage = Stage::new();
        let wall = stage.material(rho, m);
        furnished(&mut stage, wall, wall, 8);
        let radiosity = radiosity::Options { bounces: Some(bounces), ..radiosity::Options::default() };
        let baked = shoot_with(stage, bake::Options { radiosity, ..options(64) }).baked;
        let rho = grey(baked.patches.reflectance[0]);
        let sum: f64 = (0..=bounces).map(|k| libm::pow(rho, k.into())).sum();
        let off = worst(baked.irradiance.iter().map(|e| grey(*e)), f64::from(m) * sum);
        assert!(off < 2e-6, "{bounces} bounces: off by {off}");
        let report = &baked.report;
        assert!(report.solver.bounces == Some(bounces) && report.solver.bound.is_none(), "{:?}", report.solver);
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    }
}

/// A lamp that sends its first hit to the direct map and a glowing block: contents at every number of bounces.
#[test]
fn contents_of_some_bounces_add_up() {
    let bake = |content, bounces, solver| {
        let mut stage = Stage::new();
        let (wall, block) = (stage.material(0.8, 0.0), stage.material(0.4, 1.0));
        let charts = furnished(&mut stage, wall, block, 8);
        stage.light(LightKind::Point { radius: 0.0 }, vec3(1.0, 0.9, 1.2), Vec3::ZERO, 3.0);
        let radiosity = radiosity::Options { solver, bounces };
        let shot = shoot_with(stage, bake::Options { content, radiosity, ..options(64) });
        charts.iter().flat_map(|c| shot.mapped(*c)).map(|e| e.as_dvec3()).collect::<Vec<_>>()
    };
    let (default, other) = (Solver::default(), Solver::Jacobi);
    let mut before = vec![DVec3::ZERO; bake(Content::Direct, None, default).len()];
    for bounces in [Some(0), Some(1), Some(3), None] {
        let [full, direct, indirect] =
            [Content::Full, Content::Direct, Content::Indirect].map(|c| bake(c, bounces, default));
        assert!(direct == bake(Content::Direct, None, default), "the first hit has no bounce");
        for (full, (direct, indirect)) in full.iter().zip(direct.iter().zip(&indirect)) {
            assert!((*full - (*direct + *indirect)).abs().max_element() <= 1e-6 * full.max_element());
        }
        let grows = full.iter().zip(&before).all(|(now, before)| now.cmpge(*before * (1.0 - 1e-3)).all());
        assert!(grows, "{bounces:?}: more bounces, more light");
        assert!(full.iter().sum::<DVec3>().x > 1.01 * before.iter().sum::<DVec3>().x, "{bounces:?}");
        if bounces.is_some() {
            assert!(full == bake(Content::Full, bounces, other), "{bounces:?}: a sum is a sum");
        }
        before = full;
    }
}

/// A room of one open side under a sky, with a spot on its floor many times brighter than the rest.
fn room_with_a_bright_spot(rho: f32, texels: u32) -> Stage {
    let mut stage = Stage::new();
    let wall = stage.material(rho, 0.0);
    for face in FACES.into_iter().filter(|f| *f != Face::Front) {
        unit_room().face(&mut stage, face, wall, UVec2::ONE, UVec2::splat(texels));
    }
    let cone = LightKind::Spot { cos_inner: 0.98, cos_outer: 0.97, radius: 0.0 };
    stage.light(cone, vec3(0.4, 0.9, 0.6), Vec3::NEG_Y, 1.0);
    stage.scene.sky = Sky::Uniform(Vec3::splat(0.01));
    stage
}

/// What a bake finds on its way.
struct Rooms {
    coverage: Coverage,
    patches: Patches,
    transport: Transport,
    direct: Direct,
    sky: Vec<Vec3>,
    gathered: bool,
}

impl Rooms {
    fn new(mut stage: Stage, rays: u32) -> Self {
        let (edge, _) = stage.lay_out();
        let layout = atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), page_size: 8192 };
        let scene = &stage.scene;
        let atlas = atlas::unwrap(scene, &layout, &scene.file, &Silent, &mut Vec::new()).expect("a layout");
        let world = World::new(scene);
        let coverage = Coverage::new(&world, &atlas);
        let tracer = Tracer::new(world);
        let mut patches = Patches::new(&tracer.world, &coverage, 0.98);
        let transport =
            Transport::measure(&tracer, &coverage, &mut patches, &transport::Options::of(rays), &Silent).expect("rows");
        let sources = Sources::new(&tracer, &patches);
        let direct = Direct::measure(&tracer, &coverage, &patches, &sources, rays, &Silent).expect("direct light");
        Rooms { sky: sky_cells(&scene.sky), gathered: sources.gathered, coverage, patches, transport, direct }
    }

    /// Indirect light of every patch, with this direct light.
    fn indirect(&self, direct: &Direct, bounces: Option<u32>) -> Vec<f64> {
        let options = radiosity::Options { bounces, ..radiosity::Options::default() };
        let (sky, gathered) = (&self.sky, self.gathered);
        let found = Radiosity::solve(&self.transport, &self.patches, direct, sky, gathered, &options, &Silent);
        found.expect("a solution").indirect.iter().map(|e| grey(*e)).collect()
    }

    /// The same light, of which rows carry all that is reflected.
    fn rows_alone(&self) -> Direct {
        Direct { bounce: Bounce::default(), ..self.direct.clone() }
    }
}

/// Light of the first bounce by samples and rows, against rows alone: the same but for the rows' own noise.
#[test]
fn what_bright_patches_reflect_is_counted_once() {
    let (rho, rays) = (0.7, 1024);
    let rooms = Rooms::new(room_with_a_bright_spot(rho, 16), rays);
    let (both, rows_alone) = (&rooms.direct, rooms.rows_alone());

    // Variance of each patch's light from what is sampled, had independent rays found it.
    let sampled = |c: &u32| both.bounce.exitance.get(*c as usize).map_or(0.0, |m| grey(*m));
    let variance = |i: usize| {
        let (columns, n) = (rooms.transport.rows.row(i).columns, f64::from(rays));
        let [sum, squares] = [1, 2].map(|k| columns.iter().map(|c| sampled(c).powi(k)).sum::<f64>());
        (squares - sum * sum / n) / (n * n)
    };
    let n = rooms.patches.len();
    let variance: f64 = (0..n).map(variance).sum();
    let first: f64 = both.bounce.irradiance.iter().map(|e| grey(*e)).sum();
    assert!(first > 50.0 * libm::sqrt(variance), "noise {} hides {first}", libm::sqrt(variance));

    for bounces in [Some(0), Some(1), Some(2), Some(5), None] {
        let [got, expected] = [both, &rows_alone].map(|d| rooms.indirect(d, bounces));
        let (mut sum, mut squares) = (0.0, 0.0);
        for d in got.iter().zip(&expected).map(|(g, e)| g - e) {
            (sum, squares) = (sum + d, squares + d * d);
        }
        // The noise of the first bounce, and what becomes of it later.
        let later: f64 = (0..bounces.unwrap_or(100)).map(|k| libm::pow(rho.into(), k.into())).sum();
        let sigma = libm::sqrt(variance) * later;
        assert!(sum.abs() <= 3.0 * sigma, "{bounces:?} bounces: off by {sum}, sigma {sigma}");
        assert!(squares <= sigma * sigma, "{bounces:?} bounces: RMS {}, sigma {sigma}", libm::sqrt(squares));
    }
}

/// A pane in the sun that most light passes through, and a black wall beside it.
#[test]
fn what_a_bright_pane_reflects_is_counted_once() {
    for (base, transmission) in [(0.5, 0.0), (0.9, 0.9)] {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let base_color = Vec3::splat(base).extend(1.0);
        let pane = stage.add(Material { base_color, transmission, ..Material::default() });
        rectangle(&mut stage, pane, [vec3(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0], UVec2::splat(16));
        let wall = [vec3(-2.0, 0.05, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0];
        let wall = rectangle(&mut stage, black, wall, uvec2(32, 16));
        rectangle(&mut stage, black, [vec3(-9.0, -2.0, 9.0), Vec3::X * 18.0, Vec3::NEG_Z * 18.0], UVec2::splat(16));
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 10.0);
        let texels = stage.sizes[wall].element_product() as usize;
        let first = stage.sizes[0].element_product() as usize;
        let rooms = Rooms::new(stage, 1024);
        assert!(rooms.direct.bounce.irradiance.iter().any(|e| *e != Vec3::ZERO), "the pane is no bright patch");
        let mean = |direct: &Direct| {
            let found = rooms.indirect(direct, Some(1));
            found[first..first + texels].iter().sum::<f64>() / texels as f64
        };
        let (got, expected) = (mean(&rooms.direct), mean(&rooms.rows_alone()));
        assert!((got / expected - 1.0).abs() < 0.02, "transmission {transmission}: {got} instead of {expected}");
    }
}

/// A black strip that a small lit wall shines on. A lit floor in the strip's own plane sends it nothing, and must not
/// make it noisier.
#[test]
fn what_lies_in_a_texels_plane_takes_no_samples() {
    let noise = |rho: f32| {
        let mut stage = Stage::new();
        let (black, white) = (stage.material(0.0, 0.0), stage.material(0.9, 0.0));
        let floor = stage.material(rho, 0.0);
        let flat = |o: Vec3, x: f32, z: f32| [o, Vec3::X * x, Vec3::NEG_Z * z];
        let strip = rectangle(&mut stage, black, flat(Vec3::ZERO, 2.0, 0.5), uvec2(40, 10));
        rectangle(&mut stage, floor, flat(vec3(0.0, 0.0, 0.5), 2.0, 0.5), uvec2(40, 10));
        rectangle(&mut stage, floor, flat(vec3(0.0, 0.0, -0.5), 2.0, 0.25), uvec2(40, 5));
        let wall = [vec3(0.5, 0.5, -2.0), Vec3::X, Vec3::Y];
        rectangle(&mut stage, white, wall, UVec2::splat(20));
        // Much black ground keeps the mean low: all of the lit wall stands out of it.
        rectangle(&mut stage, black, flat(vec3(-50.0, -1.0, 50.0), 100.0, 100.0), UVec2::splat(16));
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, vec3(0.0, -1.0, -1.0), 10.0);
        let (corner, size) = (stage.lay_out().1[strip], stage.sizes[strip]);
        let rooms = Rooms::new(stage, 256);
        let at = |x: u32, y: u32| (y * size.x + x) as usize;
        let mut light = vec![0.0; size.element_product() as usize];
        for (texel, e) in rooms.coverage.texels.iter().zip(&rooms.direct.bounce.irradiance) {
            let p = texel.at.wrapping_sub(corner);
            if p.cmplt(size).all() {
                light[at(p.x, p.y)] = grey(*e);
            }
        }
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        assert!(mean > 0.0, "the wall does not shine on the strip");
        let difference = |x, y| light[at(x - 1, y)] - 2.0 * light[at(x, y)] + light[at(x + 1, y)];
        let squares: f64 =
            (0..10).flat_map(|y| (1..39).map(move |x| (x, y))).map(|(x, y)| difference(x, y).powi(2)).sum();
        libm::sqrt(squares / (6.0 * 380.0)) / mean
    };
    let (alone, beside) = (noise(0.0), noise(0.9));
    // The floor raises the mean, and so the part of the wall's light that is left to rows.
    assert!(beside < 2.0 * alone, "noise {beside} beside a lit floor, {alone} beside a black one");
}

/// Passes over the few blocks of a long table would only repeat its points.
#[test]
fn the_most_rays_are_traced_once() {
    let mut stage = Stage::new();
    let black = stage.material(0.0, 0.0);
    rectangle(&mut stage, black, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(4));
    rectangle(&mut stage, black, [vec3(0.3, 0.5, 0.3), Vec3::Z, Vec3::X], UVec2::splat(4));
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 1.0);
    let rays = 32768;
    let report = shoot(stage, rays).baked.report;
    // Only the lower square has a shadow on it: probes, what is mixed, edges.
    let most = 32 * 64 + 16 * (u64::from(rays) + 65536);
    assert!(report.rays.shadow <= most, "{} shadow rays, at most {most}", report.rays.shadow);
}

#[test]
fn power_of_a_bright_spot_is_kept() {
    let energy = shoot(room_with_a_bright_spot(0.7, 16), 1024).baked.report.energy;
    assert!(energy.emitted > 0.0 && energy.imbalance.abs() < 3e-3, "{energy:?}");
}

#[test]
fn power_put_in_is_power_absorbed() {
    let mut stage = Stage::new();
    let (wall, block) = (stage.material(0.8, 0.0), stage.material(0.3, 2.0));
    furnished(&mut stage, wall, block, 16);
    let shot = shoot(stage, 256);
    let [absorbed, emitted] = shot.power();
    // 2176 rows of 256 rays, each off by some 5 % of its value: 5 % / sqrt(2176) = .1 %.
    assert!((absorbed / emitted - 1.0).abs() < 3e-3, "{absorbed} of {emitted}");
    let energy = &shot.baked.report.energy;
    assert!((energy.emitted / (3.0 * emitted) - 1.0).abs() < 1e-4);
    assert!(energy.imbalance.abs() < 3e-3, "{}", energy.imbalance);
}

#[test]
fn walls_bleed_their_colour() {
    let mut stage = Stage::new();
    let mut paint = |r, g, b| stage.rgb(vec3(r, g, b), Vec3::ZERO, false);
    let (white, red, green) = (paint(0.8, 0.8, 0.8), paint(0.8, 0.05, 0.05), paint(0.05, 0.8, 0.05));
    let lamp = stage.material(0.0, 5.0);
    let room = unit_room();
    let charts = FACES.map(|f| {
        let material = match f {
            Face::Left => red,
            Face::Right => green,
            Face::Top => lamp,
            _ => white,
        };
        room.face(&mut stage, f, material, UVec2::ONE, UVec2::splat(16))
    });
    let shot = shoot(stage, 256);
    let floor = shot.rows(charts[2]);
    let side = |columns: std::ops::Range<usize>| {
        let texels = floor.iter().flat_map(|row| row[columns.clone()].iter().flatten());
        texels.map(|i| shot.baked.irradiance[*i]).sum::<Vec3>()
    };
    let (near_red, near_green) = (side(0..4), side(12..16));
    assert!(near_red.x > 1.05 * near_red.y && near_green.y > 1.05 * near_green.x, "{near_red} {near_green}");
    // The room is symmetric but for the colours.
    assert!((near_red.x / near_green.y - 1.0).abs() < 0.02);
    let (blue, _) = spread(&shot.values(charts[2]).iter().map(|e| f64::from(e.z)).collect::<Vec<_>>());
    assert!(blue > 0.0);
}

#[test]
fn reflectance_is_capped_with_a_warning() {
    let mut stage = Stage::new();
    let white = stage.material(1.0, 1.0);
    unit_room().all(&mut stage, white, 8);
    let shot = shoot_with(stage, bake::Options { transport: transport::Options::of(32), ..bake::Options::default() });
    assert!(worst(shot.baked.irradiance.iter().map(|e| grey(*e)), 1.0 / (1.0 - 0.98)) < 2e-3);
    assert!(shot.baked.report.warnings.iter().any(|w| w.contains("capped")), "{:?}", shot.baked.report.warnings);
    assert!((shot.baked.report.reflectance.capped_area - 6.0).abs() < 1e-4);
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut stage = Stage::new();
    let (wall, block) = (stage.material(0.7, 0.0), stage.material(0.4, 1.0));
    furnished(&mut stage, wall, block, 16);
    Cuboid::block(Vec3::splat(0.8), Vec3::splat(0.9)).all(&mut stage, block, 4);
    stage.light(LightKind::Point { radius: 0.05 }, vec3(1.0, 0.5, 1.2), Vec3::ZERO, 3.0);
    stage.lay_out();
    let mut options = options(64);
    options.atlas.density = Density::Resolution(128);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let baked = pool.install(|| parts(&stage.scene, &options));
        let bits = |v: &[Vec3]| v.iter().flat_map(|e| e.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        (bits(&baked.irradiance), baked.lightmaps.pages.iter().map(|m| bits(&m.irradiance)).collect::<Vec<_>>())
    };
    let once = run(1);
    assert!(once == run(2) && once == run(3) && once == run(1));
}
