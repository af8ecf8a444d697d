//! Charts of a lightmap that only its coordinates tell: triangles that share a corner in uv.

use crate::{
    atlas::{Atlas, Coverage, Fragment, Layout},
    math::Polygon,
    scene::World,
};
use std::collections::HashMap;

/// The chart of every global triangle.
pub(super) struct Charts {
    of: Vec<u32>,
    /// How many there are.
    pub count: u32,
}

/// Of a texel, in uv, that may be covered twice by rounding.
const TWICE: f64 = 1e-3;

impl Charts {
    pub fn new(world: &World, atlas: &Atlas, coverage: &Coverage) -> Self {
        let joined: Vec<(Vec<u32>, u32)> = atlas.layouts.iter().map(joined).collect();
        let (mut of, mut count) = (vec![0; coverage.charted.len()], 0);
        for (i, instance) in world.scene.instances.iter().enumerate() {
            let (charts, n) = &joined[instance.mesh as usize];
            let triangles = world.triangles_of(i);
            if atlas.placements[i].is_none() || charts.len() != triangles.len() {
                continue;
            }
            for (t, chart) in triangles.zip(charts) {
                of[t as usize] = count + chart;
            }
            count += n;
        }
        Charts { of, count }
    }

    /// Chart of a texel, by its largest piece.
    pub fn of(&self, coverage: &Coverage, texel: usize) -> u32 {
        largest(coverage, texel).map_or(0, |f| self.of[f.triangle as usize])
    }

    /// Texels per metre, by the same.
    pub fn density(&self, coverage: &Coverage, texel: usize) -> f64 {
        let Some(f) = largest(coverage, texel) else { return 0.0 };
        (in_texel(coverage, f, texel) / f64::from(f.area)).sqrt()
    }

    /// True if charts share the texel, or one lies on itself.
    pub fn overlap(&self, coverage: &Coverage, texel: usize) -> bool {
        let pieces = coverage.fragments_of(texel);
        let own = self.of(coverage, texel);
        pieces.iter().any(|f| self.of[f.triangle as usize] != own)
            || pieces.iter().map(|f| in_texel(coverage, f, texel)).sum::<f64>() > 1.0 + TWICE
    }
}

fn largest(coverage: &Coverage, texel: usize) -> Option<&Fragment> {
    coverage.fragments_of(texel).iter().max_by(|a, b| a.area.total_cmp(&b.area))
}

/// Area of a piece in texels.
fn in_texel(coverage: &Coverage, fragment: &Fragment, texel: usize) -> f64 {
    let uv = coverage.charted[fragment.triangle as usize].exact();
    Polygon::triangle(uv).clipped_to_cell(coverage.texels[texel].at.as_dvec2()).area().abs()
}

/// A layout's charts by triangle, and their number.
fn joined(layout: &Layout) -> (Vec<u32>, u32) {
    let mut places: HashMap<[u32; 2], u32> = HashMap::new();
    let mut corner = |v: u32| {
        let next = places.len() as u32;
        *places.entry(layout.uv[v as usize].to_array().map(f32::to_bits)).or_insert(next)
    };
    let triangles: Vec<[u32; 3]> = layout.triangles.iter().map(|t| t.map(&mut corner)).collect();
    let mut above: Vec<u32> = (0..places.len() as u32).collect();
    for [a, b, c] in &triangles {
        let a = root(&mut above, *a);
        for other in [b, c] {
            let other = root(&mut above, *other);
            above[other as usize] = a;
        }
    }
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    let mut charts = Vec::new();
    for [a, ..] in &triangles {
        let next = numbers.len() as u32;
        charts.push(*numbers.entry(root(&mut above, *a)).or_insert(next));
    }
    (charts, numbers.len() as u32)
}

fn root(above: &mut [u32], mut v: u32) -> u32 {
    while above[v as usize] != v {
        above[v as usize] = above[above[v as usize] as usize];
        v = above[v as usize];
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn triangles_that_share_a_corner_are_a_chart() {
        let uv = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.1, 0.1), (0.5, 0.5), (0.6, 0.5), (0.5, 0.6), (0.1, 0.0)];
        let uv = uv.map(|(x, y)| Vec2::new(x, y)).to_vec();
        // The second begins at another vertex in the same place.
        let layout = Layout { uv, triangles: vec![[0, 1, 2], [7, 3, 2], [4, 5, 6]], ..Layout::default() };
        assert_eq!(joined(&layout), (vec![0, 0, 1], 2));
    }
}
