//! Small glTF documents, built in memory, and the scenes and layouts that go with them.

use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3};
use luxel::atlas::{Atlas, Layout, NO_CHART, Page, Placement};
use luxel::gltf::{Document, Remarks, WriteOptions, write};
use luxel::lightmaps::{Lightmaps, Map};
use luxel::report::Report;
use luxel::scene::{Bake, Instance, Light, LightKind, Material, Mesh, Primitive, Scene};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A document under construction.
pub struct Builder {
    pub json: Value,
    pub buffer: Vec<u8>,
}

impl Builder {
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0", "generator": "a hand" },
            "scene": 0, "scenes": [{ "nodes": [] }], "nodes": [], "meshes": [], "accessors": [], "bufferViews": [],
            "buffers": [{ "byteLength": 0 }],
        });
        Builder { json, buffer: Vec::new() }
    }

    pub fn push(&mut self, key: &str, value: Value) -> usize {
        if self.json[key].is_null() {
            self.json[key] = json!([]);
        }
        let list = self.json[key].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8], more: Value) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        view.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.buffer.extend_from_slice(bytes);
        self.json["buffers"][0]["byteLength"] = self.buffer.len().into();
        self.push("bufferViews", view)
    }

    pub fn accessor(&mut self, bytes: &[u8], view: Value, accessor: Value) -> usize {
        let view = self.view(bytes, view);
        let mut full = json!({ "bufferView": view });
        full.as_object_mut().unwrap().extend(accessor.as_object().unwrap().clone());
        self.push("accessors", full)
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let bound = |f: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width).map(|i| values[i..].iter().step_by(width).copied().reduce(f).unwrap()).collect()
        };
        let accessor = json!({
            "componentType": 5126, "count": values.len() / width, "type": kind,
            "min": bound(f32::min), "max": bound(f32::max),
        });
        self.accessor(&bytes, json!({ "target": 34962 }), accessor)
    }

    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let accessor = json!({ "componentType": 5123, "count": values.len(), "type": "SCALAR" });
        self.accessor(&bytes, json!({ "target": 34963 }), accessor)
    }

    /// A square of four vertices and two triangles, with the given sets of texture coordinates.
    pub fn square(&mut self, sets: usize) -> Value {
        let positions = self.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
        let normals = self.floats("VEC3", &[0., 0., 1.].repeat(4));
        let mut attributes = json!({ "POSITION": positions, "NORMAL": normals });
        for set in 0..sets {
            let s = set as f32;
            attributes[format!("TEXCOORD_{set}")] = self.floats("VEC2", &[s, 0., 1., s, 0.5, 0.25, s, s]).into();
        }
        let indices = self.indices(&[0, 1, 2, 0, 2, 3]);
        json!({ "attributes": attributes, "indices": indices })
    }

    /// A mesh and a node that shows it.
    pub fn shown(&mut self, primitives: Value) -> usize {
        let mesh = self.push("meshes", json!({ "primitives": primitives }));
        let node = self.push("nodes", json!({ "mesh": mesh }));
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(node.into());
        mesh
    }

    pub fn texture(&mut self) -> usize {
        let image = self.push("images", json!({ "uri": format!("data:image/png;base64,{PIXEL}") }));
        self.push("textures", json!({ "source": image }))
    }

    pub fn document(mut self, path: &Path) -> Document {
        for key in ["nodes", "meshes", "accessors", "bufferViews"] {
            if self.json[key].as_array().unwrap().is_empty() {
                self.json.as_object_mut().unwrap().remove(key);
            }
        }
        Document { path: path.into(), json: self.json, buffers: vec![self.buffer], external: Vec::new() }
    }
}

/// One white pixel.
const PIXEL: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4//8/AAX+Av4N70a4AAAAAElFTkSuQmCC";

/// Reads a file back, without the reader's checks.
pub fn load(path: &Path) -> Document {
    let bytes = std::fs::read(path).unwrap();
    if !bytes.starts_with(b"glTF") {
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        let name = |b: &Value| b["uri"].as_str().unwrap().replace("%20", " ");
        let read = |b: &Value| std::fs::read(path.with_file_name(name(b))).unwrap();
        let buffers = json["buffers"].as_array().unwrap().iter().map(read).collect();
        return Document { path: path.into(), json, buffers, external: Vec::new() };
    }
    let u32_at = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap()) as usize;
    assert_eq!(u32_at(8), bytes.len());
    let length = u32_at(12);
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let binary = bytes.get(28 + length..).unwrap_or_default().to_vec();
    Document { path: path.into(), json, buffers: vec![binary], external: Vec::new() }
}

/// The numbers of an accessor that is neither sparse nor normalized, as f64.
pub fn numbers(document: &Document, index: &Value) -> Vec<f64> {
    let accessor = &document.json["accessors"][index.as_u64().unwrap() as usize];
    let width = match accessor["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        _ => 4,
    };
    let code = accessor["componentType"].as_u64().unwrap();
    let size = match code {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    };
    let at = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    let view = &document.json["bufferViews"][at(&accessor["bufferView"])];
    let stride = view["byteStride"].as_u64().map_or(width * size, |s| s as usize);
    let start = at(&view["byteOffset"]) + at(&accessor["byteOffset"]);
    let end = at(&view["byteOffset"]) + at(&view["byteLength"]);
    let bytes = &document.buffers[at(&view["buffer"])][..end];
    let mut out = Vec::new();
    for element in 0..at(&accessor["count"]) {
        for component in 0..width {
            let b = &bytes[start + element * stride + component * size..][..size];
            out.push(match code {
                5120 => f64::from(b[0] as i8),
                5121 => f64::from(b[0]),
                5122 => f64::from(i16::from_le_bytes(b.try_into().unwrap())),
                5123 => f64::from(u16::from_le_bytes(b.try_into().unwrap())),
                5125 => f64::from(u32::from_le_bytes(b.try_into().unwrap())),
                _ => f64::from(f32::from_le_bytes(b.try_into().unwrap())),
            });
        }
    }
    out
}

/// How the fixtures lay meshes out.
#[derive(Clone, Copy, PartialEq)]
pub enum Plan {
    /// Nothing is split.
    Whole,
    /// Every triangle is a chart of its own, with three vertices.
    Triangles,
}

/// The scene of a document, as far as the writer looks: every node with a mesh is an instance, quantized or sparse
/// positions are left zero.
pub fn scene(document: &Document) -> Scene {
    let mut scene = Scene::default();
    let json = &document.json;
    let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
    for (index, source) in list(&json["meshes"]).iter().enumerate() {
        let mut mesh = Mesh { name: format!("mesh {index}"), source: index as u32, ..Mesh::default() };
        for (p, primitive) in list(&source["primitives"]).iter().enumerate() {
            let first = mesh.positions.len() as u32;
            let position = &primitive["attributes"]["POSITION"];
            let accessor = &json["accessors"][position.as_u64().unwrap() as usize];
            let count = accessor["count"].as_u64().unwrap() as usize;
            if accessor["componentType"] == 5126 && accessor["sparse"].is_null() {
                let p = numbers(document, position);
                mesh.positions.extend(p.chunks(3).map(|p| Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32)));
            } else {
                mesh.positions.resize(mesh.positions.len() + count, Vec3::ZERO);
            }
            let corners: Vec<u32> = match &primitive["indices"] {
                Value::Null => (0..count as u32).collect(),
                indices => numbers(document, indices).iter().map(|&v| v as u32).collect(),
            };
            let corners: Vec<u32> = corners.iter().map(|v| v + first).collect();
            let start = mesh.triangles.len() as u32;
            let strip = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            match primitive["mode"].as_u64().unwrap_or(4) {
                4 => mesh.triangles.extend(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]])),
                5 => mesh.triangles.extend(corners.windows(3).enumerate().map(strip)),
                6 => mesh.triangles.extend(corners[1..].windows(2).map(|w| [w[0], w[1], corners[0]])),
                _ => continue,
            }
            mesh.primitives.push(Primitive {
                source: p as u32,
                triangles: start..mesh.triangles.len() as u32,
                vertices: first..first + count as u32,
                material: 0,
                uv_sets: 0,
            });
        }
        scene.meshes.push(mesh);
    }
    scene.materials.push(Material::default());
    for (index, _) in
        list(&json["nodes"]).iter().enumerate().filter(|(_, n)| n["extensions"]["KHR_lights_punctual"].is_object())
    {
        scene.lights.push(Light {
            name: String::new(),
            node: Some(index as u32),
            kind: LightKind::Point { radius: 0.0 },
            position: Vec3::ZERO,
            direction: Vec3::Y,
            intensity: Vec3::ONE,
            range: f32::INFINITY,
            bake: Bake::Full,
        });
    }
    for (index, node) in list(&json["nodes"]).iter().enumerate() {
        if let Some(mesh) = node["mesh"].as_u64() {
            let at = list(&node["translation"]).iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>();
            let transform = DAffine3::from_translation(DVec3::from_slice(if at.is_empty() { &[0.0; 3] } else { &at }));
            scene.instances.push(Instance {
                name: format!("node {index}"),
                node: index as u32,
                mesh: mesh as u32,
                transform,
                texels_per_meter: None,
            });
        }
    }
    scene
}

/// An atlas of two pages: instances lie alternately on each, in quarters.
pub fn atlas(scene: &Scene, plan: Plan) -> Atlas {
    let layouts = scene.meshes.iter().map(|mesh| layout(mesh, plan)).collect();
    let place = |i: usize| Placement { page: i as u32 % 2, offset: Vec2::new(0.25, 0.5), scale: Vec2::splat(0.25) };
    let placements = (0..scene.instances.len()).map(|i| Some(place(i))).collect();
    Atlas { layouts, placements, pages: vec![Page { size: UVec2::new(8, 4), hidden: false }; 2], kept: false }
}

fn layout(mesh: &Mesh, plan: Plan) -> Layout {
    let triangles = mesh.triangles.clone();
    let source: Vec<u32> = match plan {
        Plan::Whole => (0..mesh.positions.len() as u32).collect(),
        Plan::Triangles => triangles.as_flattened().to_vec(),
    };
    let triangles = match plan {
        Plan::Whole => triangles,
        Plan::Triangles => (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    };
    let n = source.len() as f32;
    let uv = (0..source.len()).map(|i| Vec2::new(i as f32 / n, 1.0 - i as f32 / n)).collect();
    let charts = vec![NO_CHART; triangles.len()];
    Layout { source, uv, triangles, charts, chart_count: 0 }
}

/// Pages of one value.
pub fn lightmaps(atlas: &Atlas, value: f32) -> Lightmaps {
    let page = |p: &Page| {
        let n = (p.size.x * p.size.y) as usize;
        Map { size: p.size, irradiance: vec![Vec3::splat(value); n], covered: vec![true; n] }
    };
    Lightmaps { pages: atlas.pages.iter().map(page).collect(), ..Lightmaps::default() }
}

/// Writes `document` with a lightmap of ones; returns what was written and what was said.
pub fn bake(document: &Document, plan: Plan, options: &WriteOptions, out: &Path) -> (Document, Vec<String>) {
    let scene = scene(document);
    let atlas = atlas(&scene, plan);
    let maps = lightmaps(&atlas, 1.0);
    let Remarks { mut warnings, notes } =
        write(document, &scene, &atlas, &maps, &Report::default(), options, out).unwrap();
    keep(out);
    warnings.extend(notes);
    (load(out), warnings)
}

/// Copies an output to the folder in LUXEL_KEEP, where the Khronos validator can look at it.
pub fn keep(out: &Path) {
    let Some(folder) = std::env::var_os("LUXEL_KEEP").map(PathBuf::from) else { return };
    let test = std::thread::current().name().unwrap_or("test").replace("::", "_");
    for entry in std::fs::read_dir(out.parent().unwrap()).unwrap() {
        let from = entry.unwrap().path();
        let to = folder.join(&test);
        std::fs::create_dir_all(&to).unwrap();
        if from.is_file() {
            std::fs::copy(&from, to.join(from.file_name().unwrap())).unwrap();
        }
    }
}
