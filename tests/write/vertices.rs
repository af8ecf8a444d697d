//! Vertices that are split, and those that are not.

use super::*;

#[test]
fn vertices_that_are_not_split_keep_their_accessors() {
    let folder = tempfile::tempdir().unwrap();
    let source = rich().document(&folder.path().join("in.glb"));
    let (baked, _) = bake(&source, Plan::Whole, &options(), &folder.path().join("out.glb"));
    let (old, new) = (&source.json["meshes"][0]["primitives"][0], &baked.json["meshes"][0]["primitives"][0]);
    for name in ["POSITION", "NORMAL", "TEXCOORD_0"] {
        assert_eq!(old["attributes"][name], new["attributes"][name]);
    }
    assert_eq!(old["indices"], new["indices"]);
    assert_eq!(old["targets"], new["targets"]);
}

#[test]
fn split_vertices_take_all_attributes_along() {
    let folder = tempfile::tempdir().unwrap();
    let source = rich().document(&folder.path().join("in.glb"));
    let (baked, _) = bake(&source, Plan::Triangles, &options(), &folder.path().join("out.glb"));
    let primitive = &baked.json["meshes"][0]["primitives"][0];
    assert_eq!(numbers(&baked, &primitive["indices"]), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let corner = |name: &str| numbers(&source, &attributes(&source, 0)[name]);
    for (name, width) in [("POSITION", 3), ("NORMAL", 3), ("TEXCOORD_0", 2)] {
        let (old, new) = (corner(name), numbers(&baked, &primitive["attributes"][name]));
        let expected: Vec<f64> =
            [0, 1, 2, 0, 2, 3].iter().flat_map(|&v| old[v * width..(v + 1) * width].to_vec()).collect();
        assert_eq!(new, expected, "{name}");
    }
    assert_eq!(primitive["targets"][0]["POSITION"], primitive["attributes"]["NORMAL"]);
    let position = &baked.json["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize];
    assert_eq!((&position["min"], &position["max"]), (&json!([0.0, 0.0, 0.0]), &json!([1.0, 1.0, 0.0])));
    assert_eq!(
        source.json["accessors"].as_array().unwrap().len() + 1,
        baked.json["accessors"].as_array().unwrap().len()
    );
}

#[test]
fn strips_and_fans_become_lists_when_split() {
    for (mode, expected) in [(5, [0, 1, 3, 3, 1, 2]), (6, [1, 3, 0, 3, 2, 0])] {
        for plan in [Plan::Whole, Plan::Triangles] {
            let folder = tempfile::tempdir().unwrap();
            let mut b = Builder::new();
            let mut square = b.square(1);
            square["indices"] = b.indices(&[0, 1, 3, 2]).into();
            square["mode"] = mode.into();
            b.shown(json!([square]));
            let source = b.document(&folder.path().join("in.glb"));
            let (baked, _) = bake(&source, plan, &options(), &folder.path().join("out.glb"));
            let primitive = &baked.json["meshes"][0]["primitives"][0];
            if plan == Plan::Whole {
                assert_eq!(primitive["mode"], mode);
                continue;
            }
            assert!(primitive["mode"].is_null());
            let old = numbers(&source, &attributes(&source, 0)["POSITION"]);
            let new = numbers(&baked, &primitive["attributes"]["POSITION"]);
            let corners: Vec<f64> = expected.iter().flat_map(|&v: &usize| old[3 * v..3 * v + 3].to_vec()).collect();
            assert_eq!(new, corners);
        }
    }
}

#[test]
fn quantized_interleaved_and_sparse_attributes_survive_a_split() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    // Positions of 3 x i16, interleaved with 2 x u8 (padded): stride 12.
    let vertex =
        |x: i16, y: i16| [x.to_le_bytes(), y.to_le_bytes(), [7, 0], [0, 0], [x as u8, y as u8], [0, 0]].concat();
    let bytes = [vertex(0, 0), vertex(-100, 0), vertex(9, 99), vertex(0, 50)].concat();
    let view = b.view(&bytes, json!({ "target": 34962, "byteStride": 12 }));
    let position = b.push(
        "accessors",
        json!({ "bufferView": view, "componentType": 5122, "count": 4, "type": "VEC3", "min": [-100, 0, 7], "max": [9, 99, 7] }),
    );
    let uv = b.push(
        "accessors",
        json!({ "bufferView": view, "byteOffset": 8, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2" }),
    );
    // Colours: zero but for vertex 2.
    let at = b.view(&[2], json!({}));
    let color = [0.25f32, 0.5, 1.0].map(f32::to_le_bytes).concat();
    let value = b.view(&color, json!({}));
    let sparse = json!({ "count": 1, "indices": { "bufferView": at, "componentType": 5121 }, "values": { "bufferView": value } });
    let color = b.push("accessors", json!({ "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse }));
    let indices = b.indices(&[0, 1, 2, 0, 2, 3]);
    b.shown(json!([{
        "attributes": { "POSITION": position, "TEXCOORD_0": uv, "COLOR_0": color }, "indices": indices,
    }]));
    b.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    b.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let source = b.document(&folder.path().join("in.glb"));
    let (baked, _) = bake(&source, Plan::Triangles, &options(), &folder.path().join("out.glb"));
    let at = attributes(&baked, 0);
    let expected = [0, 0, 7, -100, 0, 7, 9, 99, 7, 0, 0, 7, 9, 99, 7, 0, 50, 7].map(f64::from);
    assert_eq!(numbers(&baked, &at["POSITION"]), expected);
    assert_eq!(numbers(&baked, &at["TEXCOORD_0"]), [0, 0, 156, 0, 9, 99, 0, 0, 9, 99, 0, 50].map(f64::from));
    let accessor = |name: &str| &baked.json["accessors"][at[name].as_u64().unwrap() as usize];
    assert_eq!(accessor("TEXCOORD_0")["normalized"], true);
    assert_eq!(accessor("POSITION")["min"], json!([-100, 0, 7]));
    assert!(accessor("COLOR_0")["sparse"].is_null());
    let mut color = vec![0.0; 18];
    color[6..9].copy_from_slice(&[0.25, 0.5, 1.0]);
    color[12..15].copy_from_slice(&[0.25, 0.5, 1.0]);
    assert_eq!(numbers(&baked, &at["COLOR_0"]), color);
}

/// A primitive whose data is there twice, plain and compressed by Draco.
#[test]
fn compressed_twins_of_changed_vertices_are_dropped() {
    const DRACO: &str = "KHR_draco_mesh_compression";
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    let twin = b.view(b"compressed twin", json!({}));
    let mut other = b.square(1);
    let draco = json!({ "bufferView": twin, "attributes": { "POSITION": 0, "NORMAL": 1 } });
    for primitive in [&mut b.json["meshes"][0]["primitives"][0], &mut other] {
        primitive["extensions"] = json!({ DRACO: draco, "ACME_odd": {} });
    }
    b.json["extensionsUsed"].as_array_mut().unwrap().push(DRACO.into());
    b.json["extensionsRequired"] = json!([DRACO]);
    for plan in [Plan::Whole, Plan::Triangles] {
        let source = Builder { json: b.json.clone(), buffer: b.buffer.clone() }.document(&folder.path().join("in.glb"));
        let (baked, notes) = bake(&source, plan, &options(), &folder.path().join("out.glb"));
        assert!(notes.iter().all(|n| !n.contains(DRACO)), "{notes:?}");
        assert_eq!(baked.json["meshes"][0]["primitives"][0]["extensions"], json!({ "ACME_odd": {} }));
        assert!(!baked.json.to_string().contains(DRACO));
        assert!(!baked.buffers[0].windows(15).any(|w| w == b"compressed twin"));
    }
    // A primitive that is not laid out keeps its twin.
    b.push("meshes", json!({ "primitives": [other] }));
    let source = b.document(&folder.path().join("in.glb"));
    let scene = scene(&source);
    let mut atlas = atlas(&scene, Plan::Whole);
    atlas.layouts[1] = Default::default();
    let (out, maps) = (folder.path().join("out.glb"), lightmaps(&atlas, 1.0));
    write(&source, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
    let baked = load(&out);
    assert!(baked.json["meshes"][0]["primitives"][0]["extensions"][DRACO].is_null());
    assert_eq!(baked.json["meshes"][1]["primitives"][0]["extensions"][DRACO]["bufferView"], twin);
    assert_eq!(baked.json["extensionsRequired"], json!([DRACO]));
}
