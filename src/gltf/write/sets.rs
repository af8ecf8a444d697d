//! Who reads which texture coordinates: the lightmap needs TEXCOORD_1, so a set that lies there and is read moves to
//! the next free one, and the textures that read it are re-pointed. One that nobody reads is replaced.

use super::{accessor::uint, store::visit_mut};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};

/// A primitive's place in the document: mesh and primitive.
pub type Place = (usize, usize);

/// The lightmap's set.
pub const LIGHTMAP: &str = "TEXCOORD_1";

/// The primitive at `place`.
pub fn primitive(json: &Value, place: Place) -> Option<&Map<String, Value>> {
    json.get("meshes")?.get(place.0)?.get("primitives")?.get(place.1)?.as_object()
}

/// The primitive at `place`.
pub fn primitive_mut(json: &mut Value, place: Place) -> Option<&mut Map<String, Value>> {
    json.get_mut("meshes")?.get_mut(place.0)?.get_mut("primitives")?.get_mut(place.1)?.as_object_mut()
}

/// True if a texture of the primitive's materials, variants included, or of its own extensions reads `set`.
pub fn reads(json: &Value, primitive: &Map<String, Value>, set: u64) -> bool {
    let material = |m: &usize| json.get("materials").and_then(|all| all.get(*m)).is_some_and(|m| names(m, set));
    materials(primitive).iter().any(material) || primitive.get("extensions").is_some_and(|e| names(e, set))
}

/// The set to which the primitive's TEXCOORD_1 has to move; `None` if it has none or nothing reads it.
pub fn refuge(json: &Value, primitive: &Map<String, Value>) -> Option<u64> {
    let attributes = primitive.get("attributes")?.as_object()?;
    if !attributes.contains_key(LIGHTMAP) || !reads(json, primitive, 1) {
        return None;
    }
    (2..).find(|n| !attributes.contains_key(&format!("TEXCOORD_{n}")))
}

/// Re-points the textures of primitives whose set 1 moves, `moves`: to which set.
///
/// A material that others use as well, or with another set, is duplicated. Returns a note for each material.
pub fn repoint(json: &mut Value, moves: &BTreeMap<Place, u64>) -> Vec<String> {
    for (&place, &to) in moves {
        if let Some(extensions) = primitive_mut(json, place).and_then(|p| p.get_mut("extensions")) {
            rename(extensions, to);
        }
    }
    let mut notes = Vec::new();
    for (m, users) in users(json, moves) {
        if !names(&json["materials"][m], 1) {
            continue;
        }
        let mut shared = users.contains_key(&None);
        let original = json["materials"][m].clone();
        for (to, places) in users.iter().filter_map(|(to, places)| Some(((*to)?, places))) {
            let mut material = original.clone();
            rename(&mut material, to);
            notes.push(note(m, &original, to, shared));
            if !shared {
                json["materials"][m] = material;
                shared = true; // The next one, with another set, has to be a copy.
                continue;
            }
            let Some(list) = json["materials"].as_array_mut() else { continue };
            let copy = list.len();
            list.push(material);
            for &place in places {
                if let Some(p) = primitive_mut(json, place) {
                    exchange(p, m, copy);
                }
            }
        }
    }
    notes
}

/// The primitives that use each material, by the set to which their set 1 moves.
fn users(json: &Value, moves: &BTreeMap<Place, u64>) -> BTreeMap<usize, BTreeMap<Option<u64>, Vec<Place>>> {
    let mut users: BTreeMap<usize, BTreeMap<Option<u64>, Vec<Place>>> = BTreeMap::new();
    for place in places(json) {
        for m in primitive(json, place).map(materials).unwrap_or_default() {
            users.entry(m).or_default().entry(moves.get(&place).copied()).or_default().push(place);
        }
    }
    users
}

fn note(index: usize, material: &Value, to: u64, copied: bool) -> String {
    let name = material["name"].as_str().map(|n| format!(" \"{n}\"")).unwrap_or_default();
    let copy = if copied { " (a copy of it, since others use it too)" } else { "" };
    format!("material {index}{name}{copy} read TEXCOORD_1, where the lightmap lies now: it reads TEXCOORD_{to}")
}

fn places(json: &Value) -> Vec<Place> {
    let count = |v: &Value| v.as_array().map_or(0, Vec::len);
    let meshes = count(&json["meshes"]);
    (0..meshes).flat_map(|m| (0..count(&json["meshes"][m]["primitives"])).map(move |p| (m, p))).collect()
}

/// The materials of a primitive: its own and those of KHR_materials_variants.
fn materials(primitive: &Map<String, Value>) -> BTreeSet<usize> {
    let variants = primitive.get("extensions").map(|e| &e["KHR_materials_variants"]["mappings"]);
    let mappings = variants.and_then(Value::as_array).into_iter().flatten();
    let own = primitive.get("material").and_then(uint);
    own.into_iter().chain(mappings.filter_map(|m| uint(&m["material"]))).collect()
}

fn exchange(primitive: &mut Map<String, Value>, from: usize, to: usize) {
    let swap = |v: &mut Value| {
        if uint(v) == Some(from) {
            *v = to.into();
        }
    };
    primitive.get_mut("material").into_iter().for_each(swap);
    let variants = primitive.get_mut("extensions").and_then(|e| e.get_mut("KHR_materials_variants"));
    let mappings = variants.and_then(|v| v.get_mut("mappings")?.as_array_mut());
    mappings.into_iter().flatten().filter_map(|m| m.get_mut("material")).for_each(swap);
}

/// True if a texture info in `value` names `set`, itself or by KHR_texture_transform. An object with an `index` is one.
fn names(value: &Value, set: u64) -> bool {
    match value {
        Value::Array(list) => list.iter().any(|v| names(v, set)),
        Value::Object(map) => {
            let own = map.get("texCoord").map_or(Some(0), Value::as_u64);
            let transformed = map.get("extensions").and_then(|e| e.get(TRANSFORM)?.get("texCoord")?.as_u64());
            let is_texture = map.get("index").is_some_and(Value::is_u64);
            (is_texture && (own == Some(set) || transformed == Some(set)))
                || map.iter().any(|(key, v)| key != "extras" && names(v, set))
        }
        _ => false,
    }
}

/// Makes every texture info in `value` that names set 1 name `to`.
fn rename(value: &mut Value, to: u64) {
    let set = |holder: Option<&mut Value>| {
        if let Some(v) = holder.filter(|v| v.as_u64() == Some(1)) {
            *v = to.into();
        }
    };
    visit_mut(value, &mut |map| {
        if map.get("index").is_some_and(Value::is_u64) {
            set(map.get_mut("texCoord"));
            set(map.get_mut("extensions").and_then(|e| e.get_mut(TRANSFORM)?.get_mut("texCoord")));
        }
    });
}

const TRANSFORM: &str = "KHR_texture_transform";
