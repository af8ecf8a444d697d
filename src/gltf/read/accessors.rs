//! Numbers out of buffers: every offset, stride and count is checked against the real bytes before anything is
//! allocated, so a file can claim what it likes. Any component type is read, normalized or not
//! (KHR_mesh_quantization), and sparse accessors.

use super::{
    extensions::{MESHOPT, extension, refused},
    source::{Source, label},
};
use crate::error::{Error, Result};
use gltf::json::{
    Accessor,
    accessor::{ComponentType, Type, sparse::Sparse},
    validation::Checked,
};

/// Zeros that an accessor without data may stand for, beside one for each byte of the file.
const ZEROS: usize = 1 << 16;

/// An accessor that is known to be inside its buffer.
struct View<'a> {
    /// The elements' bytes; empty for an accessor of zeros.
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

/// One accessor of a primitive, with the words for where it is used.
pub(super) struct Reader<'s, 'a> {
    source: &'s Source<'a>,
    accessor: &'s Accessor,
    component: ComponentType,
    kind: Type,
    count: usize,
    place: String,
}

impl<'s, 'a> Reader<'s, 'a> {
    /// Accessor `index`, used at `place`.
    pub fn new(source: &'s Source<'a>, index: usize, place: &str) -> Result<Self> {
        let accessor = source.part(&source.accessors, index, "accessor", place)?;
        let place = format!("{place}, {}", label("accessor", index, accessor.name.as_deref()));
        let Checked::Valid(component) = accessor.component_type else {
            return Err(source.invalid(place, "its componentType is unknown"));
        };
        let Checked::Valid(kind) = accessor.type_ else {
            return Err(source.invalid(place, "its type is unknown"));
        };
        let count = usize::try_from(accessor.count.0).ok().filter(|c| u32::try_from(*c).is_ok());
        let count = count.ok_or_else(|| source.invalid(&place, format!("its count is {}", accessor.count.0)))?;
        Ok(Reader { source, accessor, component: component.0, kind, count, place })
    }

    /// Elements it says it has. Not checked yet: never allocate by it.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Elements it says it has, or none if no buffer of the file could hold them, which reading it will tell.
    pub fn claim(&self) -> usize {
        if self.count <= self.most() { self.count } else { 0 }
    }

    /// More elements than the file's bytes, and some zeros, are not believed.
    fn most(&self) -> usize {
        let bytes: usize = self.source.document.buffers.iter().map(Vec::len).sum();
        bytes.saturating_add(ZEROS)
    }

    /// True if its type has `n` components and is no matrix.
    pub fn is_vec(&self, n: usize) -> bool {
        self.kind.multiplicity() == n && !matches!(self.kind, Type::Mat2 | Type::Mat3 | Type::Mat4)
    }

    /// All elements as vectors of `N` floats.
    pub fn floats<const N: usize>(&self) -> Result<Vec<[f32; N]>> {
        self.expect(self.is_vec(N), || format!("has type {:?} instead of {N} components", self.kind))?;
        let (component, normalized, size) = (self.component, self.accessor.normalized, self.component.size());
        let decode = |element: &[u8]| {
            let mut components = element.chunks_exact(size).map(|c| float(component, normalized, c));
            std::array::from_fn(|_| components.next().unwrap_or(0.0))
        };
        self.elements(decode, [0.0; N])
    }

    /// All elements as vertex indices.
    pub fn indices(&self) -> Result<Vec<u32>> {
        let scalar = matches!(self.kind, Type::Scalar);
        let unsigned = matches!(self.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        self.expect(scalar && unsigned, || format!("indices are {:?} of {:?}", self.kind, self.component))?;
        self.elements(unsigned_integer, 0)
    }

    fn elements<T: Copy>(&self, decode: impl Fn(&[u8]) -> T, zero: T) -> Result<Vec<T>> {
        let size = self.component.size() * self.kind.multiplicity();
        let offset = self.accessor.byte_offset.map_or(0, |o| o.0);
        let mut all: Vec<T> = match self.accessor.buffer_view {
            Some(view) => self.view(view.value(), offset, self.count, size)?.elements().map(&decode).collect(),
            None => {
                self.expect(self.count <= self.most(), || format!("{} elements without data", self.count))?;
                vec![zero; self.count]
            }
        };
        if let Some(sparse) = &self.accessor.sparse {
            self.substitute(sparse, size, decode, &mut all)?;
        }
        Ok(all)
    }

    fn substitute<T>(&self, sparse: &Sparse, size: usize, decode: impl Fn(&[u8]) -> T, all: &mut [T]) -> Result<()> {
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(self.source.invalid(&self.place, "the type of its sparse indices is unknown"));
        };
        let count = usize::try_from(sparse.count.0).ok().filter(|c| *c <= all.len());
        let count = count.ok_or_else(|| self.source.invalid(&self.place, "has more sparse elements than elements"))?;
        let (at, values) = (&sparse.indices, &sparse.values);
        let at = self.view(at.buffer_view.value(), at.byte_offset.0, count, component.0.size())?;
        let values = self.view(values.buffer_view.value(), values.byte_offset.0, count, size)?;
        for (at, value) in at.elements().map(unsigned_integer).zip(values.elements()) {
            let Some(element) = all.get_mut(at as usize) else {
                return Err(self.source.invalid(&self.place, format!("sparse index {at} is out of range")));
            };
            *element = decode(value);
        }
        Ok(())
    }

    /// `count` elements of `size` bytes from `offset` in bufferView `index`.
    fn view(&self, index: usize, offset: u64, count: usize, size: usize) -> Result<View<'a>> {
        let source = self.source;
        let view = source.part(&source.views, index, "bufferView", &self.place)?;
        let stride = view.byte_stride.map_or(size, |s| s.0);
        self.expect(stride >= size, || {
            format!("bufferView {index}: stride {stride} is less than an element's {size} bytes")
        })?;
        let bytes = view_bytes(source, index, &self.place)?;
        let length = match count {
            0 => Some(0),
            n => stride.checked_mul(n - 1).and_then(|l| l.checked_add(size)),
        };
        let end = length.and_then(|l| usize::try_from(offset).ok()?.checked_add(l));
        let Some(bytes) = end.and_then(|end| bytes.get(offset as usize..end)) else {
            let problem = format!(
                "{count} elements from byte {offset} do not fit into bufferView {index} ({} bytes)",
                bytes.len()
            );
            return Err(source.invalid(&self.place, problem));
        };
        Ok(View { bytes, stride, size })
    }

    fn expect(&self, holds: bool, problem: impl Fn() -> String) -> Result<()> {
        if holds { Ok(()) } else { Err(self.source.invalid(&self.place, problem())) }
    }
}

impl<'a> View<'a> {
    fn elements(&self) -> impl Iterator<Item = &'a [u8]> {
        let size = self.size;
        self.bytes.chunks(self.stride).map(move |c| &c[..size.min(c.len())])
    }
}

/// The bytes of bufferView `index`, used at `place`.
pub(super) fn view_bytes<'a>(source: &Source<'a>, index: usize, place: &str) -> Result<&'a [u8]> {
    let view = source.part(&source.views, index, "bufferView", place)?;
    let buffer = source.part(&source.document.buffers, view.buffer.value(), "buffer", place)?;
    let compressed = MESHOPT.iter().find(|name| extension(source.value("bufferViews", index), name).is_some());
    if let Some(name) = compressed.filter(|_| buffer.is_empty()) {
        return Err(refused(source.file, name, place));
    }
    let range = || {
        let start = usize::try_from(view.byte_offset.map_or(0, |o| o.0)).ok()?;
        buffer.get(start..start.checked_add(usize::try_from(view.byte_length.0).ok()?)?)
    };
    range().ok_or_else(|| outside(source, index, buffer.len(), place))
}

fn outside(source: &Source, index: usize, length: usize, place: &str) -> Error {
    source.invalid(place, format!("bufferView {index} lies outside its buffer of {length} bytes"))
}

fn unsigned_integer(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, b| n << 8 | u32::from(*b))
}

fn float(kind: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let n = unsigned_integer(bytes);
    let (value, largest) = match kind {
        ComponentType::F32 => return f32::from_bits(n),
        ComponentType::I8 => (f32::from(n as u8 as i8), 127.0),
        ComponentType::U8 => (f32::from(n as u8), 255.0),
        ComponentType::I16 => (f32::from(n as u16 as i16), 32767.0),
        ComponentType::U16 => (f32::from(n as u16), 65535.0),
        ComponentType::U32 => (n as f32, u32::MAX as f32),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_are_little_endian_and_normalized_by_the_specification() {
        assert_eq!(unsigned_integer(&[1, 2, 0, 0]), 513);
        assert_eq!(float(ComponentType::I8, true, &[0x80]), -1.0);
        assert_eq!(float(ComponentType::I8, true, &[0x7F]), 1.0);
        assert_eq!(float(ComponentType::U16, true, &[0xFF, 0xFF]), 1.0);
        assert_eq!(float(ComponentType::I16, false, &[0xFE, 0xFF]), -2.0);
        assert_eq!(float(ComponentType::F32, false, &1.5f32.to_le_bytes()), 1.5);
    }
}
