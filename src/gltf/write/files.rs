//! [`Files`]: the output and what lies beside it. All is written under temporary names first and renamed at the end,
//! the main file last; after a failure nothing is left behind. Files of the input are not overwritten, unless the
//! output is the input itself.

use crate::{
    error::{Error, Result},
    files,
    gltf::uri::{self, Named},
};
use serde_json::Value;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Component, Path, PathBuf};
use tempfile::NamedTempFile;

/// Files to be.
pub struct Files {
    out: PathBuf,
    /// Places of the output, of input files and of what is written already.
    taken: HashSet<PathBuf>,
    written: Vec<(PathBuf, NamedTempFile)>,
}

impl Files {
    /// An output without input.
    pub fn new(out: &Path) -> Self {
        Files { out: out.into(), taken: HashSet::from([identity(out)]), written: Vec::new() }
    }

    /// An output at `out` of the document at `input` with this JSON.
    pub fn beside(out: &Path, input: &Path, json: &Value) -> Result<Self> {
        let mut files = Files::new(out);
        let mut protected = uris(json, "images", input);
        if identity(out) != identity(input) {
            protected.push(identity(input));
            protected.extend(uris(json, "buffers", input));
        }
        if protected.iter().any(|path| files.taken.contains(path)) {
            let what = format!("{}: would overwrite a part of the input", out.display());
            return Err(Error::Usage(format!("{what}\n  choose another name")));
        }
        files.taken.extend(protected);
        Ok(files)
    }

    /// The folder of the output.
    pub fn folder(&self) -> &Path {
        files::folder(&self.out)
    }

    /// Writes a file named after the output (`x.glb`, `.page0.exr`: `x.page0.exr`); returns its URI.
    pub fn add(&mut self, suffix: &str, bytes: &[u8]) -> Result<String> {
        let stem = self.out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        self.add_named(|i| if i == 0 { format!("{stem}{suffix}") } else { format!("{stem}.{i}{suffix}") }, bytes)
    }

    /// Writes a copy of an input file named `name`; returns its URI.
    pub fn copy(&mut self, name: &Path, bytes: &[u8]) -> Result<String> {
        let clean = name.components().all(|c| matches!(c, Component::Normal(_)));
        let name = if clean { name } else { Path::new(name.file_name().unwrap_or_default()) };
        let numbered = |i| match name.file_stem().filter(|_| i > 0) {
            None => name.to_path_buf(),
            Some(stem) => {
                let mut new = name.with_file_name(format!("{}.{i}", stem.to_string_lossy())).into_os_string();
                name.extension().into_iter().for_each(|e| new.push(format!(".{}", e.to_string_lossy())));
                new.into()
            }
        };
        self.add_named(|i| numbered(i).to_string_lossy().replace('\\', "/"), bytes)
    }

    fn add_named(&mut self, name: impl Fn(usize) -> String, bytes: &[u8]) -> Result<String> {
        let free = |name: &String| !self.taken.contains(&identity(&self.out.with_file_name(name)));
        let name = (0..).map(name).find(free).unwrap_or_default();
        let path = self.out.with_file_name(&name);
        if self.folder().is_dir() {
            std::fs::create_dir_all(files::folder(&path)).map_err(|e| Error::writing(&path, e))?;
        }
        // Its folder may exist only now, and has its true name only then.
        self.taken.insert(identity(&path));
        self.written.push((path.clone(), temporary(&path, &[bytes])?));
        Ok(uri::encode(&name))
    }

    /// Writes the main file and gives all of them their names.
    pub fn finish(self, parts: &[&[u8]]) -> Result<()> {
        let main = temporary(&self.out, parts)?;
        let all: Vec<_> = self.written.into_iter().chain([(self.out, main)]).collect();
        if let Some((path, _)) = all.iter().find(|(path, _)| path.is_dir()) {
            return Err(Error::writing(path, std::io::ErrorKind::IsADirectory.into()));
        }
        for (path, file) in all {
            file.persist(&path).map_err(|e| Error::writing(&path, e.error))?;
        }
        Ok(())
    }
}

fn temporary(path: &Path, parts: &[&[u8]]) -> Result<NamedTempFile> {
    let write = || {
        let mut file = files::temporary(path)?;
        parts.iter().try_for_each(|part| file.as_file_mut().write_all(part))?;
        Ok(file)
    };
    write().map_err(|e| Error::writing(path, e))
}

/// The same path for the same file, as far as its folder exists.
fn identity(path: &Path) -> PathBuf {
    files::place(path).unwrap_or_else(|_| path.into())
}

fn uris(json: &Value, key: &str, input: &Path) -> Vec<PathBuf> {
    let list = json.get(key).and_then(Value::as_array).into_iter().flatten();
    let files = list.filter_map(|entry| Named::beside(input, entry.get("uri")?.as_str()?));
    files.map(|file| identity(&file.path)).collect()
}
