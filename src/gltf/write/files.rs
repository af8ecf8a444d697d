//! [`Files`]: the output and what lies beside it. All is written under temporary names first and renamed at the end,
//! the main file last; after a failure nothing is left behind. Files of the input are not overwritten, unless the
//! output is the input itself.

use crate::{
    error::{Error, Result},
    files,
    gltf::uri::{self, Named},
};
use serde_json::Value;
use std::io::Write;
use std::path::{Component, Path, PathBuf};
use tempfile::NamedTempFile;

/// Files to be.
pub struct Files {
    out: PathBuf,
    protected: Vec<PathBuf>,
    written: Vec<(PathBuf, NamedTempFile)>,
}

impl Files {
    /// An output without input.
    pub fn new(out: &Path) -> Self {
        Files { out: out.into(), protected: Vec::new(), written: Vec::new() }
    }

    /// An output at `out` of the document at `input` with this JSON.
    pub fn beside(out: &Path, input: &Path, json: &Value) -> Result<Self> {
        let same = identity(out) == identity(input);
        let mut protected = uris(json, "images", input);
        if !same {
            protected.push(identity(input));
            protected.extend(uris(json, "buffers", input));
        }
        if protected.contains(&identity(out)) {
            let what = format!("{}: would overwrite a part of the input", out.display());
            return Err(Error::Usage(format!("{what}\n  choose another name")));
        }
        Ok(Files { protected, ..Files::new(out) })
    }

    /// The folder of the output.
    pub fn folder(&self) -> PathBuf {
        folder(&self.out)
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
        let free = |name: &String| {
            let path = identity(&self.out.with_file_name(name));
            let taken = self.written.iter().any(|(p, _)| identity(p) == path);
            !taken && path != identity(&self.out) && !self.protected.contains(&path)
        };
        let name = (0..).map(name).find(free).unwrap_or_default();
        let path = self.out.with_file_name(&name);
        if self.folder().is_dir() {
            std::fs::create_dir_all(folder(&path)).map_err(|e| Error::writing(&path, e))?;
        }
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

/// The folder of `path`; `.` for a bare name.
pub fn folder(path: &Path) -> PathBuf {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).into()
}

/// The same path for the same file, whether it exists yet or not.
fn identity(path: &Path) -> PathBuf {
    let file = || Some(folder(path).canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(file).unwrap_or_else(|| path.into())
}

fn uris(json: &Value, key: &str, input: &Path) -> Vec<PathBuf> {
    let list = json.get(key).and_then(Value::as_array).into_iter().flatten();
    let files = list.filter_map(|entry| Named::beside(input, entry.get("uri")?.as_str()?));
    files.map(|file| identity(&file.path)).collect()
}
