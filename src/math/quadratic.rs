//! Polynomials of second order fitted to values at places in a plane (Savitzky and Golay, "Smoothing and Differentiation of
//! Data by Simplified Least Squares Procedures", 1964).

use super::simd::LANES;
use glam::{Vec2, Vec3};

/// Orthonormal polynomials up to second order over some places, of which the one at zero is the middle.
#[derive(Clone)]
pub(crate) struct Quadratic {
    /// Of each the value at every place.
    phi: [Vec<f32>; ORDER],
    /// What every place's value weighs in that of the fit at the middle.
    weights: Vec<f32>,
}

/// Terms of a polynomial.
const ORDER: usize = 6;

impl Quadratic {
    /// Gram and Schmidt's.
    pub fn over(places: &[Vec2]) -> Self {
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
        let middle = places.iter().position(|p| *p == Vec2::ZERO).unwrap_or(0);
        let mut weights = vec![0.0; places.len()];
        for phi in &basis {
            weights.iter_mut().zip(phi).for_each(|(w, value)| *w += value * phi[middle]);
        }
        Quadratic { phi: basis, weights }
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// What every place's value weighs in that of the fit at the middle.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The fit at the middle.
    pub fn middle(&self, values: impl Iterator<Item = Vec3>) -> Vec3 {
        self.weights.iter().zip(values).map(|(weight, value)| value * *weight).sum()
    }

    /// Variance of what the fit leaves of the values, of which there are more than its terms.
    pub fn left(&self, values: &[f32]) -> f32 {
        // What differs is little beside the values.
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let values: Vec<f32> = values.iter().map(|v| v - mean).collect();
        let explained: f32 = self.phi.iter().map(|phi| dot(phi, &values)).map(|c| c * c).sum();
        (dot(&values, &values) - explained).max(0.0) / (self.len() - ORDER) as f32
    }

    /// Share of the values' variance, if it is noise, that the fit has at the middle.
    pub fn kept(&self) -> f32 {
        dot(&self.weights, &self.weights)
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> Vec<Vec2> {
        (0..25).map(|k| Vec2::new((k % 5) as f32 - 2.0, (k / 5) as f32 - 2.0)).collect()
    }

    #[test]
    fn a_curve_is_followed() {
        let fit = Quadratic::over(&places());
        let law = |p: &Vec2| 3.0 + 0.5 * p.x - p.y + 0.2 * p.x * p.y - 0.1 * p.y * p.y;
        let values: Vec<f32> = places().iter().map(law).collect();
        let middle = fit.middle(values.iter().map(|&v| Vec3::splat(v)));
        assert!((middle.x - 3.0).abs() < 1e-5 && fit.left(&values) < 1e-9, "{middle} {}", fit.left(&values));
    }

    /// Of 5 by 5 the middle keeps 27 / 175; of alternating values all but the mean and a little of the squares is left.
    #[test]
    fn noise_is_told() {
        let fit = Quadratic::over(&places());
        assert!((fit.kept() - 27.0 / 175.0).abs() < 1e-5, "{}", fit.kept());
        let values: Vec<f32> = (0..25).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let left = (25.0 - 1.0 / 25.0 - 32.0 / 70.0) / 19.0;
        assert!((fit.left(&values) - left).abs() < 1e-4, "{} {left}", fit.left(&values));
    }

    /// A thousandth of noise beside the values is not lost to rounding.
    #[test]
    fn little_noise_is_told() {
        let fit = Quadratic::over(&places());
        let values: Vec<f32> = (0..25).map(|k| 1000.0 + if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        assert!((fit.left(&values) - 0.0129).abs() < 2e-4, "{}", fit.left(&values));
    }
}
