//! [`System`]: the fixed-point map, its contraction, and what comes of its solution.

use crate::{direct::Direct, math::luminance, patches::Patches, transport::Transport};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// I -> F (M + rho (D + P I)) for given light and reflectance; rgb in one lane each. Of F rho D, what direct light has
/// sampled ([`Bounce`](crate::direct::Bounce)) is not taken from the rows.
pub struct System<'t> {
    transport: &'t Transport,
    /// M + rho D of each patch, less what is sampled of it, then the exitance of each cell of the sky.
    source: Vec<Vec4>,
    reflectance: Vec<Vec4>,
    /// Sampled light of the first bounce at each receiver; empty: none.
    bounce: Vec<Vec4>,
    direct: Vec<Vec3>,
}

/// Terms of the Neumann series that sharpen the bound on the inverse.
const TERMS: usize = 4;

impl<'t> System<'t> {
    /// `sky`: exitance of the sky's cells; `gathered`: rows carry the exitance of surfaces.
    pub fn new(transport: &'t Transport, patches: &Patches, direct: &Direct, sky: &[Vec3], gathered: bool) -> Self {
        let sampled = |i: usize| direct.bounce.exitance.get(i).copied().unwrap_or_default();
        let bounce = transport.receivers.iter().filter_map(|&i| direct.bounce.irradiance.get(i as usize));
        let irradiance: Vec<Vec3> = (0..patches.len()).map(|i| direct.total(i)).collect();
        let exitance = |i: usize| if gathered { patches.exitance[i] } else { Vec3::ZERO };
        let source = (0..patches.len()).map(|i| exitance(i) + patches.reflectance[i] * irradiance[i] - sampled(i));
        System {
            transport,
            source: source.chain(sky.iter().copied()).map(|v| v.extend(0.0)).collect(),
            reflectance: patches.reflectance.iter().map(|r| r.extend(0.0)).collect(),
            bounce: bounce.map(|v| v.extend(0.0)).collect(),
            direct: irradiance,
        }
    }

    /// Number of unknowns: one rgb irradiance a receiver.
    pub fn unknowns(&self) -> usize {
        self.transport.receivers.len()
    }

    /// Applies the map; returns the matrix entries touched.
    pub fn map(&self, x: &[Vec4], out: &mut [Vec4]) -> u64 {
        let n = self.reflectance.len();
        let mut radiosity = self.source.clone();
        self.transport.interpolate(x, &mut radiosity[..n]);
        radiosity[..n]
            .par_iter_mut()
            .zip(&self.source)
            .zip(&self.reflectance)
            .for_each(|((b, source), reflectance)| *b = *source + *reflectance * *b);
        self.transport.rows.map_into(out, |row| row.sum(|c| radiosity[c as usize]));
        out.par_iter_mut().zip(&self.bounce).for_each(|(out, b)| *out += *b);
        self.transport.rows.entries()
    }

    /// Bound on the row sums of the inverse, bound on the spectral radius, and matrix entries touched.
    ///
    /// With K = F rho P and K^m 1 <= q < 1, the inverse's row sums are at most (1 + K 1 + ... + K^(m-1) 1) / (1 - q):
    /// one bright texel among dark ones does not spoil it, as it would 1 / (1 - max rho).
    pub fn amplification(&self) -> (f64, f32, u64) {
        let n = self.reflectance.len();
        let brightest: Vec<f32> = self.reflectance.iter().map(|r| r.max_element()).collect();
        let mut power = vec![Vec4::ONE; self.unknowns()];
        let mut sum = vec![1f64; self.unknowns()];
        let (mut best, mut contraction) = (f64::INFINITY, 1f32);
        for term in 1..=TERMS {
            let mut reflected = vec![Vec4::ZERO; n];
            self.transport.interpolate(&power, &mut reflected);
            reflected.iter_mut().zip(&brightest).for_each(|(r, b)| *r *= *b);
            self.transport
                .rows
                .map_into(&mut power, |row| row.sum(|c| reflected.get(c as usize).copied().unwrap_or(Vec4::ZERO)));
            let q = power.iter().map(|p| p.x).fold(0f32, f32::max);
            // The spectral radius is at most the m-th root of |K^m|; rounding up keeps it a bound.
            contraction = contraction.min(libm::powf(q, 1.0 / term as f32) * (1.0 + 1e-6)).min(0.999_999);
            let largest = sum.iter().copied().fold(0.0, f64::max);
            best = best.min(largest / (1.0 - f64::from(q)).max(1e-9));
            sum.iter_mut().zip(&power).for_each(|(s, p)| *s += f64::from(p.x));
        }
        (best, contraction, TERMS as u64 * self.transport.rows.entries())
    }

    /// Irradiance of the patches for the solution `x`.
    pub fn at_patches(&self, x: &[Vec4]) -> Vec<Vec3> {
        let mut out = vec![Vec4::ZERO; self.reflectance.len()];
        self.transport.interpolate(x, &mut out);
        out.iter().map(|v| v.truncate()).collect()
    }

    /// Mean luminance of the darker half of the patches' irradiance, or a hundredth of the mean of all, if larger: a black
    /// half would ask for more than single precision can give.
    pub fn dark_mean(&self, x: &[Vec4]) -> f64 {
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
