//! Closed forms that tests compare with.

use glam::DVec3;

/// Lambert's polygon formula: form factor of the point `p` with unit normal `n` to a convex polygon, clipped at the
/// horizon, whichever way its vertices run.
pub fn element_to_polygon(p: DVec3, n: DVec3, polygon: &[DVec3]) -> f64 {
    let mut above: Vec<DVec3> = Vec::new();
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = ((*a - p).dot(n), (b - p).dot(n));
        if da >= 0.0 {
            above.push(*a - p);
        }
        if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
            above.push(a.lerp(b, da / (da - db)) - p);
        }
    }
    let edges = (0..above.len()).map(|i| {
        let (a, b) = (above[i], above[(i + 1) % above.len()]);
        let cross = a.cross(b);
        let sin = cross.length();
        if sin < 1e-300 { 0.0 } else { libm::atan2(sin, a.dot(b)) * cross.dot(n) / sin }
    });
    edges.sum::<f64>().abs() / std::f64::consts::TAU
}

/// Mean of `f` over the parallelogram `o + u s + v t`, by `k` x `k` points of the midpoint rule.
pub fn mean_over([o, s, t]: [DVec3; 3], k: usize, f: impl Fn(DVec3) -> f64) -> f64 {
    let at = |i: usize| (i as f64 + 0.5) / k as f64;
    let points = (0..k * k).map(|i| o + s * at(i % k) + t * at(i / k));
    points.map(f).sum::<f64>() / (k * k) as f64
}

/// Integral of cos^2 to the normal over the angle along edges, as seen from `p`: what [`aliasing`] asks for.
pub fn outline(p: DVec3, n: DVec3, edges: &[[DVec3; 2]]) -> f64 {
    const PIECES: usize = 16;
    let at = |[a, b]: [DVec3; 2], k: usize| (a.lerp(b, k as f64 / PIECES as f64) - p).normalize_or_zero();
    let pieces = edges.iter().flat_map(|edge| (0..PIECES).map(move |k| [at(*edge, k), at(*edge, k + 1)]));
    let piece = |[a, b]: [DVec3; 2]| {
        let cos = (a + b).normalize_or_zero().dot(n).max(0.0);
        a.angle_between(b) * cos * cos
    };
    pieces.map(piece).sum()
}

/// Standard error, at most, of the form factor that a hemicube finds of something with this [`outline`].
///
/// Pixels inside and outside are counted as they are; those that the outline crosses are counted whole or not at all: off
/// by at most half their delta form factor, root mean square. With pixels of edge h (2 over their number), at an angle phi
/// to the middle of their face and theta to the normal, that factor is h^2 cos^3 phi cos theta / pi. An angle d along the
/// outline is a way of at most d / cos^2 phi on the face, which crosses at most sqrt 2 / h times as many pixels: squares
/// sum to h^3 sqrt 2 / (4 pi^2) times the integral of cos^2 theta. Four more for where it begins and ends.
pub fn aliasing(resolution: u32, outline: f64) -> f64 {
    let (h, pi) = (2.0 / f64::from(resolution), std::f64::consts::PI);
    let crossed = std::f64::consts::SQRT_2 * h * h * h / (4.0 * pi * pi) * outline;
    let ends = 4.0 * (h * h / (2.0 * pi)).powi(2);
    libm::sqrt(crossed + ends)
}

/// Relative error of the midpoint rule with `n` x `n` points for what one square receives from its opposite in a cube: what
/// it costs where one point stands for its texel.
pub fn one_point(n: usize) -> f64 {
    let opposite = [DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::ONE, DVec3::new(0.0, 1.0, 1.0)];
    let square = [DVec3::ZERO, DVec3::X, DVec3::Y];
    (mean_over(square, n, |p| element_to_polygon(p, DVec3::Z, &opposite)) / 0.199_824_895_7 - 1.0).abs()
}
