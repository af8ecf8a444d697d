//! The two shapes of a glTF file: one binary, or JSON with its buffers beside it.

use super::{files::Files, store::Store};
use crate::error::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// Writes the document as one binary file and names all files.
pub fn write_glb(store: Store, files: Files, out: &Path) -> Result<()> {
    let (json, buffers) = store.settle(true);
    let mut json = serde_json::to_vec(&json).map_err(|e| Error::writing(out, e.into()))?;
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = buffers.into_iter().next().unwrap_or_default();
    let padding = vec![0; binary.len().next_multiple_of(4) - binary.len()];
    let size = |n: usize| u32::try_from(n).map_err(|_| Error::writing(out, std::io::ErrorKind::FileTooLarge.into()));
    let chunk = if binary.is_empty() { 0 } else { 8 + binary.len() + padding.len() };
    let mut head = b"glTF\x02\0\0\0".to_vec();
    head.extend(size(20 + json.len() + chunk)?.to_le_bytes());
    head.extend(size(json.len())?.to_le_bytes());
    head.extend(b"JSON");
    let mut middle = Vec::new();
    if chunk > 0 {
        middle.extend(size(chunk - 8)?.to_le_bytes());
        middle.extend(b"BIN\0");
    }
    files.finish(&[&head, &json, &middle, &binary, &padding])
}

/// Writes the document as JSON, its buffers beside it, and names all files.
pub fn write_gltf(store: Store, mut files: Files, out: &Path) -> Result<()> {
    let (mut json, buffers) = store.settle(false);
    for (i, bytes) in buffers.iter().enumerate().filter(|(_, bytes)| !bytes.is_empty()) {
        let suffix = if i == 0 { ".bin".into() } else { format!(".buffer{i}.bin") };
        let uri = files.add(&suffix, bytes)?;
        if let Some(entry) = json["buffers"][i].as_object_mut() {
            entry.shift_insert(0, "uri".into(), Value::from(uri));
        }
    }
    let mut text = serde_json::to_vec_pretty(&json).map_err(|e| Error::writing(out, e.into()))?;
    text.push(b'\n');
    files.finish(&[&text])
}
