//! [`Source`]: the document's parts, typed, and the words for what is wrong with them.
//!
//! Each part is deserialized by itself, so that a fault is named by its part and parts that luxel does not read
//! (animations, skins, unknown extensions) need not be valid. Nothing here trusts an index: look-ups are errors.

use crate::{
    error::{Error, Result},
    files,
    gltf::{
        Document,
        uri::{self, Named},
    },
};
use gltf::json::{
    Accessor, Camera, Material, Mesh, Node, Texture, buffer::View, extensions::scene::khr_lights_punctual::Light,
    texture::Sampler,
};
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// A document with its parts typed.
pub(super) struct Source<'a> {
    pub file: &'a Path,
    pub document: &'a Document,
    pub accessors: Vec<Accessor>,
    pub views: Vec<View>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub samplers: Vec<Sampler>,
    pub meshes: Vec<Mesh>,
    pub nodes: Vec<Node>,
    pub cameras: Vec<Camera>,
    pub lights: Vec<Light>,
}

impl<'a> Source<'a> {
    pub fn new(document: &'a Document) -> Result<Self> {
        let file = document.path.as_path();
        let json = &document.json;
        let lights = json.get("extensions").and_then(|e| e.get("KHR_lights_punctual")).unwrap_or(&Value::Null);
        Ok(Source {
            file,
            document,
            accessors: list(file, json, "accessors", "accessor")?,
            views: list(file, json, "bufferViews", "bufferView")?,
            materials: list(file, json, "materials", "material")?,
            textures: list(file, json, "textures", "texture")?,
            samplers: list(file, json, "samplers", "sampler")?,
            meshes: list(file, json, "meshes", "mesh")?,
            nodes: list(file, json, "nodes", "node")?,
            cameras: list(file, json, "cameras", "camera")?,
            lights: list(file, lights, "lights", "light")?,
        })
    }

    /// Part `index` of a list, or the error that `place` names one that is not there.
    pub fn part<'p, T>(&self, list: &'p [T], index: usize, kind: &str, place: &str) -> Result<&'p T> {
        list.get(index).ok_or_else(|| {
            self.invalid(place, format!("names {kind} {index}, but the file has {} of that kind", list.len()))
        })
    }

    /// The untyped part, for what the types do not hold. Null if there is none.
    pub fn value(&self, list: &str, index: usize) -> &'a Value {
        self.document.json.get(list).and_then(|l| l.get(index)).unwrap_or(&Value::Null)
    }

    /// For example `node 7 "Lamp"`.
    pub fn node_name(&self, index: usize) -> String {
        label("node", index, self.nodes.get(index).and_then(|n| n.name.as_deref()))
    }

    /// The error that the file is broken at `place`.
    pub fn invalid(&self, place: impl Into<String>, problem: impl Into<String>) -> Error {
        broken(self.file, place, problem)
    }
}

/// The error that a file is broken at `place`, with the remedy that fits every fault of a document.
pub(super) fn broken(file: &Path, place: impl Into<String>, problem: impl Into<String>) -> Error {
    let remedy = format!(
        "export the file again; the Khronos validator tells more: npx @gltf-transform/cli validate \"{}\"",
        file.display()
    );
    Error::invalid(file, place, problem, remedy)
}

/// The bytes that `text`, a URI in `document`'s part `place`, stands for.
pub(super) fn linked(document: &Path, text: &str, place: &str) -> Result<Vec<u8>> {
    if let Some(data) = uri::data(text) {
        return data.map_err(|problem| broken(document, place, problem));
    }
    let Some(named) = Named::beside(document, text) else {
        let remedy = "download it, put it beside the document and name it by a relative path";
        return Err(Error::unsupported(document, format!("{place}: the remote address {text}"), remedy));
    };
    files::read(&named.path).map_err(|e| match e {
        Error::Io { source, .. } => Error::invalid(
            document,
            place,
            format!("its file {} cannot be read: {source}", named.path.display()),
            "put the file there, or export the scene as one .glb",
        ),
        other => other,
    })
}

/// For example `mesh 3 "Wall"`, or `mesh 3` without a name.
pub(super) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} \"{name}\""),
        _ => format!("{kind} {index}"),
    }
}

/// `json[key]` if it is a list; empty if there is none.
pub(super) fn array<'v>(file: &Path, json: &'v Value, key: &str) -> Result<&'v [Value]> {
    match json.get(key) {
        None => Ok(&[]),
        Some(Value::Array(items)) => Ok(items),
        Some(_) => Err(broken(file, key, "is not a list")),
    }
}

fn list<'v, T: Deserialize<'v>>(file: &Path, json: &'v Value, key: &str, kind: &str) -> Result<Vec<T>> {
    let typed = |(i, v): (usize, &'v Value)| {
        T::deserialize(v)
            .map_err(|e| broken(file, label(kind, i, v.get("name").and_then(Value::as_str)), e.to_string()))
    };
    array(file, json, key)?.iter().enumerate().map(typed).collect()
}
