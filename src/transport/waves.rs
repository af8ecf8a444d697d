//! Rows in waves: the fronts first, then the backs that their rays met, until no ray meets a new one. Once for all methods
//! that shoot.

use super::{
    Eye, Options, Stats,
    draft::Draft,
    receiver::Receiver,
    rows::{BLOCK, Block, Rows},
    sight::{Sight, renumber},
};
use crate::{
    error,
    math::PointTable,
    memory,
    patches::Patches,
    progress::{Observer, check},
};
use rayon::prelude::*;

/// One method's mathematics.
pub(super) trait Method: Sync {
    /// What its rays meet.
    fn sight(&self) -> &Sight<'_>;

    /// The rows of some texels, of all their fronts or all their backs.
    fn block<'s>(&'s self, desk: &mut Desk<'s>, texels: &[u32], back: bool, observer: &dyn Observer) -> Done;
}

/// All rows.
pub(super) struct Measured {
    pub rows: Rows,
    pub eyes: Vec<Eye>,
    pub stats: Stats,
}

/// Rows of a block.
#[derive(Default)]
pub(super) struct Done {
    pub block: Block,
    pub eyes: Vec<Eye>,
    pub validity: Vec<f32>,
    pub buried: Vec<bool>,
    pub stats: Stats,
}

/// Where a block is measured: its allocations serve one block after the other.
#[derive(Default)]
pub(super) struct Desk<'a> {
    receivers: Vec<Receiver<'a>>,
    rows: Vec<Draft>,
}

impl<'a> Desk<'a> {
    /// The receivers at `texels`, and a row for each that has met nothing yet.
    pub fn clear(
        &mut self,
        sight: &'a Sight,
        table: &'a PointTable,
        texels: &[u32],
        back: bool,
    ) -> (&[Receiver<'a>], &mut [Draft]) {
        let receiver = || Receiver::new(sight.tracer, sight.coverage);
        self.receivers.resize_with(self.receivers.len().max(texels.len()), receiver);
        self.rows.resize_with(self.receivers.len(), Draft::default);
        let (receivers, rows) = (&mut self.receivers[..texels.len()], &mut self.rows[..texels.len()]);
        receivers.iter_mut().zip(texels).for_each(|(r, &texel)| r.set(texel, back, table));
        rows.iter_mut().for_each(Draft::clear);
        (receivers, rows)
    }
}

/// Measures the fronts that are `receivers`, then the backs, and tells `patches` of them.
pub(super) fn measure(
    method: &dyn Method,
    patches: &mut Patches,
    receivers: &[u32],
    options: &Options,
    observer: &dyn Observer,
) -> error::Result<Measured> {
    let texels = patches.fronts;
    let mut wave = receivers.to_vec();
    let (mut back, mut backs) = (false, Vec::new());
    let (mut validity, mut buried) = (Vec::with_capacity(wave.len()), Vec::with_capacity(wave.len()));
    let (mut blocks, mut eyes) = (Vec::new(), Vec::new());
    let mut stats = Stats::default();
    observer.begin("transport", wave.len() as u64);
    while !wave.is_empty() {
        let blocks_of = wave.par_chunks(BLOCK);
        let done: Vec<_> =
            blocks_of.map_init(Desk::default, |desk, texels| method.block(desk, texels, back, observer)).collect();
        check(observer)?;
        for done in done {
            blocks.push(done.block);
            eyes.extend(done.eyes);
            validity.extend(done.validity);
            buried.extend(done.buried);
            stats += done.stats;
        }
        wave = method.sight().take_met(&backs);
        backs.extend_from_slice(&wave);
        patches.add_backs(&wave);
        back = true;
        if !wave.is_empty() {
            // Nobody knew how many backs would be met.
            memory::fits(options.bytes_of_entries(wave.len(), patches.len()) >> 20, memory::free_mb(), memory::REMEDY)?;
            observer.begin("transport: backs", wave.len() as u64);
        }
    }
    renumber(&mut blocks, texels as u32, &backs, patches.len() as u32);
    let measured = receivers.iter().copied().chain(texels as u32..patches.len() as u32);
    for ((patch, validity), buried) in measured.zip(validity).zip(buried) {
        patches.validity[patch as usize] = validity;
        patches.buried[patch as usize] = buried;
    }
    Ok(Measured { rows: Rows::new(blocks), eyes, stats })
}
