//! `--strip-lights`: lights that are in the map leave the file, for loaders that would draw them again.

use super::bind::prune;
use serde_json::Value;

const LIGHTS: &str = "KHR_lights_punctual";

/// Takes the lights of `nodes` away; when none is left, the extension as well.
pub fn strip(json: &mut Value, nodes: &[u32]) {
    for &node in nodes {
        if let Some(node) = json.get_mut("nodes").and_then(|n| n.get_mut(node as usize)) {
            prune(node, &["extensions", LIGHTS]);
        }
    }
    let mut all = json.get("nodes").and_then(Value::as_array).into_iter().flatten();
    if all.any(|node| node["extensions"].get(LIGHTS).is_some()) {
        return;
    }
    prune(json, &["extensions", LIGHTS]);
    for list in ["extensionsUsed", "extensionsRequired"] {
        if let Some(names) = json.get_mut(list).and_then(Value::as_array_mut) {
            names.retain(|name| name != LIGHTS);
            if names.is_empty() {
                json.as_object_mut().and_then(|root| root.shift_remove(list));
            }
        }
    }
}
