//! The layering is a rule: a room imports only rooms listed above it, and a foreign crate stays in its room.

use std::{fs, path::Path};

/// Rooms in their order, as in src/lib.rs. The program (cli, main) stands above them all.
fn rooms() -> Vec<String> {
    let lib = fs::read_to_string("src/lib.rs").unwrap();
    lib.lines().filter_map(|l| l.strip_prefix("pub mod ")?.strip_suffix(';')).map(String::from).collect()
}

fn sources(room: &str) -> Vec<(String, String)> {
    let file = format!("src/{room}.rs");
    let mut found = Vec::new();
    if Path::new(&file).exists() {
        found.push((file.clone(), fs::read_to_string(&file).unwrap()));
    }
    let mut folders = vec![format!("src/{room}")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            let name = path.to_str().unwrap().to_string();
            if path.is_dir() {
                folders.push(name);
            } else if name.ends_with(".rs") {
                found.push((name, fs::read_to_string(&path).unwrap()));
            }
        }
    }
    found
}

/// The first segment of every path that starts at the crate's root, `use crate::{a, b::c}` included.
fn imports(source: &str) -> Vec<String> {
    let source: String = source.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let name = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut out = Vec::new();
    for rest in source.split("crate::").skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            out.push(name(rest));
            continue;
        };
        let (mut depth, mut start) = (0, true);
        for (i, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => start = true,
                c if start && c.is_alphanumeric() => {
                    out.push(name(&list[i..]));
                    start = false;
                }
                _ => {}
            }
        }
    }
    out
}

#[test]
fn rooms_import_only_what_stands_above_them() {
    let rooms = rooms();
    assert!(rooms.len() > 10, "src/lib.rs lists the rooms");
    for (order, room) in rooms.iter().enumerate() {
        let files = sources(room);
        assert!(!files.is_empty(), "{room} has a source");
        for (file, source) in files {
            for import in imports(&source) {
                let below = rooms.iter().position(|r| *r == import).is_some_and(|at| at > order);
                assert!(!below, "{file} imports {import}, which stands below {room}");
            }
        }
    }
}

#[test]
fn foreign_crates_stay_in_their_rooms() {
    let homes = [
        ("obvhs", &["trace"][..]),
        ("image", &["pixels"]),
        ("exr", &["pixels"]),
        ("uvunwrap", &["atlas"]),
        ("xatlas_rs", &["atlas"]),
        ("guillotiere", &["atlas"]),
        ("clap", &["cli"]),
        ("serde_json", &["gltf", "cli"]),
        ("sysinfo", &["memory", "processor"]),
        ("tiny_skia", &["chart"]),
        ("ttf_parser", &["chart"]),
        ("nalgebra", &["radiosity"]),
    ];
    let mut all = rooms();
    all.push("cli".into());
    for room in all {
        for (file, source) in sources(&room) {
            for (name, homes) in homes {
                let uses = source.contains(&format!("use {name}::")) || source.contains(&format!("use {name} as "));
                // A module of ours may bear the crate's name.
                let own = Path::new(&file).parent().unwrap().join(format!("{name}.rs")).exists();
                assert!(!uses || own || homes.contains(&room.as_str()), "{file} uses {name}");
            }
        }
    }
}
