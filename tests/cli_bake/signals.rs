//! Ctrl-C: exit code 130, and no half a file.

use super::*;
use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

/// Starts a bake and waits for the room of this name; what is said further.
fn begun(folder: &Folder, options: &str, room: &str) -> (Child, impl Iterator<Item = String>) {
    let mut child = folder.command(options).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with(room)));
    (child, lines)
}

/// Ctrl-C.
fn signal(child: &Child) {
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
}

#[test]
fn an_interrupted_bake_writes_nothing() {
    let folder = Folder::new();
    let (mut child, _lines) = begun(&folder, "bake room.gltf --resolution 256 --rays 4096", "transport");
    signal(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(folder.files(), ["room.gltf"]);
}

/// Sends Ctrl-C until it ends; its exit code, none if it does not.
fn interrupt(child: &mut Child) -> Option<i32> {
    for _ in 0..300 {
        signal(child);
        thread::sleep(Duration::from_millis(100));
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
    }
    child.kill().unwrap();
    child.wait().unwrap().code()
}

#[test]
fn one_signal_ends_a_dense_solve() {
    let folder = Folder::new();
    // Every texel an unknown, which takes seconds: groups of them would be solved before the signal comes.
    let options = "bake room.gltf --resolution 88 --rays 16 --no-reuse --solver direct --threads 1";
    let (mut child, mut lines) = begun(&folder, options, "radiosity");
    signal(&child);
    assert!(lines.any(|line| line == "interrupted"), "it was asked once only");
    assert_eq!((child.wait().unwrap().code(), folder.files()), (Some(130), vec!["room.gltf".into()]));
}

/// The reader of the report does not read it.
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
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    while !folder.path("a.glb").exists() {
        assert!(child.try_wait().unwrap().is_none());
        thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(interrupt(&mut child), Some(130));
}

/// Signals while files are written go by: all of them are there, and none is a half.
#[test]
fn signals_among_the_writing_leave_whole_files() {
    let folder = Folder::new();
    // Until then names are tried, too, and signals end the program.
    let options = "bake room.gltf -o a.glb --flat b.glb --resolution 1024 --rays 1";
    let (mut child, _lines) = begun(&folder, options, "radiosity");
    let half = |name: &String| name.starts_with(".luxel-");
    while !folder.path("a.glb").exists() {
        assert!(child.try_wait().unwrap().is_none());
        if folder.files().iter().any(half) {
            signal(&child);
        }
    }
    // The last of them may count again when all is written.
    assert!(matches!(child.wait().unwrap().code(), Some(0 | 130)));
    assert_eq!(folder.files(), ["a.glb", "b.glb", "room.gltf"]);
}
