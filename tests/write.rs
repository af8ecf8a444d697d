//! The door out: what is bound, what survives, and that nothing grows.

#[path = "common/write_fixtures.rs"]
mod fixtures;

use fixtures::{Builder, Plan, atlas, bake, keep, lightmaps, load, numbers, scene};
use glam::{UVec2, Vec2, Vec3};
use luxel::gltf::{Document, WriteOptions, write, write_flat};
use luxel::pixels::exr;
use luxel::report::Report;
use luxel::scene::{Bake, Material, Texture, TextureRef, Wrap};
use serde_json::{Value, json};
use std::path::Path;

fn options() -> WriteOptions {
    WriteOptions::default()
}

fn attributes(document: &Document, mesh: usize) -> &Value {
    &document.json["meshes"][mesh]["primitives"][0]["attributes"]
}

/// A file with a little of everything that luxel does not look at.
fn rich() -> Builder {
    let mut b = Builder::new();
    let mut square = b.square(1);
    square["extras"] = json!({ "indices": 0, "bufferView": 0 });
    square["targets"] = json!([{ "POSITION": square["attributes"]["NORMAL"] }]);
    b.shown(json!([square]));
    b.json["meshes"][0]["weights"] = json!([0.5]);
    b.json["meshes"][0]["name"] = "Wand ä".into();
    b.json["nodes"][0]["extras"] = json!({ "luxel": { "static": true }, "buffer": 7 });
    b.json["nodes"][0]["extensions"] = json!({ "ACME_tag": { "tag": [1, 2.5, "x"] } });
    let camera = json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.01 } });
    b.push("cameras", camera);
    b.push("nodes", json!({ "camera": 0, "name": "Eye", "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    b.json["scenes"][0]["nodes"] = json!([0, 1]);
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let values = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
    for view in [times, values] {
        b.json["bufferViews"][view].as_object_mut().unwrap().remove("target");
    }
    b.push(
        "animations",
        json!({
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }],
            "samplers": [{ "input": times, "output": values }],
        }),
    );
    let secret = b.view(b"secret bytes", json!({}));
    b.json["extensions"] = json!({
        "ACME_blob": { "bufferView": secret, "odd": 1.23456789012345 },
        "KHR_lights_punctual": { "lights": [{ "type": "point" }] },
    });
    b.json["extensionsUsed"] = json!(["ACME_tag", "ACME_blob", "KHR_lights_punctual"]);
    b.json["extras"] = json!({ "author": "someone" });
    b
}

/// The bytes of the view that the unknown extension names.
fn secret(document: &Document) -> &[u8] {
    let view = &document.json["bufferViews"]
        [document.json["extensions"]["ACME_blob"]["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    &document.buffers[0][start..start + view["byteLength"].as_u64().unwrap() as usize]
}

#[test]
fn everything_else_survives() {
    for plan in [Plan::Whole, Plan::Triangles] {
        let folder = tempfile::tempdir().unwrap();
        let source = rich().document(&folder.path().join("in.glb"));
        let (baked, notes) = bake(&source, plan, &options(), &folder.path().join("out.glb"));
        assert!(notes.is_empty(), "{notes:?}");
        let (old, new) = (&source.json, &baked.json);
        for key in ["asset", "cameras", "scenes", "scene"] {
            assert_eq!(old[key], new[key], "{key}");
        }
        assert_eq!(new["meshes"][0]["name"], "Wand ä");
        assert_eq!(new["meshes"][0]["weights"], json!([0.5]));
        assert_eq!(new["meshes"][0]["primitives"][0]["extras"], old["meshes"][0]["primitives"][0]["extras"]);
        assert_eq!(new["nodes"][1], old["nodes"][1]);
        assert_eq!(new["nodes"][0]["extensions"]["ACME_tag"], json!({ "tag": [1, 2.5, "x"] }));
        assert_eq!(new["nodes"][0]["extras"]["luxel"]["static"], true);
        assert_eq!(new["nodes"][0]["extras"]["buffer"], 7);
        assert_eq!(new["extensions"]["ACME_blob"]["odd"], 1.23456789012345);
        assert_eq!(new["extras"]["author"], "someone");
        assert_eq!(secret(&baked), b"secret bytes");
        let sampler = &new["animations"][0]["samplers"][0];
        assert_eq!(numbers(&baked, &sampler["output"]), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
    }
}

#[test]
fn pages_and_nodes_are_bound_and_mirrored() {
    let folder = tempfile::tempdir().unwrap();
    let source = rich().document(&folder.path().join("in.glb"));
    let (baked, _) = bake(&source, Plan::Whole, &options(), &folder.path().join("out.glb"));
    let root = &baked.json["extensions"]["LUXEL_lightmap"];
    assert_eq!(root["bakedLights"], json!([1]));
    assert_eq!(root["pages"].as_array().unwrap().len(), 2);
    assert!(root["generator"].as_str().unwrap().starts_with("luxel "));
    let page = &root["pages"][0];
    for (key, value) in [
        ("mimeType", json!("image/x-exr")),
        ("width", json!(8)),
        ("height", json!(4)),
        ("encoding", json!("irradiance")),
        ("content", json!("full")),
        ("scale", json!(1.0)),
    ] {
        assert_eq!(page[key], value, "{key}");
    }
    let (size, texels) = exr::decode(page_bytes(&baked, 0)).unwrap();
    assert_eq!((size, texels), (UVec2::new(8, 4), vec![Vec3::ONE; 32]));
    let node = json!({ "page": 0, "texCoord": 1, "offset": [0.25, 0.5], "scale": [0.25, 0.25] });
    assert_eq!(baked.json["nodes"][0]["extensions"]["LUXEL_lightmap"], node);
    assert_eq!(baked.json["nodes"][0]["extras"]["luxel"]["lightmap"], node);
    assert_eq!(&baked.json["extras"]["luxel"]["lightmap"], root);
    assert!(baked.json["extensionsUsed"].as_array().unwrap().contains(&"LUXEL_lightmap".into()));
    assert!(baked.json["extensionsRequired"].is_null() && baked.json["images"].is_null());
    let uv = numbers(&baked, &attributes(&baked, 0)["TEXCOORD_1"]);
    assert_eq!(uv, [0.0, 1.0, 0.25, 0.75, 0.5, 0.5, 0.75, 0.25]);
}

fn page_bytes(document: &Document, page: usize) -> &[u8] {
    let page = &document.json["extensions"]["LUXEL_lightmap"]["pages"][page];
    let view = &document.json["bufferViews"][page["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    &document.buffers[0][start..start + view["byteLength"].as_u64().unwrap() as usize]
}

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

#[test]
fn a_set_that_is_read_moves_and_its_textures_are_repointed() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let texture = b.texture();
    let material = |set: Value| json!({ "name": "Marble", "pbrMetallicRoughness": { "baseColorTexture": set } });
    let plain = b.push("materials", material(json!({ "index": texture, "texCoord": 1 })));
    let transformed = json!({ "index": texture, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } });
    let transformed = b.push("materials", material(transformed));
    for (sets, material) in [(2, plain), (3, plain), (2, transformed), (2, usize::MAX)] {
        let mut square = b.square(sets);
        if material != usize::MAX {
            square["material"] = material.into();
        }
        b.shown(json!([square]));
    }
    // A mesh that is not laid out keeps the material as it was.
    let mut square = b.square(2);
    square["material"] = plain.into();
    b.push("meshes", json!({ "primitives": [square] }));
    b.json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    let source = b.document(&folder.path().join("in.glb"));
    for plan in [Plan::Whole, Plan::Triangles] {
        let out = folder.path().join("out.glb");
        let scene = scene(&source);
        let mut atlas = atlas(&scene, plan);
        atlas.layouts[4] = Default::default();
        let maps = lightmaps(&atlas, 1.0);
        let notes = write(&source, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
        keep(&out);
        let baked = load(&out);
        assert_eq!(notes.notes.len(), 3, "{notes:?}");
        let set = |mesh: usize| {
            let m = baked.json["meshes"][mesh]["primitives"][0]["material"].as_u64().unwrap() as usize;
            let info = &baked.json["materials"][m]["pbrMetallicRoughness"]["baseColorTexture"];
            let moved = info["extensions"]["KHR_texture_transform"]["texCoord"].as_u64();
            (m, moved.or(info["texCoord"].as_u64()).unwrap())
        };
        assert_eq!([set(0), set(1), set(2), set(4)], [(2, 2), (3, 3), (1, 2), (0, 1)]);
        let names = |mesh: usize| attributes(&baked, mesh).as_object().unwrap().len();
        assert_eq!([names(0), names(1), names(2), names(3)], [5, 6, 5, 4]);
        for (mesh, to) in [(0, 2), (1, 3)] {
            let old = numbers(&source, &attributes(&source, mesh)["TEXCOORD_1"]);
            let new = numbers(&baked, &attributes(&baked, mesh)[format!("TEXCOORD_{to}")]);
            assert_eq!(old[..6], new[..6]);
        }
    }
}

#[test]
fn a_missing_first_set_is_made_and_a_rebake_makes_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let square = b.square(0);
    b.shown(json!([square]));
    let source = b.document(&folder.path().join("in.glb"));
    let out = folder.path().join("out.glb");
    let (baked, _) = bake(&source, Plan::Whole, &options(), &out);
    assert_eq!(attributes(&baked, 0)["TEXCOORD_0"], attributes(&baked, 0)["TEXCOORD_1"]);
    let (again, _) = bake(&baked, Plan::Triangles, &options(), &out);
    assert_eq!(attributes(&again, 0)["TEXCOORD_0"], attributes(&again, 0)["TEXCOORD_1"]);
    assert_eq!(numbers(&again, &attributes(&again, 0)["TEXCOORD_0"]).len(), 12);
}

#[test]
fn baking_again_replaces_and_does_not_grow() {
    for plan in [Plan::Whole, Plan::Triangles] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out.glb");
        let mut document = rich().document(&folder.path().join("in.glb"));
        let mut files = Vec::new();
        for _ in 0..4 {
            document = bake(&document, plan, &options(), &out).0;
            files.push(std::fs::read(&out).unwrap());
            assert_eq!(secret(&document), b"secret bytes");
        }
        assert!(
            files.iter().all(|f| f.len() == files[0].len()),
            "{:?}",
            files.iter().map(Vec::len).collect::<Vec<_>>()
        );
        assert_eq!(files[2], files[3]);
        // Fewer pages: the rest of the old ones goes.
        let scene = scene(&document);
        let mut atlas = atlas(&scene, plan);
        atlas.pages.truncate(1);
        let maps = lightmaps(&atlas, 1.0);
        write(&document, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
        assert!(std::fs::metadata(&out).unwrap().len() < files[0].len() as u64);
        let document = load(&out);
        assert_eq!(document.json["extensions"]["LUXEL_lightmap"]["pages"].as_array().unwrap().len(), 1);
    }
}

#[test]
fn kept_coordinates_leave_meshes_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let square = b.square(2);
    b.shown(json!([square]));
    let source = b.document(&folder.path().join("in.glb"));
    let scene = scene(&source);
    let mut atlas = atlas(&scene, Plan::Whole);
    atlas.kept = true;
    let out = folder.path().join("out.glb");
    let maps = lightmaps(&atlas, 1.0);
    write(&source, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
    keep(&out);
    let baked = load(&out);
    assert_eq!(baked.json["meshes"], source.json["meshes"]);
    assert_eq!(baked.json["accessors"], source.json["accessors"]);
    assert!(baked.json["nodes"][0]["extensions"]["LUXEL_lightmap"].is_object());
}

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
fn bright_pages_have_a_scale_unless_they_are_floats() {
    let folder = tempfile::tempdir().unwrap();
    let source = rich().document(&folder.path().join("in.glb"));
    let scene = scene(&source);
    let atlas = atlas(&scene, Plan::Whole);
    for (float, scale) in [(false, 16.0), (true, 1.0)] {
        let out = folder.path().join("out.glb");
        let options = WriteOptions { float, ..options() };
        let maps = lightmaps(&atlas, 1e6);
        write(&source, &scene, &atlas, &maps, &Report::default(), &options, &out).unwrap();
        let baked = load(&out);
        assert_eq!(baked.json["extensions"]["LUXEL_lightmap"]["pages"][0]["scale"], scale);
        let (_, texels) = exr::decode(page_bytes(&baked, 0)).unwrap();
        let error = (texels[0] * scale as f32 - Vec3::splat(1e6)).abs().max_element();
        assert!(error <= if float { 0.0 } else { 1e6 / 2048.0 }, "{error}");
    }
}

#[test]
fn baked_lights_can_be_taken_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    b.push("nodes", json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    b.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let source = b.document(&folder.path().join("in.glb"));
    let strip = |bakes: [Bake; 2], name: &str| {
        let mut scene = scene(&source);
        scene.lights.iter_mut().zip(bakes).for_each(|(light, bake)| light.bake = bake);
        let (atlas, out) = (atlas(&scene, Plan::Whole), folder.path().join(name));
        let (maps, options) = (lightmaps(&atlas, 1.0), WriteOptions { strip_lights: true, ..options() });
        write(&source, &scene, &atlas, &maps, &Report::default(), &options, &out).unwrap();
        keep(&out);
        load(&out)
    };
    let some = strip([Bake::Indirect, Bake::Full], "some.glb");
    assert_eq!(some.json["extensions"]["LUXEL_lightmap"]["bakedLights"], json!([2]));
    assert!(some.json["extensions"]["KHR_lights_punctual"].is_object());
    assert!(some.json["nodes"][2]["extensions"].is_null());
    assert!(some.json["nodes"][1]["extensions"]["KHR_lights_punctual"].is_object());
    let none = strip([Bake::Full; 2], "none.glb");
    assert!(!none.json.to_string().contains("KHR_lights_punctual"));
}

#[test]
fn extras_that_are_no_object_stay_and_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    b.json["nodes"][0]["extras"] = "a note".into();
    let source = b.document(&folder.path().join("in.glb"));
    let (baked, notes) = bake(&source, Plan::Whole, &options(), &folder.path().join("out.glb"));
    assert_eq!(baked.json["nodes"][0]["extras"], "a note");
    assert!(baked.json["nodes"][0]["extensions"]["LUXEL_lightmap"].is_object());
    assert_eq!(notes.len(), 1, "{notes:?}");
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
fn the_flat_file_shows_radiance_on_page_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    b.json["nodes"][0]["translation"] = json!([1.0, 2.0, 3.0]);
    b.push("nodes", json!({ "mesh": 0, "name": "again" }));
    let source = b.document(&folder.path().join("in.glb"));
    let mut scene = scene(&source);
    // A sheared one: its positions have to be its own.
    scene.instances[1].transform.matrix3.y_axis.x = 0.5;
    let atlas = atlas(&scene, Plan::Triangles);
    let pages = vec![(UVec2::new(8, 4), vec![Vec3::new(0.25, 1.0, 4.0); 32]); 2];
    let out = folder.path().join("flat.glb");
    let notes = write_flat(&source, &scene, &atlas, &pages, 1.0, &out).unwrap();
    keep(&out);
    assert_eq!(notes.len(), 1);
    let flat = load(&out);
    assert_eq!(flat.json["nodes"][1]["name"], "again");
    assert_eq!(flat.json["nodes"][0]["matrix"][13], 2.0);
    assert!(flat.json["nodes"][1]["matrix"].is_null());
    let uv = numbers(&flat, &attributes(&flat, 0)["TEXCOORD_0"]);
    assert_eq!(uv[..2], [0.25, 0.75]);
    assert_eq!(flat.json["meshes"][1]["primitives"][0]["material"], 2);
    let sheared = numbers(&flat, &attributes(&flat, 1)["POSITION"]);
    assert_eq!(sheared[6..9], [1.5, 1.0, 0.0]);
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

#[test]
fn slots_that_others_follow_stay_and_are_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glb");
    let (mut document, _) = bake(&rich().document(&folder.path().join("in.glb")), Plan::Whole, &options(), &out);
    // Another tool adds a view of its own behind the pages.
    let views = document.json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteLength": 4 }));
    let count = views.len();
    document.json["extensions"]["ACME_blob"]["bufferView"] = (count - 1).into();
    let scene = scene(&document);
    let mut few = atlas(&scene, Plan::Whole);
    few.pages.truncate(1);
    write(&document, &scene, &few, &lightmaps(&few, 1.0), &Report::default(), &options(), &out).unwrap();
    keep(&out);
    let views = |d: &Document| d.json["bufferViews"].as_array().unwrap().clone();
    let less = load(&out);
    assert_eq!(views(&less).len(), count);
    assert_eq!(views(&less).iter().filter(|v| v["name"] == "luxel: unused").count(), 1);
    let (more, _) = bake(&less, Plan::Whole, &options(), &out);
    assert_eq!(views(&more).len(), count);
    assert!(views(&more).iter().all(|v| v["name"].is_null()));
}

/// Real files, with every layout, twice.
#[test]
fn real_scenes() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "glb") {
            continue;
        }
        let source = load(&path);
        let stem = path.file_stem().unwrap().to_str().unwrap();
        for (plan, label) in [(Plan::Whole, "whole"), (Plan::Triangles, "split")] {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path().join(format!("{stem}.{label}.glb"));
            let (first, notes) = bake(&source, plan, &options(), &out);
            let size = || std::fs::metadata(&out).unwrap().len();
            let mut sizes = vec![size()];
            let (second, _) = bake(&first, plan, &options(), &out);
            sizes.push(size());
            bake(&second, plan, &options(), &out);
            sizes.push(size());
            println!("{stem} {label}: {sizes:?}; {notes:?}");
            // The second bake may order the bytes anew, which changes the digits of offsets.
            assert!(sizes[1] <= sizes[0] + sizes[0] / 1000 && sizes[1] == sizes[2], "{stem} {label}");
            let scene = scene(&source);
            let atlas = atlas(&scene, plan);
            let pages = vec![(UVec2::new(8, 4), vec![Vec3::ONE; 32]); 2];
            write_flat(&source, &scene, &atlas, &pages, 1.0, &folder.path().join(format!("{stem}.{label}.flat.glb")))
                .unwrap();
            let gltf = folder.path().join(format!("{stem}.{label}.gltf"));
            bake(&source, plan, &options(), &gltf);
        }
    }
}

/// Every mesh has a material of its own, which reads the set that moves.
#[test]
fn many_materials_are_repointed() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let texture = b.texture();
    let square = b.square(2);
    for _ in 0..5000 {
        let slot = json!({ "index": texture, "texCoord": 1 });
        let mut own = square.clone();
        own["material"] = b.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": slot } })).into();
        b.shown(json!([own]));
    }
    let source = b.document(&folder.path().join("in.glb"));
    let (baked, notes) = bake(&source, Plan::Whole, &options(), &folder.path().join("out.glb"));
    assert_eq!(notes.len(), 5000);
    let materials = baked.json["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 5000, "none is shared, so none is copied");
    assert!(materials.iter().all(|m| m["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] == 2));
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

#[test]
fn the_flat_file_shows_unlit_surfaces_in_their_own_colour() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let (lit, unlit) = (b.square(1), b.square(1));
    b.shown(json!([lit, unlit]));
    b.shown(json!([unlit]));
    let source = b.document(&folder.path().join("in.glb"));
    let mut scene = scene(&source);
    let picture =
        Texture::new(UVec2::new(2, 1), vec![[255, 0, 0, 255], [0, 0, 255, 128]], true, [Wrap::Repeat; 2], true);
    scene.textures.push(picture);
    let base_texture = Some(TextureRef { texture: 0, set: 0, transform: glam::Affine2::from_scale(Vec2::splat(2.0)) });
    let base_color = glam::Vec4::new(1.0, 0.5, 0.25, 1.0);
    scene.materials.push(Material { base_color, base_texture, unlit: true, ..Material::default() });
    scene.meshes[0].primitives[1].material = 1;
    scene.meshes[1].primitives[0].material = 1;
    for mesh in &mut scene.meshes {
        mesh.uvs = vec![(0..mesh.positions.len()).map(|v| Vec2::splat(v as f32)).collect()];
    }
    let mut atlas = atlas(&scene, Plan::Whole);
    atlas.placements[1] = None;
    atlas.layouts[1] = Default::default();
    let pages = vec![(UVec2::new(8, 4), vec![Vec3::ONE; 32]); 2];
    let out = folder.path().join("flat.glb");
    write_flat(&source, &scene, &atlas, &pages, 1.0, &out).unwrap();
    keep(&out);
    let flat = load(&out);
    assert_eq!(flat.json["nodes"].as_array().unwrap().len(), 2);
    let drawn = [&flat.json["meshes"][0]["primitives"][1], &flat.json["meshes"][1]["primitives"][0]];
    assert_eq!(flat.json["meshes"][0]["primitives"][0]["material"], 0);
    for primitive in drawn {
        let material = &flat.json["materials"][primitive["material"].as_u64().unwrap() as usize];
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
        let pbr = &material["pbrMetallicRoughness"];
        assert_eq!(pbr["baseColorFactor"], json!([1.0, 0.5, 0.25, 1.0]));
        let texture = &flat.json["textures"][pbr["baseColorTexture"]["index"].as_u64().unwrap() as usize];
        let image = &flat.json["images"][texture["source"].as_u64().unwrap() as usize];
        let view = &flat.json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let bytes = &flat.buffers[0][start..start + view["byteLength"].as_u64().unwrap() as usize];
        assert_eq!(luxel::pixels::decode(bytes).unwrap().rgba[0], [255, 0, 0, 255]);
        // The texture's transform is in the coordinates.
        let uv = numbers(&flat, &primitive["attributes"]["TEXCOORD_0"]);
        assert_eq!(uv[2] - uv[0], 2.0);
        assert_eq!(numbers(&flat, &primitive["indices"]).len(), 6);
    }
    let materials = flat.json["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 2 * pages.len() + 1, "each material once");
}
