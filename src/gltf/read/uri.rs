//! Bytes behind a URI: `data:` or a file beside the document. Nothing is fetched from a network.

use super::source::broken;
use crate::error::{Error, Result};
use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;
use std::{
    borrow::Cow,
    io,
    path::{Path, PathBuf},
};

const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes that `text`, a URI in `document`'s part `place`, stands for.
pub(super) fn bytes(document: &Path, text: &str, place: &str) -> Result<Vec<u8>> {
    if let Some(data) = text.strip_prefix("data:") {
        let (kind, data) = data.split_once(',').ok_or_else(|| broken(document, place, "its data URI has no comma"))?;
        let raw: Cow<[u8]> = percent_decode_str(data).into();
        if !kind.ends_with(";base64") {
            return Ok(raw.into_owned());
        }
        return BASE64.decode(&raw).map_err(|e| broken(document, place, format!("its data URI is damaged: {e}")));
    }
    let Some(path) = beside(document, text) else {
        let remedy = "download it, put it beside the document and name it by a relative path";
        return Err(Error::unsupported(document, format!("{place}: the remote address {text}"), remedy));
    };
    file(&path).map_err(|e| match e {
        Error::Io { source, .. } => Error::invalid(
            document,
            place,
            format!("its file {} cannot be read: {source}", path.display()),
            "put the file there, or export the scene as one .glb",
        ),
        other => other,
    })
}

/// The file that `text` names beside `document`; `None` for data and remote URIs.
pub(super) fn beside(document: &Path, text: &str) -> Option<PathBuf> {
    if text.starts_with("data:") || text.contains("://") {
        return None;
    }
    let name = percent_decode_str(text).decode_utf8_lossy();
    let folder = document.parent().unwrap_or(Path::new(""));
    let exact = folder.join(text);
    // Some exporters do not escape: a name that exists as it is spelled wins.
    Some(if exact.is_file() { exact } else { folder.join(name.as_ref()) })
}

/// The bytes of an ordinary file (a device or a pipe could go on for ever).
pub(super) fn file(path: &Path) -> Result<Vec<u8>> {
    let read = || {
        if std::fs::metadata(path)?.is_file() {
            std::fs::read(path)
        } else {
            Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a file"))
        }
    };
    read().map_err(|e| Error::reading(path, e))
}
