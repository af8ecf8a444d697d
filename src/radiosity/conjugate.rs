//! Conjugate gradients (Hestenes and Stiefel, 1952) on the symmetric form: A rho (I - F rho) is symmetric where light
//! goes both ways alike, A_i F_ij = A_j F_ji, and positive definite on the receivers that reflect anything.
//!
//! Rows of rays are not that symmetric. So the symmetric part of A F, scaled ([`Symmetric`]), stands for it, and its solution
//! corrects the true system's, again and again: what is converged is the true residual. Where a correction takes less than a
//! third off that, rows are too noisy for this method, and it gives up. Takes the rows by column, which is as large as the
//! rows.

use super::{
    Method, System,
    channels::{difference, dot},
    columns::Columns,
};
use glam::DVec3;
use rayon::prelude::*;

#[derive(Default)]
pub(super) struct Conjugate {
    symmetric: Option<Symmetric>,
    /// Residual before the last correction.
    before: Option<f64>,
}

/// Share of the residual that a correction leaves of the symmetric system (the noise of rows leaves about as much of the
/// true one), and most steps to get there.
const LEFT: f64 = 0.3;
const STEPS: usize = 100;
/// Steps of the scaling. Measured: rows of 16 rays at reflectance .99 need four, those of 64 one.
const SCALINGS: usize = 4;
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
        let preparing = if self.symmetric.is_none() { Symmetric::PASSES * system.entries() } else { 0 };
        let symmetric = self.symmetric.get_or_insert_with(|| Symmetric::new(system));
        let (correction, steps) = solve(system, symmetric, &residual)?;
        let corrected: Vec<DVec3> = x.iter().zip(&correction).map(|(x, c)| *x + *c).collect();
        // A plain iteration for the receivers that reflect nothing, and the noise.
        let mapping = system.map(&corrected, x);
        Some(preparing + 2 * steps as u64 * system.entries() + mapping)
    }
}

/// Solves A rho (I - G rho) e = A rho r, A G being symmetric, each channel for itself, preconditioned by
/// A rho: where that is 0, e stays 0. None if it is not positive definite.
fn solve(system: &System, symmetric: &Symmetric, residual: &[DVec3]) -> Option<(Vec<DVec3>, usize)> {
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
        symmetric.apply(system, &p, &mut image);
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

/// A G = D S D, with S the symmetric part of A F.
///
/// What a patch sends by the rows of others is noisier than what its own row receives: rows of S may sum to more than A,
/// and then A rho (I - G rho) is not positive definite where rho is near 1. D gives them the sums of A F again (symmetric
/// scaling: Knight, Ruiz and Ucar, 2014), so that light which is the same everywhere is sent on as the true system does.
struct Symmetric {
    columns: Columns,
    /// D, of each row and column.
    scale: Vec<f64>,
}

impl Symmetric {
    /// Matrix entries touched to make one, in all that there are: two for the columns.
    const PASSES: u64 = 2 + 2 * SCALINGS as u64;

    fn new(system: &System) -> Self {
        let (n, rows) = (system.unknowns(), &system.transport.rows);
        let columns = Columns::new(rows, n);
        let received = |v: &[f64]| {
            let mut received = vec![0.0; n];
            rows.map_into(&mut received, |row| row.split(n as u32)[0].sum(|c| v[c as usize]));
            received
        };
        let mut scale = vec![1.0; n];
        let mut sums = Vec::new();
        for _ in 0..SCALINGS {
            let there = received(&scale);
            if sums.is_empty() {
                sums.clone_from(&there);
            }
            let sent = |j: usize| columns.column(j).map(|(i, share)| system.area[i] * scale[i] * share).sum::<f64>();
            let sum = |j: usize| 0.5 * scale[j] * (there[j] + sent(j) / system.area[j]);
            // Who sees nothing, or has no open area, is left as it is.
            let factor = |j: usize| Some(sums[j] / sum(j)).filter(|f| f.is_finite() && *f > 0.0);
            let next = (0..n).into_par_iter().map(|j| scale[j] * factor(j).map_or(1.0, f64::sqrt));
            scale = next.collect();
        }
        Symmetric { columns, scale }
    }

    /// (I - G rho) v on the receivers that reflect.
    fn apply(&self, system: &System, v: &[DVec3], out: &mut [DVec3]) {
        let scaled: Vec<DVec3> = v.par_iter().zip(&self.scale).map(|(v, scale)| *v * *scale).collect();
        system.scatter(&scaled, out);
        out.par_iter_mut().enumerate().for_each(|(j, out)| {
            let power = system.power(j);
            let back: DVec3 = self.columns.column(j).map(|(i, share)| system.power(i) * scaled[i] * share).sum();
            let there_and_back = 0.5 * self.scale[j] * (*out + back / system.area[j]);
            *out = DVec3::select(power.cmpgt(DVec3::ZERO), v[j] - there_and_back, DVec3::ZERO);
        });
    }
}
