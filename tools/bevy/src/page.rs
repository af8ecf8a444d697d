//! A page of a lightmap as an image of Bevy's.

use crate::data::{Page, Problem};
use bevy::{
    asset::RenderAssetUsages,
    image::{CompressedImageFormats, Image, ImageFormat, ImageSampler, ImageType},
    render::render_resource::TextureFormat,
};
use half::f16;
use std::f32::consts::PI;

/// The picture, with E / pi as texels: what Bevy multiplies with base colours, as long as a material's
/// `lightmap_exposure` is 1.
pub fn image(bytes: &[u8], page: &Page, usages: RenderAssetUsages) -> Result<Image, Problem> {
    let exr = ImageType::Format(ImageFormat::OpenExr);
    // Linear filtering, no repetition, no mipmaps.
    let mut image = Image::from_buffer(bytes, exr, CompressedImageFormats::NONE, false, ImageSampler::linear(), usages)
        .map_err(|error| format!("is not a whole EXR picture: {}", first_line(&error.to_string())))?;
    let (width, height) = (image.width(), image.height());
    if (width, height) != (page.width, page.height) {
        return Err(format!("is {width} x {height}, not {} x {}", page.width, page.height));
    }
    let texels: Vec<f32> = floats(&image).collect();
    let factor = page.scale / PI;
    // Every GPU filters halves, not all of them floats.
    if texels.iter().all(|x| (x * factor).abs() <= f32::from(f16::MAX)) {
        image.texture_descriptor.format = TextureFormat::Rgba16Float;
        image.data = Some(texels.iter().flat_map(|x| f16::from_f32(x * factor).to_le_bytes()).collect());
    } else {
        image.data = Some(texels.iter().flat_map(|x| (x * factor).to_le_bytes()).collect());
    }
    Ok(image)
}

/// What Bevy reads from an EXR picture.
fn floats(image: &Image) -> impl Iterator<Item = f32> {
    debug_assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba32Float);
    let bytes = image.data.as_deref().unwrap_or_default();
    bytes.chunks_exact(4).map(|x| f32::from_le_bytes([x[0], x[1], x[2], x[3]]))
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}
