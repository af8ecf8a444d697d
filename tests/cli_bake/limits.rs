//! What a bake must not hang on, overwrite, or take more memory for than there is.

use super::*;

/// Runs `command`, which must end by itself: a guard against hangs, not a clock.
#[cfg(unix)]
fn ends(mut command: std::process::Command) -> (Option<i32>, String) {
    use std::{process::Stdio, time::Duration};
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    for _ in 0..3000 {
        if let Some(status) = child.try_wait().unwrap() {
            let mut said = String::new();
            std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut said).unwrap();
            return (status.code(), said);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    child.kill().unwrap();
    panic!("{command:?} waits for ever");
}

#[cfg(unix)]
#[test]
fn pipes_devices_and_folders_are_refused_at_once() {
    let folder = Folder::new();
    let fifo = |name: &str| {
        assert!(std::process::Command::new("mkfifo").arg(folder.path(name)).status().unwrap().success());
    };
    for name in ["sky.hdr", "in.glb", "a.png", "a.bin"] {
        fifo(name);
    }
    std::fs::create_dir(folder.path("sky.exr")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path("zero.hdr")).unwrap();
    let refused = |arguments: &str, named: &str| {
        let (code, said) = ends(folder.command(&format!("{arguments} {QUICK}")));
        assert_eq!(code, Some(3), "{arguments}: {said}");
        assert!(said.contains(named) && said.contains("is not an ordinary file"), "{arguments}: {said}");
    };
    refused("bake room.gltf --sky sky.hdr", "sky.hdr");
    refused("bake room.gltf --sky zero.hdr", "zero.hdr");
    refused("bake room.gltf --sky sky.exr,2", "sky.exr");
    refused("bake in.glb", "in.glb");
    odd(&folder, |json| json["buffers"][0]["uri"] = "a.bin".into());
    refused("bake odd.gltf", "a.bin");
    odd(&folder, |json| {
        json["images"] = json!([{ "uri": "a.png" }]);
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    });
    refused("bake odd.gltf", "a.png");
}

/// Writing fails after the bake: files may not grow beyond one block.
#[cfg(unix)]
#[test]
fn a_full_disk_is_code_1_and_leaves_what_was_there() {
    let folder = Folder::new();
    let old = |name: &str| std::fs::write(folder.path(name), "old").unwrap();
    let names = ["a.glb", "a.gltf", "a.json", "a.page0.exr", "a.png", "flat.glb"];
    names.iter().for_each(|name| old(name));
    let bake = |options: &str| {
        let luxel = env!("CARGO_BIN_EXE_luxel");
        let mut shell = std::process::Command::new("sh");
        let script = format!("trap '' XFSZ; ulimit -f 1; exec '{luxel}' bake room.gltf {QUICK} {options}");
        shell.args(["-c", &script]).current_dir(folder.path("."));
        ends(shell)
    };
    for (options, named) in
        [("-o a.glb", "a.glb"), ("-o a.gltf", "a.page0.exr"), ("-o a.glb --sidecar --float", "a.page0.exr")]
    {
        let (code, said) = bake(&format!("{options} --preview a.png --flat flat.glb --report a.json"));
        assert_eq!(code, Some(1), "{options}: {said}");
        assert!(said.contains(&format!("error: {named}")) && !said.contains(".luxel-"), "{options}: {said}");
        assert_eq!(folder.files().len(), names.len() + 1, "{:?}", folder.files());
        assert!(names.iter().all(|name| std::fs::read(folder.path(name)).unwrap() == b"old"), "{options}");
    }
}

#[test]
fn a_bake_that_does_not_fit_is_refused_with_a_remedy() {
    // Four terabytes; a machine that has them would bake for days.
    if luxel::memory::free_mb() > 4_000_000 {
        return;
    }
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --rays 65536 --resolution 4096");
    assert_eq!((said.code, said.out.as_str()), (1, ""), "{}", said.err);
    assert!(said.err.contains("MB free") && said.err.contains("lower --resolution"), "{}", said.err);
    assert_eq!(folder.files(), ["room.gltf"]);
}

/// The room with `n` pictures of `edge` pixels squared, each read by a node's material.
fn pictured(folder: &Folder, n: usize, edge: u32) {
    let picture = luxel::pixels::encode_png(glam::UVec2::splat(edge), &vec![[90; 3]; (edge * edge) as usize]).unwrap();
    std::fs::write(folder.path("a.png"), &picture).unwrap();
    odd(folder, |json| {
        let uv = accessor(json, &floats(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]), 5126, 4, "VEC2");
        for i in 0..n {
            let add = |list: &mut Value, part: Value| match list.as_array_mut() {
                Some(list) => list.push(part),
                None => *list = json!([part]),
            };
            add(&mut json["images"], json!({ "uri": "a.png" }));
            add(&mut json["textures"], json!({ "source": i }));
            let pbr = json!({ "baseColorTexture": { "index": i }, "metallicFactor": 0 });
            add(&mut json["materials"], json!({ "pbrMetallicRoughness": pbr }));
            let mut primitive = json["meshes"][0]["primitives"][0].clone();
            primitive["attributes"]["TEXCOORD_0"] = uv.into();
            primitive["material"] = (i + 2).into();
            add(&mut json["meshes"], json!({ "primitives": [primitive] }));
            add(&mut json["nodes"], json!({ "mesh": i + 2, "translation": [0, i + 3, 0] }));
            add(&mut json["scenes"][0]["nodes"], json!(i + 3));
        }
    });
}

#[cfg(target_os = "linux")]
#[test]
fn pictures_that_do_not_fit_into_memory_are_refused_with_a_remedy() {
    let folder = Folder::new();
    pictured(&folder, 20, 4096);
    let said = folder.confined(1_500_000, &format!("bake odd.gltf {QUICK} --threads 1"));
    assert_eq!(said.code, 1, "{}", said.err);
    assert!(said.err.contains("MB free") && said.err.contains("gltf-transform/cli resize"), "{}", said.err);
    assert_eq!(folder.files(), ["a.png", "odd.gltf", "room.gltf"]);
}

/// What is announced is what is taken, or more, but not twice as much.
#[cfg(target_os = "linux")]
#[test]
fn the_announcement_bounds_memory() {
    let folder = Folder::new();
    // Rooms of sheets that reach into each other: of many texels the back is met, too.
    odd(&folder, |json| {
        json["materials"][0]["doubleSided"] = true.into();
        let nodes = json["nodes"].as_array_mut().unwrap();
        nodes.push(json!({ "mesh": 0, "translation": [0.5, 0.4, 0.3] }));
        let last = nodes.len() - 1;
        json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(last));
    });
    for options in [
        "room.gltf --resolution 512 --rays 16",
        "room.gltf --resolution 256 --rays 256 --solver jacobi",
        "room.gltf --resolution 512 --rays 64 --bounces 2",
        "odd.gltf --resolution 512 --rays 16",
        "room.gltf --resolution 512 --error 0.3%",
    ] {
        let said = folder.luxel(&format!("bake {options} --threads 2 --report r.json"));
        let told = said.err.split(" rays, up to ").last().and_then(|rest| rest.split(' ').next()).unwrap();
        let told: u64 = told.parse().unwrap();
        let report: Value = serde_json::from_slice(&std::fs::read(folder.path("r.json")).unwrap()).unwrap();
        let taken = report["peak_memory_mb"].as_u64().unwrap();
        assert!(taken <= told && told < 2 * taken, "{options}: {told} MB told, {taken} MB taken");
    }
}

#[test]
fn the_announcement_counts_pictures() {
    let folder = Folder::new();
    pictured(&folder, 2, 1024);
    let said = folder.luxel(&format!("bake odd.gltf {QUICK}"));
    assert!(said.code == 0 && said.err.contains(" MB of them taken (10 MB of textures), "), "{}", said.err);
}

#[test]
fn densities_beyond_memory_are_refused_with_a_remedy() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --texels-per-meter 20000 --page-size 32768 --rays 1");
    assert!([1, 2].contains(&said.code), "{}", said.err);
    assert!(said.err.contains("lower --resolution or --texels-per-meter"), "{}", said.err);
}
