//! [`Columns`] and [`Readers`]: rows and interpolation by column, for solvers that follow light from where it leaves.
//! Four bytes more for every entry of the rows.

use super::System;
use crate::transport::{Interpolation, Rows};

/// Who meets each patch.
pub(super) struct Columns {
    rows: Lists<u32>,
    weights: Vec<f64>,
}

impl Columns {
    /// Transposes, at the cost of touching every entry twice; cells of the sky are left out, since nothing leads there.
    pub fn new(rows: &Rows, patches: usize) -> Self {
        let pairs = |give: &mut dyn FnMut(usize, u32)| {
            for i in 0..rows.len() {
                rows.row(i)
                    .columns
                    .iter()
                    .filter(|c| (**c as usize) < patches)
                    .for_each(|c| give(*c as usize, i as u32));
            }
        };
        let weights = (0..rows.len()).map(|i| f64::from(rows.row(i).weight)).collect();
        Columns { rows: Lists::new(patches, pairs), weights }
    }

    /// The receiver and the weight of every entry of column `c`.
    pub fn column(&self, c: usize) -> impl ExactSizeIterator<Item = (usize, f64)> {
        self.rows.of(c).iter().map(|i| (*i as usize, self.weights[*i as usize]))
    }
}

/// The patches that read a receiver.
pub(super) enum Readers {
    /// Its own.
    Own,
    /// These, with their weights.
    Many(Lists<(u32, f32)>),
}

impl Readers {
    pub fn new(system: &System) -> Self {
        match &system.transport.interpolation {
            Interpolation::Identity => Readers::Own,
            Interpolation::Convex { starts, entries } => Readers::Many(Lists::new(system.unknowns(), |give| {
                for (patch, w) in starts.windows(2).enumerate() {
                    let row = &entries[w[0] as usize..w[1] as usize];
                    row.iter().for_each(|(receiver, weight)| give(*receiver as usize, (patch as u32, *weight)));
                }
            })),
        }
    }

    /// Gives every patch that reads `receiver`, and the weight of what it reads.
    pub fn each(&self, receiver: usize, mut give: impl FnMut(usize, f64)) {
        match self {
            Readers::Own => give(receiver, 1.0),
            Readers::Many(lists) => lists.of(receiver).iter().for_each(|(p, w)| give(*p as usize, f64::from(*w))),
        }
    }
}

/// Values by key, in the order in which they were given.
pub(super) struct Lists<T> {
    starts: Vec<usize>,
    values: Vec<T>,
}

impl<T: Copy + Default> Lists<T> {
    /// `pairs` gives the same keys and values both times.
    fn new(keys: usize, pairs: impl Fn(&mut dyn FnMut(usize, T))) -> Self {
        let mut starts = vec![0; keys + 1];
        pairs(&mut |key, _| starts[key + 1] += 1);
        (0..keys).for_each(|k| starts[k + 1] += starts[k]);
        let (mut next, mut values) = (starts.clone(), vec![T::default(); starts[keys]]);
        pairs(&mut |key, value| {
            values[next[key]] = value;
            next[key] += 1;
        });
        Lists { starts, values }
    }

    fn of(&self, key: usize) -> &[T] {
        &self.values[self.starts[key]..self.starts[key + 1]]
    }
}
