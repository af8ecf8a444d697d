//! Lambertian surfaces and what holes they have.

use super::{Mesh, Primitive, Scene, TextureRef};
use glam::{Vec2, Vec3, Vec4};

/// How a surface looks to a radiosity solver. Factors are linear; textures multiply them.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// rgb: diffuse colour before metalness; a: opacity.
    pub base_color: Vec4,
    /// Multiplies `base_color`, alpha included.
    pub base_texture: Option<TextureRef>,
    /// Metals reflect no diffuse light: reflectance is multiplied by 1 - metallic.
    pub metallic: f32,
    /// Of microfacets, for pictures: 0 is a mirror.
    pub roughness: f32,
    /// Its blue channel multiplies `metallic`, its green one `roughness`.
    pub metallic_texture: Option<TextureRef>,
    /// Emitted radiance L (W/m^2/sr); exitance M = pi L.
    pub emission: Vec3,
    /// Multiplies `emission`.
    pub emission_texture: Option<TextureRef>,
    /// What opacity means.
    pub alpha: Alpha,
    /// Share of light that goes straight through, tinted by the base colour (KHR_materials_transmission).
    pub transmission: f32,
    /// Its red channel multiplies `transmission`.
    pub transmission_texture: Option<TextureRef>,
    /// Both sides reflect and emit; else the back blocks and brings nothing.
    pub double_sided: bool,
    /// Drawn as it is: lights nothing, is not lit, blocks (KHR_materials_unlit).
    pub unlit: bool,
}

/// Meaning of a material's opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// Ignored.
    Opaque,
    /// Holes where opacity is below the cutoff.
    Mask(f32),
    /// Rays pass with probability 1 - opacity.
    Blend,
}

impl Default for Material {
    /// Grey .8 Lambertian, one-sided, opaque.
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: Vec4::new(0.8, 0.8, 0.8, 1.0),
            base_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            alpha: Alpha::Opaque,
            transmission: 0.0,
            transmission_texture: None,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// True if rays may pass: an intersection has to ask [`Scene::transmittance`].
    pub fn has_holes(&self) -> bool {
        self.alpha != Alpha::Opaque || self.transmission > 0.0
    }

    /// True if any part of it emits.
    pub fn emits(&self) -> bool {
        !self.unlit && self.emission.max_element() > 0.0
    }
}

/// Surface properties at one point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface {
    /// Diffuse reflectance rho, rgb in [0, 1].
    pub reflectance: Vec3,
    /// Emitted radiance L, rgb.
    pub emission: Vec3,
    /// Share of light that passes straight through, rgb in [0, 1].
    pub transmittance: Vec3,
    /// Share of `1 - metallic`; 1 for a dielectric.
    pub dielectric: f32,
    /// What the metallic share mirrors head on, rgb in [0, 1]. Light that bounces knows nothing of it.
    pub mirror: Vec3,
    /// Roughness of that mirror.
    pub roughness: f32,
}

impl Scene {
    /// Surface properties of triangle `t` of `mesh` at barycentrics (1 - u - v, u, v).
    ///
    /// `footprint`: length of the area to average, in texture coordinates; 0 reads the finest level.
    pub fn surface(&self, mesh: &Mesh, t: u32, bary: Vec2, footprint: f32) -> Surface {
        let primitive = &mesh.primitives[mesh.primitive_of(t)];
        let m = &self.materials[primitive.material as usize];
        if m.unlit {
            return Surface {
                transmittance: Vec3::splat(self.hole(m, mesh, t, bary, footprint)),
                ..Surface::default()
            };
        }
        let look = |r: &Option<TextureRef>| r.as_ref().map_or(Vec4::ONE, |r| self.texel(r, mesh, t, bary, footprint));
        let base = self.base_color(mesh, t, bary, footprint);
        let metal = look(&m.metallic_texture);
        let dielectric = 1.0 - m.metallic * metal.z;
        let through = m.transmission * look(&m.transmission_texture).x;
        let holes = match m.alpha {
            Alpha::Opaque => 0.0,
            Alpha::Mask(cutoff) => f32::from(u8::from(base.w < cutoff)),
            Alpha::Blend => 1.0 - base.w.clamp(0.0, 1.0),
        };
        let albedo = base.truncate().clamp(Vec3::ZERO, Vec3::ONE);
        // Rays meet the surface with probability 1 - mean transmittance: what it reflects is given that they do.
        let met = 1.0 - through * albedo.element_sum() / 3.0;
        let kept = (1.0 - through) / met.max(1e-6);
        let reflectance = albedo * dielectric * kept;
        Surface {
            reflectance: reflectance.min(Vec3::ONE),
            emission: m.emission * look(&m.emission_texture).truncate(),
            transmittance: Vec3::splat(holes) + albedo * through * (1.0 - holes),
            dielectric,
            mirror: (albedo * (1.0 - dielectric) * kept).min(Vec3::ONE),
            roughness: m.roughness * metal.y,
        }
    }

    /// True if [`Scene::surface`] is the same at all points of triangle `t` of `mesh`.
    pub fn is_uniform(&self, mesh: &Mesh, t: u32) -> bool {
        let m = &self.materials[mesh.primitives[mesh.primitive_of(t)].material as usize];
        let slots = [&m.base_texture, &m.metallic_texture, &m.emission_texture, &m.transmission_texture];
        mesh.colors.is_empty() && slots.iter().all(|slot| slot.is_none())
    }

    /// Base colour (linear) and opacity of triangle `t` of `mesh` at `bary`: all that an unlit surface has.
    pub fn base_color(&self, mesh: &Mesh, t: u32, bary: Vec2, footprint: f32) -> Vec4 {
        let m = &self.materials[mesh.primitives[mesh.primitive_of(t)].material as usize];
        let texture = m.base_texture.as_ref().map_or(Vec4::ONE, |r| self.texel(r, mesh, t, bary, footprint));
        m.base_color * texture * vertex_color(mesh, t, bary)
    }

    /// Share of light (rgb) that passes straight through triangle `t` of `mesh` at `bary`.
    pub fn transmittance(&self, mesh: &Mesh, t: u32, bary: Vec2) -> Vec3 {
        self.surface(mesh, t, bary, 0.0).transmittance
    }

    fn hole(&self, m: &Material, mesh: &Mesh, t: u32, bary: Vec2, footprint: f32) -> f32 {
        let alpha = self.base_color(mesh, t, bary, footprint).w;
        match m.alpha {
            Alpha::Opaque => 0.0,
            Alpha::Mask(cutoff) => f32::from(u8::from(alpha < cutoff)),
            Alpha::Blend => 1.0 - alpha.clamp(0.0, 1.0),
        }
    }

    fn texel(&self, r: &TextureRef, mesh: &Mesh, t: u32, bary: Vec2, footprint: f32) -> Vec4 {
        let uv = match mesh.uvs.get(r.set as usize) {
            Some(set) if !set.is_empty() => {
                let [a, b, c] = mesh.triangles[t as usize].map(|v| set[v as usize]);
                a + (b - a) * bary.x + (c - a) * bary.y
            }
            _ => Vec2::ZERO,
        };
        let footprint = footprint * r.transform.matrix2.determinant().abs().sqrt();
        self.textures[r.texture as usize].sample(r.transform.transform_point2(uv), footprint)
    }
}

fn vertex_color(mesh: &Mesh, t: u32, bary: Vec2) -> Vec4 {
    if mesh.colors.is_empty() {
        return Vec4::ONE;
    }
    let [a, b, c] = mesh.triangles[t as usize].map(|v| mesh.colors[v as usize]);
    a + (b - a) * bary.x + (c - a) * bary.y
}

impl Primitive {
    /// True if the file has texture coordinate set `set` for this primitive.
    pub fn has_uv(&self, set: u32) -> bool {
        set < 32 && self.uv_sets >> set & 1 == 1
    }
}
