//! Penumbrae from few rays: a texel in a soft shadow reads a surface fitted to its neighbours' samples.
//!
//! Light in a penumbra is smooth, its samples are noisy, each texel's own. A polynomial of second order fitted to a window
//! of 5 x 5 texels keeps a sixth of the noise's variance at the middle, of 9 x 9 a twentieth (Savitzky and Golay, 1964), and
//! follows a curve, which one of first order would flatten by as much as the noise hides. What the fit leaves tells whether
//! it may: more than the noise of the samples is an edge; then a smaller window is tried, and at last the texel keeps its own.

use super::received::Received;
use crate::{
    atlas::Coverage,
    math::{Quadratic, luminance},
    patches::{Patches, continues},
};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Texels from the middle of a window to its edge, the first tried first.
const REACHES: [i32; 3] = [4, 3, 2];
/// Texels from which a fit is trusted.
const ENOUGH: usize = 12;

/// Fits those of some patches whose own samples disagree.
pub(super) fn smooth(coverage: &Coverage, patches: &Patches, which: &[u32], received: &mut [Received]) {
    let full = REACHES.map(|reach| Quadratic::over(&places(reach).map(|d| d.as_vec2()).collect::<Vec<_>>()));
    let samples: Vec<Sample> = received.par_iter().map(Sample::of).collect();
    let smoothed = |&i: &u32| {
        let patch = i as usize;
        if patch >= patches.fronts || samples[patch].variance == 0.0 {
            return None;
        }
        let mut window = Window::around(coverage, patches, patch);
        REACHES.iter().zip(&full).find_map(|(&reach, full)| {
            window.narrow(reach);
            fit(&window, full, &samples, received, patch)
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

/// `full`: the fit of a window without gaps.
fn fit(window: &Window, full: &Quadratic, samples: &[Sample], received: &[Received], patch: usize) -> Option<Received> {
    let n = window.texels.len();
    if n < ENOUGH {
        return None;
    }
    let quadratic = if n == full.len() { Cow::Borrowed(full) } else { Cow::Owned(Quadratic::over(&window.places)) };
    let samples = || window.texels.iter().map(|&t| &samples[t as usize]);
    let noise = samples().map(|s| s.variance).sum::<f32>() / n as f32;
    if quadratic.left(&samples().map(|s| s.light).collect::<Vec<_>>()) > noise {
        return None;
    }
    let own = received[patch];
    let zero = own.zip(&own, |_, _| Vec3::ZERO);
    let add =
        |sum: Received, (&t, &weight): (&u32, &f32)| sum.zip(&received[t as usize], |sum, light| sum + light * weight);
    let sum = window.texels.iter().zip(quadratic.weights()).fold(zero, add);
    Some(Received { variance: noise * quadratic.kept(), ..sum.zip(&zero, Vec3::max) })
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
