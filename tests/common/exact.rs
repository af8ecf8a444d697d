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
