//! Small exact systems: given form factors, one element a surface, straight to the solver.

use crate::{Case, Outcome, numbers, vectors};
use glam::Vec3;
use luxel::{
    direct::Direct,
    patches::Patches,
    progress::Silent,
    radiosity::{Solver, System},
    transport::Transport,
};

/// Most entries of a row; weights are implicit, so a factor is a count over their number.
const ENTRIES: u32 = 8192;

/// Irradiance H of each surface: H_i = sum_j F_ij (M_j + rho_j H_j).
fn solve_lumped(f: &[Vec<f64>], rho: &[f64], exitance: &[f64]) -> Vec<f64> {
    let n = rho.len();
    let grey = |v: &[f64]| v.iter().map(|v| Vec3::splat(*v as f32)).collect::<Vec<_>>();
    let patches = Patches {
        area: vec![1.0; n],
        reflectance: grey(rho),
        exitance: grey(exitance),
        validity: vec![1.0; n],
        buried: vec![false; n],
        fronts: n,
        ..Patches::default()
    };
    let none = || vec![Vec3::ZERO; n];
    let direct =
        Direct { lights: none(), hidden_lights: none(), emitters: none(), sky_peaks: none(), ..Direct::default() };
    let transport = Transport::from_rows(n, f.iter().map(|row| counted(row)));
    transport.validate(&patches).expect("rows of form factors");
    let sky = vec![Vec3::ZERO; luxel::math::CELLS as usize];
    let system = System::new(&transport, &patches, &direct, &sky, true);
    let solved = Solver::ALL.map(|s| system.solve(s, 1e-7, &Silent).expect("nobody interrupts").indirect);
    let solution = solved[0].clone();
    for (solver, solved) in Solver::ALL.iter().zip(&solved).skip(1) {
        for (a, b) in solved.iter().zip(&solution) {
            assert!((a.x - b.x).abs() <= precision(f64::from(b.x)) as f32, "{solver:?}: {a}, default {b}");
        }
    }
    solution.iter().map(|e| f64::from(e.x)).collect()
}

/// A row as counts over the number of entries at which they come closest.
fn counted(row: &[f64]) -> (Vec<u32>, f32) {
    let counts = |n: u32| row.iter().map(|f| (f * f64::from(n)).round()).collect::<Vec<_>>();
    let off = |n: u32| {
        let error = |(f, c): (&f64, &f64)| (f - c / f64::from(n)).abs();
        row.iter().zip(&counts(n)).map(error).fold(0.0, f64::max)
    };
    let whole = |n: &u32| counts(*n).iter().sum::<f64>() <= f64::from(*n);
    let n = (1..=ENTRIES).filter(whole).min_by(|a, b| off(*a).total_cmp(&off(*b))).expect("a row of counts");
    let columns = counts(n).iter().enumerate().flat_map(|(j, c)| vec![j as u32; *c as usize]).collect();
    (columns, 1.0 / n as f32)
}

/// Radiosities B = M + rho H.
fn radiosities(f: &[Vec<f64>], rho: &[f64], exitance: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let h = solve_lumped(f, rho, exitance);
    let b = (0..h.len()).map(|i| exitance[i] + rho[i] * h[i]).collect();
    (h, b)
}

/// Reflectances and the weights of rows are single precision: half a last place each, amplified by up to
/// 1 / (1 - .99).
fn precision(value: f64) -> f64 {
    2.0 * 100.0 / f64::from(1 << 24) * value.abs()
}

pub fn prism(case: &Case) -> Outcome {
    let f = vectors(&case.inputs["F"])?;
    let (_, b) = radiosities(&f, &numbers(&case.inputs["rho"])?, &numbers(&case.inputs["E"])?);
    let expected = numbers(&case.expected)?;
    let check = |i: usize| {
        let tolerance = case.tolerance("", expected[i])?;
        let shape = precision(b[i]);
        Ok(crate::Check { what: format!("B{i}"), got: b[i], expected: expected[i], tolerance, sigma: 0.0, shape })
    };
    Ok((0..b.len()).map(check).collect::<Result<_, String>>()?)
}

pub fn infinite_plates(case: &Case) -> Outcome {
    let f = [vec![0.0, 1.0], vec![1.0, 0.0]];
    let (_, b) = radiosities(&f, &[case.input("rho1")?, case.input("rho2")?], &[case.input("E1")?, 0.0]);
    Ok(["B1", "B2"]
        .iter()
        .zip(b)
        .map(|(key, b)| case.check(key, b, 0.0, precision(b)))
        .collect::<Result<_, String>>()?)
}

pub fn concentric_spheres(case: &Case) -> Outcome {
    let ratio = case.input("r_in")? / case.input("r_out")?;
    let f = [vec![0.0, 1.0], vec![ratio * ratio, 1.0 - ratio * ratio]];
    let rho = [case.input("rho_in")?, case.input("rho_out")?];
    let (h, b) = radiosities(&f, &rho, &[case.input("E_in")?, case.input("E_out")?]);
    let got = [("H_in", h[0]), ("H_out", h[1]), ("B_in", b[0]), ("B_out", b[1])];
    Ok(got.iter().map(|(key, v)| case.check(key, *v, 0.0, precision(*v))).collect::<Result<_, String>>()?)
}

pub fn cube_one_emitter(case: &Case) -> Outcome {
    let (rho_top, rho) = (case.input("rho_top")?, case.input("rho_others")?);
    // Unit squares opposed at distance 1 (Howell C-11); the four others share the rest alike.
    let root = std::f64::consts::SQRT_2;
    let opposite = 2.0 / std::f64::consts::PI
        * (0.5 * libm::log(4.0 / 3.0) + 2.0 * root * libm::atan(1.0 / root) - 2.0 * libm::atan(1.0));
    let adjacent = (1.0 - opposite) / 4.0;
    let factor = |i: usize, j: usize| match (i, j) {
        _ if i == j => 0.0,
        _ if i ^ 1 == j => opposite,
        _ => adjacent,
    };
    let f: Vec<Vec<f64>> = (0..6).map(|i| (0..6).map(|j| factor(i, j)).collect()).collect();
    let mut reflectance = [rho; 6];
    reflectance[0] = rho_top;
    let (h, _) = radiosities(&f, &reflectance, &[case.input("E_top")?, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let got = [("H_top", h[0]), ("H_bottom", h[1]), ("H_side", h[2])];
    Ok(got.iter().map(|(key, v)| case.check(key, *v, 0.0, precision(*v))).collect::<Result<_, String>>()?)
}
