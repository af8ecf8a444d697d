//! Where results go: names that nobody typed, and mistakes found before anything takes long.

use super::{args::Bake, values::has_extension};
use luxel::{
    error::{Error, Result},
    files,
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
    let input = place(input)?;
    let mut places: Vec<PathBuf> = Vec::new();
    let others = [&outputs.preview, &outputs.flat, &outputs.report].into_iter().flatten();
    for path in [&outputs.scene].into_iter().chain(others) {
        let at = place(path)?;
        let taken = places.contains(&at) || !places.is_empty() && at == input;
        if taken {
            return Err(Error::Usage(format!("{}: two files of this bake have the same name", path.display())));
        }
        if path.exists() && !path.is_file() {
            return Err(Error::Usage(format!("{}: is not a file that can be replaced", path.display())));
        }
        files::probe(path)?;
        places.push(at);
    }
    Ok(outputs)
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

/// The file's place whatever links and dots lead to it; its folder must exist.
fn place(path: &Path) -> Result<PathBuf> {
    if let Ok(place) = path.canonicalize() {
        return Ok(place);
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().map_err(|e| Error::writing(path, in_folder(folder, &e)))?;
    Ok(folder.join(path.file_name().unwrap_or_default()))
}

fn in_folder(folder: &Path, reason: &io::Error) -> io::Error {
    io::Error::new(reason.kind(), format!("the folder {} cannot be used: {reason}", folder.display()))
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
