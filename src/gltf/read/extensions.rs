//! Which extensions luxel reads, may ignore, or refuses, and the tool that converts what it refuses.

use super::source::array;
use crate::error::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// Extensions that may stand in `extensionsRequired`: read, without influence on light, or refused where they are used.
const KNOWN: &[&str] = &[
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "LUXEL_lightmap",
];

/// Compression of buffer views.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Compression of primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
/// Compression of textures.
pub(super) const BASISU: &str = "KHR_texture_basisu";
/// Many copies of a node's mesh.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Refuses a document that requires an extension luxel does not know.
pub(super) fn check(file: &Path, json: &Value) -> Result<()> {
    for name in array(file, json, "extensionsRequired")?.iter().filter_map(Value::as_str) {
        if !KNOWN.contains(&name) {
            return Err(refused(file, name, ""));
        }
    }
    Ok(())
}

/// The error that `place` (may be empty) needs extension `name`.
pub(super) fn refused(file: &Path, name: &str, place: &str) -> Error {
    let input = file.display();
    let remedy = match name {
        DRACO | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            format!("decode it first: npx @gltf-transform/cli copy \"{input}\" OUT.glb")
        }
        BASISU => format!("decode it first: npx @gltf-transform/cli ktxdecompress \"{input}\" OUT.glb"),
        "EXT_texture_avif" => {
            format!("convert its textures first: npx @gltf-transform/cli png \"{input}\" OUT.glb")
        }
        INSTANCING => "export the copies as ordinary nodes that share a mesh".into(),
        _ => "export the file without this extension".into(),
    };
    let feature = if place.is_empty() { name.into() } else { format!("{name} ({place})") };
    Error::unsupported(file, feature, remedy)
}

/// True for a buffer without data of its own that stands in for compressed data.
pub(super) fn is_fallback(buffer: &Value) -> bool {
    MESHOPT.iter().any(|name| extension(buffer, name).is_some_and(|e| e.get("fallback") == Some(&Value::Bool(true))))
}

/// Extension `name` of a part.
pub(super) fn extension<'v>(part: &'v Value, name: &str) -> Option<&'v Value> {
    part.get("extensions").and_then(|e| e.get(name))
}
