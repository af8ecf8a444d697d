//! [`Lightmaps`]: solved texels as pictures, ready to be bound to nodes.
//!
//! A texel whose front lies inside other geometry takes its back, where that is open and lit (inverted normals), or is
//! filled from its neighbours. Gutters are filled into empty texels only: a valid black stays black.

mod fill;
pub(crate) use fill::gutters;
mod seams;

pub use seams::jump_across_seams;

use crate::{
    atlas::{Atlas, Coverage},
    direct::Direct,
    patches::Patches,
    radiosity::Radiosity,
};
use glam::{UVec2, Vec3};

/// What the maps hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// Direct and indirect light.
    #[default]
    Full,
    /// First-hit light of punctual lights: what an engine can draw in real time.
    Direct,
    /// Everything else, emissive surfaces and sky included.
    Indirect,
}

/// The visible pages of the atlas, filled with irradiance.
#[derive(Clone, Debug, Default)]
pub struct Lightmaps {
    /// One for each visible page, in the atlas' order.
    pub pages: Vec<Map>,
    /// What they hold.
    pub content: Content,
    /// Texels whose front is buried and dark.
    pub buried: usize,
    /// Texels that show their back, because their front is buried and the back is lit.
    pub turned: usize,
}

/// One page of irradiance.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// Width and height in texels.
    pub size: UVec2,
    /// Irradiance E (W/m^2, rgb), rows from the top; gutters are filled, everything further away is 0.
    pub irradiance: Vec<Vec3>,
    /// True where a surface covers the texel.
    pub covered: Vec<bool>,
}

impl Lightmaps {
    /// Lays the patches' irradiance out on the visible pages.
    pub fn new(
        atlas: &Atlas,
        coverage: &Coverage,
        patches: &Patches,
        direct: &Direct,
        radiosity: &Radiosity,
        content: Content,
    ) -> Self {
        let value = |p: usize| match content {
            Content::Full => direct.lights[p] + direct.surroundings(p) + radiosity.indirect[p],
            Content::Direct => direct.lights[p],
            Content::Indirect => direct.surroundings(p) + radiosity.indirect[p],
        };
        let lit = |p: usize| direct.total(p) + radiosity.indirect[p] != Vec3::ZERO;
        let mut back_of = std::collections::HashMap::new();
        for (k, &t) in patches.backs.iter().enumerate() {
            back_of.insert(t as usize, patches.fronts + k);
        }
        let mut maps = Lightmaps { content, ..Lightmaps::default() };
        for (page, p) in atlas.pages.iter().enumerate().filter(|(_, p)| !p.hidden) {
            let pixels = coverage.grids[page].len();
            let mut map = Map { size: p.size, irradiance: vec![Vec3::ZERO; pixels], covered: vec![false; pixels] };
            let mut empty = vec![true; pixels];
            for (pixel, &t) in coverage.grids[page].iter().enumerate() {
                let t = t as usize;
                if t >= patches.fronts {
                    continue;
                }
                map.covered[pixel] = true;
                let buried = patches.buried[t] && !lit(t);
                match back_of.get(&t).filter(|&&b| buried && lit(b) && !patches.buried[b]) {
                    Some(&back) => {
                        maps.turned += 1;
                        (map.irradiance[pixel], empty[pixel]) = (value(back), false);
                    }
                    None if buried => maps.buried += 1,
                    None => (map.irradiance[pixel], empty[pixel]) = (value(t), false),
                }
            }
            gutters(map.size, &mut map.irradiance, &empty);
            maps.pages.push(map);
        }
        maps
    }
}

impl Map {
    /// Irradiance at texel coordinates `at`, bilinear as engines read it.
    pub fn bilinear(&self, at: glam::Vec2) -> Vec3 {
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
