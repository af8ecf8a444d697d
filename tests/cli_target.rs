//! `luxel bake` to a target: `--error`, `--time`, `--quality`.

mod program;

use program::Folder;
use serde_json::Value;

/// The report of a bake of the room with these options, and the exit code.
fn bake(folder: &Folder, options: &str) -> (i32, Value) {
    let said = folder.luxel(&format!("bake room.gltf -o lit.glb --resolution 32 --quiet --report - {options}"));
    let report = serde_json::from_str(&said.out).unwrap_or_else(|e| panic!("{options}: {e}\n{}", said.err));
    (said.code, report)
}

#[test]
fn an_easy_target_is_reached_with_few_rays() {
    for options in ["--error 50%", "--error .5", "--quality preview"] {
        let (code, report) = bake(&Folder::new(), options);
        let target = &report["target"];
        assert_eq!((code, &target["reached"]), (0, &Value::Bool(true)), "{options}: {target}");
        let last = target["looks"].as_array().unwrap().last().unwrap();
        assert!(last["high"].as_f64() <= target["error"].as_f64(), "{options}: {target}");
        assert!(last["rays"].as_u64().unwrap() <= 64, "{options}: {target}");
        // The figure that is told comes from other points than those that decided.
        assert_ne!(report["audit"]["error"]["value"], last["error"]);
    }
}

/// Texels of 32 to a page: their own size bounds no texel's mean, but rays do.
#[test]
fn a_target_that_is_missed_is_an_exit_code_if_it_was_typed() {
    let folder = Folder::new();
    let (code, report) = bake(&folder, "--error .001%");
    assert_eq!((code, &report["target"]["reached"]), (4, &Value::Bool(false)));
    assert!(report["warnings"].to_string().contains("was not reached"), "{}", report["warnings"]);
    assert_eq!(folder.files(), ["lit.glb", "room.gltf"], "the output is written");
    let looks = report["target"]["looks"].as_array().unwrap();
    let rays: Vec<u64> = looks.iter().map(|l| l["rays"].as_u64().unwrap()).collect();
    assert!(rays.len() > 1 && rays.is_sorted_by(|a, b| a < b), "{rays:?}");
}

/// Once as few rays as there are at first, then more.
#[test]
fn progress_tells_attempts_apart() {
    let said = Folder::new().luxel("bake room.gltf --resolution 32 --error .001%");
    let rays = said.err.lines().filter_map(|line| line.strip_suffix(" rays: transport ...")?.parse().ok());
    let rays: Vec<u32> = rays.collect();
    assert!(rays.len() > 1 && rays[0] == 16 && rays.is_sorted_by(|a, b| a < b), "{}", said.err);
    assert!(said.err.contains("\n16 rays: audit ...\n"), "{}", said.err);
    let fixed = Folder::new().luxel("bake room.gltf --resolution 32 --rays 4");
    assert!(fixed.err.contains("\ntransport ...\n"), "{}", fixed.err);
}

#[test]
fn two_per_cent_is_what_nobody_has_to_type() {
    let (code, report) = bake(&Folder::new(), "");
    assert_eq!((code, report["target"]["error"].as_f64()), (0, Some(0.02)));
    let (_, fixed) = bake(&Folder::new(), "--rays 4");
    assert_eq!((&fixed["target"], &fixed["audit"]), (&Value::Null, &Value::Null));
}

#[test]
fn time_ends_a_bake() {
    let (code, report) = bake(&Folder::new(), "--time 1s");
    let target = &report["target"];
    assert_eq!((code, &target["error"], &target["looks"]), (0, &Value::Null, &Value::Array(vec![])));
    assert!(report["audit"]["error"]["value"].is_f64(), "{}", report["audit"]);
    // Both: the error comes first.
    let (code, report) = bake(&Folder::new(), "--time 1000s --error 50%");
    assert_eq!((code, &report["target"]["reached"]), (0, &Value::Bool(true)));
}

/// The audit looks at all texels, wherever rows were measured.
#[test]
fn targets_work_with_rows_at_some_texels() {
    for (options, expected) in [("--error 5%", 0), ("--error .001%", 4), ("--time 2s", 0)] {
        let (code, report) = bake(&Folder::new(), &format!("{options} --receivers auto"));
        let (target, error) = (&report["target"], &report["audit"]["error"]);
        assert_eq!(
            (code, &target["reached"]),
            (expected, &Value::Bool(options == "--error 5%")),
            "{options}: {target}"
        );
        let [receivers, texels, rays] = ["receivers", "texels", "adaptive_rays"].map(|f| report[f].as_u64().unwrap());
        assert!(receivers < texels, "{options}: {receivers} of {texels}");
        let [low, value, high] = ["low", "value", "high"].map(|f| error[f].as_f64().unwrap());
        assert!(low <= value && value <= high && value < 0.05, "{options}: {error}");
        assert!(
            target["looks"].as_array().unwrap().last().is_none_or(|look| look["rays"] == rays),
            "{options}: {target}"
        );
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let files = [1, 3].map(|threads| {
        let folder = Folder::new();
        bake(&folder, &format!("--error 5% --threads {threads}"));
        std::fs::read(folder.path("lit.glb")).unwrap()
    });
    assert!(files[0] == files[1]);
}

#[test]
fn targets_and_fixed_efforts_exclude_each_other() {
    let pairs = ["--error 2% --rays 4", "--time 1s --rays 4", "--quality high --rays 4", "--error 2% --bounces 1"];
    for options in pairs.into_iter().chain(["--error 2% --quality high", "--error 0", "--error 101%", "--quality best"])
    {
        let said = Folder::new().luxel(&format!("bake room.gltf {options}"));
        assert_eq!(said.code, 2, "{options}: {}", said.err);
    }
}
