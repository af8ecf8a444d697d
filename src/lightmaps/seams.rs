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
    let mut jumps: Vec<(f32, f32)> = instances.flat_map_iter(|i| jumps_of(world, atlas, coverage, maps, i)).collect();
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
    sides.par_sort_by_key(|(edge, _)| *edge);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        atlas::{Layout, Page, Placement},
        lightmaps::Map,
        scene::{Instance, Material, Mesh, Primitive, Scene},
    };
    use glam::{DAffine3, UVec2};

    /// Three squares in a row, the first two on one chart, the last on another and turned by `turn` about the edge.
    fn row(turn: f32) -> (Scene, Atlas) {
        let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
        let along = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::new(2.0 + cos, sin, 0.0)];
        let positions = along.iter().flat_map(|&p| [p, p - Vec3::Z]).collect();
        let square = |a: u32| [[a, a + 2, a + 3], [a, a + 3, a + 1]];
        let triangles = [0, 2, 4].map(square).concat();
        let primitives = vec![Primitive { triangles: 0..6, ..Primitive::default() }];
        let mesh = Mesh { positions, triangles, primitives, ..Mesh::default() };
        let instance =
            Instance { name: String::new(), node: 0, mesh: 0, transform: DAffine3::IDENTITY, texels_per_meter: None };
        let scene = Scene {
            meshes: vec![mesh],
            instances: vec![instance],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let columns = [0.0, 0.25, 0.5, 0.75, 1.0].map(|x| [Vec2::new(x, 0.25), Vec2::ZERO.with_x(x)]);
        let triangles = [0, 2, 6].map(square).concat();
        let layout = Layout {
            source: vec![0, 1, 2, 3, 4, 5, 4, 5, 6, 7],
            uv: columns.concat(),
            triangles,
            charts: vec![0, 0, 0, 0, 1, 1],
            chart_count: 2,
        };
        let placement = Placement { page: 0, offset: Vec2::ZERO, scale: Vec2::ONE };
        let atlas = Atlas {
            layouts: vec![layout],
            placements: vec![Some(placement)],
            pages: vec![Page { size: UVec2::splat(64), hidden: false }],
            ..Atlas::default()
        };
        (scene, atlas)
    }

    /// A step of light in the middle of a chart is none; one between charts is, unless the surface has an edge there.
    #[test]
    fn a_jump_is_told_across_seams_only() {
        let jump = |turn, step: usize| {
            let (scene, atlas) = row(turn);
            let world = World::new(&scene);
            let coverage = Coverage::new(&world, &atlas);
            let irradiance = (0..64 * 64).map(|i| Vec3::splat(if i % 64 < step { 1.0 } else { 3.0 })).collect();
            let map = Map { size: UVec2::splat(64), irradiance, covered: vec![true; 64 * 64] };
            jump_across_seams(&world, &atlas, &coverage, &Lightmaps { pages: vec![map], ..Lightmaps::default() })
        };
        assert_eq!(jump(0.0, 40), Some(1.0));
        assert_eq!(jump(0.0, 16), Some(0.0));
        assert_eq!(jump(1.0, 40), None);
    }
}
