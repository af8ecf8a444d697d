//! Files that luxel bakes, loaded and spawned by a Bevy without window and GPU.
//!
//! `LUXEL` names the program; paths are from this folder.

use bevy::{
    asset::{AssetPlugin, LoadState},
    gltf::GltfPlugin,
    light::{PointLight, SpotLight},
    pbr::Lightmap,
    prelude::*,
    render::render_resource::TextureFormat,
    world_serialization::WorldSerializationPlugin,
};
use half::f16;
use luxel_bevy::{LightmapProblem, LuxelPlugin};
use serde_json::{Value, json};
use std::{
    f32::consts::PI,
    path::{Path, PathBuf},
    process::Command,
    time::{Duration, Instant},
};
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The furnished room, baked with these options.
fn baked(name: &str, options: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let program = std::env::var("LUXEL").expect("LUXEL=../../target/release/luxel cargo test");
    let scene = Path::new(ROOT).join("../../assets/room.glb");
    let mut command = Command::new(Path::new(ROOT).join(program));
    command.arg("bake").arg(scene).arg("-o").arg(folder.path().join(name));
    command.args("--resolution 64 --rays 4 --quiet".split(' ')).args(options.split_whitespace());
    let said = command.output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    folder
}

/// A Bevy in which the first scene of a file has been spawned.
fn shown(folder: &TempDir, name: &str) -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        AssetPlugin { file_path: folder.path().to_str().unwrap().into(), ..default() },
        WorldSerializationPlugin,
        GltfPlugin::default(),
        LuxelPlugin,
    ));
    app.init_asset::<Image>().init_asset::<Mesh>().init_asset::<StandardMaterial>();
    app.register_type::<Mesh3d>();
    app.finish();
    app.cleanup();
    let server = app.world().resource::<AssetServer>().clone();
    let scene = server.load(GltfAssetLabel::Scene(0).from_asset(name.to_owned()));
    app.world_mut().spawn(WorldAssetRoot(scene.clone()));
    let patience = Instant::now();
    while all::<Mesh3d>(&mut app).is_empty() {
        if let LoadState::Failed(error) = server.load_state(&scene) {
            panic!("{error}");
        }
        assert!(patience.elapsed() < Duration::from_secs(60), "the scene does not load");
        app.update();
    }
    app
}

/// All components of a kind that were spawned.
fn all<T: Component + Clone>(app: &mut App) -> Vec<T> {
    app.world_mut().query::<&T>().iter(app.world()).cloned().collect()
}

/// Whether each lamp shines.
fn shining(app: &mut App) -> Vec<bool> {
    let mut lamps = app.world_mut().query_filtered::<&Visibility, Or<(With<PointLight>, With<SpotLight>)>>();
    lamps.iter(app.world()).map(|visibility| *visibility != Visibility::Hidden).collect()
}

/// The document of a .gltf.
fn document(folder: &TempDir) -> (PathBuf, Value) {
    let file = folder.path().join("room.gltf");
    let json = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    (file, json)
}

fn texels(image: &Image) -> Vec<f32> {
    let bytes = image.data.as_ref().unwrap();
    match image.texture_descriptor.format {
        TextureFormat::Rgba16Float => {
            bytes.chunks_exact(2).map(|x| f16::from_le_bytes([x[0], x[1]]).to_f32()).collect()
        }
        TextureFormat::Rgba32Float => {
            bytes.chunks_exact(4).map(|x| f32::from_le_bytes([x[0], x[1], x[2], x[3]])).collect()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn lit_nodes_get_their_part_of_a_page() {
    let folder = baked("room.gltf", "--sidecar");
    let (_, json) = document(&folder);
    let mut app = shown(&folder, "room.gltf");
    let places: Vec<&Value> =
        json["nodes"].as_array().unwrap().iter().filter_map(|n| n["extensions"].get("LUXEL_lightmap")).collect();
    let lightmaps = all::<Lightmap>(&mut app);
    assert!(!places.is_empty() && lightmaps.len() >= places.len());
    for place in &places {
        let at = |key: &str, i: usize| place[key][i].as_f64().unwrap() as f32;
        let corner = Vec2::new(at("offset", 0), at("offset", 1));
        let rect = Rect { min: corner, max: corner + Vec2::new(at("scale", 0), at("scale", 1)) };
        let near = |l: &Lightmap| (l.uv_rect.min - rect.min).length() + (l.uv_rect.max - rect.max).length() < 1e-5;
        assert!(lightmaps.iter().any(near), "{rect:?}");
    }
    // Whoever has a lightmap has the texture coordinates for it.
    let mut lit = app.world_mut().query::<(&Mesh3d, &Lightmap)>();
    let meshes = app.world().resource::<Assets<Mesh>>();
    for (mesh, _) in lit.iter(app.world()) {
        assert!(meshes.get(&mesh.0).unwrap().contains_attribute(Mesh::ATTRIBUTE_UV_1));
    }
    assert!(all::<LightmapProblem>(&mut app).is_empty());
}

#[test]
fn texels_are_irradiance_over_pi_from_the_top() {
    // Bright pages have a scale, and are more than halves can hold.
    for (options, format) in [("", TextureFormat::Rgba16Float), ("--light-scale 100000", TextureFormat::Rgba32Float)] {
        let folder = baked("room.gltf", &format!("--sidecar {options}"));
        let (_, json) = document(&folder);
        let page = &json["extensions"]["LUXEL_lightmap"]["pages"][0];
        let scale = page["scale"].as_f64().unwrap() as f32;
        assert_eq!(scale > 1.0, !options.is_empty());
        let bytes = std::fs::read(folder.path().join(page["uri"].as_str().unwrap())).unwrap();
        let exr = image::load_from_memory_with_format(&bytes, image::ImageFormat::OpenExr).unwrap().into_rgba32f();
        let app = shown(&folder, "room.gltf");
        let server = app.world().resource::<AssetServer>();
        let handle = server.get_handle::<Image>("room.gltf#LUXEL_lightmap/Page0").unwrap();
        let shown = app.world().resource::<Assets<Image>>().get(&handle).unwrap();
        assert_eq!(shown.texture_descriptor.format, format);
        let texels = texels(shown);
        assert!(texels.len() == exr.as_raw().len() && texels.iter().any(|x| *x > 0.0 && *x != 1.0));
        for (i, (mine, stored)) in texels.iter().zip(exr.as_raw()).enumerate().filter(|(i, _)| i % 4 < 3) {
            let wanted = stored * scale / PI;
            assert!((mine - wanted).abs() <= 1e-3 * wanted + 1e-6, "{i}: {mine} {wanted}");
        }
    }
}

#[test]
fn baked_lamps_are_off_and_others_shine() {
    let full = shining(&mut shown(&baked("room.glb", ""), "room.glb"));
    assert!(!full.is_empty() && full.iter().all(|on| !on), "{full:?}");
    let mixed = shining(&mut shown(&baked("room.glb", "--content indirect"), "room.glb"));
    assert!(mixed.len() == full.len() && mixed.iter().all(|on| *on), "{mixed:?}");
}

#[test]
fn what_is_broken_leaves_the_scene_as_it_was() {
    let folder = baked("room.gltf", "--sidecar");
    let (file, json) = document(&folder);
    let name = json["extensions"]["LUXEL_lightmap"]["pages"][0]["uri"].as_str().unwrap().to_owned();
    let page = folder.path().join(&name);
    let whole = std::fs::read(&page).unwrap();
    let check = |what: &str| {
        let mut app = shown(&folder, "room.gltf");
        let problems = all::<LightmapProblem>(&mut app);
        assert!(problems.len() == 1 && problems[0].0.contains(what), "{problems:?} does not say {what:?}");
        assert!(!problems[0].0.contains('\n'), "{problems:?}");
        assert!(all::<Lightmap>(&mut app).is_empty());
        assert!(shining(&mut app).into_iter().all(|on| on));
    };
    std::fs::write(&page, &whole[..whole.len() * 3 / 4]).unwrap();
    check("page 0 is not a whole EXR picture");
    std::fs::remove_file(&page).unwrap();
    check(&format!("page 0 ({name}) cannot be read"));
    std::fs::write(&page, &whole).unwrap();
    for (key, value, what) in [("width", json!(65), "not 65 x"), ("scale", json!(-1), "has the scale -1")] {
        let mut odd = json.clone();
        odd["extensions"]["LUXEL_lightmap"]["pages"][0][key] = value;
        std::fs::write(&file, odd.to_string()).unwrap();
        check(what);
    }
    for (key, value, what) in
        [("page", json!(9), "is on page 9, but the file has 3"), ("texCoord", json!(0), "needs TEXCOORD_0; Bevy reads")]
    {
        let mut odd = json.clone();
        let mut nodes = odd["nodes"].as_array_mut().unwrap().iter_mut();
        let node = nodes.find(|n| n["extensions"].get("LUXEL_lightmap").is_some());
        node.unwrap()["extensions"]["LUXEL_lightmap"][key] = value;
        std::fs::write(&file, odd.to_string()).unwrap();
        check(what);
    }
    // In the file, where there is nothing, or beyond all numbers.
    let views = json["bufferViews"].as_array().unwrap().len();
    let nowhere = "page 0 has to be in a bufferView of the file";
    for (view, what) in [(json!(views), nowhere), (json!(views + 1), nowhere), (json!(-1), "make no sense")] {
        let mut odd = json.clone();
        let beyond = json!({ "buffer": 0, "byteOffset": u64::MAX, "byteLength": u64::MAX });
        odd["bufferViews"].as_array_mut().unwrap().push(beyond);
        let page = odd["extensions"]["LUXEL_lightmap"]["pages"][0].as_object_mut().unwrap();
        page.remove("uri");
        page.insert("bufferView".into(), view);
        std::fs::write(&file, odd.to_string()).unwrap();
        check(what);
    }
}

#[test]
fn files_without_lightmap_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(Path::new(ROOT).join("../../assets/room.glb"), folder.path().join("room.glb")).unwrap();
    let mut app = shown(&folder, "room.glb");
    assert!(all::<Lightmap>(&mut app).is_empty() && all::<LightmapProblem>(&mut app).is_empty());
    assert!(shining(&mut app).into_iter().all(|on| on));
}
