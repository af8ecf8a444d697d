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

use super::Gather;
use crate::{
    math::{
        luminance,
        simd::{self, Eight, LANES, Lanes, Level, Task},
    },
    transport::{DARK, Eye},
};
use glam::Vec3;

/// A receiver whose weights sum to more or less than 1 by this, and by what chance may do, does not see what the others
/// see. By chance: this over the root of its number of rays.
const APART: f32 = 0.02;
const CHANCE: f32 = 0.5;
/// Added to D: a ray that nobody could have found counts for nothing.
const NOBODY: f32 = 1e-20;

/// Receivers and all their rays.
pub(super) struct Pool {
    members: Vec<Member>,
    ends: Vec<Ends>,
}

struct Member {
    eye: Eye,
    /// Its rays that count.
    rays: f32,
    /// Where its part of the ends begins and ends.
    begin: usize,
    end: usize,
}

/// Where eight rays of one receiver ended.
struct Ends {
    spot: [Eight; 3],
    normal: [Eight; 3],
    radiosity: [Eight; 3],
    /// 1, or 0 in lanes without a ray.
    ray: Eight,
}

const ZERO: Eight = Eight([0.0; LANES]);

impl Pool {
    /// Collects the rays of `receivers`.
    pub fn new(gather: &Gather, receivers: &[u32]) -> Self {
        let eights = |&r: &u32| gather.neighbours.transport.rows.ends(r as usize).columns.len().div_ceil(LANES);
        let ends = Vec::with_capacity(receivers.iter().map(eights).sum());
        let mut pool = Pool { members: Vec::with_capacity(receivers.len()), ends };
        for &receiver in receivers {
            let eye = gather.neighbours.transport.eyes[receiver as usize];
            let ends = gather.neighbours.transport.rows.ends(receiver as usize);
            let begin = pool.ends.len();
            let eights = ends.columns.chunks(LANES).zip(ends.spots.chunks(LANES));
            pool.ends.extend(eights.map(|(columns, spots)| Ends::new(gather, &eye, columns, spots)));
            pool.members.push(Member { eye, rays: ends.columns.len() as f32, begin, end: pool.ends.len() });
        }
        pool
    }

    /// Of each receiver the variance of the luminance that it receives by its own rays; infinite by one, which does not tell.
    pub fn noise(&self) -> Vec<f32> {
        let of = |m: &Member| {
            if m.rays < 2.0 {
                return f32::INFINITY;
            }
            let (mut sum, mut squares) = (0.0, 0.0);
            for end in &self.ends[m.begin..m.end] {
                for lane in 0..LANES {
                    // Nothing in lanes without a ray.
                    let light = luminance(Vec3::from(end.radiosity.map(|channel| channel.0[lane])));
                    sum += light;
                    squares += light * light;
                }
            }
            (squares - sum * sum / m.rays).max(0.0) / (m.rays * (m.rays - 1.0))
        };
        self.members.iter().map(of).collect()
    }

    /// Of each receiver what it receives by the rays of all; `None` if it sees something else.
    pub fn shared(&self, level: Level) -> Vec<Option<Vec3>> {
        simd::run(level, Share(self))
    }
}

impl Ends {
    fn new(gather: &Gather, eye: &Eye, columns: &[u32], spots: &[Vec3]) -> Self {
        let mut ends = Ends { spot: [ZERO; 3], normal: [ZERO; 3], radiosity: [ZERO; 3], ray: ZERO };
        for (lane, (&column, &spot)) in columns.iter().zip(spots).enumerate() {
            // The sky, and what has no patch, faces whoever sees it.
            let facing = || (eye.position - spot).normalize_or_zero();
            let normal = gather.neighbours.patches.normal.get(column as usize).copied().unwrap_or_else(facing);
            let radiosity = if column == DARK { Vec3::ZERO } else { gather.radiosity[column as usize] };
            for axis in 0..3 {
                ends.spot[axis].0[lane] = spot[axis];
                ends.normal[axis].0[lane] = normal[axis];
                ends.radiosity[axis].0[lane] = radiosity[axis];
            }
            ends.ray.0[lane] = 1.0;
        }
        ends
    }

    /// How densely the member's rays fall on each spot, times pi.
    #[inline(always)]
    fn density<S: Lanes>(&self, m: &Member) -> S {
        let Eye { position, normal } = m.eye;
        let ([x, y, z], [i, j, k]) = (&self.spot, &self.normal);
        let x = S::load(x).sub(S::splat(position.x));
        let y = S::load(y).sub(S::splat(position.y));
        let z = S::load(z).sub(S::splat(position.z));
        let squared = x.mul(x).add(y.mul(y)).add(z.mul(z));
        let here = x.mul(S::splat(normal.x)).add(y.mul(S::splat(normal.y))).add(z.mul(S::splat(normal.z)));
        let there = x.mul(S::load(i)).add(y.mul(S::load(j))).add(z.mul(S::load(k)));
        let zero = S::splat(0.0);
        let cosines = here.max(zero).mul(zero.sub(there).max(zero));
        // A spot at the receiver itself lies in no direction.
        cosines.mul(S::splat(m.rays)).div(squared.mul(squared).max(S::splat(f32::MIN_POSITIVE)))
    }
}

struct Share<'p>(&'p Pool);

/// In plain loops: closures handed to iterators would not be compiled for the instruction set.
impl Task for Share<'_> {
    type Output = Vec<Option<Vec3>>;

    #[inline(always)]
    fn run<S: Lanes>(self) -> Self::Output {
        let Pool { members, ends } = self.0;
        // One row of densities a member.
        let mut densities = vec![ZERO; members.len() * ends.len()];
        for (member, row) in members.iter().zip(densities.chunks_exact_mut(ends.len().max(1))) {
            for (end, density) in ends.iter().zip(row) {
                *density = end.density::<S>(member).store();
            }
        }
        let mut shares = vec![true; members.len()];
        let mut inverse = vec![ZERO; ends.len()];
        loop {
            for (member, &shares_own) in members.iter().zip(&shares) {
                for k in member.begin..member.end {
                    let mut sum = S::splat(NOBODY);
                    for (row, &shares) in densities.chunks_exact(ends.len()).zip(&shares) {
                        if shares {
                            sum = sum.add(S::load(&row[k]));
                        }
                    }
                    inverse[k] = if shares_own { S::load(&ends[k].ray).div(sum).store() } else { ZERO };
                }
            }
            let mut received = Vec::with_capacity(members.len());
            let mut left = false;
            for ((member, row), shares) in members.iter().zip(densities.chunks_exact(ends.len())).zip(&mut shares) {
                let mut sums = [S::splat(0.0); 4];
                for ((density, inverse), end) in row.iter().zip(&inverse).zip(ends) {
                    let weight = S::load(density).mul(S::load(inverse));
                    let [r, g, b] = &end.radiosity;
                    sums[0] = sums[0].add(weight.mul(S::load(r)));
                    sums[1] = sums[1].add(weight.mul(S::load(g)));
                    sums[2] = sums[2].add(weight.mul(S::load(b)));
                    sums[3] = sums[3].add(weight);
                }
                let weight = total(sums[3]);
                let sum = Vec3::new(total(sums[0]), total(sums[1]), total(sums[2]));
                received.push(if *shares && weight > 0.0 { Some(sum / weight) } else { None });
                if *shares && (weight / member.rays - 1.0).abs() > APART + CHANCE / member.rays.sqrt() {
                    *shares = false;
                    left = true;
                }
            }
            if !left {
                return received;
            }
        }
    }
}

#[inline(always)]
fn total<S: Lanes>(x: S) -> f32 {
    x.store().0.iter().sum()
}
