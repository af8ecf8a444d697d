//! A picture of the light that every glTF viewer shows: unlit materials whose colour is the radiance that leaves each
//! surface, on the lightmap's layout. It holds the lit instances only, each with coordinates of its own.

use super::{
    accessor::FLOAT,
    container,
    files::Files,
    store::Store,
    vertices::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, object},
};
use crate::{
    atlas::{Atlas, Layout, Placement},
    error::{Error, Result},
    gltf::Document,
    math,
    pixels::encode_png,
    scene::{Alpha, Instance, Mesh, Scene},
};
use glam::{DAffine3, DMat4, UVec2, Vec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// Writes the lit instances with `pages` of radiance (rho E / pi + L, rows from the top) times `exposure` as sRGB.
///
/// One page for each visible page of the atlas. Returns notes, one sentence each.
pub fn write_flat(
    document: &Document,
    scene: &Scene,
    atlas: &Atlas,
    pages: &[(UVec2, Vec<Vec3>)],
    exposure: f32,
    path: &Path,
) -> Result<Vec<String>> {
    let source = Document { path: path.into(), json: head(pages.len()), buffers: Vec::new(), external: Vec::new() };
    let mut store = Store::new(&source);
    for (size, radiance) in pages {
        let texel = |v: &Vec3| math::srgb(*v * exposure);
        let picture: Vec<[u8; 3]> = radiance.iter().map(texel).collect();
        let picture = encode_png(*size, &picture).map_err(|e| Error::writing(path, e))?;
        let view = store.add_view(picture, Map::new());
        push(&mut store.json, "images", json!({ "bufferView": view, "mimeType": "image/png" }));
    }
    let mut writer = Writer { scene, store, geometry: BTreeMap::new() };
    let mut holes = false;
    for (instance, placement) in scene.instances.iter().zip(&atlas.placements) {
        let Some(placement) = placement.filter(|p| (p.page as usize) < pages.len()) else { continue };
        let Some(layout) = atlas.layouts.get(instance.mesh as usize).filter(|l| !l.uv.is_empty()) else { continue };
        let mesh = &scene.meshes[instance.mesh as usize];
        holes |= mesh.primitives.iter().any(|p| scene.materials[p.material as usize].alpha != Alpha::Opaque);
        writer.add(instance, mesh, layout, &placement, name(document, instance));
    }
    let mut json = std::mem::take(&mut writer.store.json);
    finish(&mut json);
    writer.store.json = json;
    container::write_glb(writer.store, Files::beside(path, &document.path, &document.json)?, path)?;
    let mut notes = vec![format!("{}: the detail of tiled textures is blurred to lightmap texels", path.display())];
    notes.extend(holes.then(|| format!("{}: holes and transparency of materials are not shown", path.display())));
    Ok(notes)
}

struct Writer<'a> {
    scene: &'a Scene,
    store: Store<'a>,
    /// What is written already of a mesh; `None`: in its own space, else of that node.
    geometry: BTreeMap<(u32, Option<u32>), Geometry>,
}

/// Accessors of a mesh.
#[derive(Clone)]
struct Geometry {
    positions: usize,
    /// Indices, by whether the triangles are double-sided.
    sides: Vec<(bool, usize)>,
}

impl Writer<'_> {
    fn add(&mut self, instance: &Instance, mesh: &Mesh, layout: &Layout, placement: &Placement, name: Value) {
        let origin = DAffine3::from_translation(self.scene.origin);
        let world = origin * instance.transform;
        // A node cannot shear: such an instance gets its own positions.
        let own = !orthogonal(&world);
        let key = (instance.mesh, own.then_some(instance.node));
        let Geometry { positions, sides } = match self.geometry.get(&key) {
            Some(found) => found.clone(),
            None => {
                let made = self.geometry(mesh, layout, own.then_some(&world));
                self.geometry.insert(key, made.clone());
                made
            }
        };
        let uv = layout.uv.iter().flat_map(|uv| (placement.offset + placement.scale * *uv).to_array());
        let uv = uv.flat_map(f32::to_le_bytes).collect();
        let uv =
            self.array(uv, ARRAY_BUFFER, json!({ "componentType": FLOAT, "count": layout.uv.len(), "type": "VEC2" }));
        let primitive = |(double_sided, indices): &(bool, usize)| {
            let material = 2 * placement.page as usize + usize::from(*double_sided);
            let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uv });
            json!({ "attributes": attributes, "indices": indices, "material": material })
        };
        let primitives: Vec<Value> = sides.iter().map(primitive).collect();
        if primitives.is_empty() {
            return;
        }
        let mesh = push(&mut self.store.json, "meshes", json!({ "primitives": primitives }));
        let mut node = object(json!({ "mesh": mesh }));
        if !name.is_null() {
            node.insert("name".into(), name);
        }
        if !own && world != DAffine3::IDENTITY {
            node.insert("matrix".into(), DMat4::from(world).to_cols_array().to_vec().into());
        }
        let node = push(&mut self.store.json, "nodes", node.into());
        if let Some(nodes) = self.store.json["scenes"][0]["nodes"].as_array_mut() {
            nodes.push(node.into());
        }
    }

    fn geometry(&mut self, mesh: &Mesh, layout: &Layout, world: Option<&DAffine3>) -> Geometry {
        let place = |&v: &u32| {
            let p = mesh.positions[v as usize];
            world.map_or(p, |w| w.transform_point3(p.as_dvec3()).as_vec3())
        };
        let positions: Vec<Vec3> = layout.source.iter().map(place).collect();
        let (min, max) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |b, &p| (b.0.min(p), b.1.max(p)));
        let bytes = positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
        let accessor = json!({
            "componentType": FLOAT, "count": positions.len(), "type": "VEC3",
            "min": min.to_array(), "max": max.to_array(),
        });
        let positions = self.array(bytes, ARRAY_BUFFER, accessor);
        let mirrored = world.is_some_and(|w| w.matrix3.determinant() < 0.0);
        let mut sides = Vec::new();
        for double_sided in [false, true] {
            let side =
                |p: usize| self.scene.materials[mesh.primitives[p].material as usize].double_sided == double_sided;
            let chosen = (0u32..).zip(&layout.triangles).filter(|(t, _)| side(mesh.primitive_of(*t))).map(|(_, t)| *t);
            let turn = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
            let indices: Vec<u32> = chosen.flat_map(turn).collect();
            if !indices.is_empty() {
                let bytes = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
                let accessor = json!({ "componentType": 5125, "count": indices.len(), "type": "SCALAR" });
                sides.push((double_sided, self.array(bytes, ELEMENT_ARRAY_BUFFER, accessor)));
            }
        }
        Geometry { positions, sides }
    }

    fn array(&mut self, bytes: Vec<u8>, target: u32, accessor: Value) -> usize {
        let view = self.store.add_view(bytes, object(json!({ "target": target })));
        let mut accessor = object(accessor);
        accessor.insert("bufferView".into(), view.into());
        self.store.add_accessor(accessor)
    }
}

/// Two materials a page: one-sided, double-sided.
fn head(pages: usize) -> Value {
    let material = |i: usize| {
        let mut material = json!({
            "name": format!("page {}{}", i / 2, if i % 2 == 1 { ", double-sided" } else { "" }),
            "pbrMetallicRoughness": { "baseColorTexture": { "index": i / 2 }, "metallicFactor": 0.0 },
            "extensions": { "KHR_materials_unlit": {} },
        });
        if i % 2 == 1 {
            material["doubleSided"] = true.into();
        }
        material
    };
    json!({
        "asset": { "version": "2.0", "generator": concat!("luxel ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": [] }],
        "nodes": [],
        "meshes": [],
        "materials": (0..2 * pages).map(material).collect::<Vec<_>>(),
        "textures": (0..pages).map(|i| json!({ "source": i, "sampler": 0 })).collect::<Vec<_>>(),
        "samplers": [{ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 }],
        "images": [],
    })
}

/// Takes out lists that stayed empty, which glTF does not allow.
fn finish(json: &mut Value) {
    if let Some(root) = json.as_object_mut() {
        root.retain(|_, v| v.as_array().is_none_or(|list| !list.is_empty()));
    }
    if json["scenes"][0]["nodes"].as_array().is_some_and(Vec::is_empty) {
        json["scenes"][0] = json!({});
    }
}

fn push(json: &mut Value, key: &str, value: Value) -> usize {
    json[key].as_array_mut().map_or(0, |list| {
        list.push(value);
        list.len() - 1
    })
}

fn name(document: &Document, instance: &Instance) -> Value {
    document.json["nodes"][instance.node as usize]["name"].clone()
}

/// True if the transform is a rotation with scales, as glTF demands of a node's matrix.
fn orthogonal(world: &DAffine3) -> bool {
    let m = &world.matrix3;
    let square = |a: glam::DVec3, b: glam::DVec3| a.dot(b).abs() <= 1e-7 * a.length() * b.length();
    let flat = m.determinant().abs() <= 1e-12 * m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    !flat && square(m.x_axis, m.y_axis) && square(m.y_axis, m.z_axis) && square(m.z_axis, m.x_axis)
}
