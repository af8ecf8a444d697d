//! Rows in waves: the fronts first, and the backs that are known, then the backs that their rays met, until no ray meets a
//! new one. Once for all methods that shoot.

use super::{
    Eye, Options, Stats, Transport,
    draft::Draft,
    receiver::Receiver,
    rows::{BLOCK, Block, Rows},
    sight::{Numbering, Sight, reopen},
};
use crate::{
    error,
    math::PointTable,
    memory,
    patches::{Faces, Patches},
    progress::{Observer, check},
};
use rayon::prelude::*;

/// One method's mathematics.
pub(super) trait Method: Sync {
    /// What its rays meet.
    fn sight(&self) -> &Sight<'_>;

    /// The rows of a task; none if the user wants to stop.
    fn block<'s>(&'s self, desk: &mut Desk<'s>, task: &Task, observer: &dyn Observer) -> Done;
}

/// Texels whose rows are measured together: of all their fronts, or of all their backs.
pub(super) struct Task {
    pub texels: Vec<u32>,
    pub back: bool,
    /// What was measured before, to be kept; empty if nothing was.
    pub before: Done,
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
pub(super) struct Desk<'a> {
    sight: &'a Sight<'a>,
    faces: Faces<'a>,
    receivers: Vec<Receiver<'a>>,
    rows: Vec<Draft>,
}

impl<'a> Desk<'a> {
    /// Nothing has been measured.
    pub fn new(sight: &'a Sight<'a>) -> Self {
        let faces = Faces::new(&sight.tracer.world, sight.coverage);
        Desk { sight, faces, receivers: Vec::new(), rows: Vec::new() }
    }

    /// The receivers at `texels`, and a row for each that has met nothing yet.
    pub fn clear(&mut self, table: &'a PointTable, texels: &[u32], back: bool) -> (&[Receiver<'a>], &mut [Draft]) {
        let receiver = || Receiver::new(self.sight.coverage);
        self.receivers.resize_with(self.receivers.len().max(texels.len()), receiver);
        self.rows.resize_with(self.receivers.len(), Draft::default);
        let (receivers, rows) = (&mut self.receivers[..texels.len()], &mut self.rows[..texels.len()]);
        for (receiver, &texel) in receivers.iter_mut().zip(texels) {
            receiver.set(texel, back, table, &mut self.faces);
        }
        rows.iter_mut().for_each(Draft::clear);
        (receivers, rows)
    }
}

/// Measures the rows of the receivers of `transport`, beyond those that are there, then those of the backs that are met, and
/// tells `patches` of them.
pub(super) fn measure(
    method: &dyn Method,
    patches: &mut Patches,
    transport: &mut Transport,
    options: &Options,
    observer: &dyn Observer,
) -> error::Result<()> {
    let (fronts, sky) = (patches.fronts as u32, patches.len() as u32);
    let mut wave = known(transport, patches);
    let mut blocks = Vec::with_capacity(wave.len());
    let (mut validity, mut buried) = (Vec::new(), Vec::new());
    observer.begin("transport", transport.receivers.len() as u64);
    while !wave.is_empty() {
        let run = |desk: &mut _, mut task: Task| {
            reopen(&mut task.before.block, sky);
            method.block(desk, &task, observer)
        };
        let done: Vec<Done> = wave.into_par_iter().map_init(|| Desk::new(method.sight()), run).collect();
        check(observer)?;
        for done in done {
            blocks.push(done.block);
            transport.eyes.extend(done.eyes);
            validity.extend(done.validity);
            buried.extend(done.buried);
            transport.stats += done.stats;
        }
        let met = method.sight().take_met(&patches.backs);
        transport.receivers.extend(patches.len() as u32..(patches.len() + met.len()) as u32);
        patches.add_backs(&met);
        if !met.is_empty() {
            // Nobody knew how many backs would be met.
            memory::fits(options.bytes_of_entries(met.len(), patches.len()) >> 20, memory::free_mb(), memory::REMEDY)?;
            observer.begin("transport: backs", met.len() as u64);
        }
        wave = tasks(&met, true);
    }
    let columns = Numbering::new(fronts, &patches.backs);
    blocks.par_iter_mut().for_each(|block| columns.settle(block));
    for ((&patch, validity), buried) in transport.receivers.iter().zip(validity).zip(buried) {
        patches.validity[patch as usize] = validity;
        patches.buried[patch as usize] = buried;
    }
    transport.rows = Rows::new(blocks);
    Ok(())
}

/// The receivers that are known, with what was measured of them, which `transport` no longer holds: so it is given back block
/// by block.
fn known(transport: &mut Transport, patches: &Patches) -> Vec<Task> {
    let blocks = std::mem::replace(&mut transport.rows, Rows::new(Vec::new())).into_blocks();
    if blocks.is_empty() {
        return tasks(&transport.receivers, false);
    }
    let mut eyes = std::mem::take(&mut transport.eyes).into_iter();
    let mut rest = transport.receivers.as_slice();
    let task = |block: Block| {
        let some;
        (some, rest) = rest.split_at(block.len());
        let of = |&patch: &u32| patches.texel(patch as usize);
        let before = Done {
            eyes: eyes.by_ref().take(block.len()).collect(),
            validity: some.iter().map(|&p| patches.validity[p as usize]).collect(),
            buried: some.iter().map(|&p| patches.buried[p as usize]).collect(),
            stats: Stats::default(),
            block,
        };
        Task { texels: some.iter().map(|p| of(p).0 as u32).collect(), back: of(&some[0]).1, before }
    };
    blocks.into_iter().map(task).collect()
}

/// Those of rows that are not there yet.
fn tasks(texels: &[u32], back: bool) -> Vec<Task> {
    texels.chunks(BLOCK).map(|some| Task { texels: some.to_vec(), back, before: Done::default() }).collect()
}
