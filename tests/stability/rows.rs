//! Rows of every estimator: no sum is above 1; what was scaled is told, what is wrong is refused.

use crate::common::{
    bakes::{Parts, grey, options, parts, shoot_with, try_shoot},
    scenes::{FACES, Face, furnished, rectangle, unit_room},
    stage::Stage,
    ways::{Runs, Way},
};
use glam::{UVec2, Vec3, vec3};
use luxel::{
    atlas::{Coverage, Density, Unwrap},
    bake,
    direct::{Direct, Sources, sky_cells},
    patches::Patches,
    progress::Silent,
    radiosity::{Radiosity, Solver},
    scene::{LightKind, Scene, Sky, World},
    trace::Tracer,
    transport::{Checked, FormFactors, Options, Receivers, Stats, Transport},
};

/// A cube, a room with blocks in it, and two walls under the sky; true if closed.
fn scenes() -> [(Stage, bool); 3] {
    let build = |sky: Sky, build: &dyn Fn(&mut Stage, u32)| {
        let mut stage = Stage::new();
        let m = stage.material(0.8, 1.0);
        build(&mut stage, m);
        let closed = matches!(sky, Sky::Black);
        stage.scene.sky = sky;
        (stage, closed)
    };
    [
        build(Sky::Black, &|stage, m| drop(unit_room().all(stage, m, 6))),
        build(Sky::Black, &|stage, m| drop(furnished(stage, m, m, 8))),
        build(Sky::Uniform(Vec3::ONE), &|stage, m| {
            rectangle(stage, m, [Vec3::ZERO, Vec3::X, Vec3::Y], UVec2::splat(8));
            rectangle(stage, m, [Vec3::ZERO, Vec3::Y, Vec3::Z], UVec2::splat(8));
        }),
    ]
}

/// Bakes the stage's own charts.
fn baked(stage: &mut Stage, form_factors: FormFactors) -> Parts {
    let (edge, _) = stage.lay_out();
    let mut options = Way { form_factors, ..Way::default() }.of(options(64));
    (options.atlas.unwrap, options.atlas.density) = (Unwrap::Keep, Density::Resolution(edge));
    parts(&stage.scene, &options)
}

fn rows(scene: &Scene, parts: &Parts, form_factors: FormFactors) -> (Checked, Stats) {
    let tracer = Tracer::new(World::new(scene));
    let mut patches = Patches::new(&tracer.world, &parts.coverage, 0.98);
    let options = Options { form_factors, ..Options::of(64) };
    let transport = Transport::measure(&tracer, &parts.coverage, &mut patches, &options, &Silent).expect("rows");
    (transport.validate(&patches).expect("sound rows"), transport.stats)
}

#[test]
fn no_row_sums_to_more_than_one_and_what_was_scaled_is_told() {
    for form_factors in FormFactors::ALL {
        for (k, (mut stage, closed)) in scenes().into_iter().enumerate() {
            let parts = baked(&mut stage, form_factors);
            let (Checked { sums, reciprocity }, stats) = rows(&stage.scene, &parts, form_factors);
            let told = parts.report.warnings.iter().any(|w| w.contains("were scaled"));
            println!("{form_factors}, scene {k}: sums {sums:?}, reciprocity {reciprocity:.3}, {stats:?}");
            assert!(sums[1] <= 1.0 + 1e-5 && (!closed || sums[0] >= 1.0 - 1e-5), "{form_factors}, {k}: {sums:?}");
            // Counts and delta form factors sum to 1 by themselves. Closed forms do so where nothing hides anything; where
            // blocks stand, visibility is sampled.
            let scaled = form_factors == FormFactors::Analytic && k == 1;
            assert_eq!((stats.rescaled > 0, told), (scaled, scaled), "{form_factors}, {k}: {stats:?}");
            assert!(!scaled || (1e-5..0.5).contains(&stats.excess), "{stats:?}");
        }
    }
}

#[test]
fn rows_above_one_are_refused() {
    let patches = Patches { area: vec![1.0; 2], validity: vec![1.0; 2], ..Patches::default() };
    let transport = |weight: f32| Transport::from_rows(2, [(vec![1, 1], 0.5), (vec![0], weight)]);
    assert!(transport(1.0).validate(&patches).is_ok());
    let refused = transport(1.31).validate(&patches).expect_err("a row above 1");
    assert!(refused.contains("row 1 sums to 1.3"), "{refused}");
}

/// What the suites solve by hand is what a bake solves.
#[test]
fn rows_that_serve_all_solvers_are_those_of_a_bake() {
    for way in FormFactors::ALL.map(|form_factors| Way { form_factors, solver: Solver::Jacobi }) {
        let build = || {
            let mut stage = Stage::new();
            let (wall, lamp) = (stage.material(0.5, 0.0), stage.material(0.5, 1.0));
            furnished(&mut stage, wall, lamp, 8);
            stage
        };
        let mut runs = Runs::new(way.form_factors);
        let [once, again] = [0, 1].map(|_| runs.by(way.solver).shoot(build(), options(16)).expect("it is solved"));
        let bake = try_shoot(build(), way.of(options(16))).expect("it bakes");
        assert!(grey(bake.baked.irradiance[0]) > 0.0);
        assert_eq!(bake.baked.irradiance, once.baked.irradiance, "{way:?}");
        assert_eq!(bake.baked.irradiance, again.baked.irradiance, "{way:?}");
        assert_eq!(bake.baked.lightmaps.pages[0].irradiance, again.baked.lightmaps.pages[0].irradiance, "{way:?}");
    }
}

/// Irradiance under the light of each scene, by the rows of the first: they differ in nothing else.
fn relit(scenes: &[Scene], coverage: &Coverage, options: &bake::Options) -> Vec<Vec<Vec3>> {
    let tracer = Tracer::new(World::new(&scenes[0]));
    let mut patches = Patches::new(&tracer.world, coverage, options.max_reflectance);
    let transport = Transport::measure(&tracer, coverage, &mut patches, &options.transport, &Silent).expect("rows");
    let light = |scene: &Scene| {
        let tracer = Tracer::new(World::new(scene));
        let sources = Sources::new(&tracer, &patches);
        let direct =
            Direct::measure(&tracer, coverage, &patches, &sources, options.shadow_rays, &Silent).expect("light");
        let (sky, how) = (sky_cells(&scene.sky), &options.radiosity);
        let solved = Radiosity::solve(&transport, &patches, &direct, &sky, sources.gathered, how, &Silent);
        let mut solved = solved.expect("a solution");
        if !transport.eyes.is_empty() {
            solved.reuse(&transport, &tracer, coverage, &patches, &direct, &Silent).expect("a gather");
        }
        (0..patches.len()).map(|p| direct.total(p) + solved.indirect[p]).collect()
    };
    scenes.iter().map(light).collect()
}

/// Rows that are kept relight a scene to the bit, without a ray of theirs: only texels that share with too few ask again.
#[test]
fn one_transport_serves_every_light() {
    let lit = |strength: f32| {
        let mut stage = Stage::new();
        let wall = stage.material(0.6, 0.0);
        for face in FACES.into_iter().filter(|f| *f != Face::Top) {
            unit_room().face(&mut stage, face, wall, UVec2::ONE, UVec2::splat(6));
        }
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.3 * strength, 0.5, 0.5), Vec3::ZERO, strength);
        stage.scene.sky = Sky::Uniform(vec3(0.0, 0.1, strength));
        (stage.lay_out().0, stage.scene)
    };
    let ((edge, one), (_, other)) = (lit(1.0), lit(2.0));
    let scenes = [one, other];
    for form_factors in [FormFactors::Rays, FormFactors::Hemicube { resolution: 16 }, FormFactors::Analytic] {
        for (receivers, reuse) in Receivers::ALL.into_iter().flat_map(|r| [(r, false), (r, true)]) {
            let mut options = options(16);
            options.transport = Options { form_factors, receivers, reuse, ..options.transport };
            (options.atlas.unwrap, options.atlas.density) = (Unwrap::Keep, Density::Resolution(edge));
            let baked = scenes.each_ref().map(|scene| parts(scene, &options));
            let relit = relit(&scenes, &baked[0].coverage, &options);
            assert!(relit[0] != relit[1]);
            for (relit, baked) in relit.iter().zip(&baked) {
                assert!(*relit == baked.irradiance, "{form_factors}, {receivers:?}, reuse {reuse}");
            }
        }
    }
}

/// Cards of 3 x 3 texels before a black wall, that see half of the sky, or high above it, where they see all. None has
/// neighbours enough to share with, so each has four times the rays; and again where these differ.
#[test]
fn texels_that_are_alone_have_more_rays() {
    let found = |reuse: bool, height: f32| {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let far = 1e4;
        rectangle(&mut stage, black, [vec3(0.0, far, far), Vec3::Y * (-2.0 * far), Vec3::Z * (-2.0 * far)], UVec2::ONE);
        for k in 0..40 {
            let corner = vec3(1.0 + (k % 8) as f32, height, (k / 8) as f32);
            rectangle(&mut stage, black, [corner, Vec3::Z * 0.05, Vec3::X * 0.05], UVec2::splat(3));
        }
        stage.scene.sky = Sky::Uniform(Vec3::splat(2.0 / std::f32::consts::PI));
        let transport = Options { reuse, ..Options::of(16) };
        let shot = shoot_with(stage, bake::Options { transport, ..options(16) });
        let squares = (1..=40).flat_map(|card| shot.values(card)).map(|e| (grey(e) - 1.0).powi(2)).sum::<f64>();
        (squares / 360.0, shot.baked.report.rays.traced)
    };
    let ((more, rays_of_more), (once, rays)) = (found(true, 0.0), found(false, 0.0));
    assert!(rays_of_more > 15 * rays && more < 0.06 * once, "{more} by {rays_of_more} rays, {once} by {rays}");
    let (rays_of_more, rays) = (found(true, 1e5).1, found(false, 1e5).1);
    assert_eq!(rays_of_more, 4 * rays);
}
