//! A picture of the light that every glTF viewer shows: unlit materials whose colour is the radiance that leaves each
//! surface, on the lightmap's layout, each lit instance with coordinates of its own. What is unlit in the scene stays as
//! it is.

use super::{
    accessor::{FLOAT, UNSIGNED_INT},
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
    scene::{Alpha, Instance, Mesh, Primitive, Scene, Wrap},
};
use glam::{DAffine3, DMat4, UVec2, Vec2, Vec3};
use serde_json::{Map, Value, json};
use std::{collections::BTreeMap, io, path::Path};

/// Writes the lit and the unlit instances, the lit ones with `pages` of radiance (rho E / pi + L, rows from the top) times `exposure` as sRGB.
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
    let mut writer = Writer { scene, store, lit: BTreeMap::new(), unlit: BTreeMap::new(), materials: BTreeMap::new() };
    let mut holes = false;
    for (instance, placement) in scene.instances.iter().zip(&atlas.placements) {
        let (mesh, layout) = (&scene.meshes[instance.mesh as usize], &atlas.layouts[instance.mesh as usize]);
        let placement = placement.filter(|p| (p.page as usize) < pages.len() && !layout.uv.is_empty());
        let world = DAffine3::from_translation(scene.origin) * instance.transform;
        // A node cannot shear: such an instance gets its own positions.
        let own = (!orthogonal(&world)).then_some(&world);
        let key = (instance.mesh, own.map(|_| instance.node));
        let mut primitives = Vec::new();
        if let Some(placement) = placement {
            let is_lit = |p: &&Primitive| !scene.materials[p.material as usize].unlit;
            holes |= mesh
                .primitives
                .iter()
                .filter(is_lit)
                .any(|p| scene.materials[p.material as usize].alpha != Alpha::Opaque);
            primitives.extend(writer.lit(key, mesh, layout, &placement, own));
        }
        primitives.extend(writer.unlit(key, mesh, own).map_err(|e| Error::writing(path, e))?);
        writer.place(primitives, own.map_or(world, |_| DAffine3::IDENTITY), name(document, instance));
    }
    let mut json = std::mem::take(&mut writer.store.json);
    finish(&mut json);
    writer.store.json = json;
    container::write_glb(writer.store, Files::beside(path, &document.path, &document.json)?, path)?;
    let mut notes = vec![format!("{}: the detail of tiled textures is blurred to lightmap texels", path.display())];
    notes.extend(holes.then(|| format!("{}: holes and transparency of materials are not shown", path.display())));
    Ok(notes)
}

/// A mesh in its own space, or as the node that must have positions of its own shows it.
type Key = (u32, Option<u32>);

struct Writer<'a> {
    scene: &'a Scene,
    store: Store<'a>,
    /// What is written already.
    lit: BTreeMap<Key, Geometry>,
    unlit: BTreeMap<Key, Vec<Value>>,
    /// The unlit ones, by their index in the scene.
    materials: BTreeMap<u32, usize>,
}

/// Accessors of a mesh's lit part.
#[derive(Clone)]
struct Geometry {
    positions: usize,
    /// Indices, by whether the triangles are double-sided.
    sides: Vec<(bool, usize)>,
}

impl Writer<'_> {
    /// The lit primitives of an instance.
    fn lit(
        &mut self,
        key: Key,
        mesh: &Mesh,
        layout: &Layout,
        placement: &Placement,
        world: Option<&DAffine3>,
    ) -> Vec<Value> {
        let Geometry { positions, sides } = match self.lit.get(&key) {
            Some(found) => found.clone(),
            None => {
                let made = self.geometry(mesh, layout, world);
                self.lit.insert(key, made.clone());
                made
            }
        };
        let uv = self.floats("VEC2", layout.uv.iter().map(|uv| (placement.offset + placement.scale * *uv).to_array()));
        let primitive = |(double_sided, indices): &(bool, usize)| {
            let material = 2 * placement.page as usize + usize::from(*double_sided);
            let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uv });
            json!({ "attributes": attributes, "indices": indices, "material": material })
        };
        sides.iter().map(primitive).collect()
    }

    /// The unlit primitives of a mesh.
    fn unlit(&mut self, key: Key, mesh: &Mesh, world: Option<&DAffine3>) -> io::Result<Vec<Value>> {
        if let Some(found) = self.unlit.get(&key) {
            return Ok(found.clone());
        }
        let mut made = Vec::new();
        for p in mesh.primitives.iter().filter(|p| !p.triangles.is_empty()) {
            let material = &self.scene.materials[p.material as usize];
            if !material.unlit {
                continue;
            }
            let vertices = p.vertices.start as usize..p.vertices.end as usize;
            let positions = mesh.positions[vertices.clone()].iter();
            let mut attributes = json!({ "POSITION": self.positions(positions, world) });
            if let Some(r) = &material.base_texture {
                let set = mesh.uvs.get(r.set as usize).filter(|set| !set.is_empty());
                let uv = vertices.clone().map(|v| set.map_or(Vec2::ZERO, |set| set[v]));
                let uv = self.floats("VEC2", uv.map(|uv| r.transform.transform_point2(uv).to_array()));
                attributes["TEXCOORD_0"] = uv.into();
            }
            if !mesh.colors.is_empty() {
                let colors = self.floats("VEC4", mesh.colors[vertices].iter().map(|c| c.to_array()));
                attributes["COLOR_0"] = colors.into();
            }
            let triangles = &mesh.triangles[p.triangles.start as usize..p.triangles.end as usize];
            let indices = self.indices(triangles.iter().map(|t| t.map(|v| v - p.vertices.start)), world);
            let material = self.material(p.material)?;
            made.push(json!({ "attributes": attributes, "indices": indices, "material": material }));
        }
        self.unlit.insert(key, made.clone());
        Ok(made)
    }

    /// Shows `primitives`, if there are any, by a node.
    fn place(&mut self, primitives: Vec<Value>, world: DAffine3, name: Value) {
        if primitives.is_empty() {
            return;
        }
        let mesh = push(&mut self.store.json, "meshes", json!({ "primitives": primitives }));
        let mut node = object(json!({ "mesh": mesh }));
        if !name.is_null() {
            node.insert("name".into(), name);
        }
        if world != DAffine3::IDENTITY {
            node.insert("matrix".into(), DMat4::from(world).to_cols_array().to_vec().into());
        }
        let node = push(&mut self.store.json, "nodes", node.into());
        if let Some(nodes) = self.store.json["scenes"][0]["nodes"].as_array_mut() {
            nodes.push(node.into());
        }
    }

    fn geometry(&mut self, mesh: &Mesh, layout: &Layout, world: Option<&DAffine3>) -> Geometry {
        let positions = self.positions(layout.source.iter().map(|&v| &mesh.positions[v as usize]), world);
        let mut sides = Vec::new();
        for double_sided in [false, true] {
            let side = |t: u32| {
                let material = &self.scene.materials[mesh.primitives[mesh.primitive_of(t)].material as usize];
                !material.unlit && material.double_sided == double_sided
            };
            let chosen: Vec<[u32; 3]> =
                (0..).zip(&layout.triangles).filter(|(t, _)| side(*t)).map(|(_, triangle)| *triangle).collect();
            if !chosen.is_empty() {
                sides.push((double_sided, self.indices(chosen.into_iter(), world)));
            }
        }
        Geometry { positions, sides }
    }

    /// The material of an unlit one of the scene.
    fn material(&mut self, index: u32) -> io::Result<usize> {
        if let Some(known) = self.materials.get(&index) {
            return Ok(*known);
        }
        let from = &self.scene.materials[index as usize];
        let mut material = json!({
            "name": from.name,
            "pbrMetallicRoughness": { "baseColorFactor": from.base_color.to_array(), "metallicFactor": 0.0 },
            "extensions": { "KHR_materials_unlit": {} },
            "doubleSided": from.double_sided,
        });
        match from.alpha {
            Alpha::Opaque => {}
            Alpha::Mask(cutoff) => (material["alphaMode"], material["alphaCutoff"]) = ("MASK".into(), cutoff.into()),
            Alpha::Blend => material["alphaMode"] = "BLEND".into(),
        }
        if let Some(r) = &from.base_texture {
            let texture = self.texture(r.texture)?;
            material["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
        }
        let made = push(&mut self.store.json, "materials", material);
        self.materials.insert(index, made);
        Ok(made)
    }

    /// A copy of texture `index` of the scene.
    fn texture(&mut self, index: u32) -> io::Result<usize> {
        let texture = &self.scene.textures[index as usize];
        let (size, texels) = texture.picture();
        let view = self.store.add_view(encode_png(size, texels)?, Map::new());
        let image = push(&mut self.store.json, "images", json!({ "bufferView": view, "mimeType": "image/png" }));
        let [wrap_s, wrap_t] = texture.wrap().map(|wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        });
        let filter = if texture.is_nearest() { 9728 } else { 9729 };
        let sampler = json!({ "magFilter": filter, "wrapS": wrap_s, "wrapT": wrap_t });
        let sampler = push(&mut self.store.json, "samplers", sampler);
        Ok(push(&mut self.store.json, "textures", json!({ "source": image, "sampler": sampler })))
    }

    fn positions<'p>(&mut self, positions: impl Iterator<Item = &'p Vec3>, world: Option<&DAffine3>) -> usize {
        let place = |p: &Vec3| world.map_or(*p, |w| w.transform_point3(p.as_dvec3()).as_vec3());
        let positions: Vec<Vec3> = positions.map(place).collect();
        let (min, max) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |b, &p| (b.0.min(p), b.1.max(p)));
        let accessor = self.floats("VEC3", positions.iter().map(|p| p.to_array()));
        self.store.json["accessors"][accessor]["min"] = min.to_array().to_vec().into();
        self.store.json["accessors"][accessor]["max"] = max.to_array().to_vec().into();
        accessor
    }

    /// Indices of `triangles`, turned around where `world` mirrors.
    fn indices(&mut self, triangles: impl Iterator<Item = [u32; 3]>, world: Option<&DAffine3>) -> usize {
        let mirrored = world.is_some_and(|w| w.matrix3.determinant() < 0.0);
        let turn = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        let bytes: Vec<u8> = triangles.flat_map(turn).flat_map(u32::to_le_bytes).collect();
        let accessor = json!({ "componentType": UNSIGNED_INT, "count": bytes.len() / 4, "type": "SCALAR" });
        self.array(bytes, ELEMENT_ARRAY_BUFFER, accessor)
    }

    fn floats<const N: usize>(&mut self, kind: &str, values: impl Iterator<Item = [f32; N]>) -> usize {
        let bytes: Vec<u8> = values.flatten().flat_map(f32::to_le_bytes).collect();
        let accessor = json!({ "componentType": FLOAT, "count": bytes.len() / (4 * N), "type": kind });
        self.array(bytes, ARRAY_BUFFER, accessor)
    }

    fn array(&mut self, bytes: Vec<u8>, target: u32, accessor: Value) -> usize {
        let view = self.store.add_view(bytes, object(json!({ "target": target })));
        let mut accessor = object(accessor);
        accessor.insert("bufferView".into(), view.into());
        self.store.add_accessor(accessor)
    }
}

/// Two materials a page: one-sided, double-sided. Those of unlit surfaces follow.
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
