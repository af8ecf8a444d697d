//! [`Rows`]: a sparse matrix. Of ray counts each entry is a column that one ray met; its weight, one over the row's rays,
//! is implicit: four bytes a ray. Where rays are used again, the place at which each ended is kept: sixteen. Entries that
//! differ in weight keep theirs: eight.

use glam::Vec3;
use rayon::prelude::*;
use std::{iter::Sum, ops::Mul};

/// Rows in blocks, so that they are measured in parallel, and given back block by block.
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
    /// Where each row's entries end.
    ends: Vec<u32>,
    /// Where its rays end that met nothing that shines; the next row begins there.
    dark_ends: Vec<u32>,
    weights: Vec<f32>,
    /// Weight of each entry over that of its row, in step with `columns`; empty if all are 1.
    shares: Vec<f32>,
    /// Where each ray ended, in step with `columns`; empty if that was not kept.
    spots: Vec<Vec3>,
}

/// Where the rays of a row ended.
#[derive(Clone, Copy, Debug)]
pub struct Ends<'a> {
    /// Columns, then [`DARK`] for rays that met nothing that shines.
    pub columns: &'a [u32],
    /// Their places, in step; empty if they were not kept.
    pub spots: &'a [Vec3],
}

/// In place of the column of a ray that met nothing that shines.
pub const DARK: u32 = u32::MAX;

/// In place of that of a back for which no row stands, where rows are not kept.
pub const UNKNOWN: u32 = u32::MAX - 1;

/// One row.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// Column of each entry, patches before cells of the sky; a column may repeat.
    pub columns: &'a [u32],
    /// Weight of each entry, where all weigh the same; a factor on all, where they do not.
    pub weight: f32,
    /// The other factor of each entry, in step with `columns`; empty if all weigh the same.
    pub shares: &'a [f32],
}

impl<'a> Row<'a> {
    /// Weighted sum of `value` over the entries.
    #[inline]
    pub fn sum<T: Sum + Mul<f64, Output = T>>(&self, value: impl Fn(u32) -> T) -> T {
        let sum = if self.shares.is_empty() {
            self.columns.iter().map(|&c| value(c)).sum::<T>()
        } else {
            self.columns.iter().zip(self.shares).map(|(&c, &share)| value(c) * f64::from(share)).sum()
        };
        sum * f64::from(self.weight)
    }

    /// Column and weight of each entry.
    pub fn entries(self) -> impl Iterator<Item = (u32, f64)> + 'a {
        let share = move |k: usize| self.shares.get(k).map_or(1.0, |&s| f64::from(s));
        self.columns.iter().enumerate().map(move |(k, &c)| (c, share(k) * f64::from(self.weight)))
    }

    /// Its entries before and from column `first` on, where that is one between patches and sky.
    pub fn split(self, first: u32) -> [Row<'a>; 2] {
        let at = self.columns.partition_point(|&c| c < first);
        let shares = self.shares.split_at_checked(at).unwrap_or_default();
        let (low, high) = self.columns.split_at(at);
        [Row { columns: low, shares: shares.0, ..self }, Row { columns: high, shares: shares.1, ..self }]
    }
}

impl Block {
    /// Room for `entries` entries.
    pub fn with_capacity(entries: usize) -> Self {
        Block { columns: Vec::with_capacity(entries), ..Block::default() }
    }

    /// Appends a row of `lit` columns, patches before cells of the sky, then [`DARK`] ones; `weight` is that of each
    /// entry, `spots` where the rays ended, or none.
    pub fn push(&mut self, columns: &[u32], lit: usize, weight: f32, spots: &[Vec3]) {
        let begin = self.columns.len();
        // Without places, nobody asks for rays that met nothing.
        let kept = if spots.is_empty() { lit } else { columns.len() };
        self.columns.extend_from_slice(&columns[..kept]);
        self.ends.push((begin + lit) as u32);
        self.dark_ends.push(self.columns.len() as u32);
        self.weights.push(weight);
        self.spots.extend_from_slice(spots);
    }

    /// Appends a row of entries that each weigh something else, patches before cells of the sky. A block holds rows of one
    /// kind only.
    pub fn push_weighted(&mut self, entries: impl IntoIterator<Item = (u32, f32)>) {
        entries.into_iter().for_each(|(column, weight)| {
            self.columns.push(column);
            self.shares.push(weight);
        });
        self.ends.push(self.columns.len() as u32);
        self.dark_ends.push(self.columns.len() as u32);
        self.weights.push(1.0);
    }

    /// All columns that shine, for renumbering.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = &mut u32> {
        self.columns.iter_mut().filter(|c| **c != DARK)
    }

    /// Gives back what was reserved too much.
    pub fn shrink(&mut self) {
        self.columns.shrink_to_fit();
        self.shares.shrink_to_fit();
        self.spots.shrink_to_fit();
    }

    /// Number of its rows.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True if it has none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Its rows in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        (0..self.ends.len()).map(|k| self.row(k))
    }

    /// Its row `k`.
    pub fn row(&self, k: usize) -> Row<'_> {
        let range = self.begin(k)..self.ends[k] as usize;
        let shares = self.shares.get(range.clone()).unwrap_or_default();
        Row { columns: &self.columns[range], weight: self.weights[k], shares }
    }

    /// Where the rays of its row `k` ended.
    pub fn rays(&self, k: usize) -> Ends<'_> {
        let range = self.begin(k)..self.dark_ends[k] as usize;
        Ends { columns: &self.columns[range.clone()], spots: self.spots.get(range).unwrap_or_default() }
    }

    fn begin(&self, k: usize) -> usize {
        if k == 0 { 0 } else { self.dark_ends[k - 1] as usize }
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

    /// Its blocks, to be measured further.
    pub fn into_blocks(self) -> Vec<Block> {
        self.blocks
    }

    /// Rows given one by one as columns and the weight of each entry.
    pub fn from_rows(rows: impl IntoIterator<Item = (Vec<u32>, f32)>) -> Self {
        let mut block = Block::default();
        for (mut columns, weight) in rows {
            columns.sort_unstable();
            block.push(&columns, columns.len(), weight, &[]);
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

    /// True if entries keep weights of their own.
    pub fn weighted(&self) -> bool {
        self.blocks.iter().any(|b| !b.shares.is_empty())
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> Row<'_> {
        let (block, k) = self.locate(i);
        block.row(k)
    }

    /// Where the rays of row `i` ended.
    pub fn ends(&self, i: usize) -> Ends<'_> {
        let (block, k) = self.locate(i);
        block.rays(k)
    }

    fn locate(&self, i: usize) -> (&Block, usize) {
        // Most blocks are full.
        let full = i / BLOCK;
        let found = self.firsts.get(full..full + 2).is_some_and(|ends| (ends[0]..ends[1]).contains(&i));
        let b = if found { full } else { self.firsts.partition_point(|&f| f <= i) - 1 };
        (&self.blocks[b], i - self.firsts[b])
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
        let dark = |b: &Block| (0..b.ends.len()).map(|k| u64::from(b.dark_ends[k] - b.ends[k])).sum::<u64>();
        self.blocks.iter().map(|b| b.columns.len() as u64 - dark(b)).sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let entries = |b: &Block| b.columns.capacity() + b.shares.capacity();
        let words = |b: &Block| entries(b) + 2 * b.ends.capacity() + b.weights.capacity();
        let block = |b: &Block| words(b) * 4 + b.spots.capacity() * size_of::<Vec3>();
        self.blocks.iter().map(|b| block(b) as u64).sum()
    }
}
