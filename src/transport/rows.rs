//! [`Rows`]: a sparse matrix of ray counts. Each entry is a column that one ray met; its weight, one over the row's
//! rays, is implicit: four bytes a ray.

use rayon::prelude::*;
use std::{iter::Sum, ops::Mul};

/// Rows in blocks, so that they are measured in parallel and never copied.
#[derive(Clone, Debug)]
pub struct Rows {
    blocks: Vec<Block>,
    /// First row of each block, and the number of rows.
    firsts: Vec<usize>,
}

/// Rows that are measured together.
pub const BLOCK: usize = 64;

/// Some rows.
#[derive(Clone, Debug, Default)]
pub struct Block {
    columns: Vec<u32>,
    ends: Vec<u32>,
    weights: Vec<f32>,
}

/// One row: every entry weighs the same.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// Column of each entry, patches before cells of the sky; a column may repeat.
    pub columns: &'a [u32],
    /// Weight of each entry.
    pub weight: f32,
}

impl Row<'_> {
    /// Weighted sum of `value` over the entries.
    #[inline]
    pub fn sum<T: Sum + Mul<f64, Output = T>>(&self, value: impl Fn(u32) -> T) -> T {
        self.columns.iter().map(|&c| value(c)).sum::<T>() * f64::from(self.weight)
    }
}

impl Block {
    /// Room for `entries` entries.
    pub fn with_capacity(entries: usize) -> Self {
        Block { columns: Vec::with_capacity(entries), ..Block::default() }
    }

    /// Appends a row, patches before cells of the sky; `weight` is that of each entry.
    pub fn push(&mut self, columns: impl IntoIterator<Item = u32>, weight: f32) {
        self.columns.extend(columns);
        self.ends.push(self.columns.len() as u32);
        self.weights.push(weight);
    }

    /// All entries, for renumbering.
    pub fn columns_mut(&mut self) -> &mut [u32] {
        &mut self.columns
    }

    /// Gives back what was reserved too much.
    pub fn shrink(&mut self) {
        self.columns.shrink_to_fit();
    }

    /// Its rows in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        (0..self.ends.len()).map(|k| self.row(k))
    }

    fn row(&self, k: usize) -> Row<'_> {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] as usize };
        Row { columns: &self.columns[begin..self.ends[k] as usize], weight: self.weights[k] }
    }
}

impl Rows {
    /// Rows of all blocks, in order.
    pub fn new(blocks: Vec<Block>) -> Self {
        let mut firsts = vec![0];
        for b in &blocks {
            firsts.push(firsts[firsts.len() - 1] + b.ends.len());
        }
        Rows { blocks, firsts }
    }

    /// Rows given one by one as columns and the weight of each entry.
    pub fn from_rows(rows: impl IntoIterator<Item = (Vec<u32>, f32)>) -> Self {
        let mut block = Block::default();
        for (mut columns, weight) in rows {
            columns.sort_unstable();
            block.push(columns, weight);
        }
        Rows::new(vec![block])
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.firsts[self.blocks.len()]
    }

    /// True if there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> Row<'_> {
        let b = self.firsts.partition_point(|&f| f <= i) - 1;
        self.blocks[b].row(i - self.firsts[b])
    }

    /// Applies `f` to every row in parallel: `out[i] = f(row i)`.
    pub fn map_into<T: Send>(&self, out: &mut [T], f: impl Fn(Row) -> T + Sync) {
        let mut parts = Vec::with_capacity(self.blocks.len());
        let mut rest = out;
        for b in &self.blocks {
            let (part, tail) = rest.split_at_mut(b.ends.len());
            parts.push((b, part));
            rest = tail;
        }
        parts.into_par_iter().for_each(|(block, out)| block.rows().zip(out).for_each(|(row, out)| *out = f(row)));
    }

    /// Stored entries.
    pub fn entries(&self) -> u64 {
        self.blocks.iter().map(|b| b.columns.len() as u64).sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let block = |b: &Block| (b.columns.capacity() + b.ends.capacity() + b.weights.capacity()) * 4;
        self.blocks.iter().map(|b| block(b) as u64).sum()
    }
}
