//! The door out: what is bound, what survives, and that nothing grows.

mod again;
mod files;
mod flat;
mod sets;
mod vertices;

#[path = "../common/write_fixtures.rs"]
mod fixtures;

use fixtures::{Builder, Plan, atlas, bake, keep, lightmaps, load, numbers, scene};
use glam::{UVec2, Vec3};
use luxel::{
    gltf::{Document, WriteOptions, write, write_flat},
    pixels::exr,
    report::Report,
    scene::Bake,
};
use serde_json::{Value, json};

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
