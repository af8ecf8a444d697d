//! Two independent halves of what paths find at a texel.

use super::{
    Options, Subject,
    path::{Bundle, Lights, PARTS, Sum, net},
    surface::{Footprint, Place},
};
use crate::math::hash;
use glam::DVec3;

/// Places of either half of a point.
pub(super) const PLACES: u32 = 32;
/// Share of the rays from an enclosed place that may meet fronts, if all backs that they meet are dark.
const FRONTS: f64 = 0.125;

/// Both halves of a point: open places, and what the parts of their paths found.
pub(super) struct Halves {
    pub open: [Vec<(Place, [DVec3; PARTS])>; 2],
    places: usize,
    pub rays: u64,
}

impl Halves {
    pub fn walk(
        subject: &Subject,
        lights: &Lights,
        texel: usize,
        options: &Options,
        seed: u32,
        bundle: &mut Bundle,
    ) -> Self {
        let (world, footprint) = (&subject.tracer.world, Footprint::new(subject.coverage, texel));
        let each = options.paths_a_place();
        let mut halves = Halves { open: Default::default(), places: 0, rays: 0 };
        for half in 0..2 {
            let seed = hash(seed, half);
            let on_surface = |k| footprint.at(net(k, 5, seed)).map(|(t, bary)| Place::on(world, t, bary, true));
            let places: Vec<Place> = (0..PLACES).filter_map(on_surface).collect();
            let mut sums = vec![Sum::default(); places.len() * PARTS];
            halves.rays += bundle.walk(subject, lights, &places, each as usize, seed, &mut sums);
            halves.places += places.len();
            let found = places.iter().zip(sums.chunks(PARTS)).filter(|(_, sums)| is_open(sums, each));
            let each = f64::from(each) / PARTS as f64;
            halves.open[half as usize] =
                found.map(|(p, sums)| (*p, std::array::from_fn(|i| sums[i].irradiance / each))).collect();
        }
        halves
    }

    pub fn enclosed(&self) -> f64 {
        1.0 - (self.open[0].len() + self.open[1].len()) as f64 / self.places.max(1) as f64
    }

    /// Mean over the open places of either half.
    pub fn irradiance(&self) -> [DVec3; 2] {
        [0, 1].map(|half| {
            let open = &self.open[half];
            let sum: DVec3 = open.iter().map(|(_, parts)| parts.iter().sum::<DVec3>()).sum();
            sum / (open.len() * PARTS).max(1) as f64
        })
    }
}

/// True if `rays` rays from a place saw more than an enclosed one does.
fn is_open(sums: &[Sum], rays: u32) -> bool {
    let all = |of: fn(&Sum) -> u32| sums.iter().map(of).sum::<u32>();
    let most = if all(|s| s.sheets) > 0 { 0.0 } else { FRONTS * f64::from(rays) };
    all(|s| s.out) > 0 || f64::from(all(|s| s.fronts)) > most
}
