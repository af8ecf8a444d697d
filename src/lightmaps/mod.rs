//! [`Lightmaps`]: solved texels as pictures, ready to be bound to nodes.
//!
//! A texel whose front lies inside other geometry takes its back, where that is open and lit (inverted normals), or is
//! filled from its neighbours. Gutters are filled into empty texels only: a valid black stays black.

mod fill;
pub(crate) use fill::gutters;
mod reading;
mod seams;

pub use reading::Reading;
pub use seams::jump_across_seams;

use crate::{
    atlas::{Atlas, Coverage},
    direct::Direct,
    math::luminance,
    patches::Patches,
    radiosity::Radiosity,
    scene::World,
};
use glam::{UVec2, Vec3};

/// Light inside an enclosure below this share of the mean outside has leaked in through texels that stand half outside.
const LEAK: f64 = 0.02;

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
    /// Texels whose value was not finite and is 0 instead.
    pub broken: usize,
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

impl Content {
    /// Everything there is to choose from.
    pub const ALL: [Content; 3] = [Content::Full, Content::Direct, Content::Indirect];

    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Content::Full => "full",
            Content::Direct => "direct",
            Content::Indirect => "indirect",
        }
    }
}

impl Lightmaps {
    /// Lays the patches' irradiance out on the visible pages.
    pub fn new(
        world: &World,
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
        let all = |p: usize| luminance(direct.total(p) + radiosity.indirect[p]);
        let open = (0..patches.fronts).filter(|&p| !patches.buried[p]);
        let (sum, count) = open.fold((0f64, 0), |(s, n), p| (s + f64::from(all(p)), n + 1));
        let dim = (LEAK * sum / f64::from(count.max(1u32))) as f32;
        let lit = |p: usize| all(p) > dim;
        let mut back_of = vec![None; if patches.backs.is_empty() { 0 } else { patches.fronts }];
        for (k, &t) in patches.backs.iter().enumerate() {
            back_of[t as usize] = Some(patches.fronts + k);
        }
        let charts = Charts::new(world, atlas, coverage);
        let mut maps = Lightmaps { content, ..Lightmaps::default() };
        for (page, p) in atlas.pages.iter().enumerate().filter(|(_, p)| !p.hidden) {
            let pixels = coverage.grids[page].len();
            let mut map = Map { size: p.size, irradiance: vec![Vec3::ZERO; pixels], covered: vec![false; pixels] };
            let mut state = vec![fill::State::Empty; pixels];
            for (pixel, &t) in coverage.grids[page].iter().enumerate() {
                let t = t as usize;
                if t >= patches.fronts {
                    continue;
                }
                map.covered[pixel] = true;
                let buried = patches.buried[t] && !lit(t);
                let back = back_of.get(t).copied().flatten().filter(|&b| buried && lit(b) && !patches.buried[b]);
                if buried && back.is_none() {
                    maps.buried += 1;
                    state[pixel] = fill::State::Buried(charts.of(t));
                    continue;
                }
                maps.turned += usize::from(back.is_some());
                let e = value(back.unwrap_or(t));
                maps.broken += usize::from(!e.is_finite());
                map.irradiance[pixel] = if e.is_finite() { e } else { Vec3::ZERO };
                state[pixel] = fill::State::Full(charts.of(t));
            }
            fill::buried(map.size, &mut map.irradiance, &mut state);
            let empty: Vec<bool> = state.iter().map(|s| *s == fill::State::Empty).collect();
            gutters(map.size, &mut map.irradiance, &empty);
            maps.pages.push(map);
        }
        maps
    }
}

impl Lightmaps {
    /// Irradiance of a covered texel; 0 on pages that there are not.
    pub fn value(&self, coverage: &Coverage, texel: usize) -> Vec3 {
        let t = coverage.texels[texel];
        let map = self.pages.get(t.page as usize);
        map.map_or(Vec3::ZERO, |map| map.irradiance[(t.at.y * map.size.x + t.at.x) as usize])
    }
}

/// Which chart a texel belongs to, by its largest piece.
struct Charts<'a> {
    world: &'a World<'a>,
    atlas: &'a Atlas,
    coverage: &'a Coverage,
}

impl<'a> Charts<'a> {
    fn new(world: &'a World<'a>, atlas: &'a Atlas, coverage: &'a Coverage) -> Self {
        Charts { world, atlas, coverage }
    }

    /// Instance and chart.
    fn of(&self, texel: usize) -> (u32, u32) {
        let largest = self.coverage.fragments_of(texel).iter().max_by(|a, b| a.area.total_cmp(&b.area));
        let (instance, t) = largest.map_or((0, 0), |f| self.world.locate(f.triangle));
        let mesh = self.world.scene.instances[instance].mesh as usize;
        (instance as u32, self.atlas.layouts[mesh].charts[t as usize])
    }
}
