//! What is checked of a [`Transport`]: shapes, ranges and sums; how alike light goes both ways.

use super::{Interpolation, Transport};
use crate::{math::CELLS, patches::Patches};
use rayon::prelude::*;

/// What was found of rows that are sound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// Least and largest sum of a row, the sky included.
    pub sums: [f64; 2],
    /// Root mean square of A_i F_ij - A_j F_ji over that of A_i F_ij, between receivers: how far from reciprocal rows are.
    pub reciprocity: f64,
}

/// A row may sum to so much more than 1: single precision.
const SLACK: f64 = 1e-5;

impl Transport {
    /// Checks shapes, ranges and sums.
    pub fn validate(&self, patches: &Patches) -> Result<Checked, String> {
        let n = self.receivers.len();
        if self.rows.len() != n {
            return Err(format!("{n} receivers, {} rows", self.rows.len()));
        }
        let columns = self.patches as u32 + CELLS;
        let mut sums = [f64::INFINITY, 0f64];
        for i in 0..n {
            let row = self.rows.row(i);
            if row.columns.iter().any(|&c| c >= columns) {
                return Err(format!("row {i} names a column beyond {columns}"));
            }
            if !row.columns.is_sorted_by_key(|&c| c as usize >= self.patches) {
                return Err(format!("row {i} names cells of the sky before patches"));
            }
            if row.entries().any(|e| !e.1.is_finite() || e.1 < 0.0) {
                return Err(format!("row {i} has a weight that is no share"));
            }
            let sum = row.sum(|_| 1.0);
            if sum > 1.0 + SLACK {
                return Err(format!("row {i} sums to {sum}"));
            }
            sums = [sums[0].min(sum), sums[1].max(sum)];
        }
        if let Interpolation::Convex { starts, entries } = &self.interpolation {
            for (i, w) in starts.windows(2).enumerate() {
                let row = &entries[w[0] as usize..w[1] as usize];
                let sum: f32 = row.iter().map(|e| e.1).sum();
                if row.iter().any(|e| e.1 < 0.0 || e.0 as usize >= n) || (sum - 1.0).abs() > 1e-4 {
                    return Err(format!("patch {i} is no convex combination: sum {sum}"));
                }
            }
        }
        Ok(Checked { sums, reciprocity: self.reciprocity(patches) })
    }

    /// [`Checked::reciprocity`]; of a patch, its open part counts.
    pub fn reciprocity(&self, patches: &Patches) -> f64 {
        let merged = |i: usize| {
            let mut entries: Vec<(u32, f64)> = self.rows.row(i).split(self.patches as u32)[0].entries().collect();
            entries.sort_by_key(|e| e.0);
            let sum = |same: &[(u32, f64)]| (same[0].0, same.iter().map(|e| e.1).sum::<f64>());
            entries.chunk_by(|a, b| a.0 == b.0).map(sum).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<(u32, f64)>> = (0..self.rows.len()).into_par_iter().map(merged).collect();
        let area = |p: u32| f64::from(patches.area[p as usize] * patches.validity[p as usize]);
        let (mut all, mut apart) = (0.0, 0.0);
        for (row, &i) in rows.iter().zip(&self.receivers) {
            for &(j, there) in row {
                let Some(other) = self.receiver_at(j) else { continue };
                let back = rows[other].binary_search_by_key(&i, |e| e.0).ok().map(|k| rows[other][k].1);
                let (there, back) = (area(i) * there, area(j) * back.unwrap_or(0.0));
                all += there * there;
                // What goes one way only is met once, the rest from both ends.
                apart += (there - back) * (there - back) * if back == 0.0 { 2.0 } else { 1.0 };
            }
        }
        if all > 0.0 { (apart / all).sqrt() } else { 0.0 }
    }
}
