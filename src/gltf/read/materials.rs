//! Materials to what light sees of them: the ones that triangles use, each read once.

use super::{
    source::{Source, label},
    textures::Textures,
    warnings::Warnings,
};
use crate::{
    error::Result,
    scene::{Alpha, MAX_LIGHT, Material, Texture, TextureRef},
};
use glam::{Vec3, Vec4};
use gltf::json::{self, material::AlphaMode, texture::Info, validation::Checked};
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;

/// Share by which the channels of transmitted light may differ and still be called grey.
const TINT: f32 = 0.05;

/// Materials read so far.
pub(super) struct Materials<'s, 'a> {
    source: &'s Source<'a>,
    textures: Textures<'s, 'a>,
    read: Vec<Material>,
    index: HashMap<Option<usize>, u32>,
}

impl<'s, 'a> Materials<'s, 'a> {
    pub fn new(source: &'s Source<'a>) -> Self {
        Materials { source, textures: Textures::new(source), read: Vec::new(), index: HashMap::new() }
    }

    /// Scene index of material `index` of the document, used at `place`.
    pub fn get(&mut self, index: usize, place: &str, warnings: &mut Warnings) -> Result<u32> {
        if let Some(known) = self.index.get(&Some(index)) {
            return Ok(*known);
        }
        let from = self.source.part(&self.source.materials, index, "material", place)?;
        let name = label("material", index, from.name.as_deref());
        let material = self.resolve(from, index, name, warnings)?;
        Ok(self.insert(Some(index), material))
    }

    /// Scene index of the material of a primitive that has none.
    pub fn without(&mut self) -> u32 {
        match self.index.get(&None) {
            Some(known) => *known,
            None => self.insert(None, Material::default()),
        }
    }

    /// Warns if `material` reads a texture coordinate set that a primitive of `mesh` lacks.
    pub fn check_sets(&self, material: u32, has: impl Fn(u32) -> bool, mesh: &str, warnings: &mut Warnings) {
        let m = &self.read[material as usize];
        let slots = [&m.base_texture, &m.metallic_texture, &m.emission_texture, &m.transmission_texture];
        for set in slots.into_iter().flatten().map(|r| r.set).filter(|set| !has(*set)) {
            let sentence = format!("lacks TEXCOORD_{set}, which {} reads: its texture is one colour there", m.name);
            warnings.about(mesh, sentence);
        }
    }

    pub fn finish(self, warnings: &mut Warnings) -> Result<(Vec<Material>, Vec<Texture>)> {
        let textures = self.textures.finish()?;
        for m in self.read.iter().filter(|m| m.transmission > 0.0 && !m.unlit) {
            let picture = m.base_texture.as_ref().map_or(Vec4::ONE, |r| textures[r.texture as usize].mean());
            let color = (m.base_color * picture).truncate();
            if color.max_element() - color.min_element() > TINT * color.max_element() {
                let sentence = "lets coloured light through, but only lamps and the sun are tinted: light of the sky and \
                                of bounces passes in grey";
                warnings.about(&m.name, sentence);
            }
        }
        Ok((self.read, textures))
    }

    fn insert(&mut self, key: Option<usize>, material: Material) -> u32 {
        self.read.push(material);
        let at = self.read.len() as u32 - 1;
        self.index.insert(key, at);
        at
    }

    fn resolve(
        &mut self,
        from: &json::Material,
        index: usize,
        name: String,
        warnings: &mut Warnings,
    ) -> Result<Material> {
        let look = Look::of(self.source, from, index, &name, warnings)?;
        let extensions = from.extensions.as_ref();
        let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
        let transmission = extensions.and_then(|e| e.transmission.as_ref());
        let cutoff = from.alpha_cutoff.map_or(0.5, |c| c.0);
        let Checked::Valid(alpha) = from.alpha_mode else {
            return Err(self.source.invalid(name, "its alphaMode is unknown"));
        };
        let emission = emission(from.emissive_factor.0, strength, &name, warnings);
        let through = transmission.map_or(0.0, |t| t.transmission_factor.0);
        if !(look.base.is_finite() && [look.metallic, look.roughness, through, cutoff].iter().all(|f| f.is_finite())) {
            return Err(self.source.invalid(name, "one of its factors is not finite"));
        }
        let (metallic, through) = (look.metallic.clamp(0.0, 1.0), through.clamp(0.0, 1.0));
        // A texture that a factor of zero multiplies is not looked at.
        let mut slot = |info: Option<&Info>, used: bool, srgb: bool| -> Result<Option<TextureRef>> {
            info.filter(|_| used).map(|i| self.textures.get(i, srgb, &name, warnings)).transpose()
        };
        Ok(Material {
            base_color: look.base.clamp(Vec4::ZERO, Vec4::ONE),
            base_texture: slot(look.base_texture.as_ref(), true, true)?,
            metallic,
            roughness: look.roughness.clamp(0.0, 1.0),
            metallic_texture: slot(look.metallic_texture.as_ref(), metallic > 0.0, false)?,
            emission,
            emission_texture: slot(from.emissive_texture.as_ref(), emission != Vec3::ZERO, true)?,
            alpha: match alpha {
                AlphaMode::Opaque => Alpha::Opaque,
                AlphaMode::Mask => Alpha::Mask(cutoff),
                AlphaMode::Blend => Alpha::Blend,
            },
            transmission: through,
            transmission_texture: slot(
                transmission.and_then(|t| t.transmission_texture.as_ref()),
                through > 0.0,
                false,
            )?,
            double_sided: from.double_sided,
            unlit: extensions.is_some_and(|e| e.unlit.is_some()),
            name,
        })
    }
}

/// Emitted radiance, 0 to [`MAX_LIGHT`].
fn emission(factor: [f32; 3], strength: f32, name: &str, warnings: &mut Warnings) -> Vec3 {
    let wished = factor.map(|f| f64::from(f.clamp(0.0, f32::MAX)) * f64::from(strength.clamp(0.0, f32::MAX)));
    if wished.iter().any(|c| *c > f64::from(MAX_LIGHT)) {
        warnings.about(name, format!("emits more than {MAX_LIGHT:e}: it is capped there"));
    }
    Vec3::from(wished.map(|c| c as f32)).min(Vec3::splat(MAX_LIGHT))
}

/// Base colour, metalness and roughness, from whichever model the material has.
struct Look {
    base: Vec4,
    base_texture: Option<Info>,
    metallic: f32,
    roughness: f32,
    metallic_texture: Option<Info>,
}

/// The part of KHR_materials_pbrSpecularGlossiness that is used.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SpecularGlossiness {
    #[serde(default = "one")]
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<Info>,
}

fn one() -> [f32; 4] {
    [1.0; 4]
}

impl Look {
    fn of(source: &Source, from: &json::Material, index: usize, name: &str, warnings: &mut Warnings) -> Result<Self> {
        let value: &Value = source.value("materials", index);
        if let Some(old) = super::extensions::extension(value, "KHR_materials_pbrSpecularGlossiness") {
            let old = SpecularGlossiness::deserialize(old).map_err(|e| source.invalid(name, e.to_string()))?;
            warnings.about(name, "has KHR_materials_pbrSpecularGlossiness, of which only the diffuse part is used");
            let (base, base_texture) = (Vec4::from_array(old.diffuse_factor), old.diffuse_texture);
            return Ok(Look { base, base_texture, metallic: 0.0, roughness: 1.0, metallic_texture: None });
        }
        let pbr = &from.pbr_metallic_roughness;
        Ok(Look {
            base: Vec4::from_array(pbr.base_color_factor.0),
            base_texture: pbr.base_color_texture.clone(),
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            metallic_texture: pbr.metallic_roughness_texture.clone(),
        })
    }
}
