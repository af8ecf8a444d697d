//! How visible chart seams are: the jump of the look-up across edges that two charts share.

use super::Lightmaps;
use crate::{
    atlas::{Atlas, Coverage, NO_CHART, NO_PAGE},
    math::luminance,
    scene::World,
};
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// Largest angle between the faces at an edge across which the light should be continuous.
const SMOOTH: f32 = 0.95;

/// Relative jump of irradiance across seams, 95th percentile over edges by length; `None` without seams.
pub fn jump_across_seams(world: &World, atlas: &Atlas, coverage: &Coverage, maps: &Lightmaps) -> Option<f64> {
    let mut jumps: Vec<(f32, f32)> = Vec::new();
    for i in 0..world.scene.instances.len() {
        seams_of(world, atlas, coverage, maps, i, &mut jumps);
    }
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
    triangle: u32,
    local: u32,
    middle: Vec2,
    normal: Vec3,
    length: f32,
}

fn seams_of(
    world: &World,
    atlas: &Atlas,
    coverage: &Coverage,
    maps: &Lightmaps,
    i: usize,
    jumps: &mut Vec<(f32, f32)>,
) {
    let Some(placement) = atlas.placements[i].filter(|p| !atlas.pages[p.page as usize].hidden) else { return };
    let mesh = world.mesh(i);
    let layout = &atlas.layouts[world.scene.instances[i].mesh as usize];
    let map = &maps.pages[placement.page as usize];
    let mut sides: HashMap<Edge, Vec<Side>> = HashMap::new();
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
            sides.entry(edge).or_default().push(Side { triangle, local: local as u32, middle, normal, length });
        }
    }
    let mut edges: Vec<_> = sides.into_iter().filter(|(_, s)| s.len() == 2).collect();
    // Two triangles may share several edges: only the edge itself tells those apart.
    edges.sort_unstable_by_key(|(edge, s)| (s[0].triangle, s[1].triangle, *edge));
    for (_, s) in edges {
        let same_chart = layout.charts[s[0].local as usize] == layout.charts[s[1].local as usize];
        if same_chart && s[0].middle.distance(s[1].middle) < 1e-3 || s[0].normal.dot(s[1].normal) < SMOOTH {
            continue;
        }
        let [a, b] = [0, 1].map(|k| luminance(map.bilinear(s[k].middle)));
        let mean = 0.5 * (a + b);
        if mean > 0.0 {
            jumps.push(((a - b).abs() / mean, s[0].length));
        }
    }
}
