//! `luxel chart`: what it measures, writes and refuses.

mod program;

use program::{Folder, Said};
use serde_json::{Value, json};

const SMALL: &str = "-o charts --resolution 32 --quiet";

fn chart(folder: &Folder, options: &str) -> Said {
    folder.luxel(&format!("chart room.gltf {SMALL} {options}"))
}

/// The chart.json of a run that went well.
fn charted(folder: &Folder, options: &str) -> Value {
    let said = chart(folder, options);
    assert_eq!(said.code, 0, "{}", said.err);
    serde_json::from_slice(&std::fs::read(folder.path("charts/chart.json")).unwrap()).unwrap()
}

fn points(chart: &Value) -> &Vec<Value> {
    chart["points"].as_array().unwrap()
}

fn written(folder: &Folder) -> Vec<String> {
    let entries = std::fs::read_dir(folder.path("charts")).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn every_point_says_what_it_is_and_nothing_beats_the_front() {
    let folder = Folder::new();
    let chart = charted(&folder, "--budget 60s");
    let fields = [
        "sweep",
        "form_factors",
        "solver",
        "rays",
        "reuse",
        "receivers",
        "resolution",
        "seconds",
        "entries",
        "error",
        "error_low",
        "error_high",
        "dark",
        "border",
    ];
    for point in points(&chart) {
        assert!(fields.iter().all(|f| point.get(f).is_some()), "{point}");
        let [error, low, high] = ["error", "error_low", "error_high"].map(|f| point[f].as_f64().unwrap());
        assert!(low <= error && error <= high && point["seconds"].as_f64().unwrap() > 0.0, "{point}");
    }
    for sweep in ["rays", "quality", "solvers", "density"] {
        assert!(points(&chart).iter().any(|p| p["sweep"] == sweep), "{sweep}");
    }
    assert_eq!(points(&chart).iter().filter(|p| p["default"] == true).count(), 1);
    front(&chart);
    // More rays, less error, whatever the noise.
    let error = |name: &str| points(&chart).iter().find(|p| p["name"] == name).unwrap()["error"].as_f64().unwrap();
    assert!(error("rays, used once, 256") < 0.5 * error("rays, used once, 4"));
    systems(&chart);
    assert!(chart["scaling"].is_f64() && chart["threads"].as_array().is_some_and(|t| !t.is_empty()), "{chart}");
    let order = chart["patches"]["order"][1][1].as_f64();
    assert!(order.is_none_or(|o| o > 0.0), "{}", chart["patches"]);
}

/// By seconds, errors of the front fall; no other point of the same layout is faster and more exact.
fn front(chart: &Value) {
    let of = |p: &Value| (p["seconds"].as_f64().unwrap(), p["error"].as_f64().unwrap());
    let same = |p: &&Value| p["texels"] == chart["texels"] && p["sweep"] != "density";
    let all: Vec<(f64, f64)> = points(chart).iter().filter(same).map(of).collect();
    let mut best: Vec<(f64, f64)> = points(chart).iter().filter(|p| p["pareto"] == true).map(of).collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(!best.is_empty() && best.is_sorted_by(|a, b| a.1 > b.1), "{best:?}");
    for (seconds, error) in all {
        assert!(best.iter().any(|b| b.0 <= seconds && b.1 <= error), "{seconds} {error}");
    }
}

/// Every solver ends below its tolerance, in truth as by its bound, or says why not.
fn systems(chart: &Value) {
    let runs = chart["solvers"].as_array().unwrap();
    for solver in luxel::radiosity::Solver::ALL {
        let own: Vec<&Value> = runs.iter().filter(|r| r["solver"] == solver.name()).collect();
        assert!(!own.is_empty(), "{}", solver.name());
        for run in own {
            if run["refused"].is_null() {
                let last = run["looks"].as_array().unwrap().last().unwrap();
                let [error, bound] = ["error", "bound"].map(|f| last[f].as_f64().unwrap());
                assert!(error <= bound + 1e-9 && bound <= 5e-4, "{run}");
                assert!(
                    run["passes_to_tolerance"].as_f64().unwrap() >= run["passes_to_error"].as_f64().unwrap(),
                    "{run}"
                );
            }
        }
    }
}

#[test]
fn form_factors_are_held_against_closed_forms() {
    let folder = Folder::new();
    let chart = charted(&folder, "--budget 60s --sweep form-factors");
    let runs = chart["form_factors"]["runs"].as_array().unwrap_or_else(|| panic!("{chart}"));
    let errors = |name: &str| -> Vec<f64> {
        let own = runs.iter().filter(|r| r["form_factors"] == name);
        own.map(|r| r["error"].as_f64().unwrap()).collect()
    };
    let (rays, hemicube) = (errors("rays"), errors("hemicube"));
    assert_eq!([rays.len(), hemicube.len()], [5, 5]);
    // Four times the rays, half the error.
    for halved in rays.windows(2).map(|e| e[0] / e[1]) {
        assert!((1.5..2.7).contains(&halved), "{rays:?}");
    }
    assert!(hemicube.is_sorted_by(|a, b| a > b), "{hemicube:?}");
    assert!(written(&folder).contains(&"form_factors.svg".into()));
}

#[test]
fn charts_are_whole_pictures() {
    let folder = Folder::new();
    let peers = json!({ "note": "by <hand> & eye", "curves": [{ "name": "Another", "points": [
        { "label": "few", "seconds": 2.5, "error": 0.2 }, { "label": "many", "seconds": 9, "error": 0.1, "dark": 0.3, "border": 0.1 }] }] });
    std::fs::write(folder.path("peers.json"), peers.to_string()).unwrap();
    charted(&folder, "--budget 60s --sweep solvers --sweep density --sweep patches --peers peers.json");
    let names = written(&folder);
    assert!(
        ["error.png", "error.svg", "patches.svg", "solvers.svg", "texels.svg"]
            .iter()
            .all(|n| names.contains(&(*n).into())),
        "{names:?}"
    );
    for name in names.iter().filter(|n| n.ends_with(".svg")) {
        let text = std::fs::read_to_string(folder.path("charts").join(name)).unwrap();
        let svg = roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let root = svg.root_element();
        let edge = |at: &str| root.attribute(at).unwrap().parse::<f32>().unwrap();
        let (width, height) = (edge("width"), edge("height"));
        assert!(root.descendants().any(|n| n.has_tag_name((root.tag_name().namespace().unwrap(), "path"))), "{name}");
        // No letter is left to the machine's fonts, and nothing refers to what is not there.
        assert!(!text.contains("<text") && !text.contains("NaN") && !text.contains("inf"), "{name}");
        let defined: Vec<&str> = root.descendants().filter_map(|n| n.attribute("id")).collect();
        let used = root.descendants().filter_map(|n| n.attribute("href"));
        used.for_each(|u| assert!(defined.contains(&u.trim_start_matches('#')), "{name}: {u}"));
        let png = std::fs::read(folder.path("charts").join(name.replace("svg", "png"))).unwrap();
        let [w, h] = [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as f32);
        assert_eq!((w, h), (2.0 * width, 2.0 * height), "{name}");
    }
    let error = std::fs::read_to_string(folder.path("charts/error.svg")).unwrap();
    assert!(error.contains("aria-label=\"Another\"") && error.contains("by &lt;hand&gt; &amp; eye"));
}

#[test]
fn the_budget_ends_it_and_what_is_missing_is_named() {
    let folder = Folder::new();
    let said = chart(&folder, "--budget .01s");
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("the budget leaves out rays: "), "{}", said.err);
    // The first bake and the shortest audit take longer than that.
    let none: Value = serde_json::from_slice(&std::fs::read(folder.path("charts/chart.json")).unwrap()).unwrap();
    assert_eq!(points(&none).len(), 1, "{none}");
    for sweep in luxel::chart::Sweep::ALL.map(|s| s.name()) {
        assert!(none["left_out"].as_array().unwrap().iter().any(|l| l["sweep"] == sweep), "{sweep}");
    }
    // A truth that is there takes nothing of a budget: it ends where nothing is left to do.
    let said = folder.luxel("bake room.gltf -o truth.glb --resolution 32 --rays 64 --quiet");
    assert_eq!(said.code, 0, "{}", said.err);
    let only = charted(&folder, "--budget 60m --sweep solvers --truth truth.glb");
    assert!(points(&only).iter().skip(1).all(|p| p["sweep"] == "solvers") && points(&only).len() > 2, "{only}");
    assert!(points(&only)[0]["sweep"] == "rays" && only["patches"].is_null());
}

/// Hundreds of threads on a few processors would spend their time waking one another.
#[test]
fn a_thousand_threads_are_four_a_processor_at_most() {
    let chart = charted(&Folder::new(), "--budget .01s --threads 1000");
    let processors = std::thread::available_parallelism().unwrap().get();
    assert_eq!(chart["threads_used"], 1000.min(4 * processors));
}

#[test]
fn a_baked_file_may_be_the_truth() {
    let folder = Folder::new();
    let bake = |edge: u32| {
        let said =
            folder.luxel(&format!("bake room.gltf -o {edge}.glb --resolution {edge} --rays 1024 --float --quiet"));
        assert_eq!(said.code, 0, "{}", said.err);
    };
    [32, 64].into_iter().for_each(bake);
    let chart = charted(&folder, "--budget 60m --sweep rays --truth 32.glb");
    assert_eq!(chart["truth"]["by"], "32.glb");
    for point in points(&chart) {
        assert!(point["error"] == point["error_low"] && point["error"] == point["error_high"], "{point}");
    }
    let error = |name: &str| points(&chart).iter().find(|p| p["name"] == name).unwrap()["error"].as_f64().unwrap();
    // The same rays, but that shadow rays are fewer.
    assert!(error("rays, used again, 1024") < 0.2 * error("rays, used once, 4"));
    // Sizes of patches have layouts of their own: they are held against an audit in any case.
    let chart = charted(&folder, "--budget 20s --sweep patches --truth 32.glb");
    assert!(chart["patches"]["levels"].as_array().is_some_and(|l| l.len() == 2), "{}", chart["patches"]);
    assert!(chart["patches"]["points"].as_u64().is_some_and(|n| n > 50), "{}", chart["patches"]);
    let other = Folder::new();
    std::fs::copy(folder.path("64.glb"), other.path("64.glb")).unwrap();
    let said = self::chart(&other, "--budget 1s --truth 64.glb");
    assert!(said.code == 3 && said.err.contains("laid out otherwise") && said.err.contains("\n  "), "{}", said.err);
    assert!(!other.path("charts").exists());
}

#[cfg(unix)]
#[test]
fn an_interrupted_chart_writes_nothing() {
    let folder = Folder::new();
    let mut command = folder.command("chart room.gltf -o charts --resolution 128 --budget 60s");
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    assert!(lines.any(|line| line.unwrap().starts_with("truth")));
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(folder.files(), ["room.gltf"]);
}

#[test]
fn what_makes_no_sense_is_wrong_usage() {
    let folder = Folder::new();
    for options in [
        "chart",
        "chart room.gltf",
        "chart room.gltf -o charts --budget 0",
        "chart room.gltf -o charts --budget 1h",
        "chart room.gltf -o charts --sweep everything",
        "chart room.gltf -o charts --resolution 15",
        "chart room.gltf -o charts --keep-uv --unwrap uvunwrap",
        "chart room.gltf -o charts --rays 16",
        "chart room.gltf -o charts --threads 0",
        "chart room.gltf -o room.gltf",
    ] {
        let said = folder.luxel(options);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{options}: {}", said.err);
    }
    assert_eq!(folder.files(), ["room.gltf"]);
}

#[test]
fn bad_inputs_are_named() {
    let folder = Folder::new();
    let point = |seconds: &str| {
        format!(
            r#"{{"note": "", "curves": [{{"name": "A", "points": [{{"label": "b", "seconds": {seconds}, "error": 1}}]}}]}}"#
        )
    };
    for (peers, named) in [
        ("{", "peers.json"),
        ("[]", "peers.json"),
        (r#"{"note": "", "curves": [], "more": 1}"#, "more"),
        (&point("-1"), "\"A\", \"b\""),
        (&point("0"), "above 0"),
        (&point("1e999"), "peers.json"),
    ] {
        std::fs::write(folder.path("peers.json"), peers).unwrap();
        let said = chart(&folder, "--budget 1s --peers peers.json");
        assert!(said.code == 3 && said.err.contains(named) && said.err.contains("\n  "), "{peers}: {}", said.err);
    }
    for options in ["--peers none.json", "--truth none.glb", "--truth room.gltf", "--keep-uv"] {
        let said = chart(&folder, &format!("--budget 1s {options}"));
        assert_eq!((said.code, said.out.as_str()), (3, ""), "{options}: {}", said.err);
    }
    assert_eq!(folder.luxel("chart none.glb -o charts").code, 3);
    assert_eq!(folder.luxel("chart room.gltf -o none/charts").code, 1);
    assert!(!folder.path("charts").exists());
}
