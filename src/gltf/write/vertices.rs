//! The layout becomes TEXCOORD_1: vertices that lie in two charts are split, all their attributes and morph targets
//! copied as they are; a primitive of which nothing is split keeps its accessors and gains one.

use super::{
    Remarks,
    accessor::{self, Elements, UNSIGNED_INT, UNSIGNED_SHORT, uint},
    bind,
    sets::{self, LIGHTMAP, Place},
    store::Store,
};
use crate::{
    atlas::{Atlas, Layout},
    error::{Error, Result},
    gltf::Document,
    scene::{Mesh, Primitive, Scene},
};
use glam::Vec2;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Vertex data (bufferView.target).
pub const ARRAY_BUFFER: u32 = 34962;
/// Compression of a primitive, beside its plain data.
const DRACO: &str = "KHR_draco_mesh_compression";
/// Vertex indices (bufferView.target).
pub const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Finds out whether everything that [`lay_out`] may have to copy can be read.
pub fn check(document: &Document, scene: &Scene) -> Result<()> {
    let json = &document.json;
    for (mesh, p) in scene.meshes.iter().flat_map(|m| m.primitives.iter().map(move |p| (m, p))) {
        let place = (mesh.source as usize, p.source as usize);
        let Some(primitive) = sets::primitive(json, place).filter(|_| !p.triangles.is_empty()) else { continue };
        let change =
            Change { new: Vec::new(), renamed: sets::refuge(json, primitive), bare: lacks_first_set(json, primitive) };
        for Copied { index, used, .. } in change.copied(primitive, place, &mesh.name) {
            accessor::read(document, index, p.vertices.len(), &used)?;
        }
    }
    Ok(())
}

/// Puts the atlas' layouts into the meshes.
pub fn lay_out(store: &mut Store, scene: &Scene, atlas: &Atlas) -> Result<Remarks> {
    let mut parts = Vec::new();
    for (mesh, layout) in scene.meshes.iter().zip(&atlas.layouts) {
        parts.extend(Part::of(store.document(), mesh, layout)?);
    }
    let json = &store.json;
    let moves = parts.iter().filter_map(|p| Some((p.place, sets::refuge(json, sets::primitive(json, p.place)?)?)));
    let moves: BTreeMap<Place, u64> = moves.collect();
    let warnings = parts.iter().filter_map(|p| p.doubt(json)).collect();
    let (mut arrays, mut dropped, mut twins) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
    for part in &parts {
        let bare = sets::primitive(&store.json, part.place).is_some_and(|p| lacks_first_set(&store.json, p));
        let moved = moves.get(&part.place).copied();
        let found = part.arrays(store.document(), bare, moved)?;
        let document = store.document();
        let primitive = sets::primitive_mut(&mut store.json, part.place).ok_or_else(|| part.broken(document))?;
        dropped.extend(found.detach(primitive, part.split.is_some()));
        twins.extend(drop_twin(primitive));
        arrays.extend(found.new);
    }
    let notes = sets::repoint(&mut store.json, &moves);
    store.free_accessors(&dropped);
    if !twins.is_empty() {
        store.free_views(&twins);
        if !primitives(&store.json).any(|p| p["extensions"].get(DRACO).is_some()) {
            bind::unlist(&mut store.json, DRACO);
        }
    }
    for array in arrays {
        array.attach(store);
    }
    Ok(Remarks { warnings, notes })
}

/// Takes the compressed twin of a primitive's data away, which lacks what the primitive has gained; returns its view.
fn drop_twin(primitive: &mut Map<String, Value>) -> Option<usize> {
    let extensions = primitive.get_mut("extensions")?.as_object_mut()?;
    let twin = extensions.shift_remove(DRACO)?;
    if extensions.is_empty() {
        primitive.shift_remove("extensions");
    }
    uint(&twin["bufferView"])
}

/// All primitives of a document.
fn primitives(json: &Value) -> impl Iterator<Item = &Value> {
    let meshes = json.get("meshes").and_then(Value::as_array).into_iter().flatten();
    meshes.filter_map(|m| m.get("primitives")?.as_array()).flatten()
}

/// True if TEXCOORD_0 is missing, or a copy of the lightmap's set that an earlier bake made and nothing reads.
fn lacks_first_set(json: &Value, primitive: &Map<String, Value>) -> bool {
    let Some(attributes) = primitive.get("attributes") else { return false };
    let first = attributes.get("TEXCOORD_0");
    first.is_none() || (first == attributes.get(LIGHTMAP) && !sets::reads(json, primitive, 0))
}

/// One laid-out primitive.
struct Part<'a> {
    place: Place,
    name: &'a str,
    uv: &'a [Vec2],
    count: usize,
    split: Option<Split>,
}

/// Vertices and indices that differ from the file's.
struct Split {
    /// The file's vertex of each new one.
    source: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

/// An accessor to be.
struct Array {
    places: Vec<String>,
    accessor: Map<String, Value>,
    bytes: Vec<u8>,
    target: u32,
    stride: Option<usize>,
}

/// What a primitive gains, and the names under which it keeps the rest.
struct Change {
    new: Vec<Array>,
    renamed: Option<u64>,
    bare: bool,
}

/// An accessor that is copied when vertices are split.
struct Copied {
    index: usize,
    /// Where the copy belongs.
    pointer: String,
    /// Where it is used, for messages.
    used: String,
}

impl<'a> Part<'a> {
    fn of(document: &Document, mesh: &'a Mesh, layout: &'a Layout) -> Result<Vec<Self>> {
        let mut parts = Vec::new();
        let mut end = 0;
        for p in &mesh.primitives {
            let start = end;
            end += layout.source[start..].iter().take_while(|v| p.vertices.contains(v)).count();
            if start < end && !p.triangles.is_empty() {
                let place = (mesh.source as usize, p.source as usize);
                let split = Split::of(mesh, layout, p, start..end);
                let part = Part { place, name: &mesh.name, uv: &layout.uv[start..end], count: p.vertices.len(), split };
                let n = part.uv.len() as u32;
                if part.split.iter().flat_map(|s| s.triangles.as_flattened()).any(|&v| v >= n) {
                    return Err(part.broken(document));
                }
                parts.push(part);
            }
        }
        Ok(parts)
    }

    fn broken(&self, document: &Document) -> Error {
        let place = format!("{}, primitive {}", self.name, self.place.1);
        Error::invalid(&document.path, place, "its layout does not fit the file", "Has the file changed meanwhile?")
    }

    /// A warning if the vertices change and an extension may number them.
    fn doubt(&self, json: &Value) -> Option<String> {
        const SAFE: [&str; 4] = [DRACO, "KHR_materials_variants", "EXT_mesh_features", "EXT_structural_metadata"];
        self.split.as_ref()?;
        let extensions = sets::primitive(json, self.place)?.get("extensions")?.as_object()?;
        let doubtful: Vec<&str> = extensions.keys().map(String::as_str).filter(|k| !SAFE.contains(k)).collect();
        (!doubtful.is_empty()).then(|| {
            let (name, primitive, list) = (self.name, self.place.1, doubtful.join(", "));
            format!("{name}, primitive {primitive}: vertices were split; {list} may still number the old ones")
        })
    }

    /// All arrays that this primitive needs anew.
    fn arrays(&self, document: &Document, bare: bool, renamed: Option<u64>) -> Result<Change> {
        let at = format!("/meshes/{}/primitives/{}", self.place.0, self.place.1);
        let mut uv = Array::vertices(
            json!({ "componentType": accessor::FLOAT, "count": self.uv.len(), "type": "VEC2" }),
            Elements {
                bytes: self.uv.iter().flat_map(|uv| [uv.x, uv.y]).flat_map(f32::to_le_bytes).collect(),
                size: 8,
            },
        );
        uv.places.extend(bare.then(|| format!("{at}/attributes/TEXCOORD_0")));
        uv.places.push(format!("{at}/attributes/{LIGHTMAP}"));
        let mut change = Change { new: Vec::new(), renamed, bare };
        if let Some(split) = &self.split {
            let source = sets::primitive(&document.json, self.place).ok_or_else(|| self.broken(document))?;
            let mut copies: BTreeMap<usize, Array> = BTreeMap::new();
            for Copied { index, pointer, used } in change.copied(source, self.place, self.name) {
                if let Some(array) = copies.get_mut(&index) {
                    array.places.push(pointer);
                    continue;
                }
                let elements = accessor::read(document, index, self.count, &used)?;
                let elements = elements.gather(&split.source).ok_or_else(|| self.broken(document))?;
                let mut array = Array::vertices(document.json["accessors"][index].clone(), elements);
                array.places.push(pointer);
                copies.insert(index, array);
            }
            change.new.extend(copies.into_values());
            change.new.push(split.indices(format!("{at}/indices")));
        }
        change.new.push(uv);
        Ok(change)
    }
}

impl Split {
    fn of(mesh: &Mesh, layout: &Layout, p: &Primitive, range: std::ops::Range<usize>) -> Option<Split> {
        let triangles = p.triangles.start as usize..p.triangles.end as usize;
        let (new, old) = (&layout.triangles[triangles.clone()], &mesh.triangles[triangles]);
        let source: Vec<u32> = layout.source[range.clone()].iter().map(|v| v - p.vertices.start).collect();
        let same = source.len() == p.vertices.len() && source.iter().enumerate().all(|(i, &v)| i as u32 == v);
        let first = range.start as u32;
        let lower = |t: &[u32; 3], first: u32| t.map(|v| v.wrapping_sub(first));
        if same && new.iter().zip(old).all(|(a, b)| lower(a, first) == lower(b, p.vertices.start)) {
            return None;
        }
        Some(Split { source, triangles: new.iter().map(|t| lower(t, first)).collect() })
    }

    fn indices(&self, place: String) -> Array {
        let indices = self.triangles.as_flattened();
        // The largest number of a type would mean a restart.
        let short = self.source.len() <= usize::from(u16::MAX);
        let code = if short { UNSIGNED_SHORT } else { UNSIGNED_INT };
        let bytes = match short {
            true => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            false => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
        };
        let accessor = object(json!({ "componentType": code, "count": indices.len(), "type": "SCALAR" }));
        Array { places: vec![place], accessor, bytes, target: ELEMENT_ARRAY_BUFFER, stride: None }
    }
}

impl Array {
    /// `like`: the accessor that is copied; its bounds are found again.
    fn vertices(like: Value, elements: Elements) -> Array {
        let mut accessor = object(like);
        let bounded = ["min", "max"].map(|key| accessor.shift_remove(key).is_some()).contains(&true);
        for key in ["bufferView", "byteOffset", "sparse"] {
            accessor.shift_remove(key);
        }
        let size = elements.size;
        accessor.insert("count".into(), (elements.bytes.len() / size).into());
        if let Some([min, max]) = elements.bounds(&accessor).filter(|_| bounded) {
            accessor.insert("min".into(), min);
            accessor.insert("max".into(), max);
        }
        // Every vertex begins at a multiple of four.
        let wide = size.next_multiple_of(4);
        if wide == size {
            return Array { places: Vec::new(), accessor, bytes: elements.bytes, target: ARRAY_BUFFER, stride: None };
        }
        let mut bytes = Vec::with_capacity(elements.bytes.len() / size * wide);
        for element in elements.bytes.chunks_exact(size) {
            bytes.extend_from_slice(element);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        Array { places: Vec::new(), accessor, bytes, target: ARRAY_BUFFER, stride: Some(wide) }
    }

    fn attach(self, store: &mut Store) {
        let mut view = object(json!({ "target": self.target }));
        if let Some(stride) = self.stride {
            view.insert("byteStride".into(), stride.into());
        }
        let view = store.add_view(self.bytes, view);
        let mut accessor = object(json!({ "bufferView": view }));
        accessor.extend(self.accessor);
        let index = store.add_accessor(accessor);
        for place in &self.places {
            if let Some(v) = store.json.pointer_mut(place) {
                *v = index.into();
            }
        }
    }
}

impl Change {
    /// What of the primitive at `place`, of the mesh called `mesh`, is copied: attributes and morph targets.
    fn copied(&self, primitive: &Map<String, Value>, place: Place, mesh: &str) -> Vec<Copied> {
        let at = format!("/meshes/{}/primitives/{}", place.0, place.1);
        let targets = primitive.get("targets").and_then(Value::as_array).into_iter().flatten().enumerate();
        let targets = targets.map(|(i, target)| (format!("{at}/targets/{i}"), format!("morph target {i}, "), target));
        let attributes = primitive.get("attributes").map(|a| (format!("{at}/attributes"), String::new(), a));
        let mut all = Vec::new();
        for (owner, target, map) in attributes.into_iter().chain(targets) {
            for (old, index) in map.as_object().into_iter().flatten() {
                let (Some(name), Some(index)) = (self.name(old), uint(index)) else { continue };
                let pointer = format!("{owner}/{}", name.replace('~', "~0").replace('/', "~1"));
                all.push(Copied { index, pointer, used: format!("{mesh}, primitive {}, {target}{old}", place.1) });
            }
        }
        all
    }

    /// The new name of an attribute; `None` if the lightmap's set takes its place.
    fn name(&self, old: &str) -> Option<String> {
        match (old, self.renamed) {
            (LIGHTMAP, None) => None,
            (LIGHTMAP, Some(to)) => Some(format!("TEXCOORD_{to}")),
            ("TEXCOORD_0", _) if self.bare => None,
            _ => Some(old.into()),
        }
    }

    /// Takes from `primitive` what is replaced, leaving null in its place; returns the accessors.
    fn detach(&self, primitive: &mut Map<String, Value>, split: bool) -> Vec<usize> {
        let mut dropped = Vec::new();
        let mut rename = |owner: &mut Value, base: bool| {
            let Some(map) = owner.as_object_mut() else { return };
            let mut new = Map::new();
            for (old, v) in std::mem::take(map) {
                let name = self.name(&old);
                if split || name.is_none() {
                    dropped.extend(uint(&v));
                }
                match name {
                    Some(name) => drop(new.insert(name, if split { Value::Null } else { v })),
                    None if base => drop(new.insert(old, Value::Null)),
                    None => {}
                }
            }
            if base {
                new.entry("TEXCOORD_0").or_insert(Value::Null);
                new.entry(LIGHTMAP).or_insert(Value::Null);
            }
            *map = new;
        };
        if let Some(attributes) = primitive.get_mut("attributes") {
            rename(attributes, true);
        }
        for target in primitive.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten() {
            rename(target, false);
        }
        if split {
            dropped.extend(primitive.insert("indices".into(), Value::Null).as_ref().and_then(uint));
            primitive.shift_remove("mode");
        }
        dropped
    }
}

/// The object that `json!` made.
pub fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
