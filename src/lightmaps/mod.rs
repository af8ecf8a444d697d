//! [`Lightmaps`]: solved texels as pictures, ready to be bound to nodes.

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
