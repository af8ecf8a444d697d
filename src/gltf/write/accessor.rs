//! The elements of a source accessor as raw bytes: offsets, strides and sparse values are resolved, nothing is
//! converted, every read is checked against its buffer.

use crate::{
    error::{Error, Result},
    gltf::Document,
};
use serde_json::{Map, Number, Value};

/// Tightly packed elements.
#[derive(Clone, Debug)]
pub struct Elements {
    /// All elements, one after the other.
    pub bytes: Vec<u8>,
    /// Bytes of one element.
    pub size: usize,
}

impl Elements {
    /// Element `of[i]` at place i, or `None` if one does not exist.
    pub fn gather(&self, of: &[u32]) -> Option<Elements> {
        let mut bytes = Vec::with_capacity(of.len() * self.size);
        for &i in of {
            let start = i as usize * self.size;
            bytes.extend_from_slice(self.bytes.get(start..start + self.size)?);
        }
        Some(Elements { bytes, size: self.size })
    }

    /// Smallest and largest value of each component, as glTF writes them; `None` for matrices and for what is not
    /// finite.
    pub fn bounds(&self, accessor: &Map<String, Value>) -> Option<[Value; 2]> {
        let code = accessor.get("componentType")?.as_u64()?;
        let size = component_size(code)?;
        if accessor.get("type")?.as_str()?.starts_with("MAT") || self.bytes.is_empty() {
            return None;
        }
        let mut bounds = vec![(f64::INFINITY, f64::NEG_INFINITY); self.size / size];
        for element in self.bytes.chunks_exact(self.size) {
            for (b, component) in bounds.iter_mut().zip(element.chunks_exact(size)) {
                let v = number(code, component)?;
                *b = (b.0.min(v), b.1.max(v));
            }
        }
        let json =
            |v: f64| if code == FLOAT { Number::from_f64(v).map(Value::Number) } else { Some((v as i64).into()) };
        let min = bounds.iter().map(|b| json(b.0)).collect::<Option<Vec<_>>>()?;
        let max = bounds.iter().map(|b| json(b.1)).collect::<Option<Vec<_>>>()?;
        Some([min.into(), max.into()])
    }
}

/// componentType of f32.
pub const FLOAT: u64 = 5126;
/// componentType of u16.
pub const UNSIGNED_SHORT: u64 = 5123;
/// componentType of u32.
pub const UNSIGNED_INT: u64 = 5125;

/// Reads accessor `index` of the source document, which must have `count` elements; `place` is where it is used.
pub fn read(document: &Document, index: usize, count: usize, place: &str) -> Result<Elements> {
    let fail = |problem: &str| {
        let remedy = "export the file again; luxel copies all data of the vertices when it splits them";
        Error::invalid(&document.path, format!("{place}, accessor {index}"), problem, remedy)
    };
    let accessor = &document.json["accessors"][index];
    let code = accessor["componentType"].as_u64().unwrap_or(0);
    let size = element_size(code, accessor["type"].as_str().unwrap_or(""))
        .ok_or_else(|| fail("its type or component type is unknown"))?;
    if uint(&accessor["count"]) != Some(count) {
        return Err(fail(&format!("it does not have {count} elements, as others of its primitive")));
    }
    let mut bytes = match accessor.get("bufferView") {
        None => vec![0; count.checked_mul(size).ok_or_else(|| fail("it is too large"))?],
        Some(_) => packed(document, accessor, count, size).ok_or_else(|| fail("it reaches beyond its buffer"))?,
    };
    if let Some(sparse) = accessor.get("sparse") {
        replace(document, sparse, size, &mut bytes).ok_or_else(|| fail("its sparse part is broken"))?;
    }
    Ok(Elements { bytes, size })
}

fn replace(document: &Document, sparse: &Value, size: usize, bytes: &mut [u8]) -> Option<()> {
    let count = uint(&sparse["count"])?;
    let code = sparse["indices"]["componentType"].as_u64()?;
    let wide = component_size(code)?;
    let indices = packed(document, &sparse["indices"], count, wide)?;
    let values = packed(document, &sparse["values"], count, size)?;
    for (index, value) in indices.chunks_exact(wide).zip(values.chunks_exact(size)) {
        let start = (number(code, index)? as usize).checked_mul(size)?;
        bytes.get_mut(start..start.checked_add(size)?)?.copy_from_slice(value);
    }
    Some(())
}

/// `count` elements of `size` bytes at the view and offset that `place` names.
fn packed(document: &Document, place: &Value, count: usize, size: usize) -> Option<Vec<u8>> {
    let view = document.json.get("bufferViews")?.get(uint(&place["bufferView"])?)?;
    let buffer = document.buffers.get(uint(&view["buffer"])?)?;
    let start = uint(&view["byteOffset"]).unwrap_or(0);
    let view_bytes = buffer.get(start..start.checked_add(uint(&view["byteLength"])?)?)?;
    let stride = uint(&view["byteStride"]).unwrap_or(size).max(1);
    let first = uint(&place["byteOffset"]).unwrap_or(0);
    if count > view_bytes.len() {
        return None;
    }
    let mut bytes = Vec::with_capacity(count.checked_mul(size)?);
    for i in 0..count {
        let at = first.checked_add(i.checked_mul(stride)?)?;
        bytes.extend_from_slice(view_bytes.get(at..at.checked_add(size)?)?);
    }
    Some(bytes)
}

/// A JSON number as an index or a size.
pub fn uint(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|v| usize::try_from(v).ok())
}

fn component_size(code: u64) -> Option<usize> {
    match code {
        5120 | 5121 => Some(1),
        5122 | UNSIGNED_SHORT => Some(2),
        UNSIGNED_INT | FLOAT => Some(4),
        _ => None,
    }
}

/// Bytes of an element; a matrix' columns begin at multiples of four.
fn element_size(code: u64, kind: &str) -> Option<usize> {
    let c = component_size(code)?;
    Some(match kind {
        "SCALAR" => c,
        "VEC2" => 2 * c,
        "VEC3" => 3 * c,
        "VEC4" => 4 * c,
        "MAT2" => 2 * (2 * c).next_multiple_of(4),
        "MAT3" => 3 * (3 * c).next_multiple_of(4),
        "MAT4" => 16 * c,
        _ => return None,
    })
}

fn number(code: u64, bytes: &[u8]) -> Option<f64> {
    Some(match code {
        5120 => f64::from(i8::from_le_bytes(bytes.try_into().ok()?)),
        5121 => f64::from(u8::from_le_bytes(bytes.try_into().ok()?)),
        5122 => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)),
        UNSIGNED_SHORT => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)),
        UNSIGNED_INT => f64::from(u32::from_le_bytes(bytes.try_into().ok()?)),
        FLOAT => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
        _ => return None,
    })
}
