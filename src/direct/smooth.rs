//! Penumbrae from few rays: a texel in a soft shadow reads a surface fitted to its neighbours' samples.
//!
//! Light in a penumbra is smooth, its samples are noisy, each texel's own. A polynomial of second order fitted to a window
//! of texels keeps a fifth of the noise's variance at the middle (Savitzky and Golay, 1964), and follows a curve, which one
//! of first order would flatten by as much as the noise hides. What the fit leaves tells whether it may: more than the
//! noise of the samples is an edge, and the texel keeps its own.

use super::received::Received;
use crate::{
    atlas::Coverage,
    math::luminance,
    patches::{Patches, continues},
};
use glam::{IVec2, Vec3};
use rayon::prelude::*;

/// Texels from the middle of a window to its edge.
const REACH: i32 = 2;
/// Texels from which a fit is trusted.
const ENOUGH: usize = 12;
/// Polynomials up to second order.
const ORDER: usize = 6;

/// Fits those of some patches whose own samples disagree.
pub(super) fn smooth(coverage: &Coverage, patches: &Patches, which: &[u32], received: &mut [Received]) {
    let fitted: Vec<_> = which.par_iter().map(|&i| (i, fit(coverage, patches, received, i as usize))).collect();
    fitted.into_iter().filter_map(|(i, r)| Some((i, r?))).for_each(|(i, r)| received[i as usize] = r);
}

fn fit(coverage: &Coverage, patches: &Patches, received: &[Received], patch: usize) -> Option<Received> {
    if patch >= patches.fronts || received[patch].variance == 0.0 {
        return None;
    }
    let window = Window::around(coverage, patches, patch);
    let n = window.texels.len();
    if n < ENOUGH {
        return None;
    }
    let of = |t: u32| &received[t as usize];
    let values: Vec<f32> = window.texels.iter().map(|&t| luminance(of(t).total())).collect();
    let noise = window.texels.iter().map(|&t| of(t).variance).sum::<f32>() / n as f32;
    let parts: Vec<f32> = window.basis.iter().map(|phi| phi.iter().zip(&values).map(|(p, v)| p * v).sum()).collect();
    let all: f32 = values.iter().map(|v| v * v).sum();
    let explained: f32 = parts.iter().map(|c| c * c).sum();
    if (all - explained).max(0.0) / (n - ORDER) as f32 > noise {
        return None;
    }
    let weight = |m: usize| window.basis.iter().map(|phi| phi[m] * phi[window.middle]).sum::<f32>();
    let weights: Vec<f32> = (0..n).map(weight).collect();
    let own = received[patch];
    let zero = own.zip(&own, |_, _| Vec3::ZERO);
    let add = |sum: Received, (&t, &weight): (&u32, &f32)| sum.zip(of(t), |sum, light| sum + light * weight);
    let sum = window.texels.iter().zip(&weights).fold(zero, add);
    let variance = noise * weights.iter().map(|w| w * w).sum::<f32>();
    Some(Received { variance, ..sum.zip(&zero, Vec3::max) })
}

/// A texel and those around it on the same smooth surface, with orthonormal polynomials over them.
struct Window {
    texels: Vec<u32>,
    /// Which of them is the texel.
    middle: usize,
    /// Of each polynomial the value at every texel.
    basis: Vec<Vec<f32>>,
}

impl Window {
    fn around(coverage: &Coverage, patches: &Patches, patch: usize) -> Self {
        let texel = coverage.texels[patch];
        let place = |i: usize| [patches.center[i], patches.normal[i]];
        // Half as far again allows for stretched charts.
        let apart = |i: usize, d: IVec2| 1.5 * d.as_vec2().length() * patches.area[i].max(patches.area[patch]).sqrt();
        let beside = |i: usize, d: IVec2| !patches.buried[i] && continues(place(patch), place(i), apart(i, d));
        let (mut texels, mut places, mut middle) = (Vec::new(), Vec::new(), 0);
        for d in (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| IVec2::new(x, y))) {
            let Some(t) = coverage.texel(texel.page, texel.at.as_ivec2() + d) else { continue };
            if d == IVec2::ZERO {
                middle = texels.len();
            } else if !beside(t as usize, d) {
                continue;
            }
            texels.push(t);
            places.push(d.as_vec2());
        }
        let monomials: [fn(f32, f32) -> f32; ORDER] =
            [|_, _| 1.0, |x, _| x, |_, y| y, |x, _| x * x, |x, y| x * y, |_, y| y * y];
        let mut basis: Vec<Vec<f32>> = Vec::with_capacity(ORDER);
        for monomial in monomials {
            let mut phi: Vec<f32> = places.iter().map(|p| monomial(p.x, p.y)).collect();
            for other in &basis {
                let along: f32 = phi.iter().zip(other).map(|(a, b)| a * b).sum();
                phi.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
            let length = phi.iter().map(|a| a * a).sum::<f32>().sqrt();
            // What the others say already says nothing.
            let scale = if length > 1e-3 { 1.0 / length } else { 0.0 };
            phi.iter_mut().for_each(|a| *a *= scale);
            basis.push(phi);
        }
        Window { texels, middle, basis }
    }
}
