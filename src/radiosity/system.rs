//! [`System`]: the fixed-point map, its contraction, and what comes of its solution.

use super::channels::add;
use crate::{direct::Direct, math::luminance, patches::Patches, transport::Transport};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// I -> F (M + rho (D + P I) - S) + B for given light and reflectance: of the first bounce, F rho D, the part S of the
/// exitance rho D arrives as the sampled irradiance B ([`Bounce`](crate::direct::Bounce)) instead.
///
/// In double precision: beside a lamp a thousand times brighter than the dark half, single precision ends before the
/// error that is allowed, and near reflectance 1 it is amplified ten thousandfold.
pub struct System<'t> {
    pub(super) transport: &'t Transport,
    /// M of each patch, then the exitance of each cell of the sky.
    pub(super) emission: Vec<Vec3>,
    pub(super) reflectance: Cow<'t, [Vec3]>,
    /// Of the open part of each patch, which alone sends light on.
    pub(super) area: Vec<f64>,
    /// S of each patch; empty: none.
    pub(super) sampled: &'t [Vec3],
    /// B of each receiver; empty: none.
    pub(super) extra: Vec<Vec3>,
    pub(super) direct: Vec<Vec3>,
}

/// Terms of the Neumann series that sharpen the bound on the inverse.
const TERMS: usize = 4;

/// Held for each unknown while they are made: the powers, and their sum.
pub(super) const BYTES: u64 = ((TERMS + 2) * size_of::<DVec3>()) as u64;

/// What is known of a system before it is solved.
pub struct Amplification {
    /// Bound on the row sums of the inverse of I - K.
    pub inverse: f64,
    /// Bound on the spectral radius of K, below 1.
    pub contraction: f64,
    /// 1, K 1, K K 1 and so on, by channel: what solvers can use of it.
    pub(super) powers: Vec<Vec<DVec3>>,
    /// Matrix entries touched.
    pub entries: u64,
}

impl<'t> System<'t> {
    /// `sky`: exitance of the sky's cells; `gathered`: rows carry the exitance of surfaces.
    pub fn new(
        transport: &'t Transport,
        patches: &'t Patches,
        direct: &'t Direct,
        sky: &[Vec3],
        gathered: bool,
    ) -> Self {
        let exitance = |i: usize| if gathered { patches.exitance[i] } else { Vec3::ZERO };
        let extra = transport.receivers.iter().filter_map(|&i| direct.bounce.irradiance.get(i as usize));
        System {
            transport,
            emission: (0..patches.len()).map(exitance).chain(sky.iter().copied()).collect(),
            reflectance: Cow::Borrowed(&patches.reflectance),
            area: patches.area.iter().zip(&patches.validity).map(|(a, open)| f64::from(a * open)).collect(),
            sampled: &direct.bounce.exitance,
            extra: extra.copied().collect(),
            direct: (0..patches.len()).into_par_iter().map(|i| direct.total(i)).collect(),
        }
    }

    /// Number of unknowns: one rgb irradiance a receiver.
    pub fn unknowns(&self) -> usize {
        self.transport.receivers.len()
    }

    /// Stored matrix entries.
    pub fn entries(&self) -> u64 {
        self.transport.rows.entries()
    }

    /// M of each patch as rows carry it, then the exitance of each cell of the sky.
    pub fn emission(&self) -> &[Vec3] {
        &self.emission
    }

    /// What rows see of light that has not been reflected yet, F M; returns the matrix entries touched.
    pub fn emitted(&self, out: &mut [DVec3]) -> u64 {
        self.transport.rows.map_into(out, |row| row.sum(|c| self.emission[c as usize].as_dvec3()));
        self.entries()
    }

    /// Applies the map; returns the matrix entries touched.
    pub fn map(&self, x: &[DVec3], out: &mut [DVec3]) -> u64 {
        let radiosity = self.radiosity(x);
        self.transport.rows.map_into(out, |row| row.sum(|c| radiosity[c as usize]));
        out.par_iter_mut().zip(&self.extra).for_each(|(out, extra)| *out += extra.as_dvec3());
        self.entries()
    }

    /// One receiver of the map, where columns have this radiosity.
    pub(super) fn gathered(&self, receiver: usize, radiosity: &[DVec3]) -> DVec3 {
        let extra = self.extra.get(receiver).map_or(DVec3::ZERO, |e| e.as_dvec3());
        self.transport.rows.row(receiver).sum(|c| radiosity[c as usize]) + extra
    }

    /// K x, the map without its light.
    pub(super) fn scatter(&self, x: &[DVec3], out: &mut [DVec3]) {
        let sent = self.sent(x);
        self.transport.rows.map_into(out, |row| row.sum(|c| sent[c as usize]));
    }

    /// What every column reflects of it.
    fn sent(&self, x: &[DVec3]) -> Vec<DVec3> {
        let mut sent = vec![DVec3::ZERO; self.reflectance.len()];
        self.transport.interpolate(x, &mut sent);
        sent.par_iter_mut().zip(&self.reflectance[..]).for_each(|(s, rho)| *s *= rho.as_dvec3());
        // The sky reflects nothing.
        sent.resize(self.emission.len(), DVec3::ZERO);
        sent
    }

    /// Makes `powers` nothing where light never comes that begins at the receivers where `first` is not 0, by channel: an
    /// ambient estimate must not shine into sealed rooms. Returns the matrix entries touched.
    pub(super) fn where_lit(&self, powers: &mut [Vec<DVec3>], first: &[DVec3]) -> u64 {
        let some = |v: DVec3| DVec3::select(v.cmpne(DVec3::ZERO), DVec3::ONE, DVec3::ZERO);
        let mut lit: Vec<DVec3> = first.iter().map(|v| some(*v)).collect();
        let mut dark: Vec<usize> = (0..lit.len()).filter(|&i| lit[i] != DVec3::ONE).collect();
        let mut touched = 0;
        loop {
            let sent = self.sent(&lit);
            let row = |&i: &usize| self.transport.rows.row(i);
            let found: Vec<DVec3> =
                dark.par_iter().map(|i| some(row(i).sum(|c| sent[c as usize])).max(lit[*i])).collect();
            touched += dark.iter().map(|i| row(i).columns.len() as u64).sum::<u64>();
            let same = dark.iter().zip(&found).all(|(i, found)| lit[*i] == *found);
            dark.iter().zip(found).for_each(|(i, found)| lit[*i] = found);
            dark.retain(|&i| lit[i] != DVec3::ONE);
            if same {
                break;
            }
        }
        powers.iter_mut().for_each(|power| power.iter_mut().zip(&lit).for_each(|(p, lit)| *p *= *lit));
        touched
    }

    /// Power (W) that patch `p` reflects of an irradiance of 1.
    pub(super) fn power(&self, p: usize) -> DVec3 {
        self.reflectance[p].as_dvec3() * self.area[p]
    }

    /// What rows carry of the radiosity of every column: M + rho (D + P I) - S of patches, then the sky's exitance.
    pub fn radiosity(&self, x: &[DVec3]) -> Vec<DVec3> {
        let n = self.reflectance.len();
        let mut radiosity = vec![DVec3::ZERO; n];
        radiosity.reserve_exact(self.emission.len() - n);
        self.transport.interpolate(x, &mut radiosity);
        radiosity.par_iter_mut().enumerate().for_each(|(i, b)| {
            let [emission, reflectance, direct] = [self.emission[i], self.reflectance[i], self.direct[i]];
            *b = emission.as_dvec3() + reflectance.as_dvec3() * (direct.as_dvec3() + *b);
        });
        radiosity.par_iter_mut().zip(self.sampled).for_each(|(b, sampled)| *b -= sampled.as_dvec3());
        radiosity.extend(self.emission[n..].iter().map(|cell| cell.as_dvec3()));
        radiosity
    }

    /// How much larger than its residual an error may be.
    ///
    /// With K = F rho P and K^m 1 <= q < 1, the inverse's row sums are at most (1 + K 1 + ... + K^(m-1) 1) / (1 - q):
    /// one bright texel among dark ones does not spoil it, as it would 1 / (1 - max rho).
    pub fn amplification(&self) -> Amplification {
        let most = |v: &[DVec3]| v.iter().copied().fold(DVec3::ZERO, DVec3::max);
        let mut powers = vec![vec![DVec3::ONE; self.unknowns()]];
        let mut sum = powers[0].clone();
        let (mut inverse, mut contraction) = (DVec3::INFINITY, 1f64);
        for term in 1..=TERMS {
            let mut power = vec![DVec3::ZERO; self.unknowns()];
            self.scatter(&powers[term - 1], &mut power);
            let q = most(&power);
            // The spectral radius is at most the m-th root of |K^m|; rounding up keeps it a bound.
            let root = libm::pow(q.max_element(), 1.0 / term as f64) * (1.0 + 1e-9);
            contraction = contraction.min(root).min(1.0 - 1e-9);
            let bound = DVec3::select(q.cmplt(DVec3::ONE), most(&sum) / (1.0 - q), DVec3::INFINITY);
            inverse = inverse.min(bound);
            add(&mut sum, DVec3::ONE, &power);
            powers.push(power);
        }
        Amplification { inverse: inverse.max_element(), contraction, powers, entries: TERMS as u64 * self.entries() }
    }

    /// Irradiance of the patches for the solution `x`: at least 0, where an iterate overshoots.
    pub fn at_patches(&self, x: &[DVec3]) -> Vec<Vec3> {
        let mut out = vec![DVec3::ZERO; self.reflectance.len()];
        self.transport.interpolate(x, &mut out);
        out.par_iter().map(|v| v.max(DVec3::ZERO).as_vec3()).collect()
    }

    /// Mean luminance of the darker half of the patches' irradiance, or a hundredth of the mean of all, if larger: a black
    /// half would ask for the impossible.
    pub fn dark_mean(&self, x: &[DVec3]) -> f64 {
        let indirect = self.at_patches(x);
        let mut all: Vec<f32> = indirect.iter().zip(&self.direct).map(|(i, d)| luminance(*i + *d)).collect();
        if all.is_empty() {
            return 0.0;
        }
        let half = all.len().div_ceil(2);
        all.select_nth_unstable_by(half - 1, f32::total_cmp);
        let mean = |v: &[f32]| v.iter().map(|&e| f64::from(e)).sum::<f64>() / v.len() as f64;
        mean(&all[..half]).max(1e-2 * mean(&all))
    }
}
