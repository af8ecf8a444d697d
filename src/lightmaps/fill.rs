//! Filling what a bilinear look-up may touch beyond a chart: never over a texel that has a value.

use crate::atlas::PADDING;
use glam::{IVec2, UVec2, Vec3};
use rayon::prelude::*;

/// What a texel is before filling; covered ones with their instance and chart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// No surface.
    Empty,
    /// Surface inside other geometry, without a value.
    Buried((u32, u32)),
    /// Surface with a value.
    Full((u32, u32)),
}

/// Gives buried texels the values around them in their own chart, however far; a chart without any stays black.
pub(super) fn buried(size: UVec2, values: &mut [Vec3], state: &mut [State]) {
    let (w, h) = (size.x as i32, size.y as i32);
    let waiting = |state: &[State], i: usize| match state[i] {
        State::Buried(chart) => around(i, w, h).any(|(n, _)| state[n] == State::Full(chart)).then_some((i, chart)),
        _ => None,
    };
    let mut front: Vec<_> = (0..state.len()).filter_map(|i| waiting(state, i)).collect();
    while !front.is_empty() {
        let means: Vec<Vec3> =
            front.iter().map(|&(i, chart)| mean(values, |n| state[n] == State::Full(chart), i, w, h)).collect();
        for (&(i, chart), v) in front.iter().zip(means) {
            values[i] = v;
            state[i] = State::Full(chart);
        }
        let mut next: Vec<usize> = front.iter().flat_map(|&(i, _)| around(i, w, h).map(|(n, _)| n)).collect();
        next.sort_unstable();
        next.dedup();
        front = next.into_iter().filter_map(|i| waiting(state, i)).collect();
    }
}

/// Grows `values` into `empty` texels, as far as the padding reaches; each new one is the mean of its neighbours with
/// values, those across an edge counting twice those across a corner.
pub(crate) fn gutters(size: UVec2, values: &mut [Vec3], empty: &[bool]) {
    let (w, h) = (size.x as i32, size.y as i32);
    let mut filled: Vec<bool> = empty.iter().map(|e| !e).collect();
    let mut front: Vec<usize> = (0..filled.len()).filter(|&i| filled[i]).collect();
    for _ in 0..PADDING {
        let beside = |&i: &usize| around(i, w, h).map(|(n, _)| n).filter(|&n| !filled[n]);
        let mut reached: Vec<usize> = front.par_iter().flat_map_iter(beside).collect();
        reached.sort_unstable();
        reached.dedup();
        let means: Vec<Vec3> = reached.iter().map(|&i| mean(values, |n| filled[n], i, w, h)).collect();
        for (&i, v) in reached.iter().zip(means) {
            values[i] = v;
            filled[i] = true;
        }
        front = reached;
    }
}

fn mean(values: &[Vec3], has_value: impl Fn(usize) -> bool, i: usize, w: i32, h: i32) -> Vec3 {
    let (sum, weight) = around(i, w, h)
        .filter(|&(n, _)| has_value(n))
        .fold((Vec3::ZERO, 0.0), |(s, t), (n, k)| (s + values[n] * k, t + k));
    sum / weight
}

fn around(i: usize, w: i32, h: i32) -> impl Iterator<Item = (usize, f32)> {
    let at = IVec2::new(i as i32 % w, i as i32 / w);
    (-1..=1)
        .flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y)))
        .filter(|d| *d != IVec2::ZERO)
        .map(move |d| (at + d, if d.x == 0 || d.y == 0 { 2.0 } else { 1.0 }))
        .filter(move |(p, _)| p.x >= 0 && p.y >= 0 && p.x < w && p.y < h)
        .map(move |(p, k)| ((p.y * w + p.x) as usize, k))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buried_texels_take_their_own_charts_values() {
        let (a, b) = ((0, 0), (0, 1));
        let mut state = [State::Full(a), State::Buried(a), State::Buried(a), State::Full(b), State::Buried((1, 0))];
        let mut values = [Vec3::ONE, Vec3::ZERO, Vec3::ZERO, Vec3::splat(9.0), Vec3::ZERO];
        buried(UVec2::new(5, 1), &mut values, &mut state);
        assert_eq!(values, [Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::splat(9.0), Vec3::ZERO]);
    }

    #[test]
    fn gutters_take_the_mean_of_their_neighbours() {
        let (one, three) = (Vec3::ONE, Vec3::splat(3.0));
        let mut values = [one, Vec3::ZERO, three, Vec3::ZERO];
        gutters(UVec2::new(2, 2), &mut values, &[false, true, false, true]);
        let weighted = |edge: Vec3, corner: Vec3| (2.0 * edge + corner) / 3.0;
        assert_eq!(values, [one, weighted(one, three), three, weighted(three, one)]);
    }
}
