//! Dense direct: LU with partial pivoting of I - K, channel by channel. The slow truth of small systems.

use super::{Method, System, columns::Readers};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Most unknowns, as --help says: the matrix is 128 MB then, and takes half a minute a channel.
pub const MOST: usize = 4096;

#[derive(Default)]
pub(super) struct Dense {
    steps: usize,
}

/// The first step solves; another, if it is asked for, takes off what rounding left. More do not help.
const STEPS: usize = 3;

impl Method for Dense {
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        self.steps += 1;
        if self.steps > STEPS {
            return None;
        }
        let (readers, n) = (Readers::new(system), x.len());
        let grey = system.reflectance.iter().all(|r| r.x == r.y && r.y == r.z);
        let mut factors = None;
        for channel in 0..3 {
            if channel == 0 || !grey {
                drop(factors.take()); // One matrix at a time.
                factors = Some(matrix(system, &readers, channel).lu());
            }
            let residual = DVector::from_iterator(n, mapped.iter().zip(&*x).map(|(m, x)| m[channel] - x[channel]));
            let error = factors.as_ref()?.solve(&residual)?;
            x.iter_mut().zip(error.iter()).for_each(|(x, e)| x[channel] += e);
        }
        // Elimination goes through the square of what is left once for every unknown.
        let n = n as u64;
        let square_sum = n * (n + 1) * (2 * n + 1) / 6;
        Some((system.entries() + square_sum) * if grey { 1 } else { 3 })
    }
}

/// I - F rho P of one channel.
fn matrix(system: &System, readers: &Readers, channel: usize) -> DMatrix<f64> {
    let n = system.unknowns();
    // What each patch sends on of each receiver's light is sparse, too: lists by patch.
    let mut sent = vec![Vec::new(); system.reflectance.len()];
    for i in 0..n {
        readers.each(i, |p, weight| sent[p].push((i, weight * f64::from(system.reflectance[p][channel]))));
    }
    let mut matrix = DMatrix::identity(n, n);
    for i in 0..n {
        for (c, weight) in system.transport.rows.row(i).split(sent.len() as u32)[0].entries() {
            sent[c as usize].iter().for_each(|(j, share)| matrix[(i, *j)] -= weight * share);
        }
    }
    matrix
}
