//! The reading door: every feature of a document has a test here, then every way in which one can be broken.

#[path = "../common/mod.rs"]
mod common;

mod containers;
mod damage;
mod geometry;
mod lights;
mod materials;
mod nodes;

use common::gltf::{Builder, save};
use glam::{DVec3, Vec2, Vec3, Vec4};
use luxel::{
    error::Error,
    gltf::{Input, ReadOptions, read},
};
use serde_json::{Value, json};

fn try_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Input, Error> {
    let folder = tempfile::tempdir().unwrap();
    read(&save(folder.path(), "test.glb", bytes), options)
}

fn attempt(b: &Builder) -> Result<Input, Error> {
    try_bytes(&b.glb(), &ReadOptions::default())
}

#[track_caller]
fn ok(b: &Builder) -> Input {
    attempt(b).unwrap_or_else(|e| panic!("{e}"))
}

/// The text of the error that reading `b` gives, which must be the user's.
#[track_caller]
fn err(b: &Builder) -> String {
    let e = attempt(b).map(|_| ()).expect_err("reading should fail");
    assert_eq!(e.exit_code(), 3, "{e}");
    e.to_string()
}

#[track_caller]
fn says(texts: &[String], part: &str) {
    assert!(texts.iter().any(|t| t.contains(part)), "{texts:#?} lacks {part:?}");
}

#[track_caller]
fn refuses(b: &Builder, parts: &[&str]) {
    let text = err(b);
    parts.iter().for_each(|p| assert!(text.contains(p), "{text:?} lacks {p:?}"));
}
