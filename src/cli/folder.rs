//! A folder for a command's files.

use super::signals;
use luxel::{
    error::{Error, Result},
    files,
};
use std::path::{Path, PathBuf};

/// A folder that is there or can be made.
pub struct Folder {
    /// Where it is.
    pub path: PathBuf,
}

impl Folder {
    /// Finds out whether a file of this name can be written into it, before anything takes long.
    pub fn check(path: &Path, name: &str) -> Result<Self> {
        if path.exists() && !path.is_dir() {
            return Err(Error::Usage(format!("{}: is not a folder\n  choose another with -o", path.display())));
        }
        let inside = if path.is_dir() { path.join(name) } else { path.to_path_buf() };
        signals::probe(&inside)?;
        Ok(Folder { path: path.into() })
    }

    /// Writes files by their names, each of them whole or not at all.
    pub fn write(&self, files: &[(String, Vec<u8>)]) -> Result<()> {
        if !self.path.is_dir() {
            std::fs::create_dir(&self.path).map_err(|e| Error::writing(&self.path, e))?;
        }
        files.iter().try_for_each(|(name, bytes)| files::write_whole(&self.path.join(name), |out| out.write_all(bytes)))
    }
}
