//! What is refused with what: the program, its help and the README's tables say the same.

use super::*;
use luxel::{radiosity::Solver, transport::FormFactors};
use rayon::prelude::*;
use std::{collections::BTreeSet, sync::LazyLock};

/// Two options, in order of the alphabet.
type Pair = [String; 2];

/// Efforts and methods as they are typed, quick ones where any will do.
fn options() -> Vec<String> {
    let efforts = ["--error 50%", "--time .01s", "--quality preview", "--rays 4", "--bounces 1", "--no-reuse"];
    let form_factors = FormFactors::ALL.map(|f| format!("--form-factors {}", f.name()));
    let solvers = Solver::ALL.map(|s| format!("--solver {}", s.name()));
    let all = efforts.map(String::from).into_iter().chain(form_factors).chain(solvers);
    all.chain(["--receivers auto".into()]).collect()
}

fn name(option: &str) -> &str {
    option.split(' ').next().unwrap()
}

/// What help and tables call an option: by its value where that is what is refused.
fn called(option: &str) -> &str {
    if ["--form-factors", "--solver", "--receivers"].contains(&name(option)) { option } else { name(option) }
}

fn pair(a: &str, b: &str) -> Pair {
    let mut pair = [called(a), called(b)].map(String::from);
    pair.sort();
    pair
}

/// True if the program refuses the two together; else it has to bake.
fn refuses(a: &str, b: &str) -> bool {
    let said = Folder::new().luxel(&format!("bake room.gltf --resolution 16 --quiet {a} {b}"));
    assert!([0, 2].contains(&said.code), "{a} {b}: {}", said.err);
    said.code == 2
}

/// All that the program refuses.
static REFUSED: LazyLock<BTreeSet<Pair>> = LazyLock::new(|| {
    let all = options();
    let pairs = all.iter().enumerate().flat_map(|(i, a)| all[i + 1..].iter().map(move |b| (a, b)));
    let pairs: Vec<_> = pairs.filter(|(a, b)| name(a) != name(b)).collect();
    pairs.into_par_iter().filter(|(a, b)| refuses(a, b)).map(|(a, b)| pair(a, b)).collect()
});

/// What the help says of an option, on one line.
fn help_of(option: &str) -> String {
    let help = Folder::new().luxel("bake --help").out;
    // What is said of them is set in deeper.
    let begins = |line: &str| line.find('-').is_some_and(|at| at < 8 && line[..at].trim().is_empty());
    let is_own = |line: &str| begins(line) && line.split_whitespace().next() == Some(option);
    let mut lines = help.lines().skip_while(|line| !is_own(line));
    let first = lines.next().unwrap().to_owned();
    lines.take_while(|line| !begins(line) && !line.is_empty()).fold(first, |text, line| text + " " + line.trim())
}

/// Options that stand in a list, `--time and --quality`.
fn listed(text: &str) -> impl Iterator<Item = &str> {
    text.split(", ").flat_map(|part| part.split(" and ")).map(str::trim).filter(|part| part.starts_with("--"))
}

/// `Refuses --a, --b and --c: why`, and `value refuses --d e` of one value of the option.
fn said_by_help(option: &str) -> Vec<Pair> {
    let help = help_of(option).to_lowercase();
    let clauses = help.split(['.', ';', ':', '[']);
    let said = clauses.filter_map(|clause| clause.trim().split_once("refuses "));
    said.flat_map(|(value, list)| {
        let subject = format!("{option} {value}");
        listed(list).map(move |other| pair(subject.trim(), other)).collect::<Vec<_>>()
    })
    .collect()
}

#[test]
fn help_tells_of_each_refusal() {
    let names: BTreeSet<String> = options().iter().map(|o| name(o).into()).collect();
    let said: BTreeSet<Pair> = names.iter().flat_map(|option| said_by_help(option)).collect();
    assert_eq!(said, *REFUSED);
    let help = Folder::new().luxel("bake --help").out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains("No option keeps what texels see of each other for a bake in another light"), "{help}");
}

/// The options that a cell of a table names, as they are typed; `--solver` alone is every solver.
fn typed(cell: &str) -> Vec<String> {
    let named: Vec<&str> = cell.split('`').skip(1).step_by(2).map(|o| o.trim_end_matches(" N")).collect();
    let known = options().into_iter().chain(["--audit".into()]);
    known.filter(|o| named.iter().any(|n| *n == called(o) || *n == name(o))).collect()
}

#[test]
fn the_readme_tells_of_each_refusal() {
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let cells = |line: &str| line.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect::<Vec<_>>();
    let lines: Vec<&str> = readme.lines().collect();
    let (mut refused, mut works, mut tables) = (BTreeSet::new(), Vec::new(), 0);
    for table in lines.split(|l| !l.starts_with('|')).filter(|t| t.first().is_some_and(|head| head.contains("`--"))) {
        let (head, rows) = (cells(table[0]), &table[2..]);
        tables += 1;
        for row in rows.iter().map(|row| cells(row)) {
            let word = |value: &str| value.split([' ', '[']).next().unwrap().to_owned();
            let own = match head[0].trim_matches('`') {
                "" => typed(&row[0]),
                option => row[0].split(", ").map(|value| format!("{option} {}", word(value))).collect(),
            };
            for (cell, column) in row.iter().zip(&head).skip(1) {
                let others = typed(column);
                let pairs = own.iter().flat_map(|a| others.iter().map(move |b| (a.clone(), b.clone())));
                match cell {
                    cell if cell.starts_with("refused (2)") => refused.extend(pairs.map(|(a, b)| pair(&a, &b))),
                    cell if ["work", "not needed", "does it anyway"].iter().any(|w| cell.starts_with(w)) => {
                        works.extend(pairs);
                    }
                    cell => assert!(others.is_empty() || own == others, "{own:?}, {column}: \"{cell}\" says nothing"),
                }
            }
        }
    }
    assert_eq!((tables, &refused), (3, &*REFUSED));
    for (a, b) in works {
        // Audits, which take seconds each, are not among all pairs.
        let no = if b == "--audit" { refuses(&a, &b) } else { REFUSED.contains(&pair(&a, &b)) };
        assert!(!no, "{a} {b} is refused");
    }
}

/// Scenes that a method refuses: what it says is a limit stands in its help.
#[test]
fn help_tells_of_each_limit() {
    let folder = Folder::new();
    let limited = |option: &str, arguments: &str, limits: &[&str]| {
        let said = folder.luxel(&format!("bake {arguments} --quiet"));
        assert_eq!(said.code, 2, "{arguments}: {}", said.err);
        for limit in limits {
            assert!(said.err.contains(limit), "{limit}: {}", said.err);
            assert!(help_of(option).contains(limit), "{limit}: {}", help_of(option));
        }
    };
    limited("--form-factors", "room.gltf --resolution 128 --form-factors analytic", &["patches", "2048"]);
    limited("--solver", "room.gltf --resolution 128 --rays 4 --solver direct", &["4096"]);
    odd(&folder, |json| {
        let normals = floats(&[0.0, 0.8, 0.6, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = accessor(json, &normals, 5126, 4, "VEC3").into();
    });
    limited("--form-factors", "odd.gltf --resolution 16 --form-factors analytic", &["smooth normals"]);
    odd(&folder, |json| {
        // 40 x 40 squares.
        let at = |i: u16| [f32::from(i % 41) / 10.0, 0.0, -f32::from(i / 41) / 10.0];
        let square = |i: u16| [i, i + 1, i + 42, i, i + 42, i + 41];
        let corners: Vec<f32> = (0..41 * 41).flat_map(at).collect();
        let corners = accessor(json, &floats(&corners), 5126, 41 * 41, "VEC3");
        let indices: Vec<u16> = (0..40 * 41).filter(|i| i % 41 < 40).flat_map(square).collect();
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = accessor(json, &bytes, 5123, indices.len(), "SCALAR");
        json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = corners.into();
        json["meshes"][0]["primitives"][0]["indices"] = indices.into();
    });
    let pieces = ["3072", "pieces of triangles in texels"];
    limited("--form-factors", "odd.gltf --resolution 16 --form-factors analytic", &pieces);
}
