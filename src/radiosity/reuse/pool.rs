//! [`Pool`]: rays of several receivers, weighed for each of them.
//!
//! A place y that receiver k's ray has met stands for receiver i, too, with weight p_i(y) / D(y): p_m(y) = cos_m cos_y /
//! (pi r^2) is the density with which m's rays fall on y, D the sum of the densities of all rays that could have found it
//! (the balance heuristic: Veach and Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering", 1995;
//! for paths of neighbours Bekaert, Sbert and Halton, "Accelerating Path Tracing by Re-Using Paths", 2002). The weights of
//! each receiver are scaled to sum to 1.
//!
//! D takes it that every receiver sees y. One that does not is given the others' rays beside its own, and its weights sum
//! to more than 1; one that sees what the others do not shares its rays with them for nothing, and has less. That tells
//! who has to leave.
//!
//! What is far away is seen alike by all receivers: there ([`far`](super::far)), densities are linear in where they stand.

use super::{
    Column, Gather,
    ends::List,
    far::{Basis, Horizon, Moments},
};
use crate::{
    math::{
        luminance,
        simd::{self, Eight, LANES, Lanes, Level, Task},
    },
    transport::Eye,
};
use glam::{Vec3, Vec4};

/// A receiver whose weights sum to more or less than 1 by this, and by what chance may do, does not see what the others
/// see. By chance: this over the root of its number of rays.
const APART: f32 = 0.02;
const CHANCE: f32 = 0.5;
/// Added to D: a ray that nobody could have found counts for nothing.
pub(super) const NOBODY: f32 = 1e-20;

/// Receivers and all their rays. Filled again and again: [`Pool::collect`] keeps the allocations.
#[derive(Default)]
pub(super) struct Pool {
    members: Vec<Member>,
    /// Their middle.
    center: Vec3,
    /// Rays that ended near, each weighed for every receiver, and far away.
    near: List,
    far: List,
    /// How densely the rays of each member fall on where those near have ended: one row a member.
    densities: Vec<Eight>,
}

/// What a receiver receives by its own rays.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub light: Vec3,
    /// Variance of the luminance; infinite by one ray, which does not tell.
    pub noise: f32,
    pub sums: Sums,
}

/// Sums over rays.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    pub rays: f32,
    /// Of their luminance, and of its squares; the most.
    pub light: f32,
    pub squares: f32,
    pub most: f32,
    /// Of one over their ends' distances from the middle of the pool.
    pub nearness: f32,
}

impl Sums {
    pub fn add(&mut self, o: &Self) {
        self.rays += o.rays;
        self.light += o.light;
        self.squares += o.squares;
        self.most = self.most.max(o.most);
        self.nearness += o.nearness;
    }
}

struct Member {
    eye: Eye,
    own: Own,
}

const ZERO: Eight = Eight([0.0; LANES]);

impl Pool {
    /// Collects the rays of `receivers`, in place of those that were there.
    pub fn collect(&mut self, gather: &Gather, receivers: &[u32]) {
        let transport = gather.neighbours.transport;
        let eyes = || receivers.iter().map(|&r| transport.eyes[r as usize]);
        let count = receivers.len() as f32;
        self.center = eyes().map(|eye| eye.position).sum::<Vec3>() / count;
        let horizon = Horizon::of(eyes(), self.center);
        self.members.clear();
        self.near.clear();
        self.far.clear();
        for (owner, (eye, &receiver)) in eyes().zip(receivers).enumerate() {
            let ends = transport.rows.ends(receiver as usize);
            let mut sum = Vec3::ZERO;
            let mut sums = Sums { rays: ends.columns.len() as f32, ..Sums::default() };
            for (&column, &spot) in ends.columns.iter().zip(ends.spots) {
                // The sky, and what has no patch, faces whoever sees it.
                let facing = || (eye.position - spot).normalize_or_zero();
                let Column { radiosity, normal, .. } = gather.met(&eye, column, spot);
                let normal = if normal == Vec3::ZERO { facing() } else { normal };
                let light = luminance(radiosity);
                let way = spot - self.center;
                let distance = way.length();
                sum += radiosity;
                sums.light += light;
                sums.squares += light * light;
                sums.most = sums.most.max(light);
                sums.nearness += 1.0 / distance.max(f32::MIN_POSITIVE);
                let is_far = horizon.is_far(way, distance, normal);
                let ends = if is_far { &mut self.far } else { &mut self.near };
                ends.push(owner as u32, spot, normal, radiosity);
            }
            let rays = sums.rays;
            let light = sum / rays.max(1.0);
            let noise = (sums.squares - rays * luminance(light).powi(2)).max(0.0) / (rays * (rays - 1.0));
            let noise = if rays < 2.0 { f32::INFINITY } else { noise };
            self.members.push(Member { eye, own: Own { light, noise, sums } });
        }
    }

    /// What each receiver receives by its own rays.
    pub fn own(&self) -> impl Iterator<Item = Own> {
        self.members.iter().map(|m| m.own)
    }

    /// Of each receiver what it receives by the rays of all; `None` if it sees something else.
    pub fn shared(&mut self, level: Level) -> Vec<Option<Vec3>> {
        simd::run(level, Share(self))
    }
}

struct Share<'p>(&'p mut Pool);

/// In plain loops: closures handed to iterators would not be compiled for the instruction set.
impl Task for Share<'_> {
    type Output = Vec<Option<Vec3>>;

    #[inline(always)]
    fn run<S: Lanes>(self) -> Self::Output {
        let Pool { members, center, near, far, densities, .. } = self.0;
        let near = near.eights();
        densities.clear();
        densities.reserve_exact(members.len() * near.len());
        densities.resize(members.len() * near.len(), ZERO);
        for (member, row) in members.iter().zip(densities.chunks_exact_mut(near.len().max(1))) {
            for (end, density) in near.iter().zip(row) {
                *density = end.density::<S>(&member.eye, member.own.sums.rays).store();
            }
        }
        let mut bases = Vec::with_capacity(members.len());
        for member in members.iter() {
            bases.push(Basis::of(&member.eye, member.own.sums.rays, *center));
        }
        let mut shares = vec![true; members.len()];
        let mut inverse = vec![ZERO; near.len()];
        loop {
            for (k, end) in near.iter().enumerate() {
                let mut sum = S::splat(NOBODY);
                for (row, &shares) in densities.chunks_exact(near.len()).zip(&shares) {
                    if shares {
                        sum = sum.add(S::load(&row[k]));
                    }
                }
                inverse[k] = S::load(&end.rays(&shares)).div(sum).store();
            }
            let moments = Moments::of::<S>(far, &shares, &bases, *center);
            let mut received = vec![None; members.len()];
            let mut left = false;
            for (m, member) in members.iter().enumerate() {
                if !shares[m] {
                    continue;
                }
                let mut sums = [S::splat(0.0); 4];
                for ((density, inverse), end) in densities[m * near.len()..].iter().zip(&inverse).zip(near) {
                    let weight = S::load(density).mul(S::load(inverse));
                    let [r, g, b] = &end.radiosity;
                    sums[0] = sums[0].add(weight.mul(S::load(r)));
                    sums[1] = sums[1].add(weight.mul(S::load(g)));
                    sums[2] = sums[2].add(weight.mul(S::load(b)));
                    sums[3] = sums[3].add(weight);
                }
                let sum = Vec4::from(sums.map(total)) + moments.at(&bases[m]);
                let weight = sum.w;
                if weight > 0.0 {
                    received[m] = Some(sum.truncate() / weight);
                }
                if (weight / member.own.sums.rays - 1.0).abs() > APART + CHANCE / member.own.sums.rays.sqrt() {
                    shares[m] = false;
                    left = true;
                }
            }
            if !left {
                return received;
            }
        }
    }
}

/// Of all lanes.
#[inline(always)]
pub(super) fn total<S: Lanes>(x: S) -> f32 {
    x.store().0.iter().sum()
}
