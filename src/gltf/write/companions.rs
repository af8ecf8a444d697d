//! Files that the document names by URI, images above all: a GLB takes images in, everything else is copied beside the
//! output, so that it stands where the document says.

use super::{
    files::{Files, decode_uri, folder},
    store::Store,
};
use crate::error::Result;
use base64::prelude::{BASE64_STANDARD as BASE64, Engine};
use serde_json::{Map, Value};
use std::path::Path;

/// Brings along what the document names; `embed`: images become part of the file.
pub fn bring(store: &mut Store, files: &mut Files, embed: bool) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    let from = folder(&store.document().path);
    let moved = from.canonicalize().ok() != files.folder().canonicalize().ok();
    let mut places = Vec::new();
    find(&store.json, &mut String::new(), &mut places);
    for place in places {
        let Some(uri) = store.json.pointer(&format!("{place}/uri")).and_then(Value::as_str) else { continue };
        let image = embed && place.strip_prefix("/images/").is_some_and(|rest| !rest.contains('/'));
        if let Some(bytes) = inline(uri).filter(|_| image) {
            adopt(store, &place, bytes);
            continue;
        }
        let Some(name) = decode_uri(uri).filter(|_| image || moved) else { continue };
        let path = from.join(&name);
        match std::fs::read(&path) {
            Err(e) => notes.push(format!("{}: {e}; the output names it all the same", path.display())),
            Ok(bytes) if image && mime(&bytes).is_some() => adopt(store, &place, bytes),
            Ok(bytes) if moved => {
                let uri = files.copy(&name, &bytes)?;
                if let Some(old) = store.json.pointer_mut(&format!("{place}/uri")) {
                    *old = uri.into();
                }
            }
            Ok(_) => {}
        }
    }
    Ok(notes)
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

/// The bytes of a base64 `data:` URI.
fn inline(uri: &str) -> Option<Vec<u8>> {
    let (head, data) = uri.strip_prefix("data:")?.split_once(',')?;
    head.ends_with(";base64").then(|| BASE64.decode(data).ok())?
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

/// True if `path` is to be a `.gltf`; everything else is a GLB.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"))
}
