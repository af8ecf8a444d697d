//! Noise wider than a pool: on open surfaces few rays leave blotches as large as the pools.
//!
//! Far from all that it sees, a surface receives light that varies slowly. There a polynomial of second order through the
//! means of up to 7 x 7 pools holds a tenth of the noise of one. As with penumbrae (`direct::smooth`), what the fit leaves
//! tells whether it may be: more than noise may make is light that the fit would flatten. A pool whose fit holds is moved to it
//! as a whole: what differs within it stays.

use super::{super::grouped::net, TILE, pool::Sums};
use crate::{
    math::{Frame, Quadratic, luminance},
    patches::continues,
    trace::Tracer,
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

/// What a fit leaves, over noise, at most. Measured: with half as much, 4 rays gain a fifth less.
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

impl Summary {
    /// Of receivers that share their rays, and what they receive of these. `edge`: from one to the next, metres.
    pub fn of(tile: Tile, edge: f32, receivers: impl ExactSizeIterator<Item = (Eye, Vec3)>, sums: &Sums) -> Self {
        let (count, mut position, mut normal, mut light) = (receivers.len() as f32, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for (eye, e) in receivers {
            position += eye.position;
            normal += eye.normal;
            light += e;
        }
        let mean = sums.light / sums.rays;
        let variance = (sums.squares / sums.rays - mean * mean).max(0.0);
        Summary {
            tile,
            eye: Eye { position: position / count, normal: normal.normalize_or_zero() },
            light: light / count,
            noise: variance / sums.rays * net(sums.rays / count),
            distance: sums.rays / sums.nearness,
            edge,
        }
    }
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
    let above = |p: &Summary| p.eye.above(p.edge);
    let (some, ways): (Vec<&Summary>, Vec<[Vec3; 2]>) =
        smooth.map(|(_, other)| (other, [above(pool), above(other)])).unzip();
    let open = some.into_iter().zip(tracer.are_open(&ways)).filter(|(_, open)| *open);
    std::iter::once(pool).chain(open.map(|(other, _)| other)).collect()
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
    (left <= DOUBT * noise).then(|| fit.middle(pools.iter().map(|p| p.light)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        math::{hash, unit_float},
        scene::{Instance, Material, Mesh, Primitive, Scene, World},
    };
    use glam::DAffine3;

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

    /// What is added to the pools, and their mean squared error before and after, where `scene` stands on the floor.
    fn corrected(pools: &[Summary], law: impl Fn(Vec2) -> f32, scene: &Scene) -> (Vec<Vec3>, [f32; 2]) {
        let add = corrections(pools, &Tracer::new(World::new(scene)));
        let error = |k: usize, add: f32| (pools[k].light.x + add - law(pools[k].tile.at.as_vec2())).powi(2);
        let mean = |of: &dyn Fn(usize) -> f32| (0..pools.len()).map(of).sum::<f32>() / pools.len() as f32;
        let errors = [mean(&|k| error(k, 0.0)), mean(&|k| error(k, add[k].x))];
        (add, errors)
    }

    /// A wall across the floor, between two columns of pools.
    fn wall() -> Scene {
        let (x, far) = (7.5, 40.0);
        let positions = [(-far, -1.0), (far, -1.0), (far, 9.0), (-far, 9.0)].map(|(z, y)| Vec3::new(x, y, z));
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let primitives = vec![Primitive { triangles: 0..2, ..Primitive::default() }];
        let mesh = Mesh { positions: positions.to_vec(), triangles, primitives, ..Mesh::default() };
        let instances = vec![Instance {
            name: String::new(),
            node: 0,
            mesh: 0,
            transform: DAffine3::IDENTITY,
            texels_per_meter: None,
        }];
        Scene { meshes: vec![mesh], instances, materials: vec![Material::default()], ..Scene::default() }
    }

    /// Also below zero, where rows take back what was sampled.
    #[test]
    fn blotches_are_taken_from_an_open_floor() {
        for least in [2.0, -4.0] {
            let law = |p: Vec2| least + 0.1 * p.x - 0.004 * p.y * p.y;
            let (_, [before, after]) = corrected(&floor(law, 50.0), law, &Scene::default());
            assert!(after < 0.3 * before, "{least}: {before} {after}");
        }
    }

    /// Where something is near, where pools are few, and where light changes by more than noise.
    #[test]
    fn what_may_be_no_noise_stays() {
        let law = |p: Vec2| 2.0 + 0.1 * p.x;
        let (add, _) = corrected(&floor(law, 5.0), law, &Scene::default());
        assert!(add.iter().all(|add| *add == Vec3::ZERO));
        let few: Vec<Summary> = floor(law, 50.0).into_iter().filter(|p| p.tile.at.max_element() < 3).collect();
        let (add, _) = corrected(&few, law, &Scene::default());
        assert!(add.iter().all(|add| *add == Vec3::ZERO));
        let step = |p: Vec2| if p.x < 7.5 { 1.0 } else { 3.0 };
        let (add, [before, after]) = corrected(&floor(step, 50.0), step, &Scene::default());
        let beside = (0..256).filter(|k| [7, 8].contains(&(k % 16)));
        assert!(after < before && beside.clone().count() == 32, "{before} {after}");
        assert!(beside.filter(|&k| add[k] != Vec3::ZERO).count() < 4);
    }

    /// Light of less difference than noise on either side of a wall is not mixed.
    #[test]
    fn a_wall_parts_pools() {
        let law = |p: Vec2| if p.x < 7.5 { 1.0 } else { 1.1 };
        let pools = floor(law, 50.0);
        let across = |scene: &Scene| {
            let (add, _) = corrected(&pools, law, scene);
            let side = |x: u32| (0..256).filter(move |k| k % 16 == x as usize);
            let mean = |x: u32| {
                side(x).map(|k| pools[k].light.x + add[k].x - law(pools[k].tile.at.as_vec2())).sum::<f32>() / 16.0
            };
            mean(7) - mean(8)
        };
        let [open, parted] = [Scene::default(), wall()].map(|scene| across(&scene));
        assert!(open > parted + 0.02, "{open} {parted}");
    }
}
