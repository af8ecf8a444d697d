//! Meshes, accessors, and what can be wrong with them.

use super::*;
use common::gltf::u16s;

fn modes(mode: u32, indexed: bool) -> Vec<[u32; 3]> {
    let mut b = Builder::default();
    let position = b.floats("VEC3", &(0..18).map(|i| (i * i % 7) as f32).collect::<Vec<_>>());
    let mut more = json!({ "mode": mode });
    if indexed {
        let bytes: Vec<u8> = vec![5, 4, 3, 2, 1, 0];
        more["indices"] = json!(b.accessor(json!({ "type": "SCALAR", "componentType": 5121, "count": 6 }), &bytes));
    }
    let mesh = b.mesh(json!({ "POSITION": position }), more);
    b.root(json!({ "mesh": mesh }));
    ok(&b).scene.meshes.remove(0).triangles
}

#[test]
fn strips_and_fans() {
    assert_eq!(modes(4, false), [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(modes(4, true), [[5, 4, 3], [2, 1, 0]]);
    assert_eq!(modes(5, false), [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]);
    assert_eq!(modes(6, false), [[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]);
    assert_eq!(modes(6, true), [[4, 3, 5], [3, 2, 5], [2, 1, 5], [1, 0, 5]]);
}

#[test]
fn primitives_share_arrays_and_keep_their_order() {
    let mut b = Builder::square();
    let color = b.floats("VEC3", &[0.5, 0.25, 1.0].repeat(3));
    let position = b.floats("VEC3", &[0.0, 0.0, 2.0, 1.0, 0.0, 2.0, 0.0, 1.0, 2.0]);
    let primitives = b.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({ "attributes": { "POSITION": 0 }, "mode": 1 }));
    primitives.push(json!({ "attributes": { "POSITION": position, "COLOR_0": color } }));
    let input = ok(&b);
    let mesh = &input.scene.meshes[0];
    let sources: Vec<u32> = mesh.primitives.iter().map(|p| p.source).collect();
    assert_eq!(sources, [0, 2]);
    assert_eq!((mesh.primitives[1].vertices.clone(), mesh.primitives[1].triangles.clone()), (4..7, 2..3));
    assert_eq!(mesh.triangles[2], [4, 5, 6]);
    assert_eq!((mesh.primitives[0].uv_sets, mesh.primitives[1].uv_sets), (1, 0));
    assert_eq!((mesh.uvs[0].len(), mesh.colors.len(), mesh.normals.len()), (7, 7, 7));
    assert_eq!((mesh.colors[0], mesh.colors[6]), (Vec4::ONE, Vec4::new(0.5, 0.25, 1.0, 1.0)));
    assert_eq!(mesh.normals[6], Vec3::ZERO);
    says(&input.warnings, "points or lines");
    says(&input.warnings, "no material");
    let grey = &input.scene.materials[mesh.primitives[1].material as usize];
    assert_eq!((grey.base_color.x, grey.metallic), (0.8, 0.0));
}

#[test]
fn quantized_attributes() {
    let mut b = Builder::default();
    let shorts: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 0, -32768, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let position = json!({ "type": "VEC3", "componentType": 5122, "normalized": true, "count": 3 });
    let position = b.accessor(position, &shorts);
    let view = b.view(&[127, 0, 0, 0, 127, 0, 0, 0, 127, 0, 0]);
    b.json["bufferViews"][view]["byteStride"] = json!(4);
    let normal = json!({ "bufferView": view, "type": "VEC3", "componentType": 5120, "normalized": true, "count": 3 });
    let normal = b.push("accessors", normal);
    let uv = json!({ "type": "VEC2", "componentType": 5123, "normalized": true, "count": 3 });
    let uv = b.accessor(uv, &u16s(&[0, 65535, 0, 0, 65535, 0]));
    let plain = json!({ "type": "VEC2", "componentType": 5121, "count": 3 });
    let plain = b.accessor(plain, &[1, 2, 3, 4, 5, 255]);
    let color = json!({ "type": "VEC4", "componentType": 5121, "normalized": true, "count": 3 });
    let color = b.accessor(color, &[255, 0, 51, 255].repeat(3));
    let attributes =
        json!({ "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv, "TEXCOORD_1": plain, "COLOR_0": color });
    let mesh = b.mesh(attributes, json!({}));
    b.root(json!({ "mesh": mesh }));
    b.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let m = ok(&b).scene.meshes.remove(0);
    assert_eq!(m.positions, [Vec3::ZERO, Vec3::X, Vec3::NEG_Y]);
    assert_eq!(m.normals, [Vec3::X; 3]);
    assert_eq!(m.uvs[0], [Vec2::Y, Vec2::ZERO, Vec2::X]);
    assert_eq!(m.uvs[1][2], Vec2::new(5.0, 255.0));
    assert_eq!((m.colors[0], m.primitives[0].uv_sets), (Vec4::new(1.0, 0.0, 0.2, 1.0), 3));
}

#[test]
fn sparse_accessors() {
    let mut b = Builder::triangle();
    let at = b.view(&[2]);
    let values: Vec<u8> = [7.0f32, 8.0, 9.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = b.view(&values);
    let sparse = json!({ "count": 1, "indices": { "bufferView": at, "componentType": 5121 }, "values": { "bufferView": values } });
    b.json["accessors"][0]["sparse"] = sparse.clone();
    assert_eq!(ok(&b).scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::new(7.0, 8.0, 9.0)]);
    b.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(ok(&b).scene.meshes[0].positions, [Vec3::ZERO, Vec3::ZERO, Vec3::new(7.0, 8.0, 9.0)]);
    b.json["accessors"][0]["sparse"]["count"] = json!(4);
    refuses(&b, &["more sparse elements"]);
    b.json["accessors"][0]["sparse"] = sparse;
    b.bin[36] = 3;
    refuses(&b, &["mesh 0, primitive 0, accessor 0", "sparse index 3"]);
}

#[test]
fn damaged_vertices() {
    let mut b = Builder::square();
    b.json["meshes"][0]["name"] = json!("Wall");
    b.bin[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
    refuses(&b, &["mesh 0 \"Wall\", primitive 0", "vertex 1", "not finite"]);
    let mut b = Builder::square();
    b.bin[48..60].fill(0);
    b.bin[60..64].copy_from_slice(&f32::INFINITY.to_le_bytes());
    b.bin[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let input = ok(&b);
    assert_eq!(input.scene.meshes[0].normals, [Vec3::ZERO, Vec3::ZERO, Vec3::Z, Vec3::Z]);
    assert_eq!(input.scene.meshes[0].uvs[0][0], Vec2::ZERO);
    says(&input.warnings, "normals without direction");
    says(&input.warnings, "texture coordinates");
    let mut b = Builder::square();
    b.bin[128..130].copy_from_slice(&9u16.to_le_bytes());
    refuses(&b, &["primitive 0, accessor 3", "vertex 9", "there are 4"]);
}

#[test]
fn bounds_and_absurd_numbers() {
    let change = |f: &dyn Fn(&mut Value)| {
        let mut b = Builder::square();
        f(&mut b.json);
        b
    };
    let huge = u64::MAX;
    for n in [5, 1 << 31, 1 << 40, huge] {
        refuses(&change(&|j| j["accessors"][0]["count"] = json!(n)), &["accessor 0"]);
        refuses(&change(&|j| j["accessors"][0]["byteOffset"] = json!(n)), &["accessor 0"]);
        refuses(&change(&|j| j["accessors"][2]["count"] = json!(n)), &["accessor 2"]);
        refuses(&change(&|j| j["accessors"][3]["count"] = json!(n.max(8))), &["accessor 3"]);
    }
    for n in [1 << 31, 1 << 40, huge] {
        refuses(&change(&|j| j["bufferViews"][0]["byteOffset"] = json!(n)), &["bufferView 0"]);
        refuses(&change(&|j| j["bufferViews"][0]["byteLength"] = json!(n)), &["bufferView 0"]);
        refuses(&change(&|j| j["bufferViews"][0]["byteStride"] = json!(n)), &["accessor 0"]);
    }
    refuses(&change(&|j| j["bufferViews"][0]["byteStride"] = json!(0)), &["stride 0"]);
    refuses(&change(&|j| j["accessors"][0]["type"] = json!("VEC2")), &["accessor 0", "Vec2"]);
    refuses(&change(&|j| j["accessors"][0]["componentType"] = json!(1)), &["accessor 0", "componentType"]);
    refuses(&change(&|j| j["accessors"][3]["componentType"] = json!(5122)), &["accessor 3"]);
    refuses(&change(&|j| j["meshes"][0]["primitives"][0]["mode"] = json!(9)), &["mesh 0", "mode"]);
    refuses(&change(&|j| j["accessors"] = json!({})), &["accessors"]);
    // Zeros without data: a count is only a claim.
    let zeros = |n: u64| {
        change(&move |j| {
            j["accessors"][0] = json!({ "type": "VEC3", "componentType": 5126, "count": n });
            j["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": 0 } });
        })
    };
    refuses(&zeros(4_000_000_000), &["accessor 0", "without data"]);
    assert!(attempt(&zeros(3)).is_ok());
}

#[test]
fn indices_of_parts_are_checked() {
    let set = |path: &str, n: u64| {
        let mut b = Builder::textured();
        b.json["textures"][0]["sampler"] = json!(b.push("samplers", json!({})));
        b.json["nodes"][0]["camera"] = json!(0);
        b.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }]);
        b.light(json!({ "type": "point" }), json!({}));
        assert!(attempt(&b).is_ok());
        *b.json.pointer_mut(path).unwrap() = json!(n);
        err(&b)
    };
    for path in [
        "/scene",
        "/scenes/0/nodes/0",
        "/nodes/0/mesh",
        "/nodes/0/camera",
        "/nodes/1/extensions/KHR_lights_punctual/light",
        "/meshes/0/primitives/0/attributes/POSITION",
        "/meshes/0/primitives/0/attributes/TEXCOORD_0",
        "/meshes/0/primitives/0/indices",
        "/meshes/0/primitives/0/material",
        "/accessors/0/bufferView",
        "/bufferViews/0/buffer",
        "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
        "/textures/0/source",
        "/textures/0/sampler",
        "/images/0/bufferView",
    ] {
        let text = set(path, 77);
        assert!(text.contains("77"), "{path}: {text}");
    }
}

#[test]
fn nothing_to_light() {
    let mut b = Builder::default();
    refuses(&b, &["no triangle"]);
    let mesh = b.mesh(json!({}), json!({}));
    b.root(json!({ "mesh": mesh }));
    refuses(&b, &["no triangle", "no positions"]);
    let mut b = Builder::square();
    let empty = b.push("meshes", json!({ "primitives": [] }));
    b.root(json!({ "mesh": empty }));
    let input = ok(&b);
    assert_eq!(input.scene.instances.len(), 1);
    says(&input.warnings, "has no triangles");
}

#[test]
fn an_empty_primitive_is_named_once() {
    let mut b = Builder::square();
    let indices = b.accessor(json!({ "type": "SCALAR", "componentType": 5121, "count": 0 }), &[]);
    let part = json!({ "attributes": { "POSITION": 0 }, "indices": indices });
    let empty = b.push("meshes", json!({ "primitives": [part] }));
    b.root(json!({ "mesh": empty }));
    let said: Vec<String> = ok(&b).warnings.into_iter().filter(|w| w.contains("mesh 1")).collect();
    assert_eq!(said, ["mesh 1, primitive 0: has no triangles and is left out"]);
}

/// A small file in which `counts[m]` primitives of mesh m share 2^20 triangles.
fn many_triangles(counts: &[usize]) -> Builder {
    let mut b = Builder::triangle();
    let indices = json!({ "type": "SCALAR", "componentType": 5121, "count": 3 << 20 });
    let indices = b.accessor(indices, &[0, 1, 2].repeat(1 << 20));
    let part = json!({ "attributes": { "POSITION": 0 }, "indices": indices });
    b.json["meshes"] = counts.iter().map(|n| json!({ "primitives": vec![part.clone(); *n] })).collect();
    b.json["nodes"] = (0..counts.len()).map(|mesh| json!({ "mesh": mesh })).collect();
    b.json["scenes"][0]["nodes"] = (0..counts.len()).collect();
    b
}

#[test]
fn shared_accessors_do_not_ask_for_any_number_of_triangles() {
    refuses(&many_triangles(&[65]), &["mesh 0, primitive 64", "more than 67108864 triangles", "--exclude"]);
    refuses(&many_triangles(&[1, 64]), &["mesh 1, primitive 63", "more than 67108864 triangles", "--exclude"]);
}
