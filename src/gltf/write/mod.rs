//! The door out: binds lightmaps to a document and writes it.
//!
//! The source's JSON is patched, never re-made, so that whatever luxel does not know survives. In order: an earlier
//! lightmap is taken out, layouts become TEXCOORD_1, pages become EXR files or parts of the GLB, nodes are bound.

mod accessor;
mod bind;
mod companions;
mod container;
mod files;
mod flat;
mod lights;
mod sets;
mod store;
mod vertices;

pub use flat::write_flat;

use super::Document;
use crate::{
    atlas::Atlas,
    error::{Error, Result},
    lightmaps::Lightmaps,
    pixels::exr::{self, Encoded},
    report::Report,
    scene::Scene,
};
use files::Files;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::path::Path;
use store::Store;

/// What is written besides the lightmap.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Pages have 32 bits a channel instead of 16. Default: no.
    pub float: bool,
    /// Pages and a description (`OUT.lightmap.json`) are written beside the output as well. Default: no.
    pub sidecar: bool,
    /// The baked lights are taken out of the file. Default: no.
    pub strip_lights: bool,
}

/// What a writer has to say, one sentence each.
#[derive(Clone, Debug, Default)]
pub struct Remarks {
    /// What may be wrong with the output.
    pub warnings: Vec<String>,
    /// What was done, and is as it should be.
    pub notes: Vec<String>,
}

/// Finds out whether `document` can be written to `out`, before anything takes long; `kept`: its vertices stay as they
/// are.
pub fn check(document: &Document, scene: &Scene, kept: bool, out: &Path) -> Result<()> {
    Files::beside(out, &document.path, &document.json)?;
    if kept { Ok(()) } else { vertices::check(document, scene) }
}

/// Writes `document` with `lightmaps` bound to it: a `.gltf` with files beside it, or, by any other name, a GLB.
///
/// All files are written under temporary names and renamed at the end, this one last: a failure before that leaves
/// nothing behind and changes nothing. If the system refuses to rename one of several files, those before it stay.
pub fn write(
    document: &Document,
    scene: &Scene,
    atlas: &Atlas,
    lightmaps: &Lightmaps,
    report: &Report,
    options: &WriteOptions,
    out: &Path,
) -> Result<Remarks> {
    let glb = !crate::files::has_extension(out, &["gltf"]);
    let mut store = Store::new(document);
    let mut files = Files::beside(out, &document.path, &document.json)?;
    bind::unbind(&mut store);
    let mut said = if atlas.kept { Remarks::default() } else { vertices::lay_out(&mut store, scene, atlas)? };
    let baked_lights = lights::baked(scene, lightmaps.content);
    if options.strip_lights {
        lights::strip(&mut store.json, &baked_lights);
    }
    said.warnings.extend(companions::bring(&mut store, &mut files, glb)?);

    let pages = encode(lightmaps, options.float, out)?;
    let uris = if !glb || options.sidecar { add_pages(&pages, &mut files)? } else { Vec::new() };
    let rectangles = bind::rectangles(scene, atlas, &mut said.warnings);
    if options.sidecar {
        let root = bind::root_data(lightmaps, &uris, report, &baked_lights);
        files.add(".lightmap.json", &sidecar(root, scene, &rectangles))?;
    }
    let places = if glb { embed_pages(pages, &mut store) } else { uris };
    let root = bind::root_data(lightmaps, &places, report, &baked_lights);
    said.notes.extend(bind::bind(&mut store.json, root, &rectangles));
    if glb { container::write_glb(store, files, out) } else { container::write_gltf(store, files, out) }?;
    Ok(said)
}

fn encode(lightmaps: &Lightmaps, float: bool, out: &Path) -> Result<Vec<Encoded>> {
    let pages = lightmaps.pages.par_iter().map(|page| exr::encode(page.size, &page.irradiance, float));
    pages.collect::<std::result::Result<_, _>>().map_err(|e| Error::writing(out, std::io::Error::other(e)))
}

fn add_pages(pages: &[Encoded], files: &mut Files) -> Result<Vec<(&'static str, Value, f32)>> {
    let add = |(i, page): (usize, &Encoded)| {
        Ok(("uri", files.add(&format!(".page{i}.exr"), &page.bytes)?.into(), page.scale))
    };
    pages.iter().enumerate().map(add).collect()
}

fn embed_pages(pages: Vec<Encoded>, store: &mut Store) -> Vec<(&'static str, Value, f32)> {
    let add = |page: Encoded| ("bufferView", store.add_view(page.bytes, Map::new()).into(), page.scale);
    pages.into_iter().map(add).collect()
}

/// The lightmap without the scene: the root's data and each node's rectangle.
fn sidecar(root: Value, scene: &Scene, rectangles: &[(u32, crate::atlas::Placement)]) -> Vec<u8> {
    let names: HashMap<u32, &str> = scene.instances.iter().rev().map(|i| (i.node, i.name.as_str())).collect();
    let node = |(index, placement): &(u32, crate::atlas::Placement)| {
        let name = names.get(index).copied().unwrap_or_default();
        let mut node = vertices::object(json!({ "node": index, "name": name }));
        node.extend(vertices::object(bind::node_data(placement)));
        Value::from(node)
    };
    let mut all = vertices::object(root);
    all.insert("nodes".into(), rectangles.iter().map(node).collect());
    let mut text = format!("{:#}", Value::from(all)).into_bytes();
    text.push(b'\n');
    text
}
