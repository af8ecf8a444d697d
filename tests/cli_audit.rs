//! `luxel audit` and `luxel bake --audit`: what the program does with baked files, whole and damaged.

mod program;

use program::{Folder, Said};
use serde_json::{Value, json};

const QUICK: &str = "--resolution 32 --rays 16 --quiet";
const FEW: &str = "--points 20 --quiet";

/// The room, baked with `options` to lit.gltf and lit.glb.
fn baked(options: &str) -> Folder {
    let folder = Folder::new();
    for out in ["lit.gltf", "lit.glb"] {
        let said = folder.luxel(&format!("bake room.gltf -o {out} {QUICK} {options}"));
        assert_eq!(said.code, 0, "{}", said.err);
    }
    folder
}

/// Changes the JSON of lit.gltf.
fn change(folder: &Folder, change: impl FnOnce(&mut Value)) {
    let path = folder.path("lit.gltf");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    std::fs::write(path, json.to_string()).unwrap();
}

fn figures(said: &Said) -> Value {
    assert_eq!(said.code, 0, "{}", said.err);
    let mut json: Value = serde_json::from_str(&said.out).unwrap();
    json["seconds"] = Value::Null;
    json
}

#[test]
fn a_baked_file_needs_no_options() {
    let folder = baked("--sky .5,.6,.7 --sun 30,50,3 --max-reflectance .4 --exclude Nobody* --light-scale 2");
    let [glb, gltf] =
        ["lit.glb", "lit.gltf"].map(|f| figures(&folder.luxel(&format!("audit {f} --points 80 --quiet --report -"))));
    assert_eq!(glb, gltf, "pages in the file and beside it are the same");
    let bias = |json: &Value| [&json["bias"]["low"], &json["bias"]["high"]].map(|x| x.as_f64().unwrap());
    let [low, high] = bias(&glb);
    assert!(low < 0.03 && high > -0.03 && high - low < 0.2, "{low} to {high}");
    // Under another sky the map is wrong.
    let dark = figures(&folder.luxel("audit lit.glb --points 80 --quiet --report - --sky 0,0,0"));
    assert!(bias(&dark)[0] > 0.1, "{dark}");
}

#[test]
fn any_number_of_threads_finds_the_same() {
    let folder = baked("");
    let [one, three] = [1, 3].map(|n| figures(&folder.luxel(&format!("audit lit.glb {FEW} --report - --threads {n}"))));
    assert_eq!(one, three);
}

#[test]
fn a_bake_may_audit_itself() {
    let folder = Folder::new();
    let said = folder.luxel(&format!("bake room.gltf -o a.glb {QUICK} --audit --report a.json"));
    assert_eq!(said.code, 0, "{}", said.err);
    let line = said.out.lines().find(|l| l.starts_with("audit ")).expect("a line");
    assert!(line.contains("error") && line.contains("bias") && line.contains("95 % intervals"), "{line}");
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path("a.json")).unwrap()).unwrap();
    assert!(report["audit"]["error"]["high"].is_f64() && report["texels"].is_u64());
    // The audit is no part of the lit file: its bytes are those of a bake without it.
    folder.luxel(&format!("bake room.gltf -o b.glb {QUICK}"));
    assert!(std::fs::read(folder.path("a.glb")).unwrap() == std::fs::read(folder.path("b.glb")).unwrap());
}

#[test]
fn light_that_was_dropped_is_told() {
    let folder = baked("--bounces 0");
    assert!(folder.luxel(&format!("audit lit.glb {FEW}")).err.contains("after 0 bounces"));
}

#[test]
fn files_that_are_not_baked_are_refused() {
    let folder = Folder::new();
    let said = folder.luxel("audit room.gltf");
    assert_eq!((said.code, said.out.as_str()), (3, ""));
    assert!(said.err.contains("has no lightmap") && said.err.contains("luxel bake"), "{}", said.err);
    assert_eq!(folder.luxel("audit none.glb").code, 3);
    assert_eq!(folder.files(), ["room.gltf"]);
}

#[test]
fn damaged_lightmaps_are_refused_by_their_part() {
    let ext = |json: &mut Value| json["extensions"]["LUXEL_lightmap"].take();
    type Change = fn(&mut Value, Value);
    let cases: [(&str, Change); 11] = [
        ("pages", |json, _| json["extensions"]["LUXEL_lightmap"] = json!({ "pages": [] })),
        ("not one of the file's", |json, root| {
            json["nodes"][0]["extensions"]["LUXEL_lightmap"]["page"] = 7.into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("makes no sense", |json, root| {
            json["nodes"][0]["extensions"]["LUXEL_lightmap"]["offset"] = json!([0]);
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("outside of the page", |json, root| {
            json["nodes"][0]["extensions"]["LUXEL_lightmap"]["offset"] = json!([0, 5]);
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("TEXCOORD_3", |json, root| {
            json["nodes"][0]["extensions"]["LUXEL_lightmap"]["texCoord"] = 3.into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("cannot be read", |json, mut root| {
            root["pages"][0]["uri"] = "gone.exr".into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("in a bufferView or at a uri", |json, mut root| {
            root["pages"][0]["bufferView"] = 0.into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("its encoding is \"radiance\"", |json, mut root| {
            root["pages"][0]["encoding"] = "radiance".into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("its scale is not a number above 0", |json, mut root| {
            root["pages"][0]["scale"] = (-1).into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("is 32 x 32, not 64 x 32", |json, mut root| {
            root["pages"][0]["width"] = 64.into();
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
        ("bufferView is broken", |json, mut root| {
            root["pages"][0] = json!({ "bufferView": 999, "width": 32, "height": 32 });
            json["extensions"]["LUXEL_lightmap"] = root;
        }),
    ];
    for (named, damage) in cases {
        let folder = baked("");
        change(&folder, |json| {
            let root = ext(json);
            damage(json, root);
        });
        unreadable(&folder, named);
    }
}

#[test]
fn a_scene_without_its_baked_light_is_refused() {
    let folder = baked("");
    change(&folder, |json| json["extensions"]["LUXEL_lightmap"]["bakedLights"] = json!([0]));
    refused(&folder, "its baked light is gone");
}

#[test]
fn truncated_pages_are_refused() {
    let folder = baked("");
    let page = folder.path("lit.page0.exr");
    let bytes = std::fs::read(&page).unwrap();
    for length in [0, 40, 300, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&page, &bytes[..length]).unwrap();
        unreadable(&folder, "damaged");
    }
}

#[test]
fn a_sky_that_moved_is_asked_for() {
    let folder = Folder::new();
    let sky = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".bytes().chain([128, 128, 128, 129].repeat(8));
    std::fs::write(folder.path("sky.hdr"), sky.collect::<Vec<u8>>()).unwrap();
    let said = folder.luxel(&format!("bake room.gltf -o lit.gltf {QUICK} --sky sky.hdr,2,30"));
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!(folder.luxel(&format!("audit lit.gltf {FEW}")).code, 0);
    std::fs::rename(folder.path("sky.hdr"), folder.path("moved.hdr")).unwrap();
    refused(&folder, "--sky FILE,2,30");
    assert_eq!(folder.luxel(&format!("audit lit.gltf {FEW} --sky moved.hdr,2,30")).code, 0);
}

#[test]
fn the_report_spares_the_baked_file() {
    let folder = baked("");
    let said = folder.luxel(&format!("audit lit.glb {FEW} --report lit.glb"));
    assert_eq!(said.code, 2, "{}", said.err);
    assert_eq!(folder.luxel(&format!("audit lit.glb {FEW} --report a.json")).code, 0);
}

#[test]
fn what_is_out_of_range_is_wrong_usage() {
    let folder = Folder::new();
    for options in ["--points 9", "--points -1", "--time 0", "--time 1h", "--points 20 --time 3", "--seed x"] {
        assert_eq!(folder.luxel(&format!("audit lit.glb {options}")).code, 2, "{options}");
    }
}

#[track_caller]
fn refused(folder: &Folder, named: &str) {
    says_what_to_do(folder, &format!("audit lit.gltf {FEW}"), named);
}

/// Refused by everything that reads baked files.
fn unreadable(folder: &Folder, named: &str) {
    let before = folder.files();
    refused(folder, named);
    says_what_to_do(folder, "render lit.gltf -o a.png", named);
    says_what_to_do(folder, "inspect lit.gltf -o a", named);
    assert_eq!(folder.files(), before);
}

fn says_what_to_do(folder: &Folder, arguments: &str, named: &str) {
    let said = folder.luxel(arguments);
    assert_eq!((said.code, said.out.as_str()), (3, ""), "{arguments}, {named}: {}", said.err);
    assert!(said.err.contains(named) && said.err.contains("\n  "), "{arguments}, {named}: {}", said.err);
}
