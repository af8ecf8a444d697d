//! Every failure scene by every estimator and every solver. What came out is the table of tests/README.md, which this
//! suite compares, or writes where LUXEL_WRITE is set.

use super::scenes::SCENES;
use crate::common::ways::Way;
use luxel::error::Error;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/README.md");
/// The table stands between these.
const BEGIN: &str = "<!-- table: written by the test, LUXEL_WRITE=1 cargo test --release --test stability table -->\n";
const END: &str = "<!-- end of table -->\n";

/// The only refusals there may be, and who may be off, and by how much at most.
const REFUSED: &[(&str, &str)] = &[("texel_centre_outside", "analytic")];
const OFF: &[(&str, &str, f64)] = &[
    // The ambient estimate shines into sealed rooms, less than the tolerance allows.
    ("thin_wall_leak", "shooting", 1e-5),
    // Below a pixel, or a ray's share.
    ("hemicube_alias, rows alone", "hemicube", 10.0),
    ("hemicube_alias, rows alone", "*", 100.0),
];

#[test]
fn every_way_holds_or_says_why_not() {
    let ways = Way::all();
    let mut notes: Vec<String> = Vec::new();
    let mut lines = vec![row("", ways.iter().map(|w| w.name().into())), row("---", ways.iter().map(|_| "---".into()))];
    for scene in SCENES {
        let cell = |way: &Way| {
            let (name, by) = (scene.name, way.name());
            let found = (scene.off)(*way);
            println!("{name} by {by}: {found:?}");
            match found {
                Ok(off) if off <= scene.tolerance => "holds".to_string(),
                Ok(off) => {
                    let most = OFF.iter().find(|(scene, way, _)| *scene == name && (*way == by || *way == "*"));
                    let most = most.map_or(scene.tolerance, |m| m.2);
                    assert!(off <= most, "{name} by {by}: off by {off}, at most {most}");
                    format!("off by {}", percent(off))
                }
                Err(Error::Usage(reason)) if REFUSED.contains(&(name, by)) => {
                    let reason = reason.lines().next().unwrap_or_default().to_string();
                    let note = notes.iter().position(|n| *n == reason).unwrap_or_else(|| {
                        notes.push(reason);
                        notes.len() - 1
                    });
                    format!("refused ({})", note + 1)
                }
                Err(error) => panic!("{name} by {by}: {error}"),
            }
        };
        let cells: Vec<String> = ways.iter().map(cell).collect();
        println!("{}", row(scene.name, cells.iter().cloned()));
        lines.push(row(scene.name, cells.into_iter()));
    }
    lines.push(String::new());
    lines.extend(notes.iter().enumerate().map(|(k, note)| format!("({}) `{note}`", k + 1)));
    let table = lines.join("\n") + "\n";
    let text = std::fs::read_to_string(FILE).expect("tests/README.md");
    let (head, rest) = text.split_once(BEGIN).expect("where the table begins");
    let (old, tail) = rest.split_once(END).expect("where the table ends");
    if std::env::var_os("LUXEL_WRITE").is_some() {
        std::fs::write(FILE, format!("{head}{BEGIN}\n{table}\n{END}{tail}")).expect("tests/README.md is written");
    } else {
        assert_eq!(old.trim(), table.trim(), "tests/README.md is out of date: run this test with LUXEL_WRITE=1");
    }
}

fn row(name: &str, cells: impl Iterator<Item = String>) -> String {
    format!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "))
}

/// Two digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent >= 10.0 { format!("{percent:.0} %") } else { format!("{percent:.1e} %") }
}
