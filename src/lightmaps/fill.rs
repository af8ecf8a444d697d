//! Filling what a bilinear look-up may touch beyond a chart: never over a texel that has a value.

use super::Map;
use crate::atlas::PADDING;
use glam::{IVec2, Vec3};

/// What a texel is before filling; covered ones with their chart.
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
pub(super) fn buried(map: &mut Map, state: &mut [State]) {
    let (w, h) = (map.size.x as i32, map.size.y as i32);
    let waiting = |state: &[State], i: usize| match state[i] {
        State::Buried(chart) => around(i, w, h).any(|(n, _)| state[n] == State::Full(chart)).then_some(chart),
        _ => None,
    };
    let mut front: Vec<(usize, (u32, u32))> =
        (0..state.len()).filter_map(|i| waiting(state, i).map(|chart| (i, chart))).collect();
    while !front.is_empty() {
        let values: Vec<Vec3> =
            front.iter().map(|&(i, chart)| mean(map, i, w, h, |n| state[n] == State::Full(chart))).collect();
        for (&(i, chart), v) in front.iter().zip(values) {
            map.irradiance[i] = v;
            state[i] = State::Full(chart);
        }
        let mut next: Vec<usize> = front.iter().flat_map(|&(i, _)| around(i, w, h).map(|(n, _)| n)).collect();
        next.sort_unstable();
        next.dedup();
        front = next.into_iter().filter_map(|i| waiting(state, i).map(|chart| (i, chart))).collect();
    }
}

/// Grows values into empty texels, as far as the padding reaches.
pub(super) fn gutters(map: &mut Map, state: &[State]) {
    let (w, h) = (map.size.x as i32, map.size.y as i32);
    let mut filled: Vec<bool> = state.iter().map(|s| *s != State::Empty).collect();
    let mut front: Vec<usize> = (0..filled.len()).filter(|&i| filled[i]).collect();
    for _ in 0..PADDING {
        let mut reached: Vec<usize> =
            front.iter().flat_map(|&i| around(i, w, h).map(|(n, _)| n)).filter(|&n| !filled[n]).collect();
        reached.sort_unstable();
        reached.dedup();
        let values: Vec<Vec3> = reached.iter().map(|&i| mean(map, i, w, h, |n| filled[n])).collect();
        for (&i, v) in reached.iter().zip(values) {
            map.irradiance[i] = v;
            filled[i] = true;
        }
        front = reached;
    }
}

/// Mean of the neighbours that have a value, those across an edge counting twice those across a corner.
fn mean(map: &Map, i: usize, w: i32, h: i32, has_value: impl Fn(usize) -> bool) -> Vec3 {
    let (sum, weight) = around(i, w, h)
        .filter(|&(n, _)| has_value(n))
        .fold((Vec3::ZERO, 0.0), |(s, t), (n, k)| (s + map.irradiance[n] * k, t + k));
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
