//! Outputs that are baked again.

use super::*;

#[test]
fn baking_again_replaces_and_does_not_grow() {
    for plan in [Plan::Whole, Plan::Triangles] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out.glb");
        let mut document = rich().document(&folder.path().join("in.glb"));
        let mut files = Vec::new();
        for _ in 0..4 {
            document = bake(&document, plan, &options(), &out).0;
            files.push(std::fs::read(&out).unwrap());
            assert_eq!(secret(&document), b"secret bytes");
        }
        assert!(
            files.iter().all(|f| f.len() == files[0].len()),
            "{:?}",
            files.iter().map(Vec::len).collect::<Vec<_>>()
        );
        assert_eq!(files[2], files[3]);
        // Fewer pages: the rest of the old ones goes.
        let scene = scene(&document);
        let mut atlas = atlas(&scene, plan);
        atlas.pages.truncate(1);
        let maps = lightmaps(&atlas, 1.0);
        write(&document, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
        assert!(std::fs::metadata(&out).unwrap().len() < files[0].len() as u64);
        let document = load(&out);
        assert_eq!(document.json["extensions"]["LUXEL_lightmap"]["pages"].as_array().unwrap().len(), 1);
    }
}

#[test]
fn slots_that_others_follow_stay_and_are_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.glb");
    let (mut document, _) = bake(&rich().document(&folder.path().join("in.glb")), Plan::Whole, &options(), &out);
    // Another tool adds a view of its own behind the pages.
    let views = document.json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteLength": 4 }));
    let count = views.len();
    document.json["extensions"]["ACME_blob"]["bufferView"] = (count - 1).into();
    let scene = scene(&document);
    let mut few = atlas(&scene, Plan::Whole);
    few.pages.truncate(1);
    write(&document, &scene, &few, &lightmaps(&few, 1.0), &Report::default(), &options(), &out).unwrap();
    keep(&out);
    let views = |d: &Document| d.json["bufferViews"].as_array().unwrap().clone();
    let less = load(&out);
    assert_eq!(views(&less).len(), count);
    assert_eq!(views(&less).iter().filter(|v| v["name"] == "luxel: unused").count(), 1);
    let (more, _) = bake(&less, Plan::Whole, &options(), &out);
    assert_eq!(views(&more).len(), count);
    assert!(views(&more).iter().all(|v| v["name"].is_null()));
}
