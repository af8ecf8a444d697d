//! A tiny glTF builder: push accessors, nodes and the like into the JSON, then write it as GLB.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A document under construction: `json` is open to any change, `bin` is buffer 0.
#[derive(Clone)]
pub struct Builder {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Default for Builder {
    fn default() -> Self {
        Builder { json: json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }] }), bin: vec![] }
    }
}

impl Builder {
    /// One triangle in the plane z = 0, on one node.
    pub fn triangle() -> Self {
        let mut b = Builder::default();
        let position = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let mesh = b.mesh(json!({ "POSITION": position }), json!({}));
        b.root(json!({ "mesh": mesh }));
        b
    }

    /// A unit square with texture coordinates, indices and a material, on one node.
    pub fn square() -> Self {
        let mut b = Builder::default();
        let position = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
        let uv = b.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let indices =
            b.accessor(json!({ "type": "SCALAR", "componentType": 5123, "count": 6 }), &u16s(&[0, 1, 2, 0, 2, 3]));
        let material = b.push("materials", json!({ "pbrMetallicRoughness": { "metallicFactor": 0 } }));
        let attributes = json!({ "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv });
        let mesh = b.mesh(attributes, json!({ "indices": indices, "material": material }));
        b.root(json!({ "mesh": mesh }));
        b
    }

    /// [`Builder::square`] with a small PNG as base colour.
    pub fn textured() -> Self {
        let mut b = Builder::square();
        let texels: Vec<[u8; 3]> = (0..16).map(|i| [i * 16, 255 - i * 16, 128]).collect();
        b.texture(&luxel::pixels::encode_png(glam::UVec2::new(4, 4), &texels).unwrap());
        b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
        b
    }

    /// Appends to a top-level list, which is made if needed; returns the index.
    pub fn push(&mut self, list: &str, part: Value) -> usize {
        let items = &mut self.json[list];
        if items.is_null() {
            *items = json!([]);
        }
        let items = items.as_array_mut().unwrap();
        items.push(part);
        items.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    pub fn accessor(&mut self, mut accessor: Value, bytes: &[u8]) -> usize {
        accessor["bufferView"] = json!(self.view(bytes));
        self.push("accessors", accessor)
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let n = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|k| *k == kind).unwrap() + 1;
        let bytes: Vec<u8> = values.iter().flat_map(|f| f.to_le_bytes()).collect();
        self.accessor(json!({ "type": kind, "componentType": 5126, "count": values.len() / n }), &bytes)
    }

    /// A mesh of one primitive; `more` is merged into the primitive.
    pub fn mesh(&mut self, attributes: Value, more: Value) -> usize {
        let mut primitive = json!({ "attributes": attributes });
        primitive.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    pub fn root(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
        node
    }

    pub fn light(&mut self, light: Value, mut node: Value) -> usize {
        if self.json["extensions"].is_null() {
            self.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [] } });
        }
        let lights = self.json["extensions"]["KHR_lights_punctual"]["lights"].as_array_mut().unwrap();
        lights.push(light);
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": lights.len() - 1 } });
        self.root(node)
    }

    /// An image and a texture of it.
    pub fn texture(&mut self, picture: &[u8]) -> usize {
        let view = self.view(picture);
        let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        self.push("textures", json!({ "source": image }))
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json["buffers"].is_null() && !self.bin.is_empty() {
            json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        }
        glb(&serde_json::to_vec(&json).unwrap(), &self.bin)
    }
}

/// A GLB of a JSON and a binary chunk.
pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let mut out = b"glTF".to_vec();
    let word = |out: &mut Vec<u8>, n: usize| out.extend((n as u32).to_le_bytes());
    word(&mut out, 2);
    word(&mut out, 12 + 8 + json.len() + if bin.is_empty() { 0 } else { 8 + bin.len() });
    word(&mut out, json.len());
    out.extend(b"JSON");
    out.extend(json);
    if !bin.is_empty() {
        word(&mut out, bin.len());
        out.extend(b"BIN\0");
        out.extend(bin);
    }
    out
}

pub fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Writes `bytes` as `name` into `folder`.
pub fn save(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}
