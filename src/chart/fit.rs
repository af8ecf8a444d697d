//! What points say together: the front of the best, and powers.

use super::{Point, Sweep};

/// Marks the points of the first one's layout that no other beats in error and in seconds.
pub(super) fn mark_pareto(points: &mut [Point]) {
    let Some(texels) = points.first().map(|p| p.texels) else { return };
    let own = |p: &Point| p.texels == texels && p.sweep != Sweep::Density.name();
    let all: Vec<Option<(f64, f64)>> =
        points.iter().map(|p| p.error.filter(|_| own(p)).map(|e| (p.seconds, e))).collect();
    let best = front(&all.iter().flatten().copied().collect::<Vec<_>>());
    for (point, at) in points.iter_mut().zip(&all) {
        point.pareto = at.is_some_and(|at| best.contains(&at));
    }
}

/// Those of which no other is lower in both, by the first; the second falls.
pub(super) fn front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut least = f64::INFINITY;
    sorted.retain(|p| p.1 < least && std::mem::replace(&mut least, p.1) > p.1);
    sorted
}

/// The power of the number of texels with which seconds grow, over the larger layouts.
pub(super) fn scaling(points: &[Point]) -> Option<f64> {
    let sizes = sizes(points);
    // Small layouts take the time of what does not depend on them.
    let larger = &sizes[sizes.len().saturating_sub(3)..];
    power(&larger.iter().map(|p| (p.texels as f64, p.seconds)).collect::<Vec<_>>())
}

/// The points that differ in their texels only, by them.
pub(super) fn sizes(points: &[Point]) -> Vec<&Point> {
    let mut sizes: Vec<&Point> = points.iter().take(1).collect();
    sizes.extend(points.iter().filter(|p| p.sweep == Sweep::Density.name()));
    sizes.sort_by_key(|p| p.texels);
    sizes
}

/// The slope of the straight line through logarithms, by least squares; none for fewer than two different x.
pub(super) fn power(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0).map(|p| (libm::log(p.0), libm::log(p.1))).collect();
    let n = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (xx, xy) = logs.iter().fold((0.0, 0.0), |(xx, xy), p| (xx + (p.0 - x) * (p.0 - x), xy + (p.0 - x) * (p.1 - y)));
    (xx > 1e-9).then(|| xy / xx)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let all = [(3.0, 1.0), (1.0, 5.0), (2.0, 5.0), (2.0, 2.0), (4.0, 1.0), (5.0, 0.5), (2.0, 3.0)];
        assert_eq!(front(&all), [(1.0, 5.0), (2.0, 2.0), (3.0, 1.0), (5.0, 0.5)]);
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn powers_are_found() {
        let cubes: Vec<(f64, f64)> = (1..6).map(|x| (f64::from(x), 7.0 * f64::from(x * x * x))).collect();
        assert!((power(&cubes).unwrap() - 3.0).abs() < 1e-12);
        assert!(power(&cubes[..1]).is_none() && power(&[]).is_none());
    }
}
