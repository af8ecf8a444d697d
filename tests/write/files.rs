//! The files that appear, what goes along, and what is refused.

use super::*;
use std::path::Path;

#[test]
fn a_gltf_has_its_files_beside_it() {
    let from = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let mut square = b.square(1);
    b.push("images", json!({ "uri": "maps/a%20b.png" }));
    b.push("textures", json!({ "source": 0 }));
    b.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    square["material"] = 0.into();
    b.shown(json!([square]));
    b.json["buffers"][0]["uri"] = "scene.bin".into();
    std::fs::create_dir(from.path().join("maps")).unwrap();
    let png = luxel::pixels::encode_png(UVec2::ONE, &[[255; 3]]).unwrap();
    std::fs::write(from.path().join("maps/a b.png"), &png).unwrap();
    std::fs::write(from.path().join("scene.bin"), &b.buffer).unwrap();
    let source = b.document(&from.path().join("scene.gltf"));

    let to = tempfile::tempdir().unwrap();
    let (baked, _) = bake(&source, Plan::Triangles, &options(), &to.path().join("lit room.gltf"));
    let pages = &baked.json["extensions"]["LUXEL_lightmap"]["pages"];
    assert_eq!(pages[1]["uri"], "lit%20room.page1.exr");
    assert!(exr::decode(&std::fs::read(to.path().join("lit room.page1.exr")).unwrap()).is_ok());
    assert_eq!(baked.json["buffers"][0]["uri"], "lit%20room.bin");
    assert_eq!(std::fs::read(to.path().join("maps/a b.png")).unwrap(), png);

    // Beside the input no input file is overwritten, not even by a name that would fit.
    let (beside, _) = bake(&source, Plan::Whole, &options(), &from.path().join("scene.glb"));
    assert_eq!(beside.json["images"][0]["mimeType"], "image/png");
    assert!(beside.json["images"][0]["uri"].is_null());
    let kept = std::fs::read(from.path().join("scene.bin")).unwrap();
    assert_eq!(kept, source.buffers[0]);
    let mut other = source.clone();
    other.path = from.path().join("other.gltf");
    let (beside, _) = bake(&other, Plan::Whole, &options(), &from.path().join("scene.gltf"));
    assert_eq!(beside.json["buffers"][0]["uri"], "scene.1.bin");
    assert_eq!(std::fs::read(from.path().join("scene.bin")).unwrap(), kept);
}

#[cfg(unix)]
#[test]
fn only_ordinary_files_go_along() {
    let from = tempfile::tempdir().unwrap();
    let inside = from.path().join("in");
    std::fs::create_dir(&inside).unwrap();
    std::fs::write(from.path().join("secret.txt"), "secret").unwrap();
    std::fs::write(inside.join("a:b.txt"), "plain").unwrap();
    let mut b = rich();
    b.json["images"] = json!([{ "uri": "/dev/zero" }, { "uri": "../secret.txt" }]);
    b.json["extensions"] = json!({ "VENDOR_sound": [{ "uri": "../secret.txt" }, { "uri": "a:b.txt" }] });
    let source = b.document(&inside.join("in.glb"));
    for name in ["out.glb", "out.gltf"] {
        let to = tempfile::tempdir().unwrap();
        let (baked, said) = bake(&source, Plan::Whole, &options(), &to.path().join(name));
        assert_eq!(said.len(), 3, "{said:?}");
        let count = |part: &str| said.iter().filter(|s| s.contains(part)).count();
        let counts = (count("/dev/zero: is not an ordinary file"), count("secret.txt: lies outside"));
        assert_eq!(counts, (1, 2), "{said:?}");
        assert_eq!(baked.json["images"][0]["uri"], "/dev/zero");
        assert_eq!(baked.json["extensions"]["VENDOR_sound"][1]["uri"], "a%3Ab.txt");
        assert!(to.path().join("a:b.txt").is_file() && !to.path().join("secret.txt").exists());
    }
}

/// The files of a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_output_may_be_the_input_and_sidecars_lie_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.lit.gltf");
    let mut source = rich().document(&path);
    source.json["buffers"][0]["uri"] = "room.lit.bin".into();
    std::fs::write(&path, serde_json::to_vec(&source.json).unwrap()).unwrap();
    std::fs::write(folder.path().join("room.lit.bin"), &source.buffers[0]).unwrap();
    let options = WriteOptions { sidecar: true, ..options() };
    let (baked, _) = bake(&source, Plan::Triangles, &options, &path);
    let (_, _) = bake(&baked, Plan::Triangles, &options, &path);
    let gltf = ["bin", "gltf", "lightmap.json", "page0.exr", "page1.exr"].map(|e| format!("room.lit.{e}"));
    assert_eq!(names(folder.path()), gltf);

    let folder = tempfile::tempdir().unwrap();
    bake(&source, Plan::Whole, &options, &folder.path().join("x.glb"));
    assert_eq!(names(folder.path()), ["x.glb", "x.lightmap.json", "x.page0.exr", "x.page1.exr"]);
    let text = std::fs::read(folder.path().join("x.lightmap.json")).unwrap();
    let sidecar: Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(sidecar["pages"][0]["uri"], "x.page0.exr");
    assert_eq!(sidecar["nodes"][0]["offset"], json!([0.25, 0.5]));
    assert_eq!(sidecar["nodes"][0]["node"], 0);
}

#[test]
fn broken_accessors_are_errors_and_leave_nothing() {
    for (pointer, value) in [
        ("/accessors/0/count", json!(5)),
        ("/bufferViews/1/byteLength", json!(1u64 << 40)),
        ("/bufferViews/1/byteOffset", json!(u64::MAX)),
        ("/accessors/1/componentType", json!(1)),
        ("/accessors/1/bufferView", json!(99)),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let source = rich().document(&folder.path().join("in.glb"));
        let scene = scene(&source);
        let atlas = atlas(&scene, Plan::Triangles);
        let mut broken = source.clone();
        *broken.json.pointer_mut(pointer).unwrap_or(&mut Value::Null) = value.clone();
        let out = folder.path().join("out.gltf");
        let maps = lightmaps(&atlas, 1.0);
        let options = WriteOptions { sidecar: true, ..options() };
        let result = write(&broken, &scene, &atlas, &maps, &Report::default(), &options, &out);
        assert_eq!(result.unwrap_err().exit_code(), 3, "{pointer}");
        assert!(names(folder.path()).is_empty());
    }
}

#[test]
fn a_place_that_cannot_be_written_is_the_machines_error() {
    let folder = tempfile::tempdir().unwrap();
    let source = rich().document(&folder.path().join("in.glb"));
    let scene = scene(&source);
    let atlas = atlas(&scene, Plan::Whole);
    let maps = lightmaps(&atlas, 1.0);
    std::fs::create_dir(folder.path().join("folder.gltf")).unwrap();
    for out in ["missing/out.glb", "missing/out.gltf", "folder.gltf"] {
        let out = folder.path().join(out);
        let options = WriteOptions { sidecar: true, ..options() };
        let result = write(&source, &scene, &atlas, &maps, &Report::default(), &options, &out);
        assert_eq!(result.unwrap_err().exit_code(), 1);
        assert_eq!(names(folder.path()), ["folder.gltf"]);
    }
}

#[test]
fn a_glb_gathers_all_buffers_and_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    b.texture();
    b.push("buffers", json!({ "byteLength": 21, "name": "more", "uri": "more.bin" }));
    let view = b.push("bufferViews", json!({ "buffer": 1, "byteOffset": 9, "byteLength": 12 }));
    b.json["extensions"]["ACME_blob"]["bufferView"] = view.into();
    b.json["extensionsUsed"].as_array_mut().unwrap().push("ACME_range".into());
    b.json["extensions"]["ACME_range"] = json!({ "buffer": 1, "byteOffset": 11, "byteLength": 10 });
    let mut source = b.document(&folder.path().join("in.gltf"));
    source.buffers.push(b"unused...secret bytes".to_vec());
    for plan in [Plan::Whole, Plan::Triangles] {
        let (baked, _) = bake(&source, plan, &options(), &folder.path().join("out.glb"));
        assert_eq!(baked.json["buffers"], json!([{ "byteLength": baked.json["buffers"][0]["byteLength"] }]));
        assert_eq!(secret(&baked), b"secret bytes");
        let range = &baked.json["extensions"]["ACME_range"];
        assert_eq!(range["buffer"], 0);
        assert!(baked.buffers[0][range["byteOffset"].as_u64().unwrap() as usize..].starts_with(b"cret bytes"));
        assert_eq!(baked.json["images"][0]["mimeType"], "image/png");

        let (apart, _) = bake(&source, plan, &options(), &folder.path().join("out.gltf"));
        assert_eq!(apart.json["buffers"][1]["name"], "more");
        assert_eq!(apart.json["buffers"][1]["uri"], "out.buffer1.bin");
        assert!(apart.buffers[1].ends_with(b"secret bytes"));
        assert_eq!(apart.json["images"], source.json["images"]);
    }
}

#[test]
fn a_buffer_that_stands_in_for_compressed_data_stays_apart() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    let packed = b.view(b"packed", json!({}));
    let packed = b.json["bufferViews"].as_array_mut().unwrap().remove(packed);
    b.push("buffers", json!({ "byteLength": 4, "uri": "more.bin" }));
    let fallback = json!({ "byteLength": 64, "extensions": { "EXT_meshopt_compression": { "fallback": true } } });
    b.push("buffers", fallback.clone());
    let mut compressed = packed.clone();
    let more = json!({ "mode": "ATTRIBUTES", "count": 4, "byteStride": 4 });
    compressed.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    let view = json!({
        "buffer": 2, "byteOffset": 16, "byteLength": 16, "extensions": { "EXT_meshopt_compression": compressed },
    });
    let view = b.push("bufferViews", view);
    let mut source = b.document(&folder.path().join("in.gltf"));
    source.buffers.extend([b"more".to_vec(), Vec::new()]);
    for (name, buffer) in [("out.glb", 1), ("out.gltf", 2)] {
        let scene = scene(&source);
        let atlas = atlas(&scene, Plan::Triangles);
        let maps = lightmaps(&atlas, 1.0);
        let out = folder.path().join(name);
        write(&source, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
        let json = if name == "out.glb" {
            load(&out).json
        } else {
            serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap()
        };
        assert_eq!(json["buffers"].as_array().unwrap().len(), buffer + 1);
        assert_eq!(json["buffers"][buffer], fallback);
        let view = &json["bufferViews"][view];
        assert_eq!((&view["buffer"], &view["byteOffset"]), (&json!(buffer), &json!(16)));
        let packed = &view["extensions"]["EXT_meshopt_compression"];
        assert_eq!(packed["buffer"], 0);
        let bytes = if name == "out.glb" {
            load(&out).buffers[0].clone()
        } else {
            std::fs::read(folder.path().join("out.bin")).unwrap()
        };
        assert!(bytes[packed["byteOffset"].as_u64().unwrap() as usize..].starts_with(b"packed"));
    }
}
