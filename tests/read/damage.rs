//! Damaged copies of a good file, and good files made by others.

use super::*;
use luxel::{
    atlas::{self, Density},
    bake::{Options, bake},
    gltf::{WriteOptions, write},
    progress::Silent,
    scene::Sky,
};
use std::path::Path;

/// A small generator, so that every run damages alike (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) % n as u64) as usize
    }
}

fn sample() -> Builder {
    let mut b = Builder::textured();
    b.light(json!({ "type": "spot", "spot": { "innerConeAngle": 0.1 } }), json!({ "translation": [0, 0, 2] }));
    let at = b.view(&[1]);
    let value = b.view(&[0; 12]);
    let sparse = json!({ "count": 1, "indices": { "bufferView": at, "componentType": 5121 }, "values": { "bufferView": value } });
    b.json["accessors"][0]["sparse"] = sparse;
    b.push("samplers", json!({ "wrapS": 33071 }));
    b.json["textures"][0]["sampler"] = json!(0);
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }));
    b.root(json!({ "camera": 0, "children": [3], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }));
    b.push("nodes", json!({ "mesh": 0, "extras": { "luxel.static": true } }));
    b
}

/// Bakes and writes some of what could be read: its light must be finite.
#[derive(Default)]
struct Bakery {
    baked: usize,
}

impl Bakery {
    fn take(&mut self, input: Result<Input, Error>) {
        let Ok(mut input) = input else { return };
        if self.baked >= 300 {
            return;
        }
        self.baked += 1;
        input.scene.sky = Sky::Uniform(Vec3::ONE);
        let atlas = atlas::Options { density: Density::Resolution(16), ..Default::default() };
        let Ok(baked) = bake(
            &input.scene,
            &Options { atlas, transport: luxel::transport::Options::of(4), ..Default::default() },
            &Silent,
        ) else {
            return;
        };
        let finite = baked.lightmaps.pages.iter().flat_map(|p| &p.irradiance).all(|e| e.is_finite());
        assert!(finite, "{:#}", input.document.json);
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out.glb");
        let (atlas, maps, report) = (&baked.atlas, &baked.lightmaps, &baked.report);
        match write(&input.document, &input.scene, atlas, maps, report, &WriteOptions::default(), &out) {
            Ok(_) => assert!(out.is_file()),
            // The writer takes along arrays that no light needs and the reader did not look at.
            Err(e) => assert!(e.exit_code() == 3 && !out.exists(), "{e}"),
        }
    }
}

/// Every number of a document.
fn numbers(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Number(_) => vec![value],
        Value::Array(items) => items.iter_mut().flat_map(numbers).collect(),
        Value::Object(items) => items.iter_mut().flat_map(|(_, v)| numbers(v)).collect(),
        _ => vec![],
    }
}

#[test]
fn damaged_bytes_give_an_answer() {
    let whole = sample().glb();
    assert!(try_bytes(&whole, &ReadOptions::default()).is_ok());
    let (mut random, mut bakery) = (Random(1), Bakery::default());
    for _ in 0..600 {
        let mut bytes = whole.clone();
        for _ in 0..1 + random.below(4) {
            let at = random.below(bytes.len());
            bytes[at] = if random.below(2) == 0 { random.below(256) as u8 } else { bytes[at] ^ 1 << random.below(8) };
        }
        if random.below(8) == 0 {
            bytes.truncate(random.below(bytes.len()));
        }
        bakery.take(try_bytes(&bytes, &ReadOptions::default()));
    }
}

#[test]
fn damaged_numbers_give_an_answer() {
    let whole = sample();
    let values = [
        json!(0),
        json!(1),
        json!(-1),
        json!(2),
        json!(255),
        json!(65536),
        json!(5121),
        json!(5126),
        json!(u32::MAX),
        json!(1u64 << 32),
        json!(i64::MAX),
        json!(u64::MAX),
        json!(0.5),
        json!(1e38),
        json!(-1e300),
        json!("x"),
        json!(null),
        json!([]),
        json!({}),
    ];
    let (mut random, mut bakery) = (Random(2), Bakery::default());
    let count = numbers(&mut whole.json.clone()).len();
    for i in 0..count {
        for value in &values {
            let mut b = whole.clone();
            *numbers(&mut b.json)[i] = value.clone();
            if random.below(4) == 0 {
                *numbers(&mut b.json).remove(0) = value.clone();
            }
            bakery.take(attempt(&b));
        }
    }
}

#[test]
fn scenes_of_others() {
    let Ok(folder) = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes")) else { return };
    let mut paths: Vec<_> = folder.map(|f| f.unwrap().path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "glb"));
    for path in paths {
        let input = read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let s = &input.scene;
        let triangles: usize = s.instances.iter().map(|i| s.meshes[i.mesh as usize].triangles.len()).sum();
        assert!(triangles > 0 && s.origin.is_finite());
        println!(
            "{}: {} meshes, {} instances, {triangles} triangles, {} materials, {} textures, {} lights, {:?}",
            path.display(),
            s.meshes.len(),
            s.instances.len(),
            s.materials.len(),
            s.textures.len(),
            s.lights.len(),
            input.warnings
        );
    }
}
