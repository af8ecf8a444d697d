//! The map as a viewer reads it, and as it would be at half its density.

use crate::{
    atlas::Coverage,
    lightmaps::{Lightmaps, Map},
};
use glam::{IVec2, Vec2, Vec3};

/// How a map is read at a point of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The texel that the point lies in.
    Constant,
    /// Between four texels, as viewers do.
    Bilinear,
}

impl Reading {
    /// Everything there is to choose from.
    pub const ALL: [Reading; 2] = [Reading::Constant, Reading::Bilinear];

    /// The name in charts.
    pub fn name(self) -> &'static str {
        match self {
            Reading::Constant => "constant",
            Reading::Bilinear => "bilinear",
        }
    }
}

/// What the maps say at a point of a triangle; 0 where they say nothing.
pub(super) fn read(coverage: &Coverage, maps: &Lightmaps, triangle: u32, bary: Vec2, reading: Reading) -> Vec3 {
    let charted = &coverage.charted[triangle as usize];
    let at = charted.at(bary);
    let Some(map) = maps.pages.get(charted.page as usize) else { return Vec3::ZERO };
    match reading {
        Reading::Bilinear => map.bilinear(at),
        Reading::Constant => {
            let texel = coverage.texel_near(charted, at).map(|t| coverage.texels[t as usize].at);
            texel.map_or(Vec3::ZERO, |t| map.irradiance[(t.y * map.size.x + t.x) as usize])
        }
    }
}

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
