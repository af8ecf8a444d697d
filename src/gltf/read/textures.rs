//! Textures that materials read: the image behind each, its sampler and its transform. Equal ones are shared.

use super::{
    accessors::view_bytes,
    extensions::{BASISU, extension, refused},
    source::{Source, label, linked},
    warnings::Warnings,
};
use crate::{
    error::{Error, Result},
    memory, pixels,
    scene::{Texture, TextureRef, Wrap},
};
use glam::{Affine2, Mat2, UVec2, Vec2};
use gltf::json::{
    extensions::texture::TextureTransform,
    texture::{Info, MagFilter, WrappingMode},
    validation::Checked,
};
use serde_json::Value;
use std::{borrow::Cow, collections::HashMap};

/// What makes two textures equal: image (`None`: white), wrap modes, nearest, sRGB.
type Key = (Option<usize>, [Wrap; 2], bool, bool);

/// Textures wanted so far, with a place where each is used.
pub(super) struct Textures<'s, 'a> {
    source: &'s Source<'a>,
    wanted: Vec<(Key, String)>,
    index: HashMap<Key, u32>,
}

impl<'s, 'a> Textures<'s, 'a> {
    pub fn new(source: &'s Source<'a>) -> Self {
        Textures { source, wanted: Vec::new(), index: HashMap::new() }
    }

    /// What a material called `material` reads through `info`.
    pub fn get(&mut self, info: &Info, srgb: bool, material: &str, warnings: &mut Warnings) -> Result<TextureRef> {
        let index = info.index.value();
        let from = self.source.part(&self.source.textures, index, "texture", material)?;
        let place = format!("{material}, {}", label("texture", index, from.name.as_deref()));
        let (wrap, nearest) = self.sampler(from.sampler.map(|s| s.value()), &place)?;
        let key = (self.image(index, &place, warnings)?, wrap, nearest, srgb);
        let texture = match self.index.get(&key) {
            Some(known) => *known,
            None => {
                self.wanted.push((key, place));
                let at = self.wanted.len() as u32 - 1;
                self.index.insert(key, at);
                at
            }
        };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        Ok(TextureRef {
            texture,
            set: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
            transform: transform.map_or(Affine2::IDENTITY, affine),
        })
    }

    /// Decodes all that are wanted, once their headers say that they fit into memory.
    pub fn finish(self) -> Result<Vec<Texture>> {
        let (mut all, mut largest) = (0, 0);
        for ((image, ..), place) in &self.wanted {
            let Some(image) = *image else { continue };
            let header = self.picture(image, place, pixels::measure)?;
            all += Texture::bytes(header.size);
            largest = largest.max(header.bytes);
        }
        if all > 0 {
            let input = self.source.file.display();
            let tool = format!("npx @gltf-transform/cli resize --width 2048 --height 2048 \"{input}\" OUT.glb");
            let remedy = format!("make its pictures smaller: {tool}");
            memory::fits((all + largest) >> 20, memory::free_mb(), &remedy)?;
        }
        let texture = |((image, wrap, nearest, srgb), place): &(Key, String)| {
            let (size, rgba) = match *image {
                Some(image) => self.picture(image, place, pixels::decode).map(|p| (p.size, p.rgba))?,
                None => (UVec2::ONE, vec![[255; 4]]),
            };
            Ok(Texture::new(size, rgba, *srgb, *wrap, *nearest))
        };
        self.wanted.iter().map(texture).collect()
    }

    fn sampler(&self, index: Option<usize>, place: &str) -> Result<([Wrap; 2], bool)> {
        let Some(index) = index else { return Ok(Default::default()) };
        let from = self.source.part(&self.source.samplers, index, "sampler", place)?;
        let wrap = |mode: Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
            Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
            Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
            Checked::Invalid => Err(self.source.invalid(place, format!("the wrap mode of sampler {index} is unknown"))),
        };
        let nearest = matches!(from.mag_filter, Some(Checked::Valid(MagFilter::Nearest)));
        Ok(([wrap(from.wrap_s)?, wrap(from.wrap_t)?], nearest))
    }

    /// The image of texture `index`: WebP before the plain source, which may be a fallback.
    fn image(&self, index: usize, place: &str, warnings: &mut Warnings) -> Result<Option<usize>> {
        let texture = self.source.value("textures", index);
        let source = |part: &Value| part.get("source").and_then(Value::as_u64).map(|i| i as usize);
        if let Some(webp) = extension(texture, "EXT_texture_webp").and_then(source) {
            return Ok(Some(webp));
        }
        if let Some(plain) = source(texture) {
            return Ok(Some(plain));
        }
        for name in [BASISU, "EXT_texture_avif", "MSFT_texture_dds"] {
            if extension(texture, name).is_some() {
                return Err(refused(self.source.file, name, place));
            }
        }
        warnings.about(place, "has no image: taken as white");
        Ok(None)
    }

    /// What `read` makes of the bytes of image `index`, used at `place`.
    fn picture<T>(&self, index: usize, place: &str, read: fn(&[u8]) -> std::result::Result<T, String>) -> Result<T> {
        let source = self.source;
        let images = source.document.json.get("images").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let image = source.part(images, index, "image", place)?;
        let place = format!("{place}, {}", label("image", index, image.get("name").and_then(Value::as_str)));
        let view = image.get("bufferView").and_then(Value::as_u64);
        let bytes: Cow<[u8]> = match (image.get("uri").and_then(Value::as_str), view) {
            (Some(text), _) => linked(source.file, text, &place)?.into(),
            (None, Some(view)) => view_bytes(source, usize::try_from(view).unwrap_or(usize::MAX), &place)?.into(),
            (None, None) => return Err(source.invalid(place, "has neither a uri nor a bufferView")),
        };
        read(&bytes).map_err(|problem| {
            Error::invalid(source.file, place, problem, "replace the picture by a valid PNG, JPEG or WebP file")
        })
    }
}

/// Offset, then rotation, then scale, as matrices from the left. The rotation is counter-clockwise to the eye, on
/// coordinates whose v points down.
fn affine(t: &TextureTransform) -> Affine2 {
    let (sin, cos) = (libm::sinf(t.rotation.0), libm::cosf(t.rotation.0));
    let [x, y] = t.scale.0;
    Affine2 {
        matrix2: Mat2::from_cols(Vec2::new(cos, -sin) * x, Vec2::new(sin, cos) * y),
        translation: Vec2::from_array(t.offset.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::extensions::texture::{TextureTransformOffset, TextureTransformRotation, TextureTransformScale};

    /// The specification's example: "only the lower left quadrant of the source image, rotated clockwise 90 degrees".
    #[test]
    fn transform_of_the_specification() {
        let t = affine(&TextureTransform {
            offset: TextureTransformOffset([0.0, 1.0]),
            rotation: TextureTransformRotation(std::f32::consts::FRAC_PI_2),
            scale: TextureTransformScale([0.5, 0.5]),
            ..TextureTransform::default()
        });
        for (uv, expected) in [([0.0, 0.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.5]), ([0.0, 1.0], [0.5, 1.0])] {
            let got = t.transform_point2(Vec2::from_array(uv));
            assert!(got.abs_diff_eq(Vec2::from_array(expected), 1e-6), "{uv:?}: {got}");
        }
    }
}
