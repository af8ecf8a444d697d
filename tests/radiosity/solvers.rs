//! The solvers beside each other: the same answer, what it costs, and what each refuses.

use super::{Parts, common::rooms, given, parts};
use glam::{DVec3, Vec3};
use luxel::{
    atlas::{self, Atlas, Coverage, Density, Unwrap},
    direct::{Direct, Sources, sky_cells},
    gltf,
    patches::Patches,
    progress::Silent,
    radiosity::{Options, Radiosity, Solver, System, TOLERANCE},
    scene::{Scene, World},
    trace::Tracer,
    transport::{self, Interpolation, Transport},
};
use proptest::prelude::*;
use std::path::Path;

/// The measured rows of a small room, to be painted.
fn measured(seed: u32, rays: u32) -> Parts {
    let mut stage = rooms::seeded(seed);
    let (edge, _) = stage.lay_out();
    rows_of(&stage.scene, Unwrap::Keep, edge, rays)
}

fn rows_of(scene: &Scene, unwrap: Unwrap, edge: u32, rays: u32) -> Parts {
    let options = atlas::Options { unwrap, density: Density::Resolution(edge), page_size: 8192 };
    let atlas: Atlas = atlas::unwrap(scene, &options, Path::new("room"), &Silent, &mut Vec::new()).expect("an atlas");
    let world = World::new(scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let mut patches = Patches::new(&tracer.world, &coverage, 0.98);
    let options = transport::Options { reuse: false, ..transport::Options::of(rays) };
    let transport = Transport::measure(&tracer, &coverage, &mut patches, &options, &Silent).expect("rows");
    let sources = Sources::new(&tracer, &patches);
    let direct = Direct::measure(&tracer, &coverage, &patches, &sources, 8, &Silent).expect("direct light");
    Parts { transport, patches, direct, sky: sky_cells(&scene.sky) }
}

/// A room without a window, which would let light out before it has bounced a hundred times.
fn closed(rays: u32) -> Parts {
    let is_dark = |parts: &Parts| parts.sky.iter().all(|cell| *cell == Vec3::ZERO);
    (0..).map(|seed| measured(seed, rays)).find(is_dark).expect("a closed room")
}

fn solve(system: &System, solver: Solver, tolerance: f64) -> Radiosity {
    system.solve(solver, tolerance, &Silent).expect("nobody interrupts")
}

/// Every solver that takes the parts against the dense solution, relative to the mean of the darker half.
fn agree(parts: &Parts, what: &str) {
    let system = parts.system();
    let (mut truth, mut found) = (Vec::new(), Vec::new());
    let dense =
        system.watched(Solver::Direct, 1e-9, &Silent, &mut |_, x| truth = x.to_vec()).expect("a dense solution");
    assert!(dense.report.converged && dense.report.fallback.is_none(), "{what}: {:?}", dense.report);
    let dark = system.dark_mean(&truth).max(1e-30);
    for solver in parts.solvers() {
        let report = system.watched(solver, 1e-6, &Silent, &mut |_, x| found = x.to_vec()).expect("a solution").report;
        let off = truth.iter().zip(&found).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f64::max);
        assert!(report.converged, "{what}, {solver:?}: {:?}", report.relative_bound);
        assert!(off <= 1e-5 * dark, "{what}, {solver:?}: off by {}", off / dark);
        // Rounding is in the truth, too.
        assert!(off <= report.bound.expect("a bound") + 1e-12 * dark, "{what}, {solver:?}: {off} is beyond the bound");
    }
}

proptest! {
    #[test]
    fn solvers_agree_with_dense_direct(given in given()) {
        agree(&parts(given), "random rows");
    }
}

#[test]
fn solvers_agree_with_dense_direct_on_rooms() {
    for seed in 0..6 {
        for rays in [1, 4, 64] {
            agree(&measured(seed, rays), &format!("room {seed}, {rays} rays"));
        }
    }
}

/// Paints everything, and one texel.
fn paint(parts: &mut Parts, rho: f32, one: f32) {
    parts.patches.reflectance.fill(Vec3::splat(rho));
    let middle = parts.patches.area.len() / 2;
    parts.patches.reflectance[middle] = Vec3::splat(one);
}

/// Entries touched by each, in all that there are, until every texel is within 1e-3 of the mean of the darker half.
fn passes<const N: usize>(system: &System, solvers: [Solver; N]) -> [f64; N] {
    let mut truth = Vec::new();
    let dense = Solver::Direct.check(system.unknowns(), true).is_ok();
    let reference = if dense { Solver::Direct } else { Solver::default() };
    system.watched(reference, 1e-9, &Silent, &mut |_, x| truth = x.to_vec()).expect("a solution");
    solvers.map(|solver| passes_of(system, solver, &truth))
}

fn passes_of(system: &System, solver: Solver, truth: &[DVec3]) -> f64 {
    let (dark, mut reached) = (system.dark_mean(truth), None);
    let mut watch = |touched: u64, x: &[DVec3]| {
        let off = truth.iter().zip(x).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f64::max);
        reached = reached.or((off <= 1e-3 * dark).then_some(touched));
    };
    system.watched(solver, TOLERANCE, &Silent, &mut watch).expect("a solution");
    reached.expect("a tolerance is reached") as f64 / system.entries() as f64
}

#[test]
fn the_default_touches_an_eighth_of_what_jacobi_touches() {
    for rays in [4, 16, 64] {
        let mut parts = closed(rays);
        for (rho, one, share) in [(0.5, 0.5, 1.0), (0.9, 0.9, 0.5), (0.99, 0.99, 0.125), (0.5, 0.99, 1.0)] {
            paint(&mut parts, rho, one);
            let [own, jacobi] = passes(&parts.system(), [Solver::default(), Solver::Jacobi]);
            println!("{rays} rays, {rho} and {one}: {own:.1} passes against {jacobi:.1}");
            assert!(own <= share * jacobi, "{rays} rays, {rho} and {one}: {own} passes against {jacobi}");
        }
    }
}

/// Of many spaces that are nearly sealed each fades at its own pace.
#[test]
fn the_default_touches_an_eighth_among_nearly_sealed_spaces() {
    for (file, unwrap, edge) in [
        ("assets/room.glb", Unwrap::default(), 256),
        ("tests/data/furnished.glb", Unwrap::Keep, 128),
        ("tests/data/window.glb", Unwrap::Keep, 96),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let scene = gltf::read(&path, &gltf::ReadOptions::default()).expect("a scene").scene;
        let mut parts = rows_of(&scene, unwrap, edge, 64);
        paint(&mut parts, 0.99, 0.99);
        let [own, jacobi] = passes(&parts.system(), [Solver::default(), Solver::Jacobi]);
        println!("{file}: {own:.1} passes against {jacobi:.1}");
        assert!(own <= 0.125 * jacobi, "{file}: {own} passes against {jacobi}");
    }
}

/// A black receiver has nothing to send on, but its light counts.
#[test]
fn shooting_needs_nobody_where_receivers_are_black() {
    let mut parts = closed(64);
    paint(&mut parts, 0.9, 0.0);
    let report = solve(&parts.system(), Solver::Shooting, TOLERANCE).report;
    assert!(report.converged && report.fallback.is_none(), "{report:?}");
}

/// `asymmetric_matrix_cg` of the failure scenes: a right-angled prism by crossed strings, one row off by a twentieth, with
/// a black face and without.
#[test]
fn conjugate_gradients_live_with_asymmetric_rows() {
    let row = |[a, b, c]: [usize; 3]| [vec![0; a], vec![1; b], vec![2; c]].concat();
    for rho in [[0.2f32, 0.5, 0.8], [0.0, 0.5, 0.8], [0.0; 3]] {
        // Widths 3, 4, 5: a third and two thirds, now .35 and .65; a quarter and three; two fifths and three.
        let mut prism = Parts::new([[0, 7, 13], [5, 0, 15], [8, 12, 0]].map(row).to_vec());
        prism.patches.area = vec![3.0, 4.0, 5.0];
        prism.patches.reflectance = rho.map(Vec3::splat).to_vec();
        prism.patches.exitance[0] = Vec3::ONE;
        let solved = solve(&prism.system(), Solver::ConjugateGradient, 1e-7);
        let report = &solved.report;
        assert!(report.converged && report.fallback.is_none(), "{rho:?}: {report:?}");
        for (got, expected) in solved.indirect.iter().zip(prism.dense(0).solution()) {
            assert!((f64::from(got.x) - expected).abs() <= 1e-6 * expected, "{rho:?}: {got} instead of {expected}");
        }
    }
}

/// Rows of sixteen rays are symmetric enough once they are scaled, whatever the reflectance.
#[test]
fn conjugate_gradients_live_with_rows_of_rays() {
    for rays in [16, 64] {
        let mut parts = closed(rays);
        for (rho, one) in [(0.5, 0.5), (0.9, 0.9), (0.99, 0.99), (0.5, 0.99)] {
            paint(&mut parts, rho, one);
            let report = solve(&parts.system(), Solver::ConjugateGradient, TOLERANCE).report;
            assert!(report.converged && report.fallback.is_none(), "{rays} rays, {rho} and {one}: {report:?}");
        }
    }
}

/// Rows that have nothing symmetric: the bound is still that of the true system, and the report names who came to it.
#[test]
fn conjugate_gradients_tell_where_rows_are_too_noisy() {
    let mut ring = Parts::new((0..64).map(|i| vec![(i + 1) % 64]).collect());
    ring.patches.reflectance.fill(Vec3::splat(0.9));
    ring.direct.lights[0] = Vec3::ONE;
    let report = solve(&ring.system(), Solver::ConjugateGradient, TOLERANCE).report;
    assert!(report.converged && report.fallback == Some(Solver::default().name()), "{report:?}");
}

#[test]
fn what_a_solver_cannot_do_is_wrong_usage() {
    let refused = |parts: &Parts, solver| {
        let options = Options { solver, bounces: None };
        let Parts { transport, patches, direct, sky } = parts;
        let error = Radiosity::solve(transport, patches, direct, sky, true, &options, &Silent).err()?;
        assert_eq!(error.exit_code(), 2, "{error}");
        // The sum of the first bounces needs no solver.
        let some = Options { bounces: Some(1), ..options };
        assert!(Radiosity::solve(transport, patches, direct, sky, true, &some, &Silent).is_ok());
        Some(error.to_string())
    };
    let all = |parts: &Parts| -> Vec<(Solver, String)> {
        Solver::ALL.into_iter().filter_map(|s| Some((s, refused(parts, s)?))).collect()
    };
    let ring = |n: u32| Parts::new((0..n).map(|i| vec![(i + 1) % n]).collect());
    assert_eq!(all(&ring(8)), Vec::new());
    // Interpolated receivers.
    let mut convex = ring(8);
    let entries = (0..8).flat_map(|i| [(i, 0.5), ((i + 1) % 8, 0.5)]).collect();
    convex.transport.interpolation = Interpolation::Convex { starts: (0..9).map(|i| 2 * i).collect(), entries };
    let told = all(&convex);
    assert!(matches!(&told[..], [(Solver::ConjugateGradient, e)] if e.contains("symmetric")), "{told:?}");
    // Many unknowns.
    let told = all(&ring(4097));
    assert!(matches!(&told[..], [(Solver::Direct, e)] if e.contains("4097") && e.contains("4096")), "{told:?}");
}

#[test]
fn results_do_not_depend_on_threads() {
    let parts = measured(3, 16);
    for solver in Solver::ALL {
        let [one, many] = [1, 5].map(|n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
            let solved = pool.install(|| solve(&parts.system(), solver, 1e-7));
            (solved.indirect, solved.gathered, solved.report.residuals, solved.report.entries)
        });
        assert!(one == many, "{solver:?}");
    }
}

/// The history is that of the entries touched: it grows, ends with all, and tells every look.
#[test]
fn reports_count_entries() {
    let parts = measured(1, 4);
    for solver in Solver::ALL {
        let report = solve(&parts.system(), solver, TOLERANCE).report;
        assert_eq!((report.residuals.len(), report.touched.len()), (report.iterations, report.iterations));
        // A look, and what a step takes.
        let (least, most) = match solver {
            Solver::Anderson | Solver::Chebyshev | Solver::Jacobi => (1, 1),
            Solver::GaussSeidel => (5, 5),
            Solver::Shooting => (2, 7),
            Solver::ConjugateGradient => (2, 50),
            Solver::Direct => (100, u64::MAX),
        };
        let matrix = parts.system().entries();
        let passes = |w: &[u64]| (w[1] - w[0]) / matrix;
        assert!(report.fallback.is_none() && report.iterations > 1, "{solver:?}: {report:?}");
        assert!(report.touched.windows(2).map(passes).all(|p| (least..=most).contains(&p)), "{solver:?}: {report:?}");
        assert_eq!(report.touched.last(), Some(&report.entries), "{solver:?}");
    }
}
