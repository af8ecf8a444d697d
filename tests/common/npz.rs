//! [`Npz`]: arrays as numpy stores them (`np.savez_compressed`), little-endian numbers in C order.

use std::{collections::HashMap, error::Error, fs::File, io::Read, path::Path};

/// The arrays of one file by name.
pub struct Npz(HashMap<String, Vec<f64>>);

impl Npz {
    /// Reads all arrays. Eight-byte integers above 2^53 would lose digits.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let mut archive = zip::ZipArchive::new(File::open(path)?)?;
        let mut arrays = HashMap::new();
        for i in 0..archive.len() {
            let mut entry = archive.by_index(i)?;
            let name = entry.name()?.trim_end_matches(".npy").to_owned();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes)?;
            arrays.insert(name.clone(), numbers(&bytes).ok_or(format!("{name}: not an array of numbers"))?);
        }
        Ok(Npz(arrays))
    }

    /// The numbers of an array, rows one after the other.
    pub fn array(&self, name: &str) -> Result<&[f64], String> {
        self.0.get(name).map(Vec::as_slice).ok_or(format!("there is no array {name:?}"))
    }
}

/// The contents of an .npy file.
fn numbers(bytes: &[u8]) -> Option<Vec<f64>> {
    let (start, length) = match (bytes.get(..6)? == b"\x93NUMPY", *bytes.get(6)?) {
        (true, 1) => (10, u16::from_le_bytes(bytes.get(8..10)?.try_into().ok()?) as usize),
        (true, _) => (12, u32::from_le_bytes(bytes.get(8..12)?.try_into().ok()?) as usize),
        (false, _) => return None,
    };
    let header = std::str::from_utf8(bytes.get(start..start + length)?).ok()?;
    let data = &bytes[start + length..];
    if header.contains("'fortran_order': True") {
        return None;
    }
    let kind = header.split("'descr':").nth(1)?.split('\'').nth(1)?;
    macro_rules! each {
        ($t:ty) => {
            data.chunks_exact(size_of::<$t>()).map(|b| <$t>::from_le_bytes(b.try_into().unwrap()) as f64).collect()
        };
    }
    Some(match kind {
        "<f4" => each!(f32),
        "<f8" => each!(f64),
        "<i2" => each!(i16),
        "<i4" => each!(i32),
        "<i8" => each!(i64),
        _ => return None,
    })
}
