//! The map as it would be at half its density.

use crate::{
    atlas::Coverage,
    lightmaps::{Lightmaps, Map},
};
use glam::{IVec2, Vec2, Vec3};

/// Bilinear look-up in the map of every second texel: the means of 2 x 2 covered ones.
pub(super) fn halved(coverage: &Coverage, maps: &Lightmaps, triangle: u32, bary: Vec2) -> Vec3 {
    let charted = &coverage.charted[triangle as usize];
    let at = charted.at(bary);
    let Some(map) = maps.pages.get(charted.page as usize) else { return Vec3::ZERO };
    let p = at * 0.5 - 0.5;
    let (corner, f) = (p.floor().as_ivec2(), p - p.floor());
    let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let w = (if x == 0 { 1.0 - f.x } else { f.x }) * (if y == 0 { 1.0 - f.y } else { f.y });
        if let Some(value) = block(map, corner + IVec2::new(x, y)) {
            sum += value * w;
            weight += w;
        }
    }
    if weight > 0.0 { sum / weight } else { map.bilinear(at) }
}

/// The mean of the covered texels of a block.
fn block(map: &Map, at: IVec2) -> Option<Vec3> {
    let texels = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| at * 2 + IVec2::new(x, y));
    let size = map.size.as_ivec2();
    let inside = texels.iter().filter(|p| p.cmpge(IVec2::ZERO).all() && p.cmplt(size).all());
    let covered = inside.map(|p| (p.y * size.x + p.x) as usize).filter(|i| map.covered[*i]);
    let (sum, count) = covered.fold((Vec3::ZERO, 0), |(s, n), i| (s + map.irradiance[i], n + 1));
    (count > 0).then(|| sum / count as f32)
}
