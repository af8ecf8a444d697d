//! Lights that are in the map, so that an engine must not draw them again; and `--strip-lights`: they leave the file, for
//! loaders that would.

use super::bind::{prune, unlist};
use crate::{
    lightmaps::Content,
    scene::{Bake, Scene},
};
use serde_json::Value;

const LIGHTS: &str = "KHR_lights_punctual";

/// Nodes whose direct light maps of `content` hold.
pub fn baked(scene: &Scene, content: Content) -> Vec<u32> {
    let baked = scene.lights.iter().filter(|l| l.bake == Bake::Full && content != Content::Indirect);
    let mut nodes: Vec<u32> = baked.filter_map(|l| l.node).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

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
    unlist(json, LIGHTS);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Light, LightKind};
    use glam::Vec3;

    #[test]
    fn only_lights_whose_direct_light_is_baked_are_named() {
        let light = |node, bake| Light {
            name: String::new(),
            node,
            kind: LightKind::Point { radius: 0.0 },
            position: Vec3::ZERO,
            direction: Vec3::Y,
            intensity: Vec3::ONE,
            range: f32::INFINITY,
            bake,
        };
        let lights = [(Some(7), Bake::Full), (Some(3), Bake::Indirect), (Some(2), Bake::Full), (None, Bake::Full)];
        let scene = Scene { lights: lights.map(|(node, bake)| light(node, bake)).into(), ..Scene::default() };
        assert_eq!(baked(&scene, Content::Full), [2, 7]);
        assert_eq!(baked(&scene, Content::Direct), [2, 7]);
        assert!(baked(&scene, Content::Indirect).is_empty());
    }
}
