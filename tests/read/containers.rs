//! GLB and .gltf, buffers and files beside them.

use super::*;
use base64::Engine;
use common::gltf::glb;

#[test]
fn glb_is_read_and_its_json_kept() {
    let mut b = Builder::square();
    b.json["extensions"] = json!({ "VENDOR_x": { "a": [1, 2.5, null] } });
    let input = ok(&b);
    assert!(input.document.external.is_empty());
    assert_eq!(input.document.json["extensions"], b.json["extensions"]);
    assert!(input.document.buffers[0].starts_with(&b.bin));
    assert_eq!(input.warnings, Vec::<String>::new());
    let mesh = &input.scene.meshes[0];
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!(mesh.uvs[0][2], Vec2::new(1.0, 0.0));
    assert_eq!((mesh.source, mesh.primitives[0].uv_sets, mesh.primitives[0].vertices.clone()), (0, 1, 0..4));
    assert_eq!(input.scene.origin, DVec3::new(0.5, 0.5, 0.0));
    assert_eq!(input.scene.instances[0].transform.translation, DVec3::new(-0.5, -0.5, 0.0));
}

#[test]
fn gltf_with_escaped_file_names() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::textured();
    let picture = luxel::pixels::encode_png(glam::UVec2::ONE, &[[255, 0, 0]]).unwrap();
    b.json["images"][0] = json!({ "uri": "my%20picture.png" });
    b.json["buffers"] = json!([{ "byteLength": b.bin.len(), "uri": "a%20b.bin" }]);
    save(folder.path(), "a b.bin", &b.bin);
    save(folder.path(), "my picture.png", &picture);
    let path = save(folder.path(), "test.gltf", format!("\u{feff}{}", b.json).as_bytes());
    let input = read(&path, &ReadOptions::default()).unwrap();
    let external: Vec<&str> = input.document.external.iter().map(|e| e.uri.as_str()).collect();
    assert_eq!(external, ["a%20b.bin", "my%20picture.png"]);
    assert_eq!(input.scene.textures[0].sample(Vec2::ZERO, 0.0), Vec4::new(1.0, 0.0, 0.0, 1.0));
}

#[test]
fn data_uris() {
    let mut b = Builder::textured();
    let text = |bytes: &[u8], kind: &str| {
        format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
    };
    let picture = luxel::pixels::encode_png(glam::UVec2::ONE, &[[0, 0, 255]]).unwrap();
    b.json["images"][0] = json!({ "uri": text(&picture, "image/png") });
    b.json["buffers"] = json!([{ "byteLength": b.bin.len(), "uri": text(&b.bin, "application/octet-stream") }]);
    let input = try_bytes(b.json.to_string().as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(input.scene.textures[0].sample(Vec2::ZERO, 0.0).z, 1.0);
    b.json["buffers"][0]["uri"] = json!("data:x;base64,%%%");
    refuses(&b, &["buffer 0", "data URI"]);
}

#[test]
fn what_is_missing_is_named() {
    let missing = read(std::path::Path::new("/does/not/exist.glb"), &ReadOptions::default()).unwrap_err();
    assert!(matches!(missing, Error::Io { input: true, .. }) && missing.exit_code() == 3);
    let mut b = Builder::square();
    b.json["buffers"] = json!([{ "byteLength": b.bin.len(), "uri": "gone.bin" }]);
    refuses(&b, &["buffer 0", "gone.bin"]);
    b.json["buffers"] = json!([{ "byteLength": 10, "uri": "https://example.org/a.bin" }]);
    refuses(&b, &["remote"]);
    b.json["buffers"] = json!([{ "byteLength": 1_000_000_000_000u64 }]);
    refuses(&b, &["buffer 0", "cut off"]);
    b.json["buffers"] = json!([]);
    refuses(&b, &["buffer 0"]);
}

#[test]
fn damaged_containers() {
    let whole = Builder::square().glb();
    for end in [0, 3, 4, 11, 12, 15, 19, 20, 100, whole.len() - 5] {
        assert!(try_bytes(&whole[..end], &ReadOptions::default()).is_err(), "{end} bytes");
    }
    let mut b = Builder::square();
    b.json["asset"]["version"] = json!("1.0");
    refuses(&b, &["version 1.0"]);
    b.json["asset"] = json!({});
    refuses(&b, &["asset.version"]);
    assert!(try_bytes(&glb(b"[]", b""), &ReadOptions::default()).is_err());
    let deep = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"x\":{}", "[".repeat(200_000));
    assert!(try_bytes(&glb(deep.as_bytes(), b""), &ReadOptions::default()).is_err());
}
