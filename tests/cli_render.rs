//! `luxel render` and `luxel inspect`: pictures of baked files, and what they refuse.

mod program;

use luxel::pixels::{decode, exr};
use program::Folder;
use serde_json::{Value, json};

const QUICK: &str = "--resolution 32 --rays 16 --quiet";
const SMALL: &str = "--size 96x54 --quiet";

/// The room, baked with `options` to lit.gltf.
fn baked(options: &str) -> Folder {
    let folder = Folder::new();
    bake(&folder, options);
    folder
}

fn bake(folder: &Folder, options: &str) {
    let said = folder.luxel(&format!("bake room.gltf -o lit.gltf {QUICK} {options}"));
    assert_eq!(said.code, 0, "{}", said.err);
}

fn render(folder: &Folder, options: &str) {
    let said = folder.luxel(&format!("render lit.gltf {options}"));
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{options}");
}

fn change(folder: &Folder, name: &str, change: impl FnOnce(&mut Value)) {
    let path = folder.path(name);
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    std::fs::write(path, json.to_string()).unwrap();
}

fn levels(folder: &Folder, name: &str) -> Vec<u8> {
    let picture = decode(&std::fs::read(folder.path(name)).unwrap()).unwrap();
    picture.rgba.as_flattened().to_vec()
}

fn mean(folder: &Folder, name: &str) -> f32 {
    let (_, radiance) = exr::decode(&std::fs::read(folder.path(name)).unwrap()).unwrap();
    radiance.iter().map(|c| c.element_sum()).sum::<f32>() / radiance.len() as f32
}

#[test]
fn a_file_looks_like_the_preview_of_its_bake() {
    let folder = baked("--preview a.png");
    render(&folder, "-o b.png --samples 2 --quiet");
    let (a, b) = (levels(&folder, "a.png"), levels(&folder, "b.png"));
    // Pages are stored in halves.
    assert!(a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a.abs_diff(*b) <= 1));
}

#[test]
fn any_number_of_threads_paints_the_same() {
    let folder = Folder::new();
    change(&folder, "room.gltf", metal);
    bake(&folder, "");
    let [one, three] = [1, 3].map(|n| {
        render(&folder, &format!("-o a.exr {SMALL} --threads {n}"));
        std::fs::read(folder.path("a.exr")).unwrap()
    });
    assert!(one == three);
}

/// Every surface becomes half rough, half dark metal.
fn metal(room: &mut Value) {
    for material in room["materials"].as_array_mut().unwrap() {
        material["pbrMetallicRoughness"] = json!({ "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "roughnessFactor": 0.5 });
    }
}

#[test]
fn metal_shows_what_it_mirrors() {
    let folder = Folder::new();
    change(&folder, "room.gltf", metal);
    bake(&folder, "--sky 1,1,1");
    render(&folder, &format!("-o metal.exr {SMALL} --samples 2 --camera 0,.5,1.5,0,0,0"));
    change(&folder, "lit.gltf", |lit| {
        for material in lit["materials"].as_array_mut().unwrap() {
            material["pbrMetallicRoughness"]["metallicFactor"] = 0.0.into();
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.0, 0.0, 0.0, 1.0]);
        }
    });
    render(&folder, &format!("-o black.exr {SMALL} --samples 2 --camera 0,.5,1.5,0,0,0"));
    let [metal, black] = ["metal.exr", "black.exr"].map(|name| mean(&folder, name));
    assert!(metal > black + 0.3, "{metal} {black}");
}

#[test]
fn lamps_that_the_map_leaves_to_the_engine_are_drawn() {
    let folder = baked("--sun 30,50,3 --sky .1,.1,.1");
    let camera = "--camera 0,1.5,1.5,0,0,0";
    render(&folder, &format!("-o full.exr {SMALL} {camera}"));
    bake(&folder, "--sun 30,50,3 --sky .1,.1,.1 --content indirect");
    render(&folder, &format!("-o mixed.exr {SMALL} {camera}"));
    let [full, mixed] = ["full.exr", "mixed.exr"].map(|name| mean(&folder, name));
    assert!((mixed / full - 1.0).abs() < 0.02, "{mixed} {full}");
}

#[cfg(target_os = "linux")]
#[test]
fn pictures_take_memory_for_pixels_and_none_for_rays() {
    let folder = baked("");
    // Upwards, past everything: 16 million rays.
    let said = folder
        .confined(400_000, "render lit.gltf -o a.png --size 500x500 --samples 8 --camera 0,9,0,0,99,1 --threads 1");
    assert_eq!(said.code, 0, "{}", said.err);
    let said = folder.confined(400_000, "render lit.gltf -o b.png --size 16384x16384 --samples 32 --threads 1");
    assert_eq!(said.code, 1, "{}", said.err);
    assert!(said.err.contains("MB free") && said.err.contains("lower --size"), "{}", said.err);
    assert!(!folder.files().contains(&"b.png".into()));
}

#[test]
fn what_cannot_be_painted_is_refused() {
    let folder = baked("");
    for (arguments, code, what) in [
        ("render lit.gltf -o lit.jpg", 2, ".png or .exr"),
        ("render lit.gltf", 2, "--output"),
        ("render lit.gltf -o a.png --size 5", 2, "width and height"),
        ("render lit.gltf -o a.png --size 0x9", 2, "width and height"),
        ("render lit.gltf -o a.png --samples 0", 2, "0 is not in"),
        ("render lit.gltf -o a.png --camera Nobody", 2, "no camera `Nobody`"),
        ("render lit.gltf -o a.png --camera 1,2,3,4,5", 2, "six numbers"),
        ("render lit.gltf -o a.png --camera 1,2,3,1,2,3", 2, "another target"),
        ("render lit.gltf -o none/a.png", 1, "the folder none cannot be used"),
        ("render room.gltf -o a.png", 3, "bake it first"),
        ("render none.gltf -o a.png", 3, "none.gltf"),
        ("render", 2, "Usage: luxel render"),
        ("inspect", 2, "Usage: luxel inspect"),
        ("inspect lit.gltf", 2, "--output"),
        ("inspect lit.gltf -o pictures --camera Nobody", 2, "no camera `Nobody`"),
        ("inspect lit.gltf -o none/pictures", 1, "the folder none cannot be used"),
        ("inspect lit.gltf -o room.gltf/pictures", 1, "the folder room.gltf cannot be used"),
        ("inspect none.gltf -o pictures", 3, "none.gltf"),
        ("inspect room.gltf -o pictures", 3, "bake it first"),
        ("inspect lit.gltf -o room.gltf", 2, "is not a folder"),
    ] {
        let said = folder.luxel(arguments);
        assert_eq!(said.code, code, "{arguments}: {}", said.err);
        assert!(said.err.contains(what), "{arguments}: {}", said.err);
    }
    assert!(!folder.files().iter().any(|name| name.ends_with(".png") || name == "pictures"));
}

#[test]
fn an_inspection_is_a_picture_a_layer_and_says_what_it_shows() {
    let folder = baked("");
    let said = folder.luxel("inspect lit.gltf -o pictures --points 50");
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    for name in ["density", "charts", "overlaps", "validity", "receivers", "rows", "error"] {
        assert!(said.out.contains(&format!("{name} ")), "{}", said.out);
        for picture in ["page0", "view"] {
            assert!(levels(&folder, &format!("pictures/{picture}.{name}.png")).iter().any(|l| *l > 100), "{name}");
        }
    }
    assert!(said.out.contains("0 texels are shared by charts"), "{}", said.out);
    // The lamp shrinks into the middle of the page, where the floor is.
    change(&folder, "lit.gltf", |lit| {
        let place = &mut lit["nodes"][1]["extensions"]["LUXEL_lightmap"];
        assert_eq!(place["page"], 0);
        place["offset"] = json!([0.3, 0.3]);
        place["scale"] = json!([0.1, 0.1]);
    });
    let said = folder.luxel("inspect lit.gltf -o pictures --points 50");
    assert!(said.code == 0 && !said.out.contains("0 texels are shared"), "{}{}", said.out, said.err);
}

#[test]
fn receivers_are_those_of_the_bake() {
    let folder = Folder::new();
    let bright = |options: &str| {
        let said =
            folder.luxel(&format!("bake room.gltf -o lit.gltf --resolution 128 --quiet --report a.json {options}"));
        assert_eq!(said.code, 0, "{}", said.err);
        let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
        let said = folder.luxel("inspect lit.gltf -o pictures --points 10 --quiet");
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        let picture = decode(&std::fs::read(folder.path("pictures/page0.receivers.png")).unwrap()).unwrap();
        let bright = picture.rgba.iter().filter(|c| c[0] > 128).count();
        // No sheet of the room has a back that rays meet, so that all receivers are texels.
        assert_eq!(bright as u64, report["receivers"].as_u64().unwrap(), "{options}");
        (bright, report["texels"].as_u64().unwrap() as usize)
    };
    let (all, texels) = bright("--rays 16");
    let (some, _) = bright("--rays 16 --receivers auto");
    let (more, _) = bright("--rays 1024 --receivers auto");
    assert!(all == texels && some < more && more < texels, "{some} {more} {texels}");
}

#[test]
fn what_is_enclosed_is_about_what_the_bake_found() {
    let folder = Folder::new();
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/room.glb"), folder.path("room.glb")).unwrap();
    let said = folder.luxel("bake room.glb -o lit.glb --resolution 256 --rays 16 --quiet --report a.json");
    assert_eq!(said.code, 0, "{}", said.err);
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
    let said = folder.luxel("inspect lit.glb -o pictures --points 10");
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let picture = decode(&std::fs::read(folder.path("pictures/page0.validity.png")).unwrap()).unwrap();
    let red = picture.rgba.iter().filter(|c| c[0] > 200 && c[1] < 50).count();
    assert!(said.out.contains(&format!("{red} texels are enclosed")), "{red}: {}", said.out);
    // The bake asks 16 points of each texel, the inspection 8.
    let share = red as f64 / report["buried_texels"].as_f64().unwrap();
    assert!((0.95..1.05).contains(&share), "{share}");
}

#[cfg(unix)]
#[test]
fn interrupted_painting_ends_at_once_and_writes_nothing() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf -o lit.gltf --resolution 512 --rays 1 --quiet");
    assert_eq!(said.code, 0, "{}", said.err);
    // So that there is a warning once the file is open.
    change(&folder, "lit.gltf", |lit| {
        lit["extensions"]["LUXEL_lightmap"].as_object_mut().unwrap().remove("report");
    });
    let before = folder.files();
    for arguments in
        ["render lit.gltf -o a.png --size 8000x8000 --samples 4", "inspect lit.gltf -o a --points 16777216"]
    {
        let mut command = folder.command(arguments);
        let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
        let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
        assert!(lines.any(|line| line.unwrap().contains("does not say")));
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{arguments}");
        assert_eq!(folder.files(), before, "{arguments}");
    }
}
