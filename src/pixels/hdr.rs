//! HDR in: skies, as OpenEXR or Radiance RGBE, into linear rgb.
//!
//! A header is believed only within [`MAX_SIZE`] and within what the file's length can hold.

use crate::{
    error::{Error, Result},
    files,
};
use ::exr::prelude::{MetaData, ReadChannels, ReadLayers, ReadSpecificChannel};
use ::exr::{
    image::pixel_vec::PixelVec,
    image::{Image, Layer, SpecificChannels},
    math::Vec2 as Pair,
};
use glam::{UVec2, Vec3};
use image::ImageDecoder;
use std::{io::Cursor, path::Path};

/// Largest width and height that are read.
pub const MAX_SIZE: UVec2 = UVec2::new(16384, 8192);

/// Pixels that one byte of a file may stand for; zip, the tightest of the packings, stays below 350.
const MAX_PIXELS_PER_BYTE: u64 = 1024;

/// A picture of radiance.
#[derive(Clone, Debug, Default)]
pub struct Hdr {
    /// Width and height.
    pub size: UVec2,
    /// Linear rgb, finite and not negative, rows from the top.
    pub radiance: Vec<Vec3>,
    /// Pixels that had a negative or non-finite channel, which was made 0.
    pub repaired: usize,
}

/// Reads `file`, which is OpenEXR or Radiance by its content.
pub fn read_hdr(file: &Path) -> Result<Hdr> {
    let bytes = files::read(file)?;
    let (size, mut radiance) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        openexr(file, &bytes)?
    } else if bytes.starts_with(b"#?") {
        rgbe(file, &bytes)?
    } else {
        return Err(Error::unsupported(file, "a picture that is neither OpenEXR nor Radiance HDR", CONVERT));
    };
    let repaired = radiance.iter_mut().map(repair).filter(|&bad| bad).count();
    Ok(Hdr { size, radiance, repaired })
}

const CONVERT: &str = "convert it to a flat OpenEXR or Radiance .hdr file, for example with oiiotool or Blender";

fn repair(c: &mut Vec3) -> bool {
    let good = c.map(|x| if x.is_finite() && x >= 0.0 { x } else { 0.0 });
    let bad = good != *c;
    *c = good;
    bad
}

fn checked(file: &Path, size: UVec2, length: usize) -> Result<UVec2> {
    if size.min_element() == 0 {
        return Err(Error::invalid(file, "header", "the picture is empty", "give a picture with pixels"));
    }
    if size.cmpgt(MAX_SIZE).any() {
        let what = format!("a picture of {} x {} pixels", size.x, size.y);
        let remedy =
            format!("scale it down to at most {} x {}; 2048 x 1024 is plenty for a sky", MAX_SIZE.x, MAX_SIZE.y);
        return Err(Error::unsupported(file, what, remedy));
    }
    if u64::from(size.x) * u64::from(size.y) > MAX_PIXELS_PER_BYTE * length as u64 {
        let problem = format!("{length} bytes are too few for {} x {} pixels", size.x, size.y);
        return Err(Error::invalid(file, "header", problem, "the file is cut short: copy it again"));
    }
    Ok(size)
}

fn broken(file: &Path, problem: impl ToString) -> Error {
    Error::invalid(file, "picture", problem.to_string(), "the file is damaged or cut short: export it again")
}

fn rgbe(file: &Path, bytes: &[u8]) -> Result<(UVec2, Vec<Vec3>)> {
    // The signature is `#?RADIANCE` or, from some programs, `#?RGBE`: a comment either way.
    let decoder = image::codecs::hdr::HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(|e| broken(file, e))?;
    let size = checked(file, UVec2::from(decoder.dimensions()), bytes.len())?;
    // EXPOSURE is what the pixels were multiplied by.
    let scale = decoder.metadata().exposure.filter(|e| e.is_finite() && *e > 0.0).map_or(1.0, f32::recip);
    let mut raw = vec![0u8; size.x as usize * size.y as usize * 12];
    decoder.read_image(&mut raw).map_err(|e| broken(file, e))?;
    let channel = |b: [u8; 4]| f32::from_ne_bytes(b) * scale;
    let pixels = raw.as_chunks::<4>().0.as_chunks::<3>().0;
    Ok((size, pixels.iter().map(|c| Vec3::from(c.map(channel))).collect()))
}

fn openexr(file: &Path, bytes: &[u8]) -> Result<(UVec2, Vec<Vec3>)> {
    let fail = |e: ::exr::error::Error| match e {
        ::exr::error::Error::NotSupported(what) => Error::unsupported(file, format!("OpenEXR with {what}"), CONVERT),
        other => broken(file, other),
    };
    let meta = MetaData::read_from_buffered(bytes, false).map_err(fail)?;
    let as_size = |s: Pair<usize>| UVec2::new(s.0.min(u32::MAX as usize) as u32, s.1.min(u32::MAX as usize) as u32);
    let has = |name: &str| meta.headers.iter().any(|h| h.channels.list.iter().any(|c| c.name.eq(name)));
    for header in &meta.headers {
        checked(file, as_size(header.layer_size), bytes.len())?;
        checked(file, as_size(header.shared_attributes.display_window.size), bytes.len())?;
    }
    let read = ::exr::prelude::read().no_deep_data().largest_resolution_level().specific_channels();
    if has("R") && has("G") && has("B") {
        let read = read.required("R").required("G").required("B");
        let read = read.collect_pixels(PixelVec::constructor, PixelVec::set_pixel).first_valid_layer();
        let image = read.all_attributes().from_buffered(Cursor::new(bytes)).map_err(fail)?;
        Ok(in_display_window(&image, |&(r, g, b): &(f32, f32, f32)| Vec3::new(r, g, b)))
    } else if has("Y") && !has("RY") && !has("BY") {
        let read = read.required("Y");
        let read = read.collect_pixels(PixelVec::constructor, PixelVec::set_pixel).first_valid_layer();
        let image = read.all_attributes().from_buffered(Cursor::new(bytes)).map_err(fail)?;
        Ok(in_display_window(&image, |&(y,): &(f32,)| Vec3::splat(y)))
    } else {
        let names = meta.headers.iter().flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()));
        let names = names.take(8).collect::<Vec<_>>().join(", ");
        Err(Error::unsupported(file, format!("OpenEXR with channels {names}, without R, G, B or a lone Y"), CONVERT))
    }
}

/// The data window may be smaller than the picture, or larger: what is not there is black.
fn in_display_window<T, C>(
    image: &Image<Layer<SpecificChannels<PixelVec<T>, C>>>,
    color: impl Fn(&T) -> Vec3,
) -> (UVec2, Vec<Vec3>) {
    let (layer, window) = (&image.layer_data, image.attributes.display_window);
    let (size, data) = (window.size, &layer.channel_data.pixels);
    let shift = |at: usize, axis: fn(Pair<i32>) -> i32, length: usize| {
        let p = at as i64 + i64::from(axis(window.position)) - i64::from(axis(layer.attributes.layer_position));
        usize::try_from(p).ok().filter(|&p| p < length)
    };
    let pixel = |x: usize, y: usize| {
        let (x, y) = (shift(x, |p| p.0, layer.size.0)?, shift(y, |p| p.1, layer.size.1)?);
        data.pixels.get(y * layer.size.0 + x).map(&color)
    };
    let rows = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
    let radiance = rows.map(|(x, y)| pixel(x, y).unwrap_or(Vec3::ZERO)).collect();
    (UVec2::new(size.0 as u32, size.1 as u32), radiance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::exr::prelude::{Compression, Encoding, Layer, LayerAttributes, SpecificChannels, WritableImage};

    fn written(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("sky");
        std::fs::write(&file, bytes).unwrap();
        (dir, file)
    }

    fn color(at: Pair<usize>) -> (f32, f32, f32) {
        (at.0 as f32, at.1 as f32 * 0.5, 4.0)
    }

    fn exr_bytes(compression: Compression) -> Vec<u8> {
        let encoding = Encoding { compression, ..Encoding::SMALL_FAST_LOSSLESS };
        let channels = SpecificChannels::rgb(color);
        let image = Image::from_layer(Layer::new((6, 3), LayerAttributes::named("sky"), encoding, channels));
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn every_lossless_exr_reads_back() {
        use Compression::{PIZ, RLE, Uncompressed, ZIP1, ZIP16};
        for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ] {
            let (_dir, file) = written(&exr_bytes(compression));
            let hdr = read_hdr(&file).unwrap();
            assert_eq!((hdr.size, hdr.repaired), (UVec2::new(6, 3), 0), "{compression}");
            let expected = (0..18).map(|i| Vec3::from(color(Pair(i % 6, i / 6)))).collect::<Vec<_>>();
            assert_eq!(hdr.radiance, expected, "{compression}");
        }
    }

    #[test]
    fn grey_exr_is_grey_and_bad_values_become_black() {
        let values = |at: Pair<usize>| ([1.0, -1.0, f32::NAN, f32::INFINITY][at.0],);
        let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(values);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_channels((4, 1), channels).write().to_buffered(&mut bytes).unwrap();
        let (_dir, file) = written(&bytes.into_inner());
        let hdr = read_hdr(&file).unwrap();
        assert_eq!(hdr.radiance, [Vec3::ONE, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
        assert_eq!(hdr.repaired, 3);
    }

    #[test]
    fn radiance_reads_back_within_its_mantissa() {
        let pixels = (0..32).map(|i| image::Rgb([i as f32, 2.0, 1000.0])).collect::<Vec<_>>();
        let mut bytes = Vec::new();
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 16, 2).unwrap();
        let (_dir, file) = written(&bytes);
        let hdr = read_hdr(&file).unwrap();
        assert_eq!(hdr.size, UVec2::new(16, 2));
        for (read, wrote) in hdr.radiance.iter().zip(&pixels) {
            assert!((*read - Vec3::from(wrote.0)).abs().max_element() <= 1000.0 / 128.0);
        }
    }

    #[test]
    fn damaged_pictures_are_errors_that_name_the_file() {
        let whole = exr_bytes(Compression::ZIP16);
        let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n".to_vec();
        let giant = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000000000 +X 1\n".to_vec();
        let mut cases = vec![huge, giant, b"not a picture".to_vec(), Vec::new(), b"#?".to_vec()];
        cases.extend((4..whole.len()).step_by(7).map(|n| whole[..n].to_vec()));
        for bytes in cases {
            let (_dir, file) = written(&bytes);
            let error = read_hdr(&file).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains("sky"), "{error}");
        }
    }

    #[test]
    fn a_flipped_bit_never_panics() {
        let whole = exr_bytes(Compression::PIZ);
        for i in (0..whole.len() * 8).step_by(11) {
            let mut bytes = whole.clone();
            bytes[i / 8] ^= 1 << (i % 8);
            let (_dir, file) = written(&bytes);
            let _ = read_hdr(&file);
        }
    }
}
