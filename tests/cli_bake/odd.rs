//! Scenes that are odd or broken, and what is said of them.

use super::*;

#[test]
fn triangles_without_area_are_left_out() {
    let folder = Folder::new();
    odd(&folder, |json| {
        let indices: Vec<u8> = [0u16, 1, 1, 0, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
        json["meshes"][0]["primitives"][0]["indices"] = accessor(json, &indices, 5123, 9, "SCALAR").into();
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK}"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("without area were left out: 1, the first in mesh 0"), "{}", said.err);
}

#[test]
fn a_scene_without_area_is_refused() {
    let folder = Folder::new();
    odd(&folder, |json| {
        let indices = accessor(json, &[0, 1, 1, 1, 2, 2], 5121, 6, "SCALAR");
        for mesh in json["meshes"].as_array_mut().unwrap() {
            mesh["primitives"].as_array_mut().unwrap().iter_mut().for_each(|p| p["indices"] = indices.into());
        }
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK}"));
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("mesh 0") && said.err.contains("no triangle has an area"), "{}", said.err);
    assert_eq!(folder.files(), ["odd.gltf", "room.gltf"]);
}

#[test]
fn absurdly_bright_light_stays_finite() {
    let folder = Folder::new();
    odd(&folder, |json| {
        json["materials"][1]["extensions"] = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 1e30 } });
        let light = json!({ "type": "point", "intensity": 1e35 });
        json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
        json["nodes"][2]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK} --report a.json --preview a.png --flat flat.glb"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("emits more than 1e20") && said.err.contains("brighter than 1e20"), "{}", said.err);
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
    assert!(report["energy"]["imbalance"].is_number() && report["solver"]["bound"].is_number(), "{report:#}");
}

#[test]
fn broken_scenes_are_code_3_and_their_part_is_named() {
    let folder = Folder::new();
    let refuses = |options: &str, parts: &[&str]| {
        let said = folder.luxel(&format!("bake odd.gltf {QUICK} {options}"));
        assert_eq!((said.code, said.out.as_str()), (3, ""), "{parts:?}: {}", said.err);
        assert!(parts.iter().all(|part| said.err.contains(part)), "{parts:?}: {}", said.err);
    };
    odd(&folder, |json| {
        let corners = floats(&[-2.0, 0.0, -2.0, -2.0, f32::NAN, 2.0, 2.0, 0.0, 2.0, 2.0, 0.0, -2.0]);
        json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = accessor(json, &corners, 5126, 4, "VEC3").into();
    });
    refuses("", &["mesh 0"]);
    odd(&folder, |json| {
        let folded = accessor(json, &floats(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.9, 0.1]), 5126, 4, "VEC2");
        let apart = accessor(json, &floats(&[0.0, 0.0, 0.0, 0.4, 0.4, 0.4, 0.4, 0.0]), 5126, 4, "VEC2");
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = folded.into();
        json["meshes"][1]["primitives"][0]["attributes"]["TEXCOORD_1"] = apart.into();
    });
    refuses("--keep-uv", &["mesh 0", "overlap"]);
    odd(&folder, |json| {
        json["nodes"][0]["children"] = json!([1]);
        json["nodes"][1]["children"] = json!([0]);
    });
    refuses("", &["node "]);
    odd(&folder, |json| json["buffers"][0]["uri"] = "gone.bin".into());
    refuses("", &["buffer 0", "gone.bin"]);
    odd(&folder, |json| json["buffers"][0]["uri"] = "../../secret.bin".into());
    refuses("", &["buffer 0: ../../secret.bin", "outside of the document's folder", "beside the document"]);
    odd(&folder, |json| json["nodes"][0]["scale"] = json!([1e30, 1e30, 1e30]));
    refuses("", &["node 0", "larger than 1e9 metres", "scale it down"]);
    assert_eq!(folder.files(), ["odd.gltf", "room.gltf"]);
}

#[test]
fn what_only_the_writer_reads_is_checked_before_tracing() {
    let folder = Folder::new();
    // A tetrahedron has vertices to split, and so tangents to copy.
    odd(&folder, |json| {
        let indices: Vec<u8> = [0u16, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2].iter().flat_map(|i| i.to_le_bytes()).collect();
        let corners = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let tangents = accessor(json, &floats(&[1.0, 0.0, 0.0, 1.0]), 5126, 4, "VEC4");
        let primitive = &mut json["meshes"][0]["primitives"][0].clone();
        primitive["indices"] = accessor(json, &indices, 5123, 12, "SCALAR").into();
        primitive["attributes"] = json!({ "POSITION": accessor(json, &corners, 5126, 4, "VEC3"), "TANGENT": tangents });
        json["meshes"][0]["primitives"][0] = primitive.take();
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK}"));
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("mesh 0, primitive 0, TANGENT, accessor 3"), "{}", said.err);
    assert!(!said.err.contains("texels on"), "nothing was begun: {}", said.err);
    assert_eq!(folder.files(), ["odd.gltf", "room.gltf"]);
}

#[test]
fn a_node_without_a_texel_is_named() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --texels-per-meter 1e-30 --rays 1");
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("node 0 \"Floor\" and 1 more: too small for a texel"), "{}", said.err);
}

#[test]
fn a_scene_that_is_all_unlit_is_told_so() {
    let folder = Folder::new();
    odd(&folder, |json| {
        for i in 0..2 {
            json["materials"][i]["extensions"] = json!({ "KHR_materials_unlit": {} });
        }
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK}"));
    assert!(said.err.contains("nothing is lit"), "{}", said.err);
}

#[test]
fn emitting_triangles_are_counted_whoever_carries_their_light() {
    let folder = Folder::new();
    // A scene that shines everywhere: rays bring the light, nothing of it is sampled.
    odd(&folder, |json| json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]));
    let said = folder.luxel(&format!("bake odd.gltf {QUICK} --report - --quiet"));
    let report: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(report["scene"]["emitting_triangles"], 4);
}

#[test]
fn the_preview_shows_unlit_surfaces_in_their_own_colour() {
    let folder = Folder::new();
    odd(&folder, |json| {
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 0, 0, 1]);
        json["materials"][0]["extensions"] = json!({ "KHR_materials_unlit": {} });
    });
    let said = folder.luxel(&format!("bake odd.gltf {QUICK} --preview a.png"));
    assert_eq!(said.code, 0, "{}", said.err);
    let picture = luxel::pixels::decode(&std::fs::read(folder.path("a.png")).unwrap()).unwrap();
    let red = picture.rgba.iter().filter(|c| **c == [255, 0, 0, 255]).count();
    assert!(red > 10_000, "{red} pixels");
}

#[test]
fn an_empty_uri_is_named() {
    let folder = Folder::new();
    odd(&folder, |json| json["images"] = json!([{ "uri": "" }]));
    let said = folder.luxel(&format!("bake odd.gltf -o a.glb {QUICK}"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("warning: /images/0: its uri is empty"), "{}", said.err);
}
