//! Methods and efforts: what they report, and what works with what.

use super::*;

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
