//! Files that the document names by URI, images above all: a GLB takes images in, everything else is copied beside the
//! output, so that it stands where the document says.

use super::{files::Files, store::Store};
use crate::{
    error::{Error, Result},
    files,
    gltf::uri::{self, Named},
};
use serde_json::{Map, Value};

/// Brings along what the document names; `embed`: images become part of the file. Returns what was left behind.
///
/// Only ordinary files are opened. Outside of the document's folder these are pictures or nothing: a document must not
/// make any file of the machine a part of the output.
pub fn bring(store: &mut Store, output: &mut Files, embed: bool) -> Result<Vec<String>> {
    let mut warnings = Vec::new();
    let document = store.document().path.clone();
    let moved = files::folder(&document).canonicalize().ok() != output.folder().canonicalize().ok();
    let mut places = Vec::new();
    find(&store.json, &mut String::new(), &mut places);
    for place in places {
        let Some(text) = store.json.pointer(&format!("{place}/uri")).and_then(Value::as_str) else { continue };
        let image = place.strip_prefix("/images/").is_some_and(|rest| !rest.contains('/'));
        if let Some(data) = uri::data(text) {
            data.into_iter().filter(|_| image && embed).for_each(|bytes| adopt(store, &place, bytes));
            continue;
        }
        if text.is_empty() {
            warnings.push(format!("{place}: its uri is empty; the output keeps it so"));
            continue;
        }
        let Some(named) = Named::beside(&document, text).filter(|_| image && embed || moved) else { continue };
        let bytes = match read(&named, image) {
            Ok(bytes) => bytes,
            Err(problem) => {
                warnings.push(format!("{problem}; the output names it all the same"));
                continue;
            }
        };
        if image && embed && mime(&bytes).is_some() {
            adopt(store, &place, bytes);
        } else if moved {
            let new = output.copy(&named.name, &bytes)?;
            if let Some(old) = store.json.pointer_mut(&format!("{place}/uri")) {
                *old = new.into();
            }
        }
    }
    Ok(warnings)
}

/// The bytes of a file that goes along, or why it does not.
fn read(named: &Named, image: bool) -> std::result::Result<Vec<u8>, String> {
    let outside = || format!("{}: lies outside of the document's folder and is no picture", named.path.display());
    if named.is_outside() && !image {
        return Err(outside());
    }
    let bytes = files::read(&named.path).map_err(|e: Error| e.to_string())?;
    if named.is_outside() && mime(&bytes).is_none() { Err(outside()) } else { Ok(bytes) }
}

/// Makes a picture a part of the file, if its type is known.
fn adopt(store: &mut Store, place: &str, bytes: Vec<u8>) {
    let Some(mime) = mime(&bytes) else { return };
    let view = store.add_view(bytes, Map::new());
    if let Some(image) = store.json.pointer_mut(place).and_then(Value::as_object_mut) {
        image.shift_remove("uri");
        image.insert("bufferView".into(), view.into());
        image.insert("mimeType".into(), mime.into());
    }
}

/// JSON pointers of all objects with a `uri`, buffers and extras aside.
fn find(value: &Value, at: &mut String, places: &mut Vec<String>) {
    let length = at.len();
    let mut enter = |key: &str, v: &Value| {
        at.push('/');
        at.push_str(&key.replace('~', "~0").replace('/', "~1"));
        find(v, at, places);
        at.truncate(length);
    };
    match value {
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| enter(&i.to_string(), v)),
        Value::Object(map) => {
            let inner = map.iter().filter(|(key, _)| *key != "extras" && !(length == 0 && *key == "buffers"));
            inner.for_each(|(key, v)| enter(key, v));
            if map.get("uri").is_some_and(Value::is_string) {
                places.push(at.clone());
            }
        }
        _ => {}
    }
}

/// The type of a picture, by its first bytes.
fn mime(bytes: &[u8]) -> Option<&'static str> {
    let webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [0xab, b'K', b'T', b'X', b' ', b'2', b'0', ..] => Some("image/ktx2"),
        _ if webp => Some("image/webp"),
        _ => None,
    }
}
