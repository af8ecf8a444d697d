//! The file that looks lit in every viewer.

use super::*;
use glam::Vec2;
use luxel::scene::{Material, Texture, TextureRef, Wrap};

#[test]
fn the_flat_file_shows_radiance_on_page_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = rich();
    b.json["nodes"][0]["translation"] = json!([1.0, 2.0, 3.0]);
    b.push("nodes", json!({ "mesh": 0, "name": "again" }));
    let source = b.document(&folder.path().join("in.glb"));
    let mut scene = scene(&source);
    // A sheared one: its positions have to be its own.
    scene.instances[1].transform.matrix3.y_axis.x = 0.5;
    let atlas = atlas(&scene, Plan::Triangles);
    let pages = vec![(UVec2::new(8, 4), vec![Vec3::new(0.25, 1.0, 4.0); 32]); 2];
    let out = folder.path().join("flat.glb");
    let notes = write_flat(&source, &scene, &atlas, &pages, 1.0, &out).unwrap();
    keep(&out);
    assert_eq!(notes.len(), 1);
    let flat = load(&out);
    assert_eq!(flat.json["nodes"][1]["name"], "again");
    assert_eq!(flat.json["nodes"][0]["matrix"][13], 2.0);
    assert!(flat.json["nodes"][1]["matrix"].is_null());
    let uv = numbers(&flat, &attributes(&flat, 0)["TEXCOORD_0"]);
    assert_eq!(uv[..2], [0.25, 0.75]);
    assert_eq!(flat.json["meshes"][1]["primitives"][0]["material"], 2);
    let sheared = numbers(&flat, &attributes(&flat, 1)["POSITION"]);
    assert_eq!(sheared[6..9], [1.5, 1.0, 0.0]);
}

#[test]
fn the_flat_file_shows_unlit_surfaces_in_their_own_colour() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = Builder::new();
    let (lit, unlit) = (b.square(1), b.square(1));
    b.shown(json!([lit, unlit]));
    b.shown(json!([unlit]));
    let source = b.document(&folder.path().join("in.glb"));
    let mut scene = scene(&source);
    let picture =
        Texture::new(UVec2::new(2, 1), vec![[255, 0, 0, 255], [0, 0, 255, 128]], true, [Wrap::Repeat; 2], true);
    scene.textures.push(picture);
    let base_texture = Some(TextureRef { texture: 0, set: 0, transform: glam::Affine2::from_scale(Vec2::splat(2.0)) });
    let base_color = glam::Vec4::new(1.0, 0.5, 0.25, 1.0);
    scene.materials.push(Material { base_color, base_texture, unlit: true, ..Material::default() });
    scene.meshes[0].primitives[1].material = 1;
    scene.meshes[1].primitives[0].material = 1;
    for mesh in &mut scene.meshes {
        mesh.uvs = vec![(0..mesh.positions.len()).map(|v| Vec2::splat(v as f32)).collect()];
    }
    let mut atlas = atlas(&scene, Plan::Whole);
    atlas.placements[1] = None;
    atlas.layouts[1] = Default::default();
    let pages = vec![(UVec2::new(8, 4), vec![Vec3::ONE; 32]); 2];
    let out = folder.path().join("flat.glb");
    write_flat(&source, &scene, &atlas, &pages, 1.0, &out).unwrap();
    keep(&out);
    let flat = load(&out);
    assert_eq!(flat.json["nodes"].as_array().unwrap().len(), 2);
    let drawn = [&flat.json["meshes"][0]["primitives"][1], &flat.json["meshes"][1]["primitives"][0]];
    assert_eq!(flat.json["meshes"][0]["primitives"][0]["material"], 0);
    for primitive in drawn {
        let material = &flat.json["materials"][primitive["material"].as_u64().unwrap() as usize];
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
        let pbr = &material["pbrMetallicRoughness"];
        assert_eq!(pbr["baseColorFactor"], json!([1.0, 0.5, 0.25, 1.0]));
        let texture = &flat.json["textures"][pbr["baseColorTexture"]["index"].as_u64().unwrap() as usize];
        let image = &flat.json["images"][texture["source"].as_u64().unwrap() as usize];
        let view = &flat.json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let bytes = &flat.buffers[0][start..start + view["byteLength"].as_u64().unwrap() as usize];
        assert_eq!(luxel::pixels::decode(bytes).unwrap().rgba[0], [255, 0, 0, 255]);
        // The texture's transform is in the coordinates.
        let uv = numbers(&flat, &primitive["attributes"]["TEXCOORD_0"]);
        assert_eq!(uv[2] - uv[0], 2.0);
        assert_eq!(numbers(&flat, &primitive["indices"]).len(), 6);
    }
    let materials = flat.json["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 2 * pages.len() + 1, "each material once");
}
