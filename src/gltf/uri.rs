//! URIs of a document, for both doors: data, or a file beside it. Nothing is fetched from a network.

use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use std::{
    borrow::Cow,
    path::{Component, Path, PathBuf},
};

const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes of a `data:` URI, or what is wrong with them; `None` for any other URI.
pub fn data(text: &str) -> Option<Result<Vec<u8>, String>> {
    let inside = text.strip_prefix("data:")?;
    let decode = || {
        let (kind, data) = inside.split_once(',').ok_or("its data URI has no comma")?;
        let raw: Cow<[u8]> = percent_decode_str(data).into();
        if !kind.ends_with(";base64") {
            return Ok(raw.into_owned());
        }
        BASE64.decode(&raw).map_err(|e| format!("its data URI is damaged: {e}"))
    };
    Some(decode())
}

/// The file that `text` names, relative to the document; `None` for data and remote URIs.
fn name(document: &Path, text: &str) -> Option<PathBuf> {
    if text.starts_with("data:") || text.contains("://") {
        return None;
    }
    // Some exporters do not escape: a name that exists as it is spelled wins.
    let exact = document.parent().unwrap_or(Path::new("")).join(text).is_file();
    Some(if exact { text.into() } else { percent_decode_str(text).decode_utf8_lossy().into_owned().into() })
}

/// A file that a document names.
pub struct Named {
    /// As the document names it, decoded.
    pub name: PathBuf,
    /// Where it is.
    pub path: PathBuf,
}

impl Named {
    /// The file that `text` names beside `document`; `None` for data and remote URIs.
    pub fn beside(document: &Path, text: &str) -> Option<Self> {
        let name = name(document, text)?;
        Some(Named { path: document.parent().unwrap_or(Path::new("")).join(&name), name })
    }

    /// True if the name leads out of the document's folder.
    pub fn is_outside(&self) -> bool {
        !self.name.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
    }
}

/// A file name as a URI.
pub fn encode(name: &str) -> String {
    const RESERVED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b'/');
    utf8_percent_encode(name, RESERVED).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_read_padded_or_not() {
        for text in ["data:;base64,AQI=", "data:x/y;base64,AQI", "data:;base64,AQI%3D", "data:,%01%02"] {
            assert_eq!(data(text), Some(Ok(vec![1, 2])), "{text}");
        }
        assert!(data("data:AQI").is_some_and(|d| d.is_err()) && data("a.png").is_none());
    }

    #[test]
    fn names_are_decoded_unless_they_exist_as_spelled() {
        let folder = tempfile::tempdir().unwrap();
        let document = folder.path().join("a.gltf");
        let name = |text: &str| Named::beside(&document, text).map(|n| n.name);
        assert_eq!(name("a%20b.png"), Some("a b.png".into()));
        assert_eq!(name("a:b.png"), Some("a:b.png".into()));
        assert_eq!((name("https://x.org/a.png"), name("data:,x")), (None, None));
        std::fs::write(folder.path().join("a%20b.png"), "").unwrap();
        assert_eq!(name("a%20b.png"), Some("a%20b.png".into()));
        let outside = |text: &str| Named::beside(&document, text).unwrap().is_outside();
        assert_eq!(["a/b", "./a", "../a", "a/../../b", "/a"].map(outside), [false, false, true, true, true]);
    }
}
