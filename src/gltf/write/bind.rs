//! `LUXEL_lightmap` at the root and at each lit node, with a mirror in `extras.luxel.lightmap` for loaders that show
//! extras only; and the removal of an earlier bake's.

use super::{accessor::uint, store::Store, vertices::object};
use crate::{
    atlas::{Atlas, Placement},
    lightmaps::Lightmaps,
    report::Report,
    scene::Scene,
};
use serde_json::{Map, Value, json};

/// The extension's name.
pub const NAME: &str = "LUXEL_lightmap";

/// Takes an earlier lightmap out of the document.
pub fn unbind(store: &mut Store) {
    let root = &store.json["extensions"][NAME];
    let pages = root["pages"].as_array().into_iter().flatten().filter_map(|p| uint(&p["bufferView"]));
    let pages = pages.collect();
    remove(&mut store.json);
    for node in store.json.get_mut("nodes").and_then(Value::as_array_mut).into_iter().flatten() {
        remove(node);
    }
    store.free_views(&pages);
}

/// Rectangles of the instances that have one on a visible page, by node.
pub fn rectangles(scene: &Scene, atlas: &Atlas, warnings: &mut Vec<String>) -> Vec<(u32, Placement)> {
    let mut found: Vec<(u32, Placement)> = Vec::new();
    for (instance, placement) in scene.instances.iter().zip(&atlas.placements) {
        let visible = |p: &Placement| atlas.pages.get(p.page as usize).is_some_and(|page| !page.hidden);
        let Some(placement) = (*placement).filter(visible) else { continue };
        if found.last().is_some_and(|(node, _)| *node == instance.node) {
            warnings.push(format!("{}: only the first of its instances can be given a lightmap", instance.name));
        } else {
            found.push((instance.node, placement));
        }
    }
    found
}

/// The extension of a lit node.
pub fn node_data(p: &Placement) -> Value {
    json!({ "page": p.page, "texCoord": 1, "offset": p.offset.to_array(), "scale": p.scale.to_array() })
}

/// The root's extension; `pages`: a `bufferView` or a `uri` for each page, with its scale.
pub fn root_data(
    lightmaps: &Lightmaps,
    pages: &[(&'static str, Value, f32)],
    report: &Report,
    baked_lights: &[u32],
) -> Value {
    let content = lightmaps.content.name();
    let page = |((place, value, scale), map): (&(&'static str, Value, f32), &crate::lightmaps::Map)| {
        let mut page = object(json!({ *place: value, "mimeType": "image/x-exr" }));
        page.extend(object(json!({
            "width": map.size.x, "height": map.size.y, "encoding": "irradiance", "content": content, "scale": scale,
        })));
        Value::from(page)
    };
    let pages: Vec<Value> = pages.iter().zip(&lightmaps.pages).map(page).collect();
    let generator = concat!("luxel ", env!("CARGO_PKG_VERSION"));
    json!({ "pages": pages, "bakedLights": baked_lights, "generator": generator, "report": short(report) })
}

/// What of the report is the same on every machine: no times, no memory. What does not apply is left out.
fn short(report: &Report) -> Value {
    let mut short = object(json!({
        "texels": report.texels,
        "receivers": report.receivers,
        "adaptiveRays": report.adaptive_rays,
        "rays": report.rays.traced,
        "solver": report.solver.name,
        "bounces": report.solver.bounces,
        "iterations": report.solver.iterations,
        "entries": report.solver.entries,
        "relativeBound": report.solver.relative_bound,
        "energyImbalance": report.energy.imbalance,
        "warnings": report.warnings.len(),
        "error": report.target.as_ref().and_then(|t| t.looks.last()).and_then(|look| look.error),
        "light": report.light,
    }));
    short.retain(|_, value| !value.is_null());
    short.into()
}

/// Puts the data in place, the mirror too. Returns notes.
pub fn bind(json: &mut Value, root: Value, nodes: &[(u32, Placement)]) -> Vec<String> {
    let mut notes = Vec::new();
    let used = json.as_object_mut().map(|root| root.entry("extensionsUsed").or_insert_with(|| json!([])));
    if let Some(list) = used.and_then(Value::as_array_mut).filter(|list| list.iter().all(|name| name != NAME)) {
        list.push(NAME.into());
    }
    put(json, root, || "the file".into(), &mut notes);
    for (index, placement) in nodes {
        if let Some(node) = json.get_mut("nodes").and_then(|n| n.get_mut(*index as usize)) {
            put(node, node_data(placement), || format!("node {index}"), &mut notes);
        }
    }
    notes
}

fn put(owner: &mut Value, data: Value, name: impl Fn() -> String, notes: &mut Vec<String>) {
    let Some(owner) = owner.as_object_mut() else { return };
    match entry(owner, "extras").and_then(|extras| entry(extras, "luxel")) {
        Some(luxel) => drop(luxel.insert("lightmap".into(), data.clone())),
        None => notes.push(format!("the extras of {} are no object: they do not mirror the lightmap", name())),
    }
    if let Some(extensions) = entry(owner, "extensions") {
        extensions.insert(NAME.into(), data);
    }
}

/// The object `key` of `owner`, made if it is missing; `None` if it is something else.
fn entry<'a>(owner: &'a mut Map<String, Value>, key: &str) -> Option<&'a mut Map<String, Value>> {
    owner.entry(key).or_insert_with(|| json!({})).as_object_mut()
}

/// Takes an extension that nothing has any more out of the lists of names.
pub fn unlist(json: &mut Value, extension: &str) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        if let Some(names) = json.get_mut(list).and_then(Value::as_array_mut) {
            names.retain(|name| name != extension);
            if names.is_empty() {
                json.as_object_mut().and_then(|root| root.shift_remove(list));
            }
        }
    }
}

fn remove(owner: &mut Value) {
    prune(owner, &["extensions", NAME]);
    prune(owner, &["extras", "luxel", "lightmap"]);
}

/// Removes the value at `path`, and the objects on the way to it that become empty.
pub fn prune(owner: &mut Value, path: &[&str]) {
    let (Some(map), [key, rest @ ..]) = (owner.as_object_mut(), path) else { return };
    let Some(inner) = map.get_mut(*key) else { return };
    let before = inner.as_object().map_or(0, Map::len);
    prune(inner, rest);
    if rest.is_empty() || (before > 0 && inner.as_object().is_some_and(Map::is_empty)) {
        map.shift_remove(*key);
    }
}
