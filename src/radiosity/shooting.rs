//! Shooting (Southwell's relaxation; progressive refinement of Cohen, Chen, Wallace and Greenberg, 1988): what has been
//! received and not yet sent on, the residual, is sent on by those who have most. Their ambient estimate of what is still
//! under way goes first: each receiver's share of the same light everywhere, as much as leaves no power unshot on the
//! whole. In order, so on one thread; takes the rows by column, which is as large as the rows.

use super::{
    Method, System,
    channels::{add, difference, dot},
    columns::{Columns, Readers},
};
use glam::DVec3;

pub(super) struct Shooting {
    /// 1, K 1, K K 1 and so on.
    powers: Vec<Vec<DVec3>>,
    ground: Option<Ground>,
}

struct Ground {
    columns: Columns,
    readers: Readers,
    /// Power (W) that leaves patches for an irradiance of 1 at each receiver.
    power: Vec<DVec3>,
    /// What each receiver sees of an irradiance of 1 everywhere, K 1.
    ambient: Vec<DVec3>,
    /// What is lost of that when it is sent on once, K 1 - K K 1.
    lost: Vec<DVec3>,
}

impl Ground {
    fn new(system: &System, powers: Vec<Vec<DVec3>>) -> Self {
        let readers = Readers::new(system);
        let mut power = vec![DVec3::ZERO; system.unknowns()];
        for (i, power) in power.iter_mut().enumerate() {
            readers.each(i, |p, weight| *power += system.power(p) * weight);
        }
        let columns = Columns::new(&system.transport.rows, system.reflectance.len());
        let (ambient, lost) = (powers[1].clone(), difference(&powers[1], &powers[2]));
        Ground { columns, readers, power, ambient, lost }
    }

    /// Adds the ambient estimate to `x`, by channel, where that makes what is unshot smaller.
    fn estimate(&self, x: &mut [DVec3], unshot: &mut [DVec3]) {
        let (all, lost) = (dot(&self.power, unshot), dot(&self.power, &self.lost));
        let estimate = DVec3::select(lost.cmpgt(DVec3::ZERO), all / lost, DVec3::ZERO);
        let square = |left: &[DVec3]| (0..x.len()).map(|i| self.power[i] * left[i] * left[i]).sum::<DVec3>();
        let mut left = unshot.to_vec();
        add(&mut left, -estimate, &self.lost);
        let [before, after] = [square(unshot), square(&left)];
        let estimate = DVec3::select(after.cmplt(before), estimate, DVec3::ZERO);
        add(x, estimate, &self.ambient);
        add(unshot, -estimate, &self.lost);
    }

    /// Sends on what receiver `i` has not; the entries touched.
    fn shoot(&self, system: &System, i: usize, unshot: &mut [DVec3]) -> u64 {
        let (light, mut touched) = (std::mem::take(&mut unshot[i]), 0);
        self.readers.each(i, |p, weight| {
            let sent = system.reflectance[p].as_dvec3() * light * weight;
            let column = self.columns.column(p);
            touched += column.len() as u64;
            column.for_each(|(to, share)| unshot[to] += sent * share);
        });
        touched
    }
}

impl Shooting {
    pub fn new(powers: Vec<Vec<DVec3>>) -> Self {
        Shooting { powers, ground: None }
    }
}

impl Method for Shooting {
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        let (powers, mut touched) = (&mut self.powers, 0);
        let ground = self.ground.get_or_insert_with(|| {
            // By column: every entry twice.
            touched = 2 * system.entries() + system.where_lit(powers, mapped);
            Ground::new(system, std::mem::take(powers))
        });
        let mut unshot = difference(mapped, x);
        ground.estimate(x, &mut unshot);
        let power = |i: usize, unshot: &[DVec3]| (ground.power[i] * unshot[i]).abs().max_element();
        let until = touched + system.entries();
        while touched < until {
            let most = (0..x.len()).map(|i| power(i, &unshot)).fold(0.0, f64::max);
            if most == 0.0 {
                break;
            }
            // Who has most, and all that have nearly as much: looking for them costs a pass over the receivers.
            for i in 0..x.len() {
                if power(i, &unshot) >= 0.5 * most {
                    x[i] += unshot[i];
                    touched += ground.shoot(system, i, &mut unshot);
                }
            }
        }
        // The rest is kept where it arrived, too: black receivers have nothing to send, and are never chosen.
        add(x, DVec3::ONE, &unshot);
        Some(touched)
    }
}
