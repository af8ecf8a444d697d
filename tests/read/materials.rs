//! Materials, textures, and the extensions that change them.

use super::*;
use glam::{Affine2, UVec2};
use luxel::{
    pixels::encode_png,
    scene::{Alpha, Material, TextureRef},
};

fn with(material: Value) -> Builder {
    let mut b = Builder::textured();
    b.json["materials"][0] = material;
    b
}

#[track_caller]
fn material(b: &Builder) -> Material {
    ok(b).scene.materials.remove(0)
}

#[test]
fn factors_and_defaults() {
    let m = material(&with(json!({})));
    assert_eq!((m.base_color, m.metallic, m.emission), (Vec4::ONE, 1.0, Vec3::ZERO));
    assert_eq!((m.alpha, m.double_sided, m.unlit, m.transmission), (Alpha::Opaque, false, false, 0.0));
    let m = material(&with(json!({
        "name": "lamp", "doubleSided": true, "alphaMode": "MASK", "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25 },
        "extensions": {
            "KHR_materials_emissive_strength": { "emissiveStrength": 10 },
            "KHR_materials_transmission": { "transmissionFactor": 0.5 },
            "KHR_materials_unlit": {}, "VENDOR_y": {}
        }
    })));
    assert_eq!((m.name.as_str(), m.metallic, m.transmission), ("material 0 \"lamp\"", 0.25, 0.5));
    assert_eq!((m.emission, m.base_color), (Vec3::new(10.0, 5.0, 0.0), Vec4::new(0.1, 0.2, 0.3, 0.4)));
    assert_eq!((m.alpha, m.double_sided, m.unlit), (Alpha::Mask(0.5), true, true));
    let m = material(&with(json!({ "alphaMode": "MASK", "alphaCutoff": 0.1 })));
    assert_eq!(m.alpha, Alpha::Mask(0.1));
    assert_eq!(material(&with(json!({ "alphaMode": "BLEND" }))).alpha, Alpha::Blend);
    refuses(&with(json!({ "alphaMode": "FOG" })), &["material 0", "alphaMode"]);
    refuses(
        &with(json!({ "pbrMetallicRoughness": { "baseColorFactor": [1e39, 0, 0, 1] } })),
        &["material 0", "finite"],
    );
    for (factor, strength) in [(1e39, 1.0), (1.0, 1e39), (1e15, 1e15), (1e38, 1e38)] {
        let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        let input = ok(&with(json!({ "emissiveFactor": [factor, 0, 0], "extensions": strength })));
        assert_eq!(input.scene.materials[0].emission, Vec3::new(1e20, 0.0, 0.0));
        says(&input.warnings, "material 0: emits more than 1e20");
    }
    refuses(&with(json!({ "emissiveFactor": "red" })), &["material 0"]);
}

#[test]
fn texture_slots_and_sharing() {
    let slot = json!({ "index": 0 });
    let b = with(json!({
        "pbrMetallicRoughness": { "baseColorTexture": slot, "metallicRoughnessTexture": slot },
        "emissiveTexture": slot, "emissiveFactor": [1, 1, 1], "normalTexture": { "index": 99 },
        "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1, "transmissionTexture": slot } }
    }));
    let scene = ok(&b).scene;
    let m = &scene.materials[0];
    let texture = |r: &Option<TextureRef>| r.as_ref().unwrap().texture;
    // One picture, once read as sRGB and once as numbers.
    assert_eq!(scene.textures.len(), 2);
    assert_eq!(texture(&m.base_texture), texture(&m.emission_texture));
    assert_eq!(texture(&m.metallic_texture), texture(&m.transmission_texture));
    let at = Vec2::splat(0.125);
    let number = scene.textures[texture(&m.metallic_texture) as usize].sample(at, 0.0);
    let color = scene.textures[texture(&m.base_texture) as usize].sample(at, 0.0);
    assert!((number.z - 128.0 / 255.0).abs() < 1e-5 && (color.z - 0.2158605).abs() < 1e-4, "{number} {color}");
}

#[test]
fn only_pictures_that_light_sees_are_read() {
    let mut b = Builder::square();
    b.texture(b"broken");
    b.json["materials"][0]["emissiveTexture"] = json!({ "index": 0 });
    b.json["materials"][0]["occlusionTexture"] = json!({ "index": 0 });
    assert!(ok(&b).scene.textures.is_empty());
    b.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    refuses(&b, &["material 0, texture 0, image 0", "PNG"]);
    b.json["images"][0] = json!({ "uri": "gone.png" });
    refuses(&b, &["image 0", "gone.png"]);
    b.json["images"][0] = json!({});
    refuses(&b, &["image 0", "neither"]);
    b.json["textures"][0] = json!({});
    says(&ok(&b).warnings, "has no image");
}

#[test]
fn samplers_and_transforms() {
    let mut b = Builder::textured();
    b.json["textures"][0]["sampler"] = json!(0);
    b.push("samplers", json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }));
    let transform =
        json!({ "offset": [0.25, 0.5], "scale": [2, 3], "rotation": 0.0, "texCoord": 1, "extras": { "a": 1 } });
    let info = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = info;
    let input = ok(&b);
    let r = input.scene.materials[0].base_texture.clone().unwrap();
    assert_eq!((r.set, r.transform.translation), (1, Vec2::new(0.25, 0.5)));
    assert_eq!(r.transform, Affine2::from_scale_angle_translation(Vec2::new(2.0, 3.0), 0.0, Vec2::new(0.25, 0.5)));
    says(&input.warnings, "lacks TEXCOORD_1");
    let t = &input.scene.textures[0];
    // Clamped in u, mirrored in v, and not interpolated.
    assert_eq!(t.sample(Vec2::new(5.1, 0.1), 0.0), t.sample(Vec2::new(0.9, 0.1), 0.0));
    assert_eq!(t.sample(Vec2::new(0.1, 1.1), 0.0), t.sample(Vec2::new(0.1, 0.9), 0.0));
    assert_eq!(t.sample(Vec2::new(0.3, 0.3), 0.0), t.sample(Vec2::new(0.45, 0.45), 0.0));
    b.json["samplers"][0]["wrapS"] = json!(1);
    refuses(&b, &["sampler 0", "wrap"]);
}

#[test]
fn specular_glossiness_is_read_for_its_diffuse_part() {
    let old = json!({ "diffuseFactor": [0.5, 0.6, 0.7, 1], "diffuseTexture": { "index": 0 } });
    let b = with(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": old } }));
    let input = ok(&b);
    let m = &input.scene.materials[0];
    assert_eq!((m.base_color, m.metallic, m.base_texture.is_some()), (Vec4::new(0.5, 0.6, 0.7, 1.0), 0.0, true));
    says(&input.warnings, "pbrSpecularGlossiness");
}

#[test]
fn other_formats_of_textures() {
    let mut b = Builder::textured();
    let mut webp = Vec::new();
    let rgb = [0u8, 255, 0];
    image::codecs::webp::WebPEncoder::new_lossless(&mut webp)
        .encode(&rgb, 1, 1, image::ExtendedColorType::Rgb8)
        .unwrap();
    let view = b.view(&webp);
    b.push("images", json!({ "bufferView": view, "mimeType": "image/webp" }));
    b.json["textures"][0] = json!({ "source": 0, "extensions": { "EXT_texture_webp": { "source": 1 } } });
    b.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    assert_eq!(ok(&b).scene.textures[0].sample(Vec2::ZERO, 0.0), Vec4::new(0.0, 1.0, 0.0, 1.0));

    b.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    b.json["textures"][0] = json!({ "source": 0, "extensions": { "KHR_texture_basisu": { "source": 1 } } });
    assert!(attempt(&b).is_ok());
    b.json["textures"][0].as_object_mut().unwrap().remove("source");
    refuses(&b, &["KHR_texture_basisu", "ktxdecompress"]);
}

#[test]
fn pictures_that_claim_too_much() {
    let mut png = encode_png(UVec2::ONE, &[[1, 2, 3]]).unwrap();
    for (size, kind) in [(100_000u32, 6u8), (30_000, 2), (20_000, 0)] {
        png[16..20].copy_from_slice(&size.to_be_bytes());
        png[20..24].copy_from_slice(&size.to_be_bytes());
        png[25] = kind;
        let crc = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        let mut b = Builder::square();
        b.texture(&png);
        b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
        refuses(&b, &["image 0"]);
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

#[test]
fn extensions_that_are_refused() {
    let required = |name: &str| {
        let mut b = Builder::textured();
        b.json["extensionsRequired"] = json!([name]);
        b
    };
    refuses(&required("VENDOR_teapot"), &["VENDOR_teapot is not supported"]);
    refuses(&required("EXT_mesh_gpu_instancing"), &["EXT_mesh_gpu_instancing"]);
    assert!(attempt(&required("KHR_draco_mesh_compression")).is_ok(), "required, but no primitive needs it");

    let mut b = required("KHR_draco_mesh_compression");
    b.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression": { "bufferView": 0 } });
    assert!(attempt(&b).is_ok(), "the plain form is there");
    b.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    refuses(&b, &["KHR_draco_mesh_compression", "mesh 0, primitive 0", "npx @gltf-transform/cli copy"]);

    let mut b = Builder::square();
    b.json["buffers"] = json!([
        { "byteLength": b.bin.len() },
        { "byteLength": 48, "extensions": { "EXT_meshopt_compression": { "fallback": true } } }
    ]);
    assert!(attempt(&b).is_ok());
    b.json["bufferViews"][0]["buffer"] = json!(1);
    b.json["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": { "buffer": 0 } });
    refuses(&b, &["EXT_meshopt_compression", "npx @gltf-transform/cli copy"]);

    let mut b = Builder::square();
    b.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": {} } });
    refuses(&b, &["EXT_mesh_gpu_instancing", "node 0"]);
}

#[test]
fn tinted_glass_is_told_what_is_lost() {
    let glass = |color: Value| {
        let pbr = json!({ "baseColorFactor": color, "metallicFactor": 0 });
        let extensions = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.9 } });
        with(json!({ "pbrMetallicRoughness": pbr, "extensions": extensions }))
    };
    says(&ok(&glass(json!([0.9, 0.2, 0.2, 1]))).warnings, "material 0: lets coloured light through");
    assert!(ok(&glass(json!([0.8, 0.8, 0.8, 1]))).warnings.is_empty());
    // The tint may be that of a picture.
    let mut b = glass(json!([1, 1, 1, 1]));
    b.texture(&encode_png(UVec2::ONE, &[[200, 40, 40]]).unwrap());
    b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] =
        json!({ "index": b.json["textures"].as_array().unwrap().len() - 1 });
    says(&ok(&b).warnings, "lets coloured light through");
}
