//! Where results go: names that nobody typed, and mistakes found before anything takes long.

use super::{args::Bake, signals, values::SkyWish};
use luxel::{
    error::{Error, Result},
    files::{has_extension, place},
    gltf::Document,
};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Files to write.
#[derive(Debug)]
pub struct Outputs {
    /// The lit scene.
    pub scene: PathBuf,
    /// A picture of it.
    pub preview: Option<PathBuf>,
    /// A file that looks lit everywhere.
    pub flat: Option<PathBuf>,
    /// The report.
    pub report: Option<PathBuf>,
    /// The report takes stdout.
    pub report_on_stdout: bool,
}

/// Checks the input, then every output: kind, folder, permission, and that no two are the same file.
pub fn resolve(options: &Bake) -> Result<Outputs> {
    let input = &options.input;
    let found = std::fs::metadata(input).map_err(|e| Error::reading(input, e))?;
    if found.is_dir() {
        return Err(Error::reading(input, io::Error::from(io::ErrorKind::IsADirectory)));
    }
    let scene = options.output.clone().unwrap_or_else(|| beside(input));
    if !has_extension(&scene, &["glb", "gltf"]) {
        let what = format!("{}: the output's name must end in .glb or .gltf", scene.display());
        return Err(Error::Usage(what));
    }
    let report_on_stdout = options.report.as_deref() == Some(Path::new("-"));
    let report = options.report.clone().filter(|_| !report_on_stdout);
    let outputs =
        Outputs { scene, preview: options.preview.clone(), flat: options.flat.clone(), report, report_on_stdout };
    let mut inputs = vec![place(input)?];
    if let Some(SkyWish::Picture(file, ..)) = &options.light.sky {
        inputs.extend(file.canonicalize());
    }
    let scene = place(&outputs.scene)?;
    let mut places: Vec<PathBuf> = Vec::new();
    let others = [&outputs.preview, &outputs.flat, &outputs.report].into_iter().flatten();
    for path in [&outputs.scene].into_iter().chain(others) {
        if path.as_os_str().to_string_lossy().ends_with(std::path::is_separator) {
            return Err(Error::Usage(format!("{}: names a folder, not a file", path.display())));
        }
        let at = place(path)?;
        let others = !places.is_empty();
        if places.contains(&at) || others && (inputs.contains(&at) || belongs(&at, &scene, options.sidecar)) {
            return Err(Error::Usage(format!("{}: two files of this bake have the same name", path.display())));
        }
        if path.exists() && !path.is_file() {
            return Err(Error::Usage(format!("{}: is not a file that can be replaced", path.display())));
        }
        signals::probe(path)?;
        places.push(at);
    }
    Ok(outputs)
}

impl Outputs {
    /// Refuses to write over files that the document names, or their copies beside the lit scene.
    pub fn spare(&self, document: &Document) -> Result<()> {
        let beside = self.scene.parent().unwrap_or(Path::new(""));
        for path in [&self.preview, &self.flat, &self.report].into_iter().flatten() {
            let at = place(path)?;
            let same = |other: PathBuf| place(&other).is_ok_and(|other| other == at);
            let hit = |e: &&luxel::gltf::External| {
                let copy = e.path.strip_prefix(document.path.parent().unwrap_or(Path::new("")));
                let copy = copy.ok().filter(|_| has_extension(&self.scene, &["gltf"]));
                same(e.path.clone()) || copy.is_some_and(|name| same(beside.join(name)))
            };
            if let Some(external) = document.external.iter().find(hit) {
                let what = format!("would overwrite {}, which the scene names", external.path.display());
                return Err(Error::Usage(format!("{}: {what}\n  choose another name", path.display())));
            }
        }
        Ok(())
    }
}

/// True if a lit scene at `scene` takes the name `at` for a file that is written beside it.
fn belongs(at: &Path, scene: &Path, sidecar: bool) -> bool {
    let text = |name: Option<&std::ffi::OsStr>| name.unwrap_or_default().to_string_lossy().into_owned();
    let (name, stem) = (text(at.file_name()), text(scene.file_stem()));
    let Some(rest) = name.strip_prefix(&stem).and_then(|rest| rest.strip_prefix('.')) else { return false };
    let numbered = |head: &str, tail: &str| {
        let number = rest.strip_prefix(head).and_then(|r| r.strip_suffix(tail));
        number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let gltf = has_extension(scene, &["gltf"]);
    at.parent() == scene.parent()
        && (gltf && (rest == "bin" || numbered("buffer", ".bin"))
            || sidecar && rest == "lightmap.json"
            || (gltf || sidecar) && numbered("page", ".exr"))
}

/// `scene.glb` to `scene.lit.glb`; a `.lit` already there stays single.
fn beside(input: &Path) -> PathBuf {
    let extension = input.extension().filter(|_| has_extension(input, &["glb", "gltf"]));
    let extension = extension.unwrap_or("glb".as_ref());
    let mut name = input.file_stem().unwrap_or_default().to_owned();
    if Path::new(&name).extension() != Some("lit".as_ref()) {
        name.push(".lit");
    }
    name.push(".");
    name.push(extension);
    input.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_names() {
        for (input, output) in [
            ("a.glb", "a.lit.glb"),
            ("dir.x/a.b.gltf", "dir.x/a.b.lit.gltf"),
            ("a.lit.glb", "a.lit.glb"),
            ("a.lit.gltf", "a.lit.gltf"),
            ("lit.glb", "lit.lit.glb"),
            ("A.GLB", "A.lit.GLB"),
            ("a.vrm", "a.lit.glb"),
            ("a", "a.lit.glb"),
        ] {
            assert_eq!(beside(Path::new(input)), Path::new(output), "{input}");
        }
    }
}
