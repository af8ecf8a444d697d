//! [`Store`]: a copy of a document's JSON to be patched, and what becomes of its accessors, buffer views and buffers.
//!
//! Indices never move, since extensions nobody here knows may name them. What nothing refers to any more is freed, its
//! slot goes to the next newcomer, and [`Store::settle`] leaves its bytes out: baking a baked file does not grow it.
//! `extras` are the user's: nothing in them is taken for a reference.

use super::accessor::uint;
use crate::gltf::Document;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// A document under change.
pub struct Store<'a> {
    document: &'a Document,
    /// The JSON to patch. A freed or new accessor or view is null until the end.
    pub json: Value,
    fresh: BTreeMap<usize, (Map<String, Value>, Vec<u8>)>,
    free_views: BTreeSet<usize>,
    free_accessors: BTreeSet<usize>,
}

/// Name of slots that had to stay because others follow them.
const UNUSED: &str = "luxel: unused";

impl<'a> Store<'a> {
    /// Takes a copy of the document's JSON.
    pub fn new(document: &'a Document) -> Self {
        let mut store = Store {
            document,
            json: document.json.clone(),
            fresh: BTreeMap::new(),
            free_views: BTreeSet::new(),
            free_accessors: BTreeSet::new(),
        };
        store.free_accessors = take_unused(&mut store.json, "accessors");
        store.free_views = take_unused(&mut store.json, "bufferViews");
        store
    }

    /// The document that is patched.
    pub fn document(&self) -> &'a Document {
        self.document
    }

    /// Adds a buffer view of `bytes`; `more` are further properties (target, byteStride).
    pub fn add_view(&mut self, bytes: Vec<u8>, more: Map<String, Value>) -> usize {
        let index = slot(&mut self.json, "bufferViews", &mut self.free_views);
        self.fresh.insert(index, (more, bytes));
        index
    }

    /// Adds an accessor.
    pub fn add_accessor(&mut self, accessor: Map<String, Value>) -> usize {
        let index = slot(&mut self.json, "accessors", &mut self.free_accessors);
        self.json["accessors"][index] = accessor.into();
        index
    }

    /// Frees those of `candidates` that nothing refers to, and their views.
    pub fn free_accessors(&mut self, candidates: &BTreeSet<usize>) {
        let used = References::of(&self.json).accessors;
        let mut views = BTreeSet::new();
        for &i in candidates.difference(&used) {
            if let Some(accessor) = self.json.get_mut("accessors").and_then(|a| a.get_mut(i)) {
                let sparse = &accessor["sparse"];
                let places = [&*accessor, &sparse["indices"], &sparse["values"]];
                views.extend(places.iter().filter_map(|p| uint(p.get("bufferView")?)));
                *accessor = Value::Null;
                self.free_accessors.insert(i);
            }
        }
        self.free_views(&views);
    }

    /// Frees those of `candidates` that nothing refers to.
    pub fn free_views(&mut self, candidates: &BTreeSet<usize>) {
        let used = References::of(&self.json).views;
        for &i in candidates.difference(&used) {
            if let Some(view) = self.json.get_mut("bufferViews").and_then(|v| v.get_mut(i)) {
                *view = Value::Null;
                self.free_views.insert(i);
            }
        }
    }

    /// The finished JSON and its buffers, without the bytes that were freed; `one`: all in a single buffer.
    ///
    /// `byteLength` is set; `uri` is taken away. A buffer that only stands in for compressed data stays without bytes.
    pub fn settle(mut self, one: bool) -> (Value, Vec<Vec<u8>>) {
        close(
            &mut self.json,
            "accessors",
            &self.free_accessors,
            || json!({ "name": UNUSED, "componentType": 5121, "count": 1, "type": "SCALAR" }),
        );
        let old = &self.document.buffers;
        let mut segments = Segments::of(&self.json, old);
        let homes = homes(old, one);
        let mut buffers = vec![Vec::new(); homes.iter().max().map_or(1, |last| last + 1)];
        for s in &mut segments.0 {
            let to = &mut buffers[homes[s.buffer]];
            // Some extensions align to eight bytes: what was aligned stays so.
            to.resize(to.len() + (s.start + 8 - to.len() % 8) % 8, 0);
            s.to = to.len();
            to.extend_from_slice(&old[s.buffer][s.start..s.end]);
        }
        segments.relocate(&mut self.json, &homes);
        for (index, (mut view, bytes)) in std::mem::take(&mut self.fresh) {
            let to = &mut buffers[0];
            to.resize(to.len().next_multiple_of(4), 0);
            view.insert("buffer".into(), 0.into());
            view.insert("byteOffset".into(), to.len().into());
            view.insert("byteLength".into(), bytes.len().into());
            to.extend_from_slice(&bytes);
            self.json["bufferViews"][index] = view.into();
        }
        let needed = close(
            &mut self.json,
            "bufferViews",
            &self.free_views,
            || json!({ "name": UNUSED, "buffer": 0, "byteLength": 1 }),
        );
        // glTF knows no empty buffer.
        for (i, to) in buffers.iter_mut().enumerate().filter(|(_, to)| to.is_empty()) {
            let stands_in = i > 0 && old.iter().zip(&homes).all(|(bytes, home)| *home != i || bytes.is_empty());
            if !stands_in && (needed || !old.is_empty()) {
                to.resize(4, 0);
            }
        }
        if buffers.iter().all(Vec::is_empty) {
            buffers.clear();
        }
        self.describe(&buffers, &homes);
        (self.json, buffers)
    }

    fn describe(&mut self, buffers: &[Vec<u8>], homes: &[usize]) {
        let Some(root) = self.json.as_object_mut() else { return };
        if buffers.is_empty() {
            root.shift_remove("buffers");
            return;
        }
        let list = root.entry("buffers").or_insert_with(|| json!([]));
        if let Some(list) = list.as_array_mut() {
            // Of buffers that became one, the first one's description stays.
            let mut next = (0..).peekable();
            let mut at = homes.iter().map(|&home| next.next_if(|n| *n == home).is_some());
            list.retain(|_| at.next().unwrap_or(false));
            list.resize(buffers.len(), json!({}));
            for (entry, bytes) in list.iter_mut().zip(buffers).filter(|(_, bytes)| !bytes.is_empty()) {
                if let Some(entry) = entry.as_object_mut() {
                    entry.shift_remove("uri");
                    entry.insert("byteLength".into(), bytes.len().into());
                }
            }
        }
    }
}

/// What a document's JSON refers to, core and extensions alike. Counting too much keeps a slot; it does no harm.
#[derive(Default)]
struct References {
    accessors: BTreeSet<usize>,
    views: BTreeSet<usize>,
}

impl References {
    fn of(json: &Value) -> Self {
        let mut found = References::default();
        found.collect(json);
        found
    }

    fn collect(&mut self, value: &Value) {
        match value {
            Value::Array(list) => list.iter().for_each(|v| self.collect(v)),
            Value::Object(map) => {
                for (key, v) in map.iter().filter(|(key, _)| *key != "extras") {
                    match key.as_str() {
                        "bufferView" => self.views.extend(uint(v)),
                        "indices" | "input" | "output" | "inverseBindMatrices" | "accessor" => {
                            self.accessors.extend(uint(v));
                        }
                        "attributes" => {
                            self.accessors.extend(v.as_object().into_iter().flatten().filter_map(|a| uint(a.1)))
                        }
                        "targets" => {
                            let targets = v.as_array().into_iter().flatten().filter_map(Value::as_object);
                            self.accessors.extend(targets.flatten().filter_map(|a| uint(a.1)));
                        }
                        _ => {}
                    }
                    self.collect(v);
                }
            }
            _ => {}
        }
    }
}

/// Runs of buffer bytes that something names, by buffer and start, without overlap.
struct Segments(Vec<Segment>);

struct Segment {
    buffer: usize,
    start: usize,
    end: usize,
    to: usize,
}

impl Segments {
    fn of(json: &Value, buffers: &[Vec<u8>]) -> Self {
        let mut found = Vec::new();
        visit(json, &mut |map| {
            if let Some((buffer, start, length)) =
                range(map).filter(|r| buffers.get(r.0).is_some_and(|b| !b.is_empty()))
            {
                let len = buffers[buffer].len();
                found.push((buffer, start.min(len), start.saturating_add(length).min(len)));
            }
        });
        found.sort_unstable();
        let mut merged: Vec<Segment> = Vec::new();
        for (buffer, start, end) in found {
            match merged.last_mut() {
                Some(last) if last.buffer == buffer && start <= last.end => last.end = last.end.max(end),
                _ => merged.push(Segment { buffer, start, end, to: 0 }),
            }
        }
        Segments(merged)
    }

    fn relocate(&self, json: &mut Value, homes: &[usize]) {
        visit_mut(json, &mut |map| {
            let Some((buffer, start, _)) = range(map) else { return };
            if let Some(&home) = homes.get(buffer).filter(|home| **home != buffer) {
                map.insert("buffer".into(), home.into());
            }
            let after = self.0.partition_point(|s| (s.buffer, s.start) <= (buffer, start));
            let Some(s) = after.checked_sub(1).map(|i| &self.0[i]).filter(|s| s.buffer == buffer) else { return };
            let to = s.to + (start - s.start);
            if to != start {
                map.insert("byteOffset".into(), to.into());
            }
        });
    }
}

/// The new index of each buffer; `one`: all that have bytes become the first.
fn homes(buffers: &[Vec<u8>], one: bool) -> Vec<usize> {
    let mut stand_ins = 0;
    let home = |(i, bytes): (usize, &Vec<u8>)| match (one, i > 0 && bytes.is_empty()) {
        (false, _) => i,
        (true, false) => 0,
        (true, true) => {
            stand_ins += 1;
            stand_ins
        }
    };
    buffers.iter().enumerate().map(home).collect()
}

/// Buffer, offset and length that an object names: a buffer view or an extension's like.
fn range(map: &Map<String, Value>) -> Option<(usize, usize, usize)> {
    let start = map.get("byteOffset").map_or(Some(0), uint)?;
    Some((uint(map.get("buffer")?)?, start, uint(map.get("byteLength")?)?))
}

fn visit(value: &Value, f: &mut impl FnMut(&Map<String, Value>)) {
    match value {
        Value::Array(list) => list.iter().for_each(|v| visit(v, f)),
        Value::Object(map) => {
            f(map);
            map.iter().filter(|(key, _)| *key != "extras").for_each(|(_, v)| visit(v, f));
        }
        _ => {}
    }
}

/// Calls `f` for every object outside of `extras`.
pub fn visit_mut(value: &mut Value, f: &mut impl FnMut(&mut Map<String, Value>)) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(|v| visit_mut(v, f)),
        Value::Object(map) => {
            f(map);
            map.iter_mut().filter(|(key, _)| *key != "extras").for_each(|(_, v)| visit_mut(v, f));
        }
        _ => {}
    }
}

/// Index of a null entry of the array `key`: a free one or one more.
fn slot(json: &mut Value, key: &str, free: &mut BTreeSet<usize>) -> usize {
    let len = json[key].as_array().map_or(0, Vec::len);
    if len == 0 {
        json[key] = json!([]);
    }
    free.pop_first().unwrap_or_else(|| {
        json[key].as_array_mut().into_iter().for_each(|list| list.push(Value::Null));
        len
    })
}

/// Takes the slots that an earlier bake left unused.
fn take_unused(json: &mut Value, key: &str) -> BTreeSet<usize> {
    let list = json.get_mut(key).and_then(Value::as_array_mut);
    let unused = list.into_iter().flatten().enumerate().filter(|(_, entry)| entry["name"] == UNUSED);
    unused.map(|(i, entry)| (*entry = Value::Null, i).1).collect()
}

/// Drops free slots at the end of the array `key`, fills those before others; true if there were such.
fn close(json: &mut Value, key: &str, free: &BTreeSet<usize>, filler: impl Fn() -> Value) -> bool {
    let Some(list) = json.get_mut(key).and_then(Value::as_array_mut) else { return false };
    while !list.is_empty() && free.contains(&(list.len() - 1)) {
        list.pop();
    }
    let inner: Vec<usize> = free.iter().copied().filter(|&i| i < list.len()).collect();
    for &i in &inner {
        list[i] = filler();
    }
    if list.is_empty() {
        json.as_object_mut().and_then(|root| root.shift_remove(key));
    }
    !inner.is_empty()
}
