//! [`Groups`]: texels between which bounces need not tell apart.
//!
//! What light does within a few texels of where it is reflected is lost in what the next surface receives. So bounces are
//! followed between small squares of texels, and only the last gathers ask every texel (patches and elements of Cohen et
//! al., "An Efficient Radiosity Approach for Realistic Image Synthesis", 1986).

use super::{
    Transport,
    neighbours::Neighbours,
    rows::{BLOCK, Block, DARK, Rows},
};
use glam::UVec2;
use rayon::prelude::*;

/// Edge of the squares, texels. Measured: 2 errs no less, 8 by up to a tenth more.
const EDGE: u32 = 4;
/// Edge of a square over the harmonic mean distance to the surfaces that it sees, above which its texels stay alone: in a slit
/// of less than two texels what these send each other to and fro differs from one to the next. Corners have up to 1.
const NEAR: f32 = 1.5;

/// Patches in groups: squares of a page on one smooth surface that nothing parts; alone are patches without rays to share, and
/// those in slits.
#[derive(Clone, Debug)]
pub struct Groups {
    /// Where each group's patches begin, and their number.
    starts: Vec<u32>,
    /// Patches, group by group.
    patches: Vec<u32>,
    /// The group of each patch.
    of: Vec<u32>,
}

impl Groups {
    /// Of all patches; every one is a receiver.
    pub(super) fn new(neighbours: &Neighbours) -> Self {
        let Neighbours { coverage, transport, .. } = neighbours;
        let strips = (0..coverage.sizes.len())
            .flat_map(|page| (0..coverage.sizes[page].y.div_ceil(EDGE)).map(move |y| (page, y)));
        let strips: Vec<(usize, u32)> = strips.collect();
        let strip = |&(page, y): &(usize, u32)| {
            let squares = (0..coverage.sizes[page].x.div_ceil(EDGE)).map(|x| UVec2::new(x, y) * EDGE);
            squares.flat_map(|first| divide(neighbours, page, first)).collect()
        };
        let found: Vec<Vec<Vec<u32>>> = strips.par_iter().map(strip).collect();
        let mut groups = Groups { starts: vec![0], patches: Vec::new(), of: vec![u32::MAX; transport.patches] };
        found.into_iter().flatten().for_each(|members| groups.push(&members));
        for patch in 0..transport.patches as u32 {
            if groups.of[patch as usize] == u32::MAX {
                groups.push(&[patch]);
            }
        }
        groups
    }

    fn push(&mut self, members: &[u32]) {
        members.iter().for_each(|&p| self.of[p as usize] = self.len() as u32);
        self.patches.extend_from_slice(members);
        self.starts.push(self.patches.len() as u32);
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The patches of a group.
    pub fn members(&self, group: usize) -> &[u32] {
        &self.patches[self.starts[group] as usize..self.starts[group + 1] as usize]
    }

    /// The value of its group at every patch.
    pub fn spread<T: Copy + Send + Sync>(&self, at_groups: &[T]) -> Vec<T> {
        self.of.par_iter().map(|&group| at_groups[group as usize]).collect()
    }

    /// Rows from groups to groups and the sky, by the rays of all their members: each ray counts the same, so that entries need
    /// no weights, though members may differ in area.
    pub fn rows(&self, transport: &Transport) -> Transport {
        let (patches, n) = (transport.patches as u32, self.len() as u32);
        let groups: Vec<usize> = (0..self.len()).collect();
        let block = |groups: &[usize]| {
            let (mut block, mut columns, mut sky) = (Block::default(), Vec::new(), Vec::new());
            for &group in groups {
                columns.clear();
                sky.clear();
                let mut rays = 0.0;
                for &patch in self.members(group) {
                    let row = transport.rows.row(patch as usize);
                    let [hits, cells] = row.split(patches);
                    columns.extend(hits.columns.iter().map(|&c| self.of[c as usize]));
                    sky.extend(cells.columns.iter().map(|&c| c - patches + n));
                    rays += 1.0 / row.weight;
                }
                columns.append(&mut sky);
                block.push(&columns, columns.len(), 1.0 / rays, &[]);
            }
            block.shrink();
            block
        };
        let blocks = groups.par_chunks(BLOCK).map(block).collect();
        Transport::of(self.len(), (0..n).collect(), Rows::new(blocks))
    }
}

/// The receivers of a square, in groups.
fn divide(neighbours: &Neighbours, page: usize, first: UVec2) -> Vec<Vec<u32>> {
    let mut left = neighbours.receivers(page, first, first + EDGE, 1);
    let mut groups = Vec::new();
    while !left.is_empty() {
        let members = neighbours.around(left[left.len() / 2], &left, EDGE);
        left.retain(|r| !members.contains(r));
        if nearness(neighbours, &members) > NEAR {
            groups.extend(members.into_iter().map(|r| vec![r]));
        } else {
            groups.push(members);
        }
    }
    groups
}

/// The edge of a square over the harmonic mean distance to what its rays have met, and what may send light back.
fn nearness(neighbours: &Neighbours, members: &[u32]) -> f32 {
    let Neighbours { transport, patches, .. } = neighbours;
    let (mut sum, mut rays, mut area) = (0.0, 0.0, 0.0);
    for &r in members {
        let (ends, eye) = (transport.rows.ends(r as usize), &transport.eyes[r as usize]);
        let lit = ends.spots.iter().zip(ends.columns).filter(|(_, column)| **column != DARK);
        sum += lit.map(|(spot, _)| 1.0 / spot.distance(eye.position).max(f32::MIN_POSITIVE)).sum::<f32>();
        rays += ends.spots.len() as f32;
        area += patches.area[transport.receivers[r as usize] as usize];
    }
    area.sqrt() * sum / f32::max(rays, 1.0)
}
