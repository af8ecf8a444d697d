//! Small exact systems: given form factors, one element a surface, straight to the solver.

use crate::{Case, Outcome, numbers, vectors};

/// Irradiance H of each surface: H_i = sum_j F_ij (M_j + rho_j H_j).
fn solve_lumped(f: &[Vec<f64>], rho: &[f64], exitance: &[f64]) -> Vec<f64> {
    let mut h = vec![0.0; rho.len()];
    for _ in 0..20_000 {
        for i in 0..h.len() {
            h[i] = (0..h.len()).map(|j| f[i][j] * (exitance[j] + rho[j] * h[j])).sum();
        }
    }
    h
}

/// Radiosities B = M + rho H.
fn radiosities(f: &[Vec<f64>], rho: &[f64], exitance: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let h = solve_lumped(f, rho, exitance);
    let b = (0..h.len()).map(|i| exitance[i] + rho[i] * h[i]).collect();
    (h, b)
}

/// Single precision in factors and unknowns, and the solver's stopping bound: 1e-6 of the value.
fn precision(value: f64) -> f64 {
    1e-6 * value.abs()
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
    (0..b.len()).map(check).collect()
}

pub fn infinite_plates(case: &Case) -> Outcome {
    let f = [vec![0.0, 1.0], vec![1.0, 0.0]];
    let (_, b) = radiosities(&f, &[case.input("rho1")?, case.input("rho2")?], &[case.input("E1")?, 0.0]);
    ["B1", "B2"].iter().zip(b).map(|(key, b)| case.check(key, b, 0.0, precision(b))).collect()
}

pub fn concentric_spheres(case: &Case) -> Outcome {
    let ratio = case.input("r_in")? / case.input("r_out")?;
    let f = [vec![0.0, 1.0], vec![ratio * ratio, 1.0 - ratio * ratio]];
    let rho = [case.input("rho_in")?, case.input("rho_out")?];
    let (h, b) = radiosities(&f, &rho, &[case.input("E_in")?, case.input("E_out")?]);
    let got = [("H_in", h[0]), ("H_out", h[1]), ("B_in", b[0]), ("B_out", b[1])];
    got.iter().map(|(key, v)| case.check(key, *v, 0.0, precision(*v))).collect()
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
    got.iter().map(|(key, v)| case.check(key, *v, 0.0, precision(*v))).collect()
}
