//! How visible chart seams are: the jump of the look-up across edges that two charts share.

use super::Lightmaps;
use crate::{
    atlas::{Atlas, Coverage, NO_CHART, NO_PAGE},
    math::luminance,
    scene::World,
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Largest angle between the faces at an edge across which the light should be continuous.
const SMOOTH: f32 = 0.95;

/// Relative jump of irradiance across seams, 95th percentile over edges by length; `None` without seams.
pub fn jump_across_seams(world: &World, atlas: &Atlas, coverage: &Coverage, maps: &Lightmaps) -> Option<f64> {
    let instances = (0..world.scene.instances.len()).into_par_iter();
    let mut jumps = instances.map(|i| jumps_of(world, atlas, coverage, maps, i)).collect::<Vec<_>>().concat();
    jumps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f32 = jumps.iter().map(|j| j.1).sum();
    let mut sum = 0.0;
    jumps
        .iter()
        .find(|j| {
            sum += j.1;
            sum >= 0.95 * total
        })
        .map(|j| f64::from(j.0))
}

type Edge = [[u32; 3]; 2];

struct Side {
    /// Triangle of the mesh.
    local: usize,
    middle: Vec2,
    normal: Vec3,
    length: f32,
}

/// The jumps across an instance's seams, and the seams' lengths.
fn jumps_of(world: &World, atlas: &Atlas, coverage: &Coverage, maps: &Lightmaps, i: usize) -> Vec<(f32, f32)> {
    let placement = atlas.placements[i].filter(|p| !atlas.pages[p.page as usize].hidden);
    let Some(placement) = placement else { return Vec::new() };
    let mesh = world.mesh(i);
    let layout = &atlas.layouts[world.scene.instances[i].mesh as usize];
    let map = &maps.pages[placement.page as usize];
    let mut sides: Vec<(Edge, Side)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (local, t) in mesh.triangles.iter().enumerate() {
        let triangle = world.triangles_of(i).start + local as u32;
        let charted = &coverage.charted[triangle as usize];
        if charted.page == NO_PAGE || layout.charts[local] == NO_CHART {
            continue;
        }
        let corners = world.corners(i, local as u32);
        let normal = world.cross(i, &corners).normalize_or_zero();
        for k in 0..3 {
            let (a, b) = (k, (k + 1) % 3);
            let key = |c: usize| (mesh.positions[t[c] as usize] + 0.0).to_array().map(f32::to_bits);
            let mut edge = [key(a), key(b)];
            edge.sort_unstable();
            let middle = (charted.corners[a] + charted.corners[b]) * 0.5;
            let length = (corners[a] - corners[b]).length();
            sides.push((edge, Side { local, middle, normal, length }));
        }
    }
    // Those of one edge stay in the order of their triangles.
    sides.sort_by_key(|(edge, _)| *edge);
    let mut jumps = Vec::new();
    for sides in sides.chunk_by(|a, b| a.0 == b.0) {
        let [(_, s), (_, t)] = sides else { continue };
        let same_chart = layout.charts[s.local] == layout.charts[t.local];
        if same_chart && s.middle.distance(t.middle) < 1e-3 || s.normal.dot(t.normal) < SMOOTH {
            continue;
        }
        let [a, b] = [s, t].map(|side| luminance(map.bilinear(side.middle)));
        let mean = 0.5 * (a + b);
        if mean > 0.0 {
            jumps.push(((a - b).abs() / mean, s.length));
        }
    }
    jumps
}
