//! [`Glb`]: a glTF document under construction and its one buffer. Writes only what these scenes need.

use super::shape::Shape;
use glam::{Mat3, Quat, Vec3};
use serde_json::{Map, Value, json};

const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A document; nodes are added last and refer to meshes, cameras and lights by index.
pub struct Glb {
    json: Map<String, Value>,
    extensions: Vec<&'static str>,
    lights: Vec<Value>,
    bytes: Vec<u8>,
}

impl Glb {
    /// An empty scene of this name.
    pub fn new(scene: &str) -> Self {
        let json = json!({
            "asset": { "version": "2.0", "generator": "luxel tools/assets", "copyright": "luxel authors, MIT OR Apache-2.0" },
            "scene": 0,
            "scenes": [{ "name": scene, "nodes": [] }],
        });
        let Value::Object(json) = json else { unreachable!("an object literal") };
        Glb { json, extensions: Vec::new(), lights: Vec::new(), bytes: Vec::new() }
    }

    /// Notes that the file uses an extension.
    pub fn uses(&mut self, extension: &'static str) {
        if !self.extensions.contains(&extension) {
            self.extensions.push(extension);
        }
    }

    /// Adds a material as it stands.
    pub fn material(&mut self, material: Value) -> usize {
        self.push("materials", material)
    }

    /// A dielectric, rough material of linear `color`.
    pub fn matte(&mut self, name: &str, color: [f64; 3]) -> usize {
        self.material(json!({ "name": name, "pbrMetallicRoughness": rough(color) }))
    }

    /// An emissive material: radiance L = `strength * factor`, which one side or both give.
    pub fn glowing(&mut self, name: &str, color: [f64; 3], factor: [f64; 3], strength: f64) -> usize {
        self.uses("KHR_materials_emissive_strength");
        self.material(json!({
            "name": name,
            "pbrMetallicRoughness": rough(color),
            "emissiveFactor": factor,
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
        }))
    }

    /// Embeds a PNG, repeated and read with mip maps.
    pub fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        if !self.json.contains_key("samplers") {
            self.push("samplers", json!({ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }));
        }
        let view = self.view(png, None);
        let image = self.push("images", json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        self.push("textures", json!({ "name": name, "source": image, "sampler": 0 }))
    }

    /// A mesh of one primitive for each (shape, material).
    pub fn mesh(&mut self, name: &str, parts: &[(&Shape, usize)]) -> usize {
        let primitives: Vec<Value> = parts.iter().map(|(shape, material)| self.primitive(shape, *material)).collect();
        self.push("meshes", json!({ "name": name, "primitives": primitives }))
    }

    /// A perspective camera of vertical field of view `yfov` (radians), placed at `eye` and looking at `target`.
    pub fn camera(&mut self, name: &str, yfov: f64, eye: Vec3, target: Vec3) -> usize {
        let camera = json!({ "name": name, "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.05 } });
        let camera = self.push("cameras", camera);
        self.node(Node { at: eye, turn: look(target - eye), camera: Some(camera), ..Node::named(name) })
    }

    /// A punctual light as it stands; nodes refer to it by the index that comes back.
    pub fn light(&mut self, light: Value) -> usize {
        self.uses("KHR_lights_punctual");
        self.lights.push(light);
        self.lights.len() - 1
    }

    /// Adds a node that no other node holds yet.
    pub fn node(&mut self, node: Node) -> usize {
        let index = self.push("nodes", node.to_json());
        let roots = self.json["scenes"][0]["nodes"].as_array_mut().expect("a list of nodes");
        roots.retain(|r| !node.children.iter().any(|c| r == c));
        roots.push(json!(index));
        index
    }

    /// The finished file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.lights.is_empty() {
            json.insert("extensions".into(), json!({ "KHR_lights_punctual": { "lights": self.lights } }));
        }
        if !self.extensions.is_empty() {
            json.insert("extensionsUsed".into(), json!(self.extensions));
        }
        json.insert("buffers".into(), json!([{ "byteLength": self.bytes.len() }]));
        let mut text = serde_json::to_vec(&json).expect("a JSON value");
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut binary = self.bytes.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut out = Vec::new();
        out.extend(b"glTF");
        let total = 12 + 8 + text.len() + 8 + binary.len();
        out.extend([2, total as u32].iter().flat_map(|n: &u32| n.to_le_bytes()));
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }

    fn primitive(&mut self, shape: &Shape, material: usize) -> Value {
        let mut attributes = Map::new();
        let position = shape.positions.iter().flat_map(|p| p.to_array());
        attributes.insert("POSITION".into(), json!(self.floats("VEC3", position, true)));
        attributes.insert(
            "NORMAL".into(),
            json!(self.floats("VEC3", shape.normals.iter().flat_map(|n| n.to_array()), false)),
        );
        if !shape.uvs.is_empty() {
            attributes.insert(
                "TEXCOORD_0".into(),
                json!(self.floats("VEC2", shape.uvs.iter().flat_map(|t| t.to_array()), false)),
            );
        }
        if !shape.colors.is_empty() {
            attributes.insert(
                "COLOR_0".into(),
                json!(self.floats("VEC3", shape.colors.iter().flat_map(|c| c.to_array()), false)),
            );
        }
        let indices: Vec<u8> = shape.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&indices, Some(ELEMENT_ARRAY_BUFFER));
        let accessor =
            json!({ "bufferView": view, "componentType": 5123, "count": shape.indices.len(), "type": "SCALAR" });
        let indices = self.push("accessors", accessor);
        json!({ "attributes": attributes, "indices": indices, "material": material })
    }

    fn floats(&mut self, kind: &str, values: impl Iterator<Item = f32>, bounded: bool) -> usize {
        let width = if kind == "VEC2" { 2 } else { 3 };
        let values: Vec<f32> = values.collect();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": values.len() / width, "type": kind });
        if bounded {
            let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..width).map(|i| values.iter().skip(i).step_by(width).copied().reduce(pick).unwrap()).collect()
            };
            accessor["min"] = json!(bound(f32::min));
            accessor["max"] = json!(bound(f32::max));
        }
        self.push("accessors", accessor)
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json.entry(list).or_insert_with(|| json!([])).as_array_mut().expect("a list");
        list.push(value);
        list.len() - 1
    }
}

/// A node to be written; what is left at its default is left out of the file.
#[derive(Clone)]
pub struct Node<'a> {
    pub name: &'a str,
    pub at: Vec3,
    pub turn: Quat,
    pub scale: Vec3,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    pub light: Option<usize>,
    pub children: Vec<usize>,
    pub extras: Value,
}

impl<'a> Node<'a> {
    /// A node with a name alone.
    pub fn named(name: &'a str) -> Self {
        Node {
            name,
            at: Vec3::ZERO,
            turn: Quat::IDENTITY,
            scale: Vec3::ONE,
            mesh: None,
            camera: None,
            light: None,
            children: Vec::new(),
            extras: Value::Null,
        }
    }

    /// A mesh at a place.
    pub fn of(name: &'a str, mesh: usize, at: Vec3) -> Self {
        Node { mesh: Some(mesh), at, ..Node::named(name) }
    }

    fn to_json(&self) -> Value {
        let mut node = json!({ "name": self.name });
        if self.at != Vec3::ZERO {
            node["translation"] = decimal(&self.at.to_array());
        }
        if self.turn != Quat::IDENTITY {
            node["rotation"] = decimal(&self.turn.to_array());
        }
        if self.scale != Vec3::ONE {
            node["scale"] = decimal(&self.scale.to_array());
        }
        if let Some(mesh) = self.mesh {
            node["mesh"] = json!(mesh);
        }
        if let Some(camera) = self.camera {
            node["camera"] = json!(camera);
        }
        if let Some(light) = self.light {
            node["extensions"] = json!({ "KHR_lights_punctual": { "light": light } });
        }
        if !self.children.is_empty() {
            node["children"] = json!(self.children);
        }
        if !self.extras.is_null() {
            node["extras"] = self.extras.clone();
        }
        node
    }
}

/// Metallic-roughness of a dielectric that is as good as Lambertian.
pub fn rough(color: [f64; 3]) -> Value {
    json!({ "baseColorFactor": [color[0], color[1], color[2], 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 })
}

/// Single precision numbers with no more digits than they need.
fn decimal(values: &[f32]) -> Value {
    values.iter().map(|v| v.to_string().parse::<f64>().expect("a number")).collect()
}

/// The turn that takes -Z to `forward` and keeps +Y upright.
fn look(forward: Vec3) -> Quat {
    let back = -forward.normalize();
    let right = Vec3::Y.cross(back).normalize();
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)).normalize()
}
