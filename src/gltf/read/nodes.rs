//! The node tree flattened: world transforms in double precision, and which nodes stand still.
//!
//! Walks without recursion; a node that is reached twice (two parents, a cycle) is an error.

use super::{
    ReadOptions,
    extensions::extension,
    source::{Source, array},
    warnings::Warnings,
    wishes::Wishes,
};
use crate::error::{Error, Result};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use globset::{Glob, GlobSet, GlobSetBuilder};
use serde_json::Value;

/// A node of the scene that is baked.
pub(super) struct Placed {
    /// Index in the document.
    pub node: usize,
    /// Node space to the file's world.
    pub world: DAffine3,
    /// It moves, or is declared to: neither casts nor receives.
    pub moves: bool,
    /// What its extras ask.
    pub wishes: Wishes,
}

/// The nodes of the default scene in the order of a depth-first walk, without the excluded ones.
pub(super) fn place(source: &Source, options: &ReadOptions, warnings: &mut Warnings) -> Result<Vec<Placed>> {
    check_tree(source)?;
    let animated = animated(source);
    let exclude = globs(&options.exclude)?;
    let mut hit = vec![false; options.exclude.len()];
    let mut seen = vec![false; source.nodes.len()];
    let mut placed = Vec::new();
    let mut stack: Vec<(usize, DAffine3, bool)> =
        roots(source, warnings)?.into_iter().rev().map(|n| (n, DAffine3::IDENTITY, false)).collect();
    while let Some((node, parent, parent_moves)) = stack.pop() {
        let name = source.node_name(node);
        if std::mem::replace(&mut seen[node], true) {
            return Err(source.invalid(name, "is placed twice in the scene"));
        }
        let matched = exclude.matches(source.nodes[node].name.as_deref().unwrap_or_default());
        matched.iter().for_each(|m| hit[*m] = true);
        if !matched.is_empty() {
            continue;
        }
        let value = source.value("nodes", node);
        if extension(value, "KHR_node_visibility").and_then(|v| v.get("visible")) == Some(&Value::Bool(false)) {
            warnings.about(name, "is invisible (KHR_node_visibility) and left out with its descendants");
            continue;
        }
        let world = parent * transform(source, node)?;
        if !world.is_finite() {
            return Err(source.invalid(name, "its transform in the world is not finite"));
        }
        let wishes = Wishes::of(value.get("extras").unwrap_or(&Value::Null), &name, warnings);
        let moves = !wishes.is_static.unwrap_or(!parent_moves && !animated[node]);
        let children = source.nodes[node].children.as_deref().unwrap_or_default();
        stack.extend(children.iter().rev().map(|c| (c.value(), world, moves)));
        placed.push(Placed { node, world, moves, wishes });
    }
    for (pattern, _) in options.exclude.iter().zip(hit).filter(|(_, hit)| !hit) {
        warnings.say(format!("--exclude {pattern}: no node of the scene has such a name"));
    }
    Ok(placed)
}

/// Every child exists and has one parent; no node is its own ancestor.
fn check_tree(source: &Source) -> Result<()> {
    let mut parent = vec![None; source.nodes.len()];
    for (i, node) in source.nodes.iter().enumerate() {
        for child in node.children.iter().flatten().map(|c| c.value()) {
            source.part(&source.nodes, child, "node", &source.node_name(i))?;
            if let Some(other) = parent[child].replace(i) {
                let problem = format!("has two parents, {} and {}", source.node_name(other), source.node_name(i));
                return Err(source.invalid(source.node_name(child), problem));
            }
        }
    }
    // With one parent each, the nodes that cannot be reached from a root are the cycles and what hangs on them.
    let mut reached = vec![false; parent.len()];
    let mut stack: Vec<usize> = (0..parent.len()).filter(|n| parent[*n].is_none()).collect();
    while let Some(node) = stack.pop() {
        reached[node] = true;
        stack.extend(source.nodes[node].children.iter().flatten().map(|c| c.value()));
    }
    match reached.iter().position(|r| !r) {
        Some(node) => Err(source.invalid(source.node_name(node), "is its own ancestor, or below such a node")),
        None => Ok(()),
    }
}

fn roots(source: &Source, warnings: &mut Warnings) -> Result<Vec<usize>> {
    let json = &source.document.json;
    let scenes = array(source.file, json, "scenes")?;
    let named = match json.get("scene") {
        None => None,
        Some(v) => Some(v.as_u64().ok_or_else(|| source.invalid("scene", format!("is {v}, not an index")))? as usize),
    };
    if scenes.is_empty() && named.is_none() {
        warnings.say("the file has no scene: all its nodes are used");
        let mut is_child = vec![false; source.nodes.len()];
        let children = source.nodes.iter().flat_map(|n| n.children.iter().flatten());
        children.for_each(|c| is_child[c.value()] = true);
        return Ok((0..is_child.len()).filter(|n| !is_child[*n]).collect());
    }
    if named.is_none() {
        warnings.say("the file names no default scene: its first one is used");
    }
    let index = named.unwrap_or(0);
    let place = format!("scene {index}");
    let scene = source.part(scenes, index, "scene", "scene")?;
    let mut roots = Vec::new();
    for value in array(source.file, scene, "nodes")? {
        let node = value.as_u64().ok_or_else(|| source.invalid(&place, format!("{value} is not a node's index")))?;
        source.part(&source.nodes, node as usize, "node", &place)?;
        roots.push(node as usize);
    }
    Ok(roots)
}

/// For each node whether an animation moves it (KHR_animation_pointer included). Morph weights do not move a node.
fn animated(source: &Source) -> Vec<bool> {
    let mut animated = vec![false; source.nodes.len()];
    for channel in items(&source.document.json, "animations").iter().flat_map(|a| items(a, "channels")) {
        let target = channel.get("target").unwrap_or(&Value::Null);
        let pointer = extension(target, "KHR_animation_pointer").and_then(|p| p.get("pointer")).and_then(Value::as_str);
        let (node, path) = match pointer {
            Some(p) => {
                let mut parts = p.strip_prefix("/nodes/").unwrap_or_default().split('/');
                (parts.next().and_then(|n| n.parse().ok()), parts.next())
            }
            None => (target.get("node").and_then(Value::as_u64), target.get("path").and_then(Value::as_str)),
        };
        let moves = matches!(path, Some("translation" | "rotation" | "scale"));
        if let Some(flag) = node.and_then(|n| animated.get_mut(n as usize)).filter(|_| moves) {
            *flag = true;
        }
    }
    animated
}

fn items<'v>(value: &'v Value, key: &str) -> &'v [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn transform(source: &Source, node: usize) -> Result<DAffine3> {
    let value = source.value("nodes", node);
    let invalid = |problem: String| -> Error { source.invalid(source.node_name(node), problem) };
    if value.get("matrix").is_some() {
        let m: [f64; 16] = numbers(value, "matrix").map_err(invalid)?;
        if [m[3], m[7], m[11], m[15] - 1.0].iter().any(|c| c.abs() > 1e-6) {
            return Err(invalid("its matrix is a projection".into()));
        }
        let column = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
        return Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) });
    }
    let or = |key: &str, default: [f64; 3]| match value.get(key) {
        Some(_) => numbers(value, key).map_err(invalid).map(DVec3::from_array),
        None => Ok(DVec3::from_array(default)),
    };
    let rotation = match value.get("rotation") {
        Some(_) => DQuat::from_array(numbers(value, "rotation").map_err(invalid)?),
        None => DQuat::IDENTITY,
    };
    let length = rotation.length();
    if !(length > 1e-9 && length.is_finite()) {
        return Err(invalid("its rotation is no quaternion: its length is 0".into()));
    }
    Ok(DAffine3::from_scale_rotation_translation(
        or("scale", [1.0; 3])?,
        rotation / length,
        or("translation", [0.0; 3])?,
    ))
}

fn numbers<const N: usize>(value: &Value, key: &str) -> std::result::Result<[f64; N], String> {
    let list = value.get(key).and_then(Value::as_array).filter(|l| l.len() == N);
    let numbers: Option<Vec<f64>> = list.and_then(|l| l.iter().map(Value::as_f64).collect());
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| format!("its {key} is not a list of {N} numbers"))
}

fn globs(patterns: &[String]) -> Result<GlobSet> {
    let mut set = GlobSetBuilder::new();
    for pattern in patterns {
        set.add(Glob::new(pattern).map_err(|e| Error::Usage(format!("--exclude {pattern}: {e}")))?);
    }
    set.build().map_err(|e| Error::Usage(format!("--exclude: {e}")))
}

/// What moves does not cast or receive: says so, and whether mesh-bearing node `p` is lit.
pub(super) fn is_lit(source: &Source, p: &Placed, mesh: usize, warnings: &mut Warnings) -> bool {
    if p.wishes.is_static == Some(true) {
        return true;
    }
    let morphs = |m: &gltf::json::Mesh| m.primitives.iter().any(|p| p.targets.as_ref().is_some_and(|t| !t.is_empty()));
    let reason = if p.wishes.is_static == Some(false) {
        "is declared not static (luxel.static) and left out"
    } else if p.moves {
        "is animated or below a node that moves and left out; set extras luxel.static to true to bake it where it is"
    } else if source.nodes[p.node].skin.is_some() {
        "is skinned and left out; set extras luxel.static to true to bake it as it is"
    } else if source.meshes.get(mesh).is_some_and(morphs) {
        "has morph targets and is left out; set extras luxel.static to true to bake it as it is"
    } else {
        return true;
    };
    warnings.about(source.node_name(p.node), reason);
    false
}
