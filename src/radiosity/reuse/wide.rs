//! Noise wider than a pool: on open surfaces few rays leave blotches as large as the pools.
//!
//! Far from all that it sees, a surface receives light that varies slowly. There a polynomial of second order through the
//! means of up to 7 x 7 pools holds a tenth of the noise of one. As with penumbrae (`direct::smooth`), what the fit leaves
//! tells whether it may be: more than noise may make is light that the fit would flatten. A pool whose fit holds is moved to it
//! as a whole: what differs within it stays.

use super::TILE;
use crate::{
    math::{Frame, Quadratic, luminance},
    patches::continues,
    trace::{NOWHERE, Segment, Tracer},
    transport::Eye,
};
use glam::{IVec2, UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Tiles from the middle of a window to its edge, the first tried first.
const REACHES: [i32; 2] = [3, 2];
/// Pools from which a fit is trusted.
const ENOUGH: usize = 12;
/// Harmonic mean distance to what a pool sees, at least, over half the edge of a window. Measured: with nothing asked, a
/// Cornell box with 16 rays errs a fifth more; with twice as much, half the gain is lost.
const OPEN: f32 = 2.5;

/// What a fit leaves, over noise, at most. Measured: with half as much, errors with 4 to 6 rays fall by a third less.
const DOUBT: f32 = 2.0;

/// Where a pool has its middle: a square of a page.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Tile {
    pub page: usize,
    /// Texels from one of its receivers to the next.
    pub stride: u32,
    /// In tiles.
    pub at: UVec2,
}

/// What a pool says as a whole.
pub(super) struct Summary {
    pub tile: Tile,
    /// The mean of its receivers.
    pub eye: Eye,
    /// What they receive on average, and the variance of its luminance.
    pub light: Vec3,
    pub noise: f32,
    /// Harmonic mean distance from its middle to where rays ended, metres.
    pub distance: f32,
    /// From one receiver to the next, metres.
    pub edge: f32,
}

/// Of each pool, in the order of their tiles, what to add to what it says.
pub(super) fn corrections(pools: &[Summary], tracer: &Tracer) -> Vec<Vec3> {
    let mut at: HashMap<Tile, Vec<u32>> = HashMap::new();
    (0..).zip(pools).for_each(|(k, pool)| at.entry(pool.tile).or_default().push(k));
    let correction = |k: usize| {
        let pool = &pools[k];
        let open = |reach: &&i32| pool.distance > OPEN * (**reach as f32 + 0.5) * pool.edge * TILE as f32;
        REACHES.iter().filter(open).find_map(|&reach| {
            let around = around(pools, k, reach, &at, tracer);
            fitted(pool, &around).map(|light| light - pool.light)
        })
    };
    (0..pools.len()).into_par_iter().map(|k| correction(k).unwrap_or(Vec3::ZERO)).collect()
}

/// Pools within reach of the `k`-th on the same smooth surface, with nothing standing between; it is the first.
fn around<'p>(
    pools: &'p [Summary],
    k: usize,
    reach: i32,
    at: &HashMap<Tile, Vec<u32>>,
    tracer: &Tracer,
) -> Vec<&'p Summary> {
    let pool = &pools[k];
    let edge = pool.edge * TILE as f32;
    let lifted = |p: &Summary| p.eye.position + p.eye.normal * (0.5 * p.edge);
    let offsets = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| IVec2::new(x, y)));
    let tiles = offsets.filter_map(|d| {
        let at = (pool.tile.at.as_ivec2() + d).try_into().ok()?;
        Some((d.as_vec2().length().max(1.0), Tile { at, ..pool.tile }))
    });
    let near = tiles.flat_map(|(tiles, tile)| {
        let some = at.get(&tile).map_or(&[][..], Vec::as_slice);
        some.iter().filter(|&&o| o as usize != k).map(move |&o| (tiles, &pools[o as usize]))
    });
    let smooth = near.filter(|(tiles, other)| {
        let places = [pool, *other].map(|p| [p.eye.position, p.eye.normal]);
        continues(places[0], places[1], 1.5 * edge * tiles)
    });
    let (some, ways): (Vec<&Summary>, Vec<Segment>) = smooth
        .map(|(_, other)| {
            let origin = lifted(pool);
            (other, Segment { origin, direction: lifted(other) - origin, t: 1.0, from: NOWHERE })
        })
        .unzip();
    let mut through = vec![Vec3::ZERO; ways.len()];
    tracer.transmittance_of_each(&ways, &mut through);
    let seen = some.into_iter().zip(through).filter(|(_, way)| luminance(*way) > 0.5);
    std::iter::once(pool).chain(seen.map(|(other, _)| other)).collect()
}

/// What the fit through some pools says of the first, if noise explains what it leaves.
fn fitted(pool: &Summary, pools: &[&Summary]) -> Option<Vec3> {
    if pools.len() < ENOUGH {
        return None;
    }
    let frame = Frame::around(pool.eye.normal);
    let place = |p: &&Summary| frame.flat(p.eye.position - pool.eye.position) / (pool.edge * TILE as f32);
    let fit = Quadratic::over(&pools.iter().map(place).collect::<Vec<Vec2>>());
    let noise = pools.iter().map(|p| p.noise).sum::<f32>() / pools.len() as f32;
    let left = fit.left(&pools.iter().map(|p| luminance(p.light)).collect::<Vec<_>>());
    (left <= DOUBT * noise).then(|| fit.middle(pools.iter().map(|p| p.light)).max(Vec3::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{hash, unit_float};

    /// Square pools of a metre on a floor whose rays leave a noise of .01, half of what they seem to, and how far from all they are.
    fn floor(law: impl Fn(Vec2) -> f32, distance: f32) -> Vec<Summary> {
        let pool = |k: u32| {
            let at = UVec2::new(k % 16, k / 16);
            let place = at.as_vec2();
            let chance = (0..12).map(|i| unit_float(hash(k, i))).sum::<f32>() - 6.0;
            Summary {
                tile: Tile { page: 0, stride: 1, at },
                eye: Eye { position: Vec3::new(place.x, 0.0, -place.y), normal: Vec3::Y },
                light: Vec3::splat(law(place) + 0.1 * chance),
                noise: 0.02,
                distance,
                edge: 1.0 / TILE as f32,
            }
        };
        (0..256).map(pool).collect()
    }

    /// Mean squared error of the pools, before and after; nothing stands on the floor.
    fn errors(law: impl Fn(Vec2) -> f32 + Copy, distance: f32) -> [f32; 2] {
        let pools = floor(law, distance);
        let scene = crate::scene::Scene::default();
        let add = corrections(&pools, &Tracer::new(crate::scene::World::new(&scene)));
        let error = |k: usize, add: Vec3| {
            let at = pools[k].tile.at.as_vec2();
            (pools[k].light.x + add.x - law(at)).powi(2)
        };
        let mean = |of: &dyn Fn(usize) -> f32| (0..256).map(of).sum::<f32>() / 256.0;
        [mean(&|k| error(k, Vec3::ZERO)), mean(&|k| error(k, add[k]))]
    }

    #[test]
    fn blotches_are_taken_from_an_open_floor() {
        let [before, after] = errors(|p| 2.0 + 0.1 * p.x - 0.004 * p.y * p.y, 50.0);
        assert!(after < 0.3 * before, "{before} {after}");
    }

    /// Where something may be near, and where light changes by more than noise.
    #[test]
    fn what_is_no_noise_stays() {
        let [before, after] = errors(|p| 2.0 + 0.1 * p.x, 5.0);
        assert_eq!(before, after);
        let [before, after] = errors(|p| if p.x < 7.5 { 1.0 } else { 3.0 }, 50.0);
        assert!(after < before, "{before} {after}");
    }
}
