//! Patches that reflect much more direct light than the scene's mean: a sunlit spot in a dim room.
//!
//! Few of a row's rays meet them, and those few carry most of the light. So, as with the sky's peaks, what they reflect
//! above a level is sampled at every texel like an emitter, and rows carry the rest.

use super::Direct;
use crate::{math::luminance, patches::Patches};
use glam::Vec3;
use rayon::prelude::*;

/// Radiosity above this multiple of the mean is a peak.
const PEAK: f32 = 2.0;
/// Variance that the peaks give to what a ray meets, over the squared mean, below which they are left to the rows.
const VARIANCE: f64 = 0.02;

/// What is sampled.
pub(super) struct Bright {
    /// Exitance of each patch above the level.
    pub exitance: Vec<Vec3>,
    /// Mean luminance of the radiosity after all bounces.
    pub mean: f32,
}

impl Bright {
    /// `None` if no patch stands out, or what stands out is too little for rows to miss. `before`: what has been sampled so far,
    /// which stays.
    pub fn new(patches: &Patches, direct: &Direct, mut before: Vec<Vec3>) -> Option<Self> {
        let reflected = |i: usize| patches.reflectance[i] * direct.total(i);
        let reflected: Vec<Vec3> = (0..patches.len()).into_par_iter().map(reflected).collect();
        let mean = mean_radiosity(patches, &reflected);
        if !before.is_empty() {
            before.resize(patches.len(), Vec3::ZERO);
            return Some(Bright { exitance: before, mean });
        }
        let exitance: Vec<Vec3> = reflected.par_iter().map(|b| above(*b, PEAK * mean)).collect();
        let squares = exitance.iter().zip(&patches.area).map(|(m, a)| f64::from(luminance(*m)).powi(2) * f64::from(*a));
        let variance = squares.sum::<f64>() / patches.area.iter().map(|a| f64::from(*a)).sum::<f64>();
        (variance > VARIANCE * f64::from(mean).powi(2)).then_some(Bright { exitance, mean })
    }
}

/// The part of `radiosity` beyond the level, its colour kept.
fn above(radiosity: Vec3, level: f32) -> Vec3 {
    let l = luminance(radiosity);
    if l > level { radiosity * (1.0 - level / l) } else { Vec3::ZERO }
}

/// An estimate that needs no solution: what the lights put in is absorbed, as if the scene were closed.
pub(super) fn mean_radiosity(patches: &Patches, reflected: &[Vec3]) -> f32 {
    let (mut light, mut absorbed) = (0.0, 0.0);
    for (i, b) in reflected.iter().enumerate() {
        let area = f64::from(patches.area[i] * patches.validity[i]);
        light += f64::from(luminance(*b)) * area;
        absorbed += f64::from(1.0 - luminance(patches.reflectance[i])) * area;
    }
    (light / absorbed.max(1e-30)) as f32
}
