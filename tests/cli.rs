//! The program's manners: help, usage errors, exit codes, and what is found out before anything is baked.

mod program;

use program::Folder;
use std::process::Stdio;

#[test]
fn without_arguments_there_is_help_and_code_2() {
    let folder = Folder::new();
    for arguments in ["", "bake"] {
        let said = folder.luxel(arguments);
        assert_eq!(said.code, 2, "{arguments}");
        assert!(said.err.contains("Usage: luxel"), "{}", said.err);
    }
}

#[test]
fn help_and_version_are_results() {
    let folder = Folder::new();
    for arguments in ["--help", "bake --help", "help bake", "--version"] {
        let said = folder.luxel(arguments);
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{arguments}");
    }
    let help = folder.luxel("bake --help").out;
    for option in "--resolution --texels-per-meter --page-size --keep-uv --unwrap --exclude --rays --bounces --threads --sky --sun \
                   --light-scale --max-reflectance --content --form-factors --solver --preview --camera --flat --sidecar --strip-lights --float \
                   --report --quiet --strict Example"
        .split_whitespace()
    {
        assert!(help.contains(option), "{option} is missing in\n{help}");
    }
    assert_eq!(folder.luxel("--version").out, format!("luxel {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_is_code_2() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("folder.glb")).unwrap();
    let mut linked: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path("room.gltf")).unwrap()).unwrap();
    linked["images"] = serde_json::json!([{ "uri": "texture.png" }, { "uri": "room.bin" }]);
    std::fs::write(folder.path("linked.gltf"), linked.to_string()).unwrap();
    std::fs::write(folder.path("texture.png"), "").unwrap();
    for arguments in [
        "boil room.gltf",
        "bake room.gltf --bounces -1",
        "bake room.gltf --bounces some",
        "bake room.gltf --bounces 65537",
        "bake room.gltf --solver magic",
        "bake room.gltf --form-factors magic",
        "bake room.gltf --form-factors hemicube,3",
        "bake room.gltf other.gltf",
        "bake room.gltf -o room.obj",
        "bake room.gltf -o a.glb/",
        "bake room.gltf --report a/",
        "bake room.gltf -o folder.glb",
        "bake room.gltf -o room",
        "bake room.gltf --resolution 0",
        "bake room.gltf --resolution 512 --texels-per-meter 3",
        "bake room.gltf --resolution 8192 --page-size 1024",
        "bake room.gltf --rays many",
        "bake room.gltf --max-reflectance 1",
        "bake room.gltf --sky red",
        "bake room.gltf --sky 1,2,-3",
        "bake room.gltf --sky a.png",
        "bake room.gltf --sun 1,2",
        "bake room.gltf --camera Main",
        "bake room.gltf --preview a.png --camera Nobody",
        "bake room.gltf --preview a.png --report a.png",
        "bake room.gltf -o a.glb --flat ./a.glb",
        "bake room.gltf --report room.gltf",
        "bake room.gltf -o a.gltf --report a.bin",
        "bake room.gltf -o a.gltf --report ./a.page0.exr",
        "bake room.gltf -o a.glb --sidecar --report a.lightmap.json",
        "bake room.gltf --resolution 8",
        "bake linked.gltf --preview texture.png",
        "bake linked.gltf --report room.bin",
        "bake room.gltf --flat a.png",
    ] {
        let said = folder.luxel(arguments);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{arguments}: {}", said.err);
        assert!(said.err.starts_with("error: "), "{arguments}: {}", said.err);
    }
    assert_eq!(folder.files(), ["folder.glb", "linked.gltf", "room.gltf", "texture.png"]);
}

#[cfg(not(feature = "xatlas"))]
#[test]
fn an_unwrapper_that_was_not_built_is_named() {
    let said = Folder::new().luxel("bake room.gltf --unwrap xatlas");
    assert!(said.code == 2 && said.err.contains("--features xatlas"), "{}", said.err);
}

#[test]
fn an_unknown_camera_is_answered_with_those_there_are() {
    let said = Folder::new().luxel("bake room.gltf --preview a.png --camera Nobody");
    assert!(said.err.contains("`Nobody`; it has `"), "{}", said.err);
}

#[test]
fn the_terminal_is_not_steered_by_names() {
    let folder = Folder::new();
    let mut json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path("room.gltf")).unwrap()).unwrap();
    json["meshes"][0]["name"] = "\u{1b}[2J".into();
    json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 77.into();
    std::fs::write(folder.path("odd.gltf"), json.to_string()).unwrap();
    let said = folder.luxel("bake odd.gltf");
    assert!(said.code == 3 && said.err.contains("mesh 0 \"\u{fffd}[2J\""), "{}", said.err);
    assert!(!said.err.contains('\u{1b}'), "{}", said.err);
}

#[test]
fn remedies_fit_the_mistake() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --exclude *");
    assert!(said.err.contains("--exclude may leave out too much"), "{}", said.err);
}

#[test]
fn bad_input_is_code_3_and_named() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("folder")).unwrap();
    for (name, bytes) in [("empty.glb", ""), ("text.glb", "not a scene"), ("json.gltf", "{}"), ("text.obj", "v 0 0 0")]
    {
        std::fs::write(folder.path(name), bytes).unwrap();
    }
    std::fs::write(folder.path("sky.hdr"), "not a sky").unwrap();
    for (name, options) in [
        ("missing.glb", ""),
        ("nowhere/missing.glb", ""),
        ("folder", ""),
        ("empty.glb", ""),
        ("text.glb", ""),
        ("json.gltf", ""),
        ("text.obj", ""),
        ("room.gltf", "--sky missing.hdr"),
        ("room.gltf", "--sky sky.hdr,2,90"),
        ("room.gltf", "--exclude *"),
    ] {
        let said = folder.luxel(&format!("bake {name} {options}"));
        assert_eq!((said.code, said.out.as_str()), (3, ""), "{name} {options}: {}", said.err);
        let named = if options.starts_with("--sky") { ".hdr" } else { name };
        assert!(said.err.contains("error: ") && said.err.contains(named), "{name} {options}: {}", said.err);
    }
    assert!(folder.files().iter().all(|f| !f.contains(".lit.")));
}

#[test]
fn a_missing_output_folder_is_found_out_before_baking() {
    let folder = Folder::new();
    for options in ["-o none/a.glb", "--preview none/a.png", "--report none/a.json", "--flat none/a.glb"] {
        let said = folder.luxel(&format!("bake room.gltf {options}"));
        assert_eq!(said.code, 1, "{options}: {}", said.err);
        assert!(said.err.starts_with("error: none/a."), "{options}: {}", said.err);
    }
    assert_eq!(folder.files(), ["room.gltf"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_is_told_by_the_name_that_was_typed() {
    let said = Folder::new().luxel("bake room.gltf -o /proc/a.glb");
    assert_eq!(said.code, 1, "{}", said.err);
    assert!(said.err.starts_with("error: /proc/a.glb: ") && !said.err.contains(".luxel-"), "{}", said.err);
}

#[test]
fn closed_pipes_are_nobodys_mistake() {
    let folder = Folder::new();
    let mut child = folder.command("bake --help").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(!String::from_utf8(output.stderr).unwrap().contains("panicked"));
    let mut child = folder.command("bake missing.glb").stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(3));
}
