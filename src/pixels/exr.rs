//! OpenEXR: lightmap pages out, and in again.
//!
//! Written: one layer, scanlines from the top, ZIP, channels R G B; half floats, or 32 bits on request. A page whose
//! values do not suit a half is divided by a power of two, which loses nothing: value = texel * scale.
//! The same values give the same bytes. Neither NaN nor infinity is ever written.

use ::exr::{
    block::{self, BlockIndex, UncompressedBlock, chunk::Chunk, writer::ChunksWriter},
    image::write::layers::{LayersWriter, WritableLayers},
    prelude::{
        AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
        ReadChannels, ReadLayers, f16, read,
    },
};
use glam::{UVec2, Vec3};
use rayon::prelude::*;
use std::io::Cursor;

/// A page as the bytes of an EXR file.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The file.
    pub bytes: Vec<u8>,
    /// Power of two: value = texel * scale.
    pub scale: f32,
}

/// The largest half float.
const HALF_MAX: f32 = 65504.0;

/// Pages darker than this are scaled up: a half loses digits below 2^-14, and shadows are far darker than the maximum.
const DIM: f32 = 1.0 / 64.0;

/// Blocks of rows that are there at once, compressed.
const TOGETHER: usize = 64;

/// Encodes `values`, rows from the top; `float`: 32 bits a channel instead of 16. The error is the encoder's reason.
pub fn encode(size: UVec2, values: &[Vec3], float: bool) -> Result<Encoded, String> {
    if size.min_element() == 0 || values.len() != size.x as usize * size.y as usize {
        return Err(format!("a page of {} x {} texels cannot hold {} values", size.x, size.y, values.len()));
    }
    let scale = if float { 1.0 } else { page_scale(values) };
    let channel = |name, of: fn(&Vec3) -> f32| {
        let texels = values.iter().map(|v| finite(of(v)) / scale);
        let samples = if float {
            FlatSamples::F32(texels.collect())
        } else {
            FlatSamples::F16(texels.map(f16::from_f32).collect())
        };
        AnyChannel::new(name, samples)
    };
    let channels = [channel("B", |v| v.z), channel("G", |v| v.y), channel("R", |v| v.x)];
    let how =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let list = AnyChannels::sort(channels.into_iter().collect());
    let layer = Layer::new((size.x as usize, size.y as usize), LayerAttributes::default(), how, list);
    let bytes = write(&Image::from_layer(layer)).map_err(|e| e.to_string())?;
    Ok(Encoded { bytes, scale })
}

/// The bytes of a file. The library's own way would compress on one thread, or on all of the machine's, asked or not.
fn write(image: &Image<Layer<AnyChannels<FlatSamples>>>) -> ::exr::error::Result<Vec<u8>> {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let layers = image.layer_data.create_writer(&headers);
    let mut bytes = Cursor::new(Vec::new());
    block::write(&mut bytes, headers, true, |meta, file| {
        let compressed = |&(place, index): &(usize, BlockIndex)| {
            let data = layers.extract_uncompressed_block(&meta.headers, index);
            Ok((place, UncompressedBlock { index, data }.compress_to_chunk(&meta.headers)?))
        };
        let blocks: Vec<(usize, BlockIndex)> = block::enumerate_ordered_header_block_indices(&meta.headers).collect();
        for some in blocks.chunks(TOGETHER) {
            let chunks: Vec<(usize, Chunk)> = some.par_iter().map(compressed).collect::<::exr::error::Result<_>>()?;
            chunks.into_iter().try_for_each(|(place, chunk)| file.write_chunk(place, chunk))?;
        }
        Ok(())
    })?;
    Ok(bytes.into_inner())
}

/// Width and height as the header of an EXR file says, before anything is allocated by it.
pub fn size(bytes: &[u8]) -> Result<UVec2, String> {
    let meta = ::exr::meta::MetaData::read_from_buffered(bytes, false).map_err(|e| e.to_string())?;
    let size = meta.headers.first().ok_or("it has no layer")?.layer_size;
    Ok(UVec2::new(size.width().try_into().unwrap_or(u32::MAX), size.height().try_into().unwrap_or(u32::MAX)))
}

/// Decodes the R G B channels of an EXR file, rows from the top, not yet multiplied by the page's scale.
pub fn decode(bytes: &[u8]) -> Result<(UVec2, Vec<Vec3>), String> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, texels), p, (r, g, b): (f32, f32, f32)| texels[p.y() * *width + p.x()] = Vec3::new(r, g, b),
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let size = image.layer_data.size;
    Ok((UVec2::new(size.width() as u32, size.height() as u32), image.layer_data.channel_data.pixels.1))
}

/// The power of two by which to divide: 1 wherever halves serve well.
fn page_scale(values: &[Vec3]) -> f32 {
    let max = values.iter().flat_map(|v| v.to_array()).fold(0.0, |m, c| f32::max(m, finite(c).abs()));
    let mut scale = 1.0;
    while max / scale > HALF_MAX {
        scale *= 2.0;
    }
    // A dim page's maximum comes to [1/2, 1), 13 octaves above the values at which a half loses digits.
    while max > 0.0 && max < DIM && max / scale < 0.5 && scale > f32::MIN_POSITIVE * 1024.0 {
        scale *= 0.5;
    }
    scale
}

/// Largest irradiance: still finite when a half has rounded it up.
const LARGEST: f32 = 3.4e38;

fn finite(c: f32) -> f32 {
    debug_assert!(c.is_finite(), "irradiance must be finite");
    if c.is_nan() { 0.0 } else { c.clamp(-LARGEST, LARGEST) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(values: &[Vec3], float: bool) -> (f32, Vec<Vec3>) {
        let size = UVec2::new(values.len() as u32 / 2, 2);
        let file = encode(size, values, float).unwrap();
        let (got, texels) = decode(&file.bytes).unwrap();
        assert_eq!(got, size);
        (file.scale, texels.iter().map(|&t| t * file.scale).collect())
    }

    #[test]
    fn floats_come_back_exactly_and_in_order() {
        let values: Vec<Vec3> = (0..34).map(|i| Vec3::new(i as f32 * 0.1, 1e9 + i as f32, 1e-20)).collect();
        assert_eq!(round_trip(&values, true), (1.0, values));
    }

    #[test]
    fn halves_come_back_within_eleven_bits_at_any_brightness() {
        for (bright, scale) in [(1.0, 1.0), (60_000.0, 1.0), (65_504.0, 1.0), (65_505.0, 2.0), (1e6, 16.0), (1e-6, 0.0)]
        {
            let values: Vec<Vec3> = (0..32).map(|i| Vec3::new(1.0, 0.5, 0.01) * (bright * i as f32 / 31.0)).collect();
            let (got, texels) = round_trip(&values, false);
            assert!(scale == 0.0 || got == scale, "{bright}: {got}");
            assert_eq!(got.to_bits() & 0x7f_ffff, 0, "a power of two");
            for (a, b) in values.iter().zip(&texels) {
                assert!((*a - *b).abs().cmple(a.abs() * (1.0 / 2048.0)).all(), "{a} {b}");
            }
        }
    }

    #[test]
    fn black_and_extreme_pages_stay_finite() {
        for value in [0.0, f32::MIN_POSITIVE, f32::MIN_POSITIVE / 1024.0, f32::MAX] {
            let (scale, texels) = round_trip(&[Vec3::splat(value); 2], false);
            assert!(scale > 0.0 && scale.is_finite() && texels.iter().all(|t| t.is_finite()), "{value}: {scale}");
        }
    }

    #[test]
    #[cfg(not(debug_assertions))]
    fn what_is_not_finite_is_not_written() {
        for float in [false, true] {
            let (_, texels) = round_trip(&[Vec3::NAN, Vec3::INFINITY], float);
            assert!(texels[0] == Vec3::ZERO && texels[1].is_finite());
        }
    }

    #[test]
    fn the_same_values_give_the_same_bytes() {
        let values: Vec<Vec3> = (0..6000).map(|i| Vec3::splat((i * 7919 % 1009) as f32)).collect();
        let size = UVec2::new(60, 100);
        assert_eq!(encode(size, &values, false).unwrap().bytes, encode(size, &values, false).unwrap().bytes);
    }

    #[test]
    fn wrong_sizes_and_broken_files_are_errors() {
        assert!(encode(UVec2::new(2, 2), &[Vec3::ONE], false).is_err());
        assert!(encode(UVec2::ZERO, &[], false).is_err());
        assert!(decode(b"no picture").is_err());
    }
}
