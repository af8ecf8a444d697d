//! Meshes as unwrappers want them: welded, in a unit box, and, once cut into charts, back to the mesh's vertices.

use super::{Layout, NO_CHART, overlap, place};
use crate::scene::{Instance, Mesh, Scene};
use glam::{DVec2, DVec3, Vec2};
use std::collections::HashMap;

/// A mesh to be cut: positions welded, as its reference instance shapes it, in a unit box.
#[derive(Clone, Debug, Default)]
pub(super) struct Shape {
    /// Distinct positions.
    pub positions: Vec<[f32; 3]>,
    /// Three a triangle, in the mesh's order.
    pub indices: Vec<u32>,
    /// Triangles that get no chart: unlit ones.
    pub ignored: Vec<bool>,
    /// Metres of the reference instance per unit: a power of two, so that whoever multiplies by it finds the same
    /// triangles too thin.
    pub metres: f64,
}

/// A shape cut into charts, each flattened: vertices are split where charts end.
#[derive(Clone, Debug, Default)]
pub(super) struct Cut {
    /// Positions, split.
    pub positions: Vec<[f32; 3]>,
    /// Where each lies in its chart.
    pub uvs: Vec<[f32; 2]>,
    /// Three a triangle, in the mesh's order.
    pub indices: Vec<u32>,
    /// Number of charts.
    pub charts: usize,
}

impl Shape {
    /// The shape of mesh `index` as `instance` shows it.
    pub fn new(scene: &Scene, index: usize, instance: &Instance) -> Shape {
        let mesh = &scene.meshes[index];
        let m = instance.transform.matrix3;
        let used = || mesh.triangles.iter().flatten().map(|&v| m * mesh.positions[v as usize].as_dvec3());
        let min = used().reduce(DVec3::min).unwrap_or_default();
        let size = (used().reduce(DVec3::max).unwrap_or_default() - min).max_element();
        let metres = if size > 0.0 && size.is_finite() { power_of_two(size) } else { 1.0 };
        let mut welded = HashMap::new();
        let mut positions = Vec::new();
        let mut index_of = |v: u32| {
            let p = mesh.positions[v as usize];
            // + 0.0 makes -0 a 0.
            *welded.entry(p.to_array().map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                positions.push(((m * p.as_dvec3() - min) / metres).as_vec3().to_array());
                positions.len() as u32 - 1
            })
        };
        let indices = mesh.triangles.iter().flatten().map(|&v| index_of(v)).collect();
        let unlit = |t: usize| place::is_unlit(scene, mesh.primitives[mesh.primitive_of(t as u32)].material);
        let ignored = (0..mesh.triangles.len()).map(unlit).collect();
        Shape { positions, indices, ignored, metres }
    }

    /// Area in square units.
    pub fn area(&self) -> f64 {
        let area = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|v| DVec3::from(self.positions[v as usize].map(f64::from)));
            (b - a).cross(c - a).length() * 0.5
        };
        self.indices.chunks_exact(3).map(area).sum()
    }
}

/// The first power of two above `x`.
pub(super) fn power_of_two(x: f64) -> f64 {
    if x.is_finite() { libm::ldexp(1.0, libm::frexp(x).1) } else { 1.0 }
}

/// A flattened vertex, and the chart it belongs to, if any.
pub(super) type Flat = (Vec2, Option<u32>);

/// The layout of `mesh` from flattened vertices, three a triangle, their uv multiplied by `scale`.
///
/// A layout vertex is unique for each pair of vertex and flattened vertex. Triangles without area get no chart.
pub(super) fn layout(mesh: &Mesh, flat: &[Flat], indices: &[u32], scale: DVec2) -> Layout {
    let uv = |f: u32| (flat[f as usize].0.as_dvec2() * scale).as_vec2().clamp(Vec2::ZERO, Vec2::ONE);
    let corners = || mesh.triangles.iter().flatten().copied().zip(indices.iter().copied());
    let mut pairs: Vec<(u32, u32)> = corners().collect();
    pairs.sort_unstable();
    pairs.dedup();
    let number: HashMap<(u32, u32), u32> = pairs.iter().enumerate().map(|(i, &p)| (p, i as u32)).collect();
    let numbered: Vec<u32> = corners().map(|p| number[&p]).collect();
    let mut names = HashMap::new();
    let mut chart = |t: &[u32]| {
        let area = overlap::cross(&[t[0], t[1], t[2]].map(|v| flat[v as usize].0.as_dvec2()));
        let Some(name) = flat[t[0] as usize].1.filter(|_| area != 0.0) else { return NO_CHART };
        let next = names.len() as u32;
        *names.entry(name).or_insert(next)
    };
    Layout {
        charts: indices.chunks_exact(3).map(&mut chart).collect(),
        chart_count: names.len() as u32,
        uv: pairs.iter().map(|&(_, f)| uv(f)).collect(),
        source: pairs.into_iter().map(|(v, _)| v).collect(),
        triangles: numbered.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}
