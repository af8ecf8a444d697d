//! A lightmap that is bound to a document: what an earlier bake wrote, read back.

use super::{extensions::extension, source::linked};
use crate::{
    atlas::{Atlas, Layout, NO_CHART, PAGE_EDGES, Page, Placement},
    error::{Error, Result},
    gltf::Document,
    lightmaps::{Content, Lightmaps, Map},
    pixels::exr,
    scene::Scene,
};
use glam::{UVec2, Vec2, Vec3};
use serde::Deserialize;
use serde_json::Value;

const NAME: &str = "LUXEL_lightmap";
const PLACE: &str = "extensions.LUXEL_lightmap";

/// The options of the bake that chose its light, as the file keeps them.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Record {
    /// `--sky`.
    pub sky: Option<String>,
    /// `--sun`.
    pub sun: Option<String>,
    /// `--light-scale`.
    #[serde(rename = "lightScale")]
    pub light_scale: Option<f32>,
    /// `--max-reflectance`.
    #[serde(rename = "maxReflectance")]
    pub max_reflectance: Option<f32>,
    /// `--exclude`.
    pub exclude: Vec<String>,
    /// `--bounces`.
    pub bounces: Option<u32>,
    /// Rays a row by which the bake chose receivers, if it chose them.
    pub adaptive_rays: Option<u32>,
}

impl Record {
    /// Largest diffuse reflectance of the bake.
    pub fn reflectance(&self) -> f32 {
        self.max_reflectance.unwrap_or(0.98).clamp(1e-6, 0.9999)
    }
}

/// A lightmap and where it lies.
#[derive(Clone, Debug)]
pub struct Bound {
    /// Rectangles of the nodes that have one, over the file's own coordinates.
    pub atlas: Atlas,
    /// The pages as they are stored, their scale applied.
    pub lightmaps: Lightmaps,
}

/// Under which light `document` was baked; `None` if it does not say.
pub fn record(document: &Document) -> Result<Option<Record>> {
    let report = root(document)?.get("report");
    let Some(light) = report.and_then(|r| r.get("light")) else { return Ok(None) };
    let record = Record::deserialize(light).map_err(|e| broken(document, "report.light", e.to_string()))?;
    let bounces = report.and_then(|r| r.get("bounces")).and_then(Value::as_u64).map(|n| n.min(u32::MAX.into()) as u32);
    let rays = report.and_then(|r| r.get("adaptiveRays")).and_then(Value::as_u64);
    let adaptive_rays = rays.map(|n| n.clamp(1, 65536) as u32);
    Ok(Some(Record { bounces, adaptive_rays, ..record }))
}

/// The lightmap of `document`, whose scene is `scene`.
pub fn bound(document: &Document, scene: &Scene) -> Result<Bound> {
    let root = root(document)?;
    let pages = root.get("pages").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    if pages.is_empty() {
        return Err(broken(document, "pages", "there is no page"));
    }
    let mut lightmaps = Lightmaps { content: content(document, &pages[0])?, ..Lightmaps::default() };
    for (i, page) in pages.iter().enumerate() {
        lightmaps.pages.push(map(document, page, &format!("pages[{i}]"))?);
    }
    let mut atlas = Atlas { kept: true, layouts: vec![Layout::default(); scene.meshes.len()], ..Atlas::default() };
    atlas.pages = lightmaps.pages.iter().map(|map| Page { size: map.size, hidden: false }).collect();
    for instance in &scene.instances {
        let node = document.json.get("nodes").and_then(|n| n.get(instance.node as usize));
        let Some(data) = node.and_then(|n| extension(n, NAME)) else {
            atlas.placements.push(None);
            continue;
        };
        let (placement, set) = placement(document, data, &instance.name, lightmaps.pages.len())?;
        let mesh = &scene.meshes[instance.mesh as usize];
        let Some(uv) = mesh.uvs.get(set).filter(|uv| !uv.is_empty()) else {
            return Err(broken(document, &instance.name, format!("its mesh has no TEXCOORD_{set}")));
        };
        let layout = &mut atlas.layouts[instance.mesh as usize];
        if layout.uv.is_empty() {
            *layout = Layout {
                source: (0..mesh.positions.len() as u32).collect(),
                uv: uv.clone(),
                triangles: mesh.triangles.clone(),
                charts: vec![NO_CHART; mesh.triangles.len()],
                chart_count: 0,
            };
        }
        let inside = |p: Vec2| p.cmpge(Vec2::splat(-1e-3)).all() && p.cmple(Vec2::splat(1.001)).all();
        if !layout.uv.iter().all(|p| inside(placement.offset + placement.scale * *p)) {
            return Err(broken(document, &instance.name, "its lightmap coordinates lie outside of the page"));
        }
        atlas.placements.push(Some(placement));
    }
    if atlas.placements.iter().all(Option::is_none) {
        return Err(broken(document, "nodes", "no node that stands still has a place on a page"));
    }
    Ok(Bound { atlas, lightmaps })
}

/// Refuses a document whose baked lights are gone: it cannot be lit again.
pub fn check_lights(document: &Document) -> Result<()> {
    let nodes = root(document)?.get("bakedLights").and_then(Value::as_array).into_iter().flatten();
    for index in nodes.filter_map(Value::as_u64) {
        let node = document.json.get("nodes").and_then(|n| n.get(index as usize));
        if node.and_then(|n| extension(n, "KHR_lights_punctual")).is_none() {
            let remedy = "bake without --strip-lights to audit, or use luxel bake --audit";
            return Err(Error::invalid(&document.path, format!("node {index}"), "its baked light is gone", remedy));
        }
    }
    Ok(())
}

fn root(document: &Document) -> Result<&Value> {
    extension(&document.json, NAME).filter(|root| root.is_object()).ok_or_else(|| {
        let remedy = format!("bake it first: luxel bake \"{}\"", document.path.display());
        Error::invalid(&document.path, PLACE, "is missing: the file has no lightmap by luxel", remedy)
    })
}

fn content(document: &Document, page: &Value) -> Result<Content> {
    let name = page.get("content").and_then(Value::as_str).unwrap_or(Content::Full.name());
    let known = Content::ALL.into_iter().find(|c| c.name() == name);
    known.ok_or_else(|| broken(document, "pages[0]", format!("its content is {name:?}")))
}

fn map(document: &Document, page: &Value, place: &str) -> Result<Map> {
    let fail = |problem: String| broken(document, place, problem);
    let bytes = match (page.get("uri").and_then(Value::as_str), page.get("bufferView").and_then(Value::as_u64)) {
        (Some(uri), None) => linked(&document.path, uri, &format!("{PLACE}.{place}"))?,
        (None, Some(view)) => view_bytes(document, view).ok_or_else(|| fail("its bufferView is broken".into()))?,
        _ => return Err(fail("it is to be in a bufferView or at a uri".into())),
    };
    let encoding = page.get("encoding").and_then(Value::as_str).unwrap_or_default();
    if encoding != "irradiance" {
        return Err(fail(format!("its encoding is {encoding:?}, not \"irradiance\"")));
    }
    let scale = page.get("scale").and_then(Value::as_f64).unwrap_or(0.0) as f32;
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(fail("its scale is not a number above 0".into()));
    }
    let edge = |key: &str| page.get(key).and_then(Value::as_u64).unwrap_or(0).min(u32::MAX.into()) as u32;
    let declared = UVec2::new(edge("width"), edge("height"));
    let size = exr::size(&bytes).map_err(|e| fail(format!("its picture is damaged: {e}")))?;
    let most = *PAGE_EDGES.end();
    if size != declared || size.min_element() == 0 || size.max_element() > most {
        return Err(fail(format!("its picture is {} x {}, not {} x {}", size.x, size.y, declared.x, declared.y)));
    }
    let (_, texels) = exr::decode(&bytes).map_err(|e| fail(format!("its picture is damaged: {e}")))?;
    let irradiance: Vec<Vec3> = texels.into_iter().map(|t| t * scale).collect();
    if !irradiance.iter().all(|e| e.is_finite()) {
        return Err(fail("holds values that are not finite".into()));
    }
    Ok(Map { size, covered: vec![true; irradiance.len()], irradiance })
}

fn view_bytes(document: &Document, view: u64) -> Option<Vec<u8>> {
    let view = document.json.get("bufferViews")?.get(view as usize)?;
    let number = |key: &str| view.get(key).map_or(Some(0), Value::as_u64).map(|n| n as usize);
    let buffer = document.buffers.get(number("buffer")?)?;
    let start = number("byteOffset")?;
    buffer.get(start..start.checked_add(number("byteLength")?)?).map(<[u8]>::to_vec)
}

/// A node's rectangle, and the set of texture coordinates it is over.
fn placement(document: &Document, data: &Value, node: &str, pages: usize) -> Result<(Placement, usize)> {
    let pair = |key: &str, default: f32| match data.get(key) {
        None => Some(Vec2::splat(default)),
        Some(v) => {
            let at = |i: usize| v.get(i).and_then(Value::as_f64).map(|x| x as f32).filter(|x| x.is_finite());
            Some(Vec2::new(at(0)?, at(1)?))
        }
    };
    let page = data.get("page").and_then(Value::as_u64).filter(|p| (*p as usize) < pages);
    let set = data.get("texCoord").map_or(Some(1), Value::as_u64).filter(|s| *s < 8);
    match (page, set, pair("offset", 0.0), pair("scale", 1.0)) {
        (Some(page), Some(set), Some(offset), Some(scale)) => {
            Ok((Placement { page: page as u32, offset, scale }, set as usize))
        }
        (None, ..) => Err(broken(document, node, format!("its page is not one of the file's {pages}"))),
        _ => Err(broken(document, node, "its texCoord, offset or scale makes no sense")),
    }
}

fn broken(document: &Document, place: &str, problem: impl Into<String>) -> Error {
    let remedy = "bake the scene again: its lightmap is damaged, or was changed by another program";
    Error::invalid(&document.path, format!("{PLACE}, {place}"), problem, remedy)
}
