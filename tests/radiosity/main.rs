//! Small systems straight to the solvers, against dense algebra in double precision.

mod solvers;

#[path = "../common"]
mod common {
    #![allow(dead_code, reason = "rooms need a part of it")]
    pub mod rooms;
    pub mod scenes;
    pub mod stage;
}

use glam::{DVec3, Vec3, dvec3};
use luxel::{
    direct::{Bounce, Direct},
    math::CELLS,
    patches::Patches,
    progress::Silent,
    radiosity::{Radiosity, Solver, System, TOLERANCE},
    transport::{Interpolation, Transport},
};
use proptest::prelude::*;

/// Everything a [`System`] is made of.
struct Parts {
    transport: Transport,
    patches: Patches,
    direct: Direct,
    sky: Vec<Vec3>,
}

impl Parts {
    /// One row a patch, of these columns; black, dark, under a black sky.
    fn new(rows: Vec<Vec<u32>>) -> Self {
        let n = rows.len();
        let dark = vec![Vec3::ZERO; n];
        let weighed = |row: Vec<u32>| {
            let weight = 1.0 / row.len().max(1) as f32;
            (row, weight)
        };
        Parts {
            transport: Transport::from_rows(n, rows.into_iter().map(weighed)),
            patches: Patches {
                area: vec![1.0; n],
                validity: vec![1.0; n],
                reflectance: dark.clone(),
                exitance: dark.clone(),
                ..Patches::default()
            },
            direct: Direct {
                lights: dark.clone(),
                hidden_lights: dark.clone(),
                emitters: dark.clone(),
                sky_peaks: dark,
                ..Direct::default()
            },
            sky: vec![Vec3::ZERO; CELLS as usize],
        }
    }

    fn system(&self) -> System<'_> {
        self.transport.validate(&self.patches).expect("a sound transport");
        System::new(&self.transport, &self.patches, &self.direct, &self.sky, true)
    }

    /// The solvers that take it.
    fn solvers(&self) -> Vec<Solver> {
        let identity = matches!(self.transport.interpolation, Interpolation::Identity);
        Solver::ALL.into_iter().filter(|s| s.check(self.patches.area.len(), identity).is_ok()).collect()
    }

    fn truncated(&self, bounces: u32) -> Radiosity {
        self.system().truncated(bounces, &Silent).expect("nobody interrupts")
    }

    /// K = F rho P and the light F M, F (rho D - sampled) + what is sampled, of each channel, densely.
    fn dense(&self, channel: usize) -> Dense {
        let (n, receivers) = (self.patches.area.len(), self.transport.receivers.len());
        let mut spread = vec![vec![0.0; receivers]; n];
        match &self.transport.interpolation {
            Interpolation::Identity => (0..n).for_each(|i| spread[i][i] = 1.0),
            Interpolation::Convex { starts, entries } => {
                for (i, w) in starts.windows(2).enumerate() {
                    entries[w[0] as usize..w[1] as usize]
                        .iter()
                        .for_each(|e| spread[i][e.0 as usize] += f64::from(e.1));
                }
            }
        }
        let at = |v: &[Vec3], i: usize| f64::from(v[i][channel]);
        let mut dense = Dense { k: vec![vec![0.0; receivers]; receivers], ..Dense::default() };
        for r in 0..receivers {
            let row = self.transport.rows.row(r);
            let Bounce { exitance: sampled, irradiance: extra } = &self.direct.bounce;
            let (mut seen, mut lit) = (0.0, if extra.is_empty() { 0.0 } else { at(extra, r) });
            for &c in row.columns {
                let (c, weight) = (c as usize, f64::from(row.weight));
                if c >= n {
                    seen += weight * at(&self.sky, c - n);
                    continue;
                }
                let rho = at(&self.patches.reflectance, c);
                seen += weight * at(&self.patches.exitance, c);
                lit += weight * rho * f64::from(self.direct.total(c)[channel]);
                lit -= if sampled.is_empty() { 0.0 } else { weight * at(sampled, c) };
                dense.k[r].iter_mut().zip(&spread[c]).for_each(|(k, p)| *k += weight * rho * p);
            }
            dense.seen.push(seen);
            dense.lit.push(lit);
        }
        dense.spread = spread;
        dense
    }
}

#[derive(Default)]
struct Dense {
    k: Vec<Vec<f64>>,
    seen: Vec<f64>,
    lit: Vec<f64>,
    spread: Vec<Vec<f64>>,
}

fn times(matrix: &[Vec<f64>], v: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum()).collect()
}

impl Dense {
    /// P I_N, term by term: F M scattered up to N times, F rho D (a bounce already) up to N - 1 times.
    fn sum(&self, bounces: u32) -> Vec<f64> {
        let mut total = self.seen.clone();
        let (mut seen, mut lit) = (self.seen.clone(), self.lit.clone());
        for _ in 0..bounces {
            seen = times(&self.k, &seen);
            (0..total.len()).for_each(|i| total[i] += seen[i] + lit[i]);
            lit = times(&self.k, &lit);
        }
        times(&self.spread, &total)
    }

    /// P I of all bounces, by elimination.
    fn solution(&self) -> Vec<f64> {
        let n = self.k.len();
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let row = |i: usize| (0..n).map(|j| unit(i, j) - self.k[i][j]).chain([self.seen[i] + self.lit[i]]).collect();
        let mut a: Vec<Vec<f64>> = (0..n).map(row).collect();
        for p in 0..n {
            // Diagonally dominant: no pivots.
            let pivot = a[p].clone();
            for (_, row) in a.iter_mut().enumerate().filter(|(i, _)| *i != p) {
                let factor = row[p] / pivot[p];
                row.iter_mut().zip(&pivot).for_each(|(a, b)| *a -= factor * b);
            }
        }
        times(&self.spread, &(0..n).map(|i| a[i][n] / a[i][i]).collect::<Vec<_>>())
    }
}

/// What a patch's row meets, its colours (reflectance, exitance, direct light, the share of its reflection that is
/// sampled), and another receiver with its weight.
type Given = (Vec<u32>, [[f32; 3]; 4], (u32, f32));

/// Coloured systems with lights, emitters and a sky, from a single ray a row; patches may read two receivers, and
/// what they reflect of direct light may be sampled.
fn given() -> impl Strategy<Value = (Vec<Given>, [bool; 2])> {
    let columns = prop::collection::vec(0u32..16, 1..20);
    let colours = prop::array::uniform4(prop::array::uniform3(0f32..0.99));
    (prop::collection::vec((columns, colours, (0u32..12, 0f32..1.0)), 12), any::<[bool; 2]>())
}

fn parts((given, [interpolated, sampled]): (Vec<Given>, [bool; 2])) -> Parts {
    let mut parts = Parts::new(given.iter().map(|g| g.0.clone()).collect());
    let (mut starts, mut entries) = (vec![0], Vec::new());
    for (i, (_, colours, (other, weight))) in given.iter().enumerate() {
        let [reflectance, exitance, direct, share] = colours.map(Vec3::from_array);
        parts.patches.reflectance[i] = reflectance;
        parts.patches.exitance[i] = exitance;
        parts.direct.lights[i] = direct;
        parts.direct.sky_peaks[i] = exitance * 0.1;
        parts.sky[i] = direct * 3.0;
        if sampled {
            // What arrives need not be what rows would have found.
            parts.direct.bounce.exitance.push(reflectance * parts.direct.total(i) * share);
            parts.direct.bounce.irradiance.push(share * 0.5);
        }
        entries.extend([(i as u32, 1.0 - weight), (*other, *weight)]);
        starts.push(entries.len() as u32);
    }
    if interpolated {
        parts.transport.interpolation = Interpolation::Convex { starts, entries };
    }
    parts
}

/// Stored light is single precision.
fn close(got: f32, expected: f64, slack: f64) -> bool {
    (f64::from(got) - expected).abs() <= slack + 6e-8 * expected.abs()
}

proptest! {
    #[test]
    fn bounces_are_the_terms_of_the_neumann_sum(given in given(), bounces in 0u32..9) {
        let parts = parts(given);
        let got = parts.truncated(bounces);
        prop_assert_eq!((got.report.bounces, got.report.iterations), (Some(bounces), bounces as usize));
        prop_assert!(got.report.bound.is_none() && !got.report.converged);
        for channel in 0..3 {
            for (g, e) in got.indirect.iter().zip(parts.dense(channel).sum(bounces)) {
                prop_assert!(close(g[channel], e, 0.0), "{} instead of {e}", g[channel]);
            }
        }
    }

    #[test]
    fn solvers_are_as_near_the_truth_as_they_say(given in given()) {
        let parts = parts(given);
        for solver in parts.solvers() {
            let got = parts.system().solve(solver, TOLERANCE, &Silent).expect("nobody interrupts");
            prop_assert!(got.report.converged, "{:?}", got.report);
            let bound = got.report.bound.expect("a bound");
            for channel in 0..3 {
                for (g, e) in got.indirect.iter().zip(parts.dense(channel).solution()) {
                    prop_assert!(close(g[channel], e, bound), "{solver:?}: {} instead of {e}, {bound}", g[channel]);
                }
            }
        }
    }
}

/// Closed, every patch sees every other alike: E_N = M (1 + rho + ... + rho^N), M (1 + rho + ...) = M / (1 - rho).
fn furnace(rho: f32) -> Parts {
    let mut parts = Parts::new((0..8).map(|i| (0..8).filter(|j| *j != i).chain([i ^ 1]).collect()).collect());
    parts.patches.reflectance.fill(Vec3::splat(rho));
    parts.patches.exitance.fill(Vec3::new(1.0, 2.0, 3.0));
    parts
}

const REFLECTANCES: [f32; 5] = [0.0, 0.5, 0.97, 0.99, 0.9999];

#[test]
fn furnace_by_bounces_is_the_geometric_sum() {
    for rho in REFLECTANCES {
        let mut sum = 0.0;
        for bounces in 0..200 {
            sum += libm::pow(f64::from(rho), f64::from(bounces));
            for e in furnace(rho).truncated(bounces).indirect {
                let expected = (dvec3(1.0, 2.0, 3.0) * sum).as_vec3();
                assert!((e - expected).abs().max_element() <= 1e-7 * expected.max_element(), "{rho}, {bounces}: {e}");
            }
        }
    }
}

#[test]
fn furnaces_of_any_reflectance_converge() {
    for (rho, solver) in REFLECTANCES.into_iter().flat_map(|r| Solver::ALL.map(|s| (r, s))) {
        let solved = furnace(rho).system().solve(solver, TOLERANCE, &Silent).expect("nobody interrupts");
        assert!(solved.report.converged, "{solver:?}, {rho}: {:?}", solved.report.relative_bound);
        let expected = dvec3(1.0, 2.0, 3.0) / (1.0 - f64::from(rho));
        for e in solved.indirect {
            let off = ((e.as_dvec3() - expected) / expected).abs().max_element();
            assert!(off <= TOLERANCE, "{solver:?}, {rho}: {e} instead of {expected}");
        }
    }
}

/// One ray a row, each patch sees the next: eigenvalues all round the circle, where Chebyshev's interval is no bound.
#[test]
fn a_ring_of_single_rays_converges() {
    for (rho, solver) in [0.5, 0.97, 0.99].into_iter().flat_map(|r| Solver::ALL.map(|s| (r, s))) {
        let mut ring = Parts::new((0..64).map(|i| vec![(i + 1) % 64]).collect());
        ring.patches.reflectance.fill(Vec3::splat(rho));
        ring.direct.lights[0] = Vec3::ONE;
        let solved = ring.system().solve(solver, TOLERANCE, &Silent).expect("nobody interrupts");
        let (report, rho) = (solved.report, f64::from(rho));
        assert!(report.converged, "{solver:?}, {rho}: {:?} after {}", report.relative_bound, report.iterations);
        for (i, e) in solved.indirect.iter().enumerate() {
            let bounces = 64 - i as u32;
            let expected = libm::pow(rho, f64::from(bounces)) / (1.0 - libm::pow(rho, 64.0));
            assert!(
                close(e.x, expected, report.bound.expect("a bound")),
                "{solver:?}, {rho}: {e} instead of {expected}"
            );
        }
    }
}

/// A cupboard round a lamp beside a dim hall, far more exactly than single precision could say.
#[test]
fn a_glaring_corner_leaves_the_dark_exact() {
    let (lamp, cupboard, all) = (0u32, 1..11u32, 200u32);
    let row = |i: u32| match i {
        _ if i == lamp => cupboard.clone().collect(),
        _ if cupboard.contains(&i) => cupboard.clone().chain([lamp; 5]).collect(),
        11 => (12..all).step_by(7).chain([1]).collect(),
        _ => (1..20).map(|k| 11 + (i * 31 + k * 197) % (all - 11)).collect(),
    };
    let mut parts = Parts::new((0..all).map(row).collect());
    parts.patches.reflectance.fill(Vec3::splat(0.9));
    parts.patches.exitance[0] = Vec3::splat(1e4);
    let truth = parts.dense(0).solution();
    for solver in Solver::ALL {
        let solved = parts.system().solve(solver, 1e-9, &Silent).expect("nobody interrupts");
        let report = solved.report;
        assert!(report.converged, "{solver:?}: {:?} after {}", report.relative_bound, report.iterations);
        for (got, expected) in solved.indirect.iter().zip(&truth) {
            assert!(close(got.x, *expected, report.bound.expect("a bound")), "{solver:?}: {got} instead of {expected}");
        }
    }
}

#[test]
fn infinite_light_is_no_convergence() {
    for solver in Solver::ALL {
        let mut parts = furnace(0.5);
        parts.direct.lights[3].y = f32::INFINITY;
        let report = parts.system().solve(solver, TOLERANCE, &Silent).expect("nobody interrupts").report;
        assert!(!report.converged && report.iterations < 9, "{solver:?}: {report:?}");
    }
}

/// Nobody sees anything: nothing to solve.
#[test]
fn darkness_and_nothing_are_solved() {
    for parts in [Parts::new(Vec::new()), Parts::new(vec![Vec::new(); 3]), furnace(0.5)] {
        let mut parts = parts;
        parts.patches.exitance.fill(Vec3::ZERO);
        for solver in Solver::ALL {
            let solved = parts.system().solve(solver, TOLERANCE, &Silent).expect("nobody interrupts");
            assert!(solved.report.converged && solved.indirect.iter().all(|e| *e == Vec3::ZERO));
        }
        assert!(parts.truncated(3).indirect.iter().all(|e| e.as_dvec3() == DVec3::ZERO));
    }
}
