//! The program end to end: what it writes, what it says, and how it ends.

mod program;

use program::Folder;
use serde_json::{Value, json};

const QUICK: &str = "--resolution 32 --rays 16";

#[test]
fn the_default_output_lies_beside_the_input() {
    let folder = Folder::new();
    let said = folder.luxel(&format!("bake room.gltf {QUICK}"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.out.starts_with("output     room.lit.gltf\n"), "{}", said.out);
    assert!(folder.path("room.lit.gltf").is_file());
    assert!(folder.files().iter().all(|f| !f.starts_with('.')), "{:?}", folder.files());
}

#[test]
fn a_baked_file_can_be_baked_onto_itself() {
    let folder = Folder::new();
    assert_eq!(folder.luxel(&format!("bake room.gltf -o a.lit.glb {QUICK}")).code, 0);
    let first = std::fs::read(folder.path("a.lit.glb")).unwrap();
    let said = folder.luxel(&format!("bake a.lit.glb {QUICK} --sky 1,1,1"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert_ne!(first, std::fs::read(folder.path("a.lit.glb")).unwrap());
    assert_eq!(folder.files(), ["a.lit.glb", "room.gltf"]);
}

#[test]
fn threads_do_not_change_a_byte() {
    let folder = Folder::new();
    for threads in [1, 3] {
        let said = folder.luxel(&format!("bake room.gltf -o {threads}.glb --threads {threads} {QUICK}"));
        assert_eq!(said.code, 0, "{}", said.err);
    }
    let bytes = |name| std::fs::read(folder.path(name)).unwrap();
    assert_eq!(bytes("1.glb"), bytes("3.glb"));
}

#[test]
fn the_report_is_json_and_alone_on_stdout() {
    let folder = Folder::new();
    let said = folder.luxel(&format!("bake room.gltf -o a.glb {QUICK} --report - --quiet"));
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let report: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(report["schema"], luxel::report::SCHEMA);
    assert!(report["texels"].as_u64().unwrap() > 0);
}

#[test]
fn bounces_and_solver_are_reported() {
    let folder = Folder::new();
    let report = |options: &str| -> Value {
        let said = folder.luxel(&format!("bake room.gltf -o a.gltf {QUICK} --report - --quiet --strict {options}"));
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{options}");
        serde_json::from_str::<Value>(&said.out).unwrap()["solver"].take()
    };
    let all = report("--solver jacobi");
    assert_eq!((&all["name"], &all["bounces"], &all["converged"]), (&json!("jacobi"), &Value::Null, &json!(true)));
    assert!(all["relative_bound"].as_f64().unwrap() <= luxel::radiosity::TOLERANCE);
    for options in ["--bounces 2", "--bounces 2 --solver jacobi"] {
        let some = report(options);
        assert_eq!((&some["bounces"], &some["iterations"], &some["bound"]), (&json!(2), &json!(2), &Value::Null));
    }
    let file: Value = serde_json::from_slice(&std::fs::read(folder.path("a.gltf")).unwrap()).unwrap();
    let short = &file["extensions"]["LUXEL_lightmap"]["report"];
    assert!(short["bounces"] == 2 && short.get("relativeBound").is_none(), "{short}");
    let said = folder.luxel(&format!("bake room.gltf {QUICK} --bounces 0"));
    assert!(said.code == 0 && said.out.contains("neumann, bounces 0 to 0"), "{}{}", said.out, said.err);
}

/// The table of --solver in the README.
#[test]
fn every_solver_works_with_every_effort() {
    let folder = Folder::new();
    for solver in luxel::radiosity::Solver::ALL.map(|s| s.name()) {
        let efforts = [
            "--rays 16",
            "--rays 16 --no-reuse",
            "--rays 16 --receivers auto",
            "--rays 4 --bounces 1",
            "--quality preview",
        ];
        let refused = |effort: &str| solver == "conjugate-gradient" && effort.contains("auto");
        for effort in efforts.into_iter().filter(|effort| !refused(effort)) {
            let options = format!("--resolution 32 {effort} --solver {solver} --report - --quiet");
            let said = folder.luxel(&format!("bake room.gltf -o a.glb {options}"));
            assert_eq!(said.code, 0, "{options}: {}", said.err);
            let report = serde_json::from_str::<Value>(&said.out).unwrap()["solver"].take();
            let name = if effort.contains("bounces") { "neumann" } else { solver };
            assert_eq!((&report["name"], &report["converged"]), (&json!(name), &json!(name == solver)), "{options}");
        }
    }
}

/// The table of --form-factors in the README.
#[test]
fn every_estimator_works_or_says_why_not() {
    let folder = Folder::new();
    let efforts = [
        "--solver anderson",
        "--rays 16",
        "--rays 16 --no-reuse",
        "--receivers auto",
        "--bounces 1",
        "--audit",
        "--quality preview",
        "--error 50%",
        "--time 1s",
        "--solver conjugate-gradient",
        "--solver direct",
    ];
    for estimator in luxel::transport::FormFactors::ALL {
        let name = estimator.name();
        for effort in efforts {
            let option = effort.split(' ').next().unwrap();
            let refused = match name {
                "hemicube" => ["--quality", "--error", "--time", "--rays"].contains(&option),
                "analytic" => ["--quality", "--error", "--time"].contains(&option),
                _ => false,
            };
            let options = format!("--resolution 16 {effort} --form-factors {name} --report - --quiet");
            let said = folder.luxel(&format!("bake room.gltf -o a.glb {options}"));
            assert_eq!(said.code, if refused { 2 } else { 0 }, "{options}: {}", said.err);
            if refused {
                for part in [format!("{option}: "), format!("--form-factors {name}"), "use --form-factors rays".into()]
                {
                    assert!(said.err.contains(&part), "{options}: {}", said.err);
                }
            } else {
                let report = serde_json::from_str::<Value>(&said.out).unwrap()["form_factors"].take();
                assert_eq!(report["name"], estimator.to_string(), "{options}");
                assert_eq!(report["reciprocity"].is_number(), name != "rays", "{options}: {report}");
            }
        }
    }
}

#[test]
fn too_many_texels_for_closed_forms_are_wrong_usage() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --resolution 128 --form-factors analytic");
    assert_eq!(said.code, 2, "{}", said.err);
    for part in ["--form-factors analytic", "2048", "use --form-factors rays, or lower --resolution"] {
        assert!(said.err.contains(part), "{part}: {}", said.err);
    }
    assert_eq!(folder.files(), ["room.gltf"]);
}

#[test]
fn conjugate_gradients_with_adaptive_receivers_are_wrong_usage() {
    let folder = Folder::new();
    let options = "--resolution 32 --rays 4 --solver conjugate-gradient --receivers auto";
    let said = folder.luxel(&format!("bake room.gltf {options}"));
    assert_eq!(said.code, 2, "{}", said.err);
    for part in ["--solver conjugate-gradient", "no symmetric form", "use --solver anderson"] {
        assert!(said.err.contains(part), "{part}: {}", said.err);
    }
    assert_eq!(folder.files(), ["room.gltf"]);
    assert_eq!(folder.luxel(&format!("bake room.gltf {options} --bounces 1")).code, 0);
}

#[test]
fn too_many_texels_for_dense_lu_are_wrong_usage() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --resolution 128 --rays 4 --solver direct");
    assert_eq!(said.code, 2, "{}", said.err);
    for part in ["--solver direct", "4096", "use --solver anderson"] {
        assert!(said.err.contains(part), "{part}: {}", said.err);
    }
    assert_eq!(folder.files(), ["room.gltf"]);
    assert_eq!(folder.luxel("bake room.gltf --resolution 128 --rays 4 --solver direct --bounces 1").code, 0);
}

#[test]
fn receivers_are_reported() {
    let folder = Folder::new();
    let report = |options: &str| -> Value {
        let said = folder.luxel(&format!("bake room.gltf -o a.glb --rays 4 --report - --quiet {options}"));
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{options}");
        serde_json::from_str(&said.out).unwrap()
    };
    let count = |report: &Value, what: &str| report[what].as_u64().unwrap();
    let all = report("--resolution 256 --receivers all");
    assert_eq!(count(&all, "receivers"), count(&all, "patches"));
    let some = report("--resolution 256 --receivers auto");
    assert!(count(&some, "receivers") * 2 < count(&some, "patches"), "{some:#}");
    assert!(count(&some, "matrix_bytes") * 2 < count(&all, "matrix_bytes"));
    let said = folder.luxel("bake room.gltf --receivers few");
    assert_eq!(said.code, 2, "{}", said.err);
}

#[test]
fn every_wished_file_appears() {
    let folder = Folder::new();
    let options = "-o a.glb --preview a.png --flat flat.glb --report a.json --sidecar --float --strip-lights";
    let said = folder.luxel(&format!("bake room.gltf {QUICK} {options}"));
    assert_eq!(said.code, 0, "{}", said.err);
    for name in ["a.glb", "a.png", "flat.glb", "a.json"] {
        assert!(folder.path(name).is_file(), "{name} is missing: {:?}", folder.files());
    }
    assert!(said.out.contains("preview    a.png, exposure "), "{}", said.out);
    assert!(folder.luxel(&format!("bake room.gltf {QUICK} --preview b.png --camera 3,1,0,0,0,0")).code == 0);
    assert_ne!(std::fs::read(folder.path("a.png")).unwrap(), std::fs::read(folder.path("b.png")).unwrap());
}

#[test]
fn warnings_are_code_0_and_with_strict_1() {
    let folder = Folder::new();
    // Without its lamp the room has no light at all.
    let dark = format!("bake room.gltf -o a.glb {QUICK} --exclude Lamp");
    let said = folder.luxel(&dark);
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!(said.err.matches("warning: the scene has no light").count(), 1, "{}", said.err);
    std::fs::remove_file(folder.path("a.glb")).unwrap();
    let said = folder.luxel(&format!("{dark} --strict --quiet"));
    assert_eq!(said.code, 1, "{}", said.err);
    assert!(said.err.contains("warning: ") && folder.path("a.glb").is_file());
}

#[test]
fn a_closed_pipe_does_not_spoil_a_bake() {
    use std::process::Stdio;
    let folder = Folder::new();
    let mut command = folder.command(&format!("bake room.gltf -o a.glb {QUICK}"));
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(folder.path("a.glb").is_file());
}

#[cfg(unix)]
#[test]
fn an_interrupted_bake_writes_nothing() {
    let folder = Folder::new();
    let mut command = folder.command("bake room.gltf --resolution 256 --rays 4096");
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    assert!(lines.any(|line| line.unwrap().starts_with("transport")));
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(folder.files(), ["room.gltf"]);
}

/// Sends Ctrl-C until it ends; its exit code, none if it does not.
#[cfg(unix)]
fn interrupt(child: &mut std::process::Child) -> Option<i32> {
    for _ in 0..300 {
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(100));
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
    }
    child.kill().unwrap();
    child.wait().unwrap().code()
}

#[cfg(unix)]
#[test]
fn one_signal_ends_a_dense_solve() {
    let folder = Folder::new();
    let mut command = folder.command("bake room.gltf --resolution 64 --rays 16 --solver direct --threads 1");
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    assert!(lines.any(|line| line.unwrap().starts_with("radiosity")));
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(lines.any(|line| line.unwrap() == "interrupted"), "it was asked once only");
    assert_eq!((child.wait().unwrap().code(), folder.files()), (Some(130), vec!["room.gltf".into()]));
}

/// The reader of the report does not read it.
#[cfg(unix)]
#[test]
fn signals_count_again_when_all_is_written() {
    let folder = Folder::new();
    odd(&folder, |json| {
        for i in 3..1003 {
            json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1, "name": format!("Lamp {i}") }));
            json["scenes"][0]["nodes"].as_array_mut().unwrap().push(i.into());
        }
    });
    let mut command = folder.command("bake odd.gltf -o a.glb --resolution 512 --rays 1 --quiet --report -");
    let mut child = command.stdout(std::process::Stdio::piped()).spawn().unwrap();
    while !folder.path("a.glb").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert_eq!(interrupt(&mut child), Some(130));
}

/// Writes the room as `odd.gltf`, changed by `edit`.
fn odd(folder: &Folder, edit: impl FnOnce(&mut Value)) {
    let mut json = serde_json::from_slice(&std::fs::read(folder.path("room.gltf")).unwrap()).unwrap();
    edit(&mut json);
    std::fs::write(folder.path("odd.gltf"), json.to_string()).unwrap();
}

/// One more accessor of the room; its index.
fn accessor(json: &mut Value, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
    let data: String = bytes.iter().map(|b| format!("%{b:02x}")).collect();
    let push = |list: &mut Value, entry: Value| {
        let list = list.as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    };
    let buffer = push(&mut json["buffers"], json!({ "uri": format!("data:,{data}"), "byteLength": bytes.len() }));
    let view = push(&mut json["bufferViews"], json!({ "buffer": buffer, "byteLength": bytes.len() }));
    let entry = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
    push(&mut json["accessors"], entry)
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

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

/// Runs `command`, which must end by itself.
#[cfg(unix)]
fn ends(mut command: std::process::Command) -> (Option<i32>, String) {
    use std::{process::Stdio, time::Duration};
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    for _ in 0..600 {
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

#[test]
fn a_node_without_a_texel_is_named() {
    let folder = Folder::new();
    let said = folder.luxel("bake room.gltf --texels-per-meter 1e-30 --rays 1");
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("node 0 \"Floor\" and 1 more: too small for a texel"), "{}", said.err);
}

#[test]
fn notes_are_no_warnings() {
    let folder = Folder::new();
    let said = folder.luxel(&format!("bake room.gltf -o a.glb {QUICK} --flat flat.glb --strict --report a.json"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("note: flat.glb: ") && said.out.contains("warnings   0"), "{}{}", said.out, said.err);
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
    assert_eq!(report["notes"].as_array().unwrap().len(), 1);
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
    odd(&folder, |json| json["materials"][0]["doubleSided"] = true.into());
    for options in [
        "room.gltf --resolution 512 --rays 16",
        "room.gltf --resolution 256 --rays 256 --solver jacobi",
        "room.gltf --resolution 512 --rays 64 --bounces 2",
        "odd.gltf --resolution 512 --rays 16",
    ] {
        let said = folder.luxel(&format!("bake {options} --threads 2 --report r.json"));
        let told = said.err.split(" rays, up to ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
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
fn densities_beyond_memory_are_refused_before_packing() {
    let folder = Folder::new();
    let began = std::time::Instant::now();
    let said = folder.luxel("bake room.gltf --texels-per-meter 20000 --page-size 32768 --rays 1");
    assert!([1, 2].contains(&said.code), "{}", said.err);
    assert!(said.err.contains("lower --resolution or --texels-per-meter"), "{}", said.err);
    assert!(began.elapsed().as_secs() < 3, "{:?}", began.elapsed());
}

#[test]
fn a_thousand_threads_do_no_harm() {
    let folder = Folder::new();
    let began = std::time::Instant::now();
    let said = folder.luxel(&format!("bake room.gltf {QUICK} --threads 1000"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(began.elapsed().as_secs() < 4, "{:?}", began.elapsed());
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
