//! Penumbrae from few rays: a texel in a soft shadow reads a surface fitted to its neighbours' samples.
//!
//! Light in a penumbra is smooth, its samples are noisy, each texel's own. A polynomial of second order fitted to a window
//! of 5 x 5 texels keeps a sixth of the noise's variance at the middle, of 9 x 9 a twentieth (Savitzky and Golay, 1964), and
//! follows a curve, which one of first order would flatten by as much as the noise hides. What the fit leaves tells whether
//! it may: more than the noise of the samples is an edge; then a smaller window is tried, and at last the texel keeps its own.

use super::received::Received;
use crate::{
    atlas::Coverage,
    math::{luminance, simd::LANES},
    patches::{Patches, continues},
};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Texels from the middle of a window to its edge, the first tried first.
const REACHES: [i32; 3] = [4, 3, 2];
/// Texels from which a fit is trusted.
const ENOUGH: usize = 12;
/// Polynomials up to second order.
const ORDER: usize = 6;

/// Fits those of some patches whose own samples disagree.
pub(super) fn smooth(coverage: &Coverage, patches: &Patches, which: &[u32], received: &mut [Received]) {
    let full = REACHES.map(|reach| Basis::over(&places(reach).map(|d| d.as_vec2()).collect::<Vec<_>>()));
    let samples: Vec<Sample> = received.par_iter().map(Sample::of).collect();
    let smoothed = |&i: &u32| {
        let patch = i as usize;
        if patch >= patches.fronts || samples[patch].variance == 0.0 {
            return None;
        }
        let mut window = Window::around(coverage, patches, patch);
        REACHES.iter().zip(&full).find_map(|(&reach, full)| {
            window.narrow(reach);
            fit(&window, full, &samples, received)
        })
    };
    let fitted: Vec<_> = which.par_iter().map(smoothed).collect();
    which.iter().zip(fitted).filter_map(|(&i, r)| Some((i, r?))).for_each(|(i, r)| received[i as usize] = r);
}

/// What decides whether a fit may be.
struct Sample {
    /// Luminance of all light.
    light: f32,
    /// Of it.
    variance: f32,
}

impl Sample {
    fn of(r: &Received) -> Self {
        Sample { light: luminance(r.total()), variance: r.variance }
    }
}

/// `full`: the basis of a window without gaps.
fn fit(window: &Window, full: &Basis, samples: &[Sample], received: &[Received]) -> Option<Received> {
    let n = window.texels.len();
    if n < ENOUGH {
        return None;
    }
    let basis = if n == full.weights.len() { Cow::Borrowed(full) } else { Cow::Owned(Basis::over(&window.places)) };
    let samples = || window.texels.iter().map(|&t| &samples[t as usize]);
    let noise = samples().map(|s| s.variance).sum::<f32>() / n as f32;
    let values: Vec<f32> = samples().map(|s| s.light).collect();
    let explained: f32 = basis.phi.iter().map(|phi| dot(phi, &values)).map(|c| c * c).sum();
    if (dot(&values, &values) - explained).max(0.0) / (n - ORDER) as f32 > noise {
        return None;
    }
    let own = received[window.texels[middle(&window.places)] as usize];
    let zero = own.zip(&own, |_, _| Vec3::ZERO);
    let add =
        |sum: Received, (&t, &weight): (&u32, &f32)| sum.zip(&received[t as usize], |sum, light| sum + light * weight);
    let sum = window.texels.iter().zip(&basis.weights).fold(zero, add);
    let variance = noise * dot(&basis.weights, &basis.weights);
    Some(Received { variance, ..sum.zip(&zero, Vec3::max) })
}

/// Sums eight products at a time.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}

/// A texel and those around it on the same smooth surface, and where they lie from it.
struct Window {
    texels: Vec<u32>,
    places: Vec<Vec2>,
}

/// Places as far as this from the middle, row by row.
fn places(reach: i32) -> impl Iterator<Item = IVec2> {
    (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| IVec2::new(x, y)))
}

/// Orthonormal polynomials over some places.
#[derive(Clone)]
struct Basis {
    /// Of each the value at every place.
    phi: [Vec<f32>; ORDER],
    /// What every place's value weighs in that of the fit at the middle.
    weights: Vec<f32>,
}

impl Basis {
    /// Gram and Schmidt's.
    fn over(places: &[Vec2]) -> Self {
        let monomials: [fn(f32, f32) -> f32; ORDER] =
            [|_, _| 1.0, |x, _| x, |_, y| y, |x, _| x * x, |x, y| x * y, |_, y| y * y];
        let mut basis: [Vec<f32>; ORDER] = Default::default();
        for (k, monomial) in monomials.into_iter().enumerate() {
            let mut phi: Vec<f32> = places.iter().map(|p| monomial(p.x, p.y)).collect();
            for other in &basis[..k] {
                let along = dot(&phi, other);
                phi.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
            let length = dot(&phi, &phi).sqrt();
            // What the others say already says nothing.
            let scale = if length > 1e-3 { 1.0 / length } else { 0.0 };
            phi.iter_mut().for_each(|a| *a *= scale);
            basis[k] = phi;
        }
        let mut weights = vec![0.0; places.len()];
        for phi in &basis {
            let middle = phi[middle(places)];
            weights.iter_mut().zip(phi).for_each(|(w, phi)| *w += phi * middle);
        }
        Basis { phi: basis, weights }
    }
}

/// Which of some places is the texel itself.
fn middle(places: &[Vec2]) -> usize {
    places.iter().position(|d| *d == Vec2::ZERO).unwrap_or(0)
}

impl Window {
    /// The largest.
    fn around(coverage: &Coverage, patches: &Patches, patch: usize) -> Self {
        let texel = coverage.texels[patch];
        let place = |i: usize| [patches.center[i], patches.normal[i]];
        // Half as far again allows for stretched charts.
        let apart = |i: usize, d: IVec2| 1.5 * d.as_vec2().length() * patches.area[i].max(patches.area[patch]).sqrt();
        let beside = |i: usize, d: IVec2| !patches.buried[i] && continues(place(patch), place(i), apart(i, d));
        let texels = (2 * REACHES[0] as usize + 1).pow(2);
        let mut window = Window { texels: Vec::with_capacity(texels), places: Vec::with_capacity(texels) };
        for d in places(REACHES[0]) {
            let Some(t) = coverage.texel(texel.page, texel.at.as_ivec2() + d) else { continue };
            if d == IVec2::ZERO || beside(t as usize, d) {
                window.texels.push(t);
                window.places.push(d.as_vec2());
            }
        }
        window
    }

    /// Leaves only what is not further away.
    fn narrow(&mut self, reach: i32) {
        let mut inside = self.places.iter().map(|d| d.abs().max_element() <= reach as f32);
        self.texels.retain(|_| inside.next() == Some(true));
        self.places.retain(|d| d.abs().max_element() <= reach as f32);
    }
}
