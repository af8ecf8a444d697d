//! Who reads which texture coordinates.

use super::*;

#[test]
fn a_set_that_is_read_moves_and_its_textures_are_repointed() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let texture = b.texture();
    let material = |set: Value| json!({ "name": "Marble", "pbrMetallicRoughness": { "baseColorTexture": set } });
    let plain = b.push("materials", material(json!({ "index": texture, "texCoord": 1 })));
    let transformed = json!({ "index": texture, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } });
    let transformed = b.push("materials", material(transformed));
    for (sets, material) in [(2, plain), (3, plain), (2, transformed), (2, usize::MAX)] {
        let mut square = b.square(sets);
        if material != usize::MAX {
            square["material"] = material.into();
        }
        b.shown(json!([square]));
    }
    // A mesh that is not laid out keeps the material as it was.
    let mut square = b.square(2);
    square["material"] = plain.into();
    b.push("meshes", json!({ "primitives": [square] }));
    b.json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    let source = b.document(&folder.path().join("in.glb"));
    for plan in [Plan::Whole, Plan::Triangles] {
        let out = folder.path().join("out.glb");
        let scene = scene(&source);
        let mut atlas = atlas(&scene, plan);
        atlas.layouts[4] = Default::default();
        let maps = lightmaps(&atlas, 1.0);
        let notes = write(&source, &scene, &atlas, &maps, &Report::default(), &options(), &out).unwrap();
        keep(&out);
        let baked = load(&out);
        assert_eq!(notes.notes.len(), 3, "{notes:?}");
        let set = |mesh: usize| {
            let m = baked.json["meshes"][mesh]["primitives"][0]["material"].as_u64().unwrap() as usize;
            let info = &baked.json["materials"][m]["pbrMetallicRoughness"]["baseColorTexture"];
            let moved = info["extensions"]["KHR_texture_transform"]["texCoord"].as_u64();
            (m, moved.or(info["texCoord"].as_u64()).unwrap())
        };
        assert_eq!([set(0), set(1), set(2), set(4)], [(2, 2), (3, 3), (1, 2), (0, 1)]);
        let names = |mesh: usize| attributes(&baked, mesh).as_object().unwrap().len();
        assert_eq!([names(0), names(1), names(2), names(3)], [5, 6, 5, 4]);
        for (mesh, to) in [(0, 2), (1, 3)] {
            let old = numbers(&source, &attributes(&source, mesh)["TEXCOORD_1"]);
            let new = numbers(&baked, &attributes(&baked, mesh)[format!("TEXCOORD_{to}")]);
            assert_eq!(old[..6], new[..6]);
        }
    }
}

#[test]
fn a_missing_first_set_is_made_and_a_rebake_makes_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let square = b.square(0);
    b.shown(json!([square]));
    let source = b.document(&folder.path().join("in.glb"));
    let out = folder.path().join("out.glb");
    let (baked, _) = bake(&source, Plan::Whole, &options(), &out);
    assert_eq!(attributes(&baked, 0)["TEXCOORD_0"], attributes(&baked, 0)["TEXCOORD_1"]);
    let (again, _) = bake(&baked, Plan::Triangles, &options(), &out);
    assert_eq!(attributes(&again, 0)["TEXCOORD_0"], attributes(&again, 0)["TEXCOORD_1"]);
    assert_eq!(numbers(&again, &attributes(&again, 0)["TEXCOORD_0"]).len(), 12);
}

/// Every mesh has a material of its own, which reads the set that moves.
#[test]
fn many_materials_are_repointed() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let texture = b.texture();
    let square = b.square(2);
    for _ in 0..5000 {
        let slot = json!({ "index": texture, "texCoord": 1 });
        let mut own = square.clone();
        own["material"] = b.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": slot } })).into();
        b.shown(json!([own]));
    }
    let source = b.document(&folder.path().join("in.glb"));
    let (baked, notes) = bake(&source, Plan::Whole, &options(), &folder.path().join("out.glb"));
    assert_eq!(notes.len(), 5000);
    let materials = baked.json["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 5000, "none is shared, so none is copied");
    assert!(materials.iter().all(|m| m["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] == 2));
}
