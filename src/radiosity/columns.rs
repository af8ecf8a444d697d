//! [`Columns`] and [`Readers`]: rows and interpolation by column, for solvers that follow light from where it leaves.
//! As many bytes more for every entry of the rows as the rows have.

use super::System;
use crate::transport::{Interpolation, Rows};

/// Who meets each patch.
pub(super) struct Columns {
    rows: Lists<u32>,
    /// Of each row.
    weights: Vec<f64>,
    /// Of each entry, where they differ.
    shares: Option<Lists<f32>>,
}

impl Columns {
    /// Transposes, at the cost of touching every entry twice; cells of the sky are left out, since nothing leads there.
    pub fn new(rows: &Rows, patches: usize) -> Self {
        let sent = move |i: usize| rows.row(i).split(patches as u32)[0];
        let who = |give: &mut dyn FnMut(usize, u32)| {
            (0..rows.len()).for_each(|i| sent(i).columns.iter().for_each(|c| give(*c as usize, i as u32)));
        };
        let how_much = |give: &mut dyn FnMut(usize, f32)| {
            let entries = (0..rows.len()).map(sent).flat_map(|row| row.columns.iter().zip(row.shares));
            entries.for_each(|(c, share)| give(*c as usize, *share));
        };
        let weights = (0..rows.len()).map(|i| f64::from(rows.row(i).weight)).collect();
        let shares = rows.weighted().then(|| Lists::new(patches, how_much));
        Columns { rows: Lists::new(patches, who), weights, shares }
    }

    /// The receiver and the weight of every entry of column `c`.
    pub fn column(&self, c: usize) -> impl ExactSizeIterator<Item = (usize, f64)> {
        let shares = self.shares.as_ref().map_or(&[][..], |shares| shares.of(c));
        let share = |k: usize| shares.get(k).map_or(1.0, |&s| f64::from(s));
        self.rows.of(c).iter().enumerate().map(move |(k, i)| (*i as usize, self.weights[*i as usize] * share(k)))
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
