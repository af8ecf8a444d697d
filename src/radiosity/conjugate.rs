//! Conjugate gradients (Hestenes and Stiefel, 1952) on the symmetric form: A rho (I - F rho) is symmetric where light
//! goes both ways alike, A_i F_ij = A_j F_ji, and positive definite on the receivers that reflect anything.
//!
//! Rows of rays are not that symmetric. So the symmetric part of A F stands for it, and its solution corrects the true
//! system's, again and again: what is converged is the true residual. Where a correction takes less than a third off that, rows are too
//! noisy for this method, and it gives up. Takes the rows by column, which is as large as the rows.

use super::{
    Method, System,
    channels::{difference, dot},
    columns::Columns,
};
use glam::DVec3;
use rayon::prelude::*;

#[derive(Default)]
pub(super) struct Conjugate {
    columns: Option<Columns>,
    /// Residual before the last correction.
    before: Option<f64>,
}

/// Share of the residual that a correction leaves of the symmetric system (the noise of rows leaves about as much of the
/// true one), and most steps to get there.
const LEFT: f64 = 0.3;
const STEPS: usize = 100;
/// Share of the true residual that a correction may leave.
const ENOUGH: f64 = 0.7;

impl Method for Conjugate {
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        let residual = difference(mapped, x);
        let norm = libm::sqrt(dot(&residual, &residual).element_sum());
        if self.before.is_some_and(|before| norm > ENOUGH * before) {
            return None;
        }
        self.before = Some(norm);
        let transposing = if self.columns.is_none() { 2 * system.entries() } else { 0 };
        let columns =
            self.columns.get_or_insert_with(|| Columns::new(&system.transport.rows, system.reflectance.len()));
        let (correction, steps) = solve(system, columns, &residual)?;
        let corrected: Vec<DVec3> = x.iter().zip(&correction).map(|(x, c)| *x + *c).collect();
        // A plain iteration for the receivers that reflect nothing, and the noise.
        let mapping = system.map(&corrected, x);
        Some(transposing + 2 * steps as u64 * system.entries() + mapping)
    }
}

/// Solves A rho (I - G rho) e = A rho r with the symmetric part of A F as A G, each channel for itself, preconditioned by
/// A rho: where that is 0, e stays 0. None if it is not positive definite.
fn solve(system: &System, columns: &Columns, residual: &[DVec3]) -> Option<(Vec<DVec3>, usize)> {
    let n = residual.len();
    let power: Vec<DVec3> = (0..n).map(|i| system.power(i)).collect();
    let mut error = vec![DVec3::ZERO; n];
    // Residual and direction over A rho, as the preconditioner leaves them.
    let mut r: Vec<DVec3> =
        residual.iter().zip(&power).map(|(r, p)| DVec3::select(p.cmpgt(DVec3::ZERO), *r, DVec3::ZERO)).collect();
    let mut p = r.clone();
    let weighed = |a: &[DVec3], b: &[DVec3]| {
        let products: Vec<DVec3> = a.par_iter().zip(&power).map(|(a, power)| *a * *power).collect();
        dot(&products, b)
    };
    let mut square = weighed(&r, &r);
    let enough = square * (LEFT * LEFT);
    let mut image = vec![DVec3::ZERO; n];
    for step in 0..STEPS {
        if square.cmple(enough).all() {
            return Some((error, step));
        }
        symmetric(system, columns, &p, &mut image);
        let curvature = weighed(&p, &image);
        let busy = square.cmpgt(enough);
        if (busy & !curvature.cmpgt(DVec3::ZERO)).any() {
            return None;
        }
        let alpha = DVec3::select(busy, square / curvature, DVec3::ZERO);
        error.par_iter_mut().zip(&p).for_each(|(e, p)| *e += alpha * *p);
        r.par_iter_mut().zip(&image).for_each(|(r, q)| *r -= alpha * *q);
        let next = weighed(&r, &r);
        let beta = DVec3::select(busy, next / square, DVec3::ZERO);
        p.par_iter_mut().zip(&r).for_each(|(p, r)| *p = *r + beta * *p);
        square = next;
    }
    Some((error, STEPS))
}

/// (I - G rho) v on the receivers that reflect.
fn symmetric(system: &System, columns: &Columns, v: &[DVec3], out: &mut [DVec3]) {
    system.scatter(v, out);
    out.par_iter_mut().enumerate().for_each(|(j, out)| {
        let [power, area] = [system.power(j), DVec3::splat(f64::from(system.area[j]))];
        let back: DVec3 = columns.column(j).map(|(i, share)| system.power(i) * v[i] * share).sum();
        let there_and_back = 0.5 * (*out + back / area);
        *out = DVec3::select(power.cmpgt(DVec3::ZERO), v[j] - there_and_back, DVec3::ZERO);
    });
}
