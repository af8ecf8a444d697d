//! The program end to end: what it writes, what it says, and how it ends.

mod limits;
mod methods;
mod odd;
mod refusals;
#[cfg(unix)]
mod signals;

#[path = "../program/mod.rs"]
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
    for threads in [1, 3, 1000] {
        let said = folder.luxel(&format!("bake room.gltf -o {threads}.glb --threads {threads} {QUICK}"));
        assert_eq!(said.code, 0, "{}", said.err);
    }
    let bytes = |name| std::fs::read(folder.path(name)).unwrap();
    assert!(bytes("1.glb") == bytes("3.glb") && bytes("1.glb") == bytes("1000.glb"));
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
fn notes_are_no_warnings() {
    let folder = Folder::new();
    let said = folder.luxel(&format!("bake room.gltf -o a.glb {QUICK} --flat flat.glb --strict --report a.json"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("note: flat.glb: ") && said.out.contains("warnings   0"), "{}{}", said.out, said.err);
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
    assert_eq!(report["notes"].as_array().unwrap().len(), 1);
}
