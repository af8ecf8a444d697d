//! STUB until the writer is merged.

use super::Document;
use crate::{
    atlas::Atlas,
    error::{Error, Result},
    lightmaps::Lightmaps,
    report::Report,
    scene::Scene,
};
use glam::{UVec2, Vec3};
use std::path::Path;

/// What is written besides the lightmap.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Pages have 32 bits a channel instead of 16. Default: no.
    pub float: bool,
    /// Pages and a description are written beside the output as well. Default: no.
    pub sidecar: bool,
    /// The baked lights are taken out of the file. Default: no.
    pub strip_lights: bool,
    /// Nodes whose light is in the map and must not be drawn again.
    pub baked_lights: Vec<u32>,
}

/// Writes `document` with `lightmaps` bound to it.
pub fn write(
    document: &Document,
    _: &Scene,
    _: &Atlas,
    _: &Lightmaps,
    _: &Report,
    _: &WriteOptions,
    _: &Path,
) -> Result<Vec<String>> {
    Err(Error::unsupported(&document.path, "writing", "merge the writer"))
}

/// Writes the lit instances with `pages` of radiance.
pub fn write_flat(
    document: &Document,
    _: &Scene,
    _: &Atlas,
    _: &[(UVec2, Vec<Vec3>)],
    _: f32,
    _: &Path,
) -> Result<Vec<String>> {
    Err(Error::unsupported(&document.path, "writing", "merge the writer"))
}
