//! Punctual lights, by the formulas of KHR_lights_punctual.

use glam::Vec3;

/// What of a light goes into the lightmap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bake {
    /// Its direct light and its bounces.
    #[default]
    Full,
    /// Its bounces only: the engine draws the direct light.
    Indirect,
    /// Nothing.
    None,
}

/// A light without surface.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name for messages.
    pub name: String,
    /// Index of the node in the source document; `None` for one given on the command line.
    pub node: Option<u32>,
    /// Shape of the light.
    pub kind: LightKind,
    /// Position in the scene's space (not used by directional lights).
    pub position: Vec3,
    /// Unit direction in which the light travels (not used by point lights).
    pub direction: Vec3,
    /// rgb; candela (W/sr) for point and spot, lux (W/m^2 across the beam) for directional.
    pub intensity: Vec3,
    /// Distance (metres) at which the light ends, infinite without.
    pub range: f32,
    /// What of it is baked.
    pub bake: Bake,
}

/// Largest radiance, irradiance or intensity of a channel that comes from a file: more is capped, so that sums of
/// light stay finite.
pub const MAX_LIGHT: f32 = 1e20;

/// Shape of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines everywhere alike.
    Point {
        /// Radius (metres) of the ball that softens shadows; 0: hard.
        radius: f32,
    },
    /// Shines into a cone.
    Spot {
        /// Cosine of the half angle inside which the light is full.
        cos_inner: f32,
        /// Cosine of the half angle outside which there is none.
        cos_outer: f32,
        /// Radius (metres) of the ball that softens shadows; 0: hard.
        radius: f32,
    },
    /// Parallel light from infinity.
    Directional {
        /// Diameter of the disc in the sky, radians; 0: hard shadows.
        angle: f32,
    },
}
