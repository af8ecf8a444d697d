//! [`Document`]: a glTF file as it lies on the disk, untouched.

use serde_json::Value;
use std::path::PathBuf;

/// A read glTF file: the whole JSON and the bytes of its buffers.
#[derive(Clone, Debug)]
pub struct Document {
    /// The file.
    pub path: PathBuf,
    /// Its JSON, nothing dropped, nothing added.
    pub json: Value,
    /// The resolved bytes of each of its buffers.
    pub buffers: Vec<Vec<u8>>,
    /// True if the file is a GLB.
    pub is_glb: bool,
}
