//! The file's bytes to a [`Document`]: GLB chunks or plain JSON, and every buffer's bytes.

use super::{
    extensions,
    source::{array, broken, label, linked},
};
use crate::{
    error::{Error, Result},
    files,
    gltf::{Document, document::External, uri::Named},
};
use serde_json::Value;
use std::{collections::HashSet, path::Path};

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// Reads `path` and the buffers it names; checks the version and the required extensions, nothing else.
pub(super) fn open(path: &Path) -> Result<Document> {
    let bytes = files::read(path)?;
    let (json, bin) = if bytes.starts_with(MAGIC) { chunks(path, &bytes)? } else { (bytes.as_slice(), None) };
    let json = parse(path, json)?;
    version(path, &json)?;
    extensions::check(path, &json)?;
    let buffers = buffers(path, &json, bin)?;
    let external = external(path, &json)?;
    Ok(Document { path: path.into(), json, buffers, external })
}

/// JSON and binary chunk of a GLB.
fn chunks<'b>(path: &Path, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>)> {
    let place = "GLB header";
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let cut = || broken(path, place, "the file ends too early");
    let (container, length) = (word(4).ok_or_else(cut)?, word(8).ok_or_else(cut)? as usize);
    if container != 2 {
        return Err(Error::unsupported(path, format!("GLB version {container}"), "export it as glTF 2.0"));
    }
    if length > bytes.len() {
        return Err(broken(path, place, format!("{length} bytes announced, the file has {}", bytes.len())));
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while at + 8 <= length {
        let (size, kind) = (word(at).ok_or_else(cut)? as usize, word(at + 4).ok_or_else(cut)?);
        let chunk = bytes[..length].get(at + 8..).and_then(|rest| rest.get(..size)).ok_or_else(|| {
            broken(path, format!("GLB chunk at byte {at}"), format!("{size} bytes announced, the file ends earlier"))
        })?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BIN if bin.is_none() => bin = Some(chunk),
            _ => {}
        }
        at += 8 + size;
    }
    Ok((json.ok_or_else(|| broken(path, place, "there is no JSON chunk"))?, bin))
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Value> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let end = bytes.iter().rposition(|b| *b != 0).map_or(0, |i| i + 1);
    let json: Value = serde_json::from_slice(&bytes[..end])
        .map_err(|e| broken(path, "JSON", format!("this is not a glTF document: {e}")))?;
    if json.is_object() { Ok(json) } else { Err(broken(path, "JSON", "this is not a glTF document")) }
}

fn version(path: &Path, json: &Value) -> Result<()> {
    let of = |key: &str| json.get("asset").and_then(|a| a.get(key)).and_then(Value::as_str);
    let Some(version) = of("version") else {
        return Err(broken(path, "asset.version", "is missing: this is not a glTF document"));
    };
    let newest = of("minVersion").unwrap_or(version);
    if [version, newest].iter().any(|v| v.split('.').next() != Some("2")) {
        return Err(Error::unsupported(path, format!("glTF version {version}"), "export it as glTF 2.0"));
    }
    Ok(())
}

fn buffers(path: &Path, json: &Value, bin: Option<&[u8]>) -> Result<Vec<Vec<u8>>> {
    let mut buffers = Vec::new();
    for (i, buffer) in array(path, json, "buffers")?.iter().enumerate() {
        let place = label("buffer", i, buffer.get("name").and_then(Value::as_str));
        let length = buffer.get("byteLength").and_then(Value::as_u64);
        let length = length.ok_or_else(|| broken(path, &place, "has no byteLength"))?;
        let bytes = match (buffer.get("uri"), bin) {
            (Some(Value::String(text)), _) if Named::beside(path, text).is_some_and(|named| named.is_outside()) => {
                // What is read here may become a part of the output, whatever it is; pictures show what they are.
                let remedy = "put the file beside the document, or export the scene as one .glb";
                return Err(Error::unsupported(
                    path,
                    format!("{place}: {text}, outside of the document's folder,"),
                    remedy,
                ));
            }
            (Some(Value::String(text)), _) => linked(path, text, &place)?,
            (Some(_), _) => return Err(broken(path, place, "its uri is not a string")),
            (None, Some(bin)) if i == 0 => bin.to_vec(),
            (None, _) if extensions::is_fallback(buffer) => {
                buffers.push(Vec::new());
                continue;
            }
            (None, _) => return Err(broken(path, place, "has neither a uri nor a binary chunk")),
        };
        if (bytes.len() as u64) < length {
            return Err(broken(path, place, format!("is cut off: {} of {length} bytes", bytes.len())));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

fn external(path: &Path, json: &Value) -> Result<Vec<External>> {
    let (mut files, mut known) = (Vec::new(), HashSet::new());
    for list in ["buffers", "images"] {
        for part in array(path, json, list)? {
            let Some(text) = part.get("uri").and_then(Value::as_str) else { continue };
            if let Some(named) = Named::beside(path, text).filter(|_| known.insert(text)) {
                files.push(External { uri: text.into(), path: named.path });
            }
        }
    }
    Ok(files)
}
