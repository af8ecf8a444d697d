//! [`Document`]: the file as it is, so that the writer can give it back with nothing lost.

use serde_json::Value;
use std::path::PathBuf;

/// A glTF file, its JSON untouched and its buffers resolved.
#[derive(Clone, Debug)]
pub struct Document {
    /// The file it was read from.
    pub path: PathBuf,
    /// The whole JSON document, unknown parts included, keys in the file's order.
    pub json: Value,
    /// Bytes of each of `buffers`, at least its `byteLength` of them; empty for one that only stands in for
    /// compressed data (EXT_meshopt_compression).
    pub buffers: Vec<Vec<u8>>,
    /// Files beside it that `buffers` and `images` name.
    pub external: Vec<External>,
}

/// A file that a document names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct External {
    /// As the document spells it: relative and percent-encoded.
    pub uri: String,
    /// Where it is.
    pub path: PathBuf,
}
