//! [`Patches`]: what each texel stands for.

use glam::Vec3;

/// One entry a patch: first the covered texels in the order of [`crate::atlas::Coverage`], then backs that rays met.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    /// World area, m^2.
    pub area: Vec<f32>,
    /// A point on the surface near the texel's middle.
    pub center: Vec<Vec3>,
    /// Unit face normal (of the largest piece).
    pub normal: Vec<Vec3>,
    /// Diffuse reflectance, capped.
    pub reflectance: Vec<Vec3>,
    /// Emitted exitance M = pi L, W/m^2.
    pub exitance: Vec<Vec3>,
}
