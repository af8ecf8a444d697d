//! Look-ups at points of the surface.

use super::{Lightmaps, Map};
use crate::atlas::Coverage;
use glam::{Vec2, Vec3};

/// How a map is read at a point of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The texel that the point lies in.
    Constant,
    /// Between four texels, as engines read it.
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

impl Lightmaps {
    /// Irradiance at a point of a triangle; 0 where the maps say nothing.
    pub fn read(&self, coverage: &Coverage, triangle: u32, bary: Vec2, reading: Reading) -> Vec3 {
        let charted = &coverage.charted[triangle as usize];
        let at = charted.at(bary);
        let Some(map) = self.pages.get(charted.page as usize) else { return Vec3::ZERO };
        match reading {
            Reading::Bilinear => map.bilinear(at),
            Reading::Constant => {
                let texel = coverage.texel_near(charted, at).map(|t| coverage.texels[t as usize].at);
                texel.map_or(Vec3::ZERO, |t| map.irradiance[(t.y * map.size.x + t.x) as usize])
            }
        }
    }
}

impl Map {
    /// Irradiance at texel coordinates `at`, bilinear as engines read it.
    pub fn bilinear(&self, at: Vec2) -> Vec3 {
        let p = at - 0.5;
        let (i, f) = (p.floor().as_ivec2(), p - p.floor());
        let get = |x: i32, y: i32| {
            let (x, y) = (x.clamp(0, self.size.x as i32 - 1), y.clamp(0, self.size.y as i32 - 1));
            self.irradiance[y as usize * self.size.x as usize + x as usize]
        };
        let row = |y: i32| get(i.x, y).lerp(get(i.x + 1, y), f.x);
        row(i.y).lerp(row(i.y + 1), f.y)
    }
}
