//! [`Baked`]: what a glTF file says about its lightmap, checked, in the terms of Bevy.

use bevy::{
    math::Rect,
    platform::collections::{HashMap, HashSet},
};
use serde::{Deserialize, de::DeserializeOwned};

/// The extension's name.
pub const NAME: &str = "LUXEL_lightmap";
/// The only set of texture coordinates that Bevy reads lightmaps with.
const TEXCOORD: u32 = 1;
/// What rounding may add to the edge of a rectangle.
const ROUNDING: f32 = 1e-5;

/// What is wrong with a lightmap, in one line.
pub type Problem = String;

/// A file's lightmap.
#[derive(Clone, Debug, Default)]
pub struct Baked {
    /// The pages.
    pub pages: Vec<Page>,
    /// The lit nodes' pages and rectangles (Bevy's `uv_rect`), by index of the node.
    pub places: HashMap<usize, (usize, Rect)>,
    /// Nodes whose light is in the map.
    pub lights: HashSet<usize>,
}

/// A page of texels.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Page {
    /// Where it is, if it is in the file.
    pub buffer_view: Option<usize>,
    /// Where it is, if it is beside the file.
    pub uri: Option<String>,
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    encoding: String,
    /// Irradiance over texel.
    pub scale: f32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Root {
    pages: Vec<Page>,
    #[serde(default)]
    baked_lights: HashSet<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Place {
    page: usize,
    tex_coord: u32,
    offset: [f32; 2],
    scale: [f32; 2],
}

impl Baked {
    /// Reads a document; one without lightmap lights nothing.
    pub fn read(document: &gltf::Document) -> Result<Self, Problem> {
        let Some(root) = document.extension_value(NAME) else { return Ok(Self::default()) };
        let Root { pages, baked_lights: lights } = parsed(root, "the file")?;
        for (index, page) in pages.iter().enumerate() {
            page.check().map_err(|problem| format!("page {index} {problem}"))?;
        }
        let mut places = HashMap::default();
        for node in document.nodes() {
            let Some(value) = node.extension_value(NAME) else { continue };
            let name = node.name().map(|name| format!(" ({name})")).unwrap_or_default();
            let label = format!("node {}{name}", node.index());
            let place: Place = parsed(value, &label)?;
            if node.mesh().is_none() {
                return Err(format!("{label} has a rectangle but no mesh"));
            }
            if place.page >= pages.len() {
                return Err(format!("{label} is on page {}, but the file has {}", place.page, pages.len()));
            }
            if place.tex_coord != TEXCOORD || !has_texcoord(&node) {
                return Err(format!(
                    "{label} needs TEXCOORD_{}; Bevy reads lightmaps with TEXCOORD_{TEXCOORD}, which every primitive must have",
                    place.tex_coord
                ));
            }
            let rect = place.rect().ok_or_else(|| format!("{label} reaches beyond its page"))?;
            places.insert(node.index(), (place.page, rect));
        }
        Ok(Baked { pages, places, lights })
    }
}

impl Page {
    fn check(&self) -> Result<(), Problem> {
        match self {
            Page { buffer_view, uri, .. } if buffer_view.is_some() == uri.is_some() => {
                Err("has to be in a bufferView of the file or at a uri".into())
            }
            Page { encoding, .. } if encoding != "irradiance" => Err(format!("holds {encoding}, not irradiance")),
            Page { scale, .. } if !(*scale > 0.0 && scale.is_finite()) => Err(format!("has the scale {scale}")),
            _ => Ok(()),
        }
    }
}

impl Place {
    /// v counts from the top, in the file as in Bevy. Bevy packs the corners as fractions of 1, so nothing may lie beyond.
    fn rect(&self) -> Option<Rect> {
        let [u, v] = self.offset;
        let corners = [u, v, u + self.scale[0], v + self.scale[1]];
        let inside = corners.iter().all(|x| (-ROUNDING..=1.0 + ROUNDING).contains(x));
        let [u0, v0, u1, v1] = corners.map(|x| x.clamp(0.0, 1.0));
        // Not `Rect::new`, which would swap corners.
        inside.then_some(Rect { min: [u0, v0].into(), max: [u1, v1].into() })
    }
}

/// Whether all surfaces of a node's mesh have the set that lightmaps are read with.
fn has_texcoord(node: &gltf::Node) -> bool {
    use gltf::mesh::Mode;
    let mut primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
    primitives.all(|primitive| {
        let surface = matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        !surface || primitive.get(&gltf::Semantic::TexCoords(TEXCOORD)).is_some()
    })
}

fn parsed<T: DeserializeOwned>(value: &serde_json::Value, of: &str) -> Result<T, Problem> {
    T::deserialize(value).map_err(|error| format!("the data of {of} make no sense: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A file with two nodes on one page, and a lamp that is in it.
    fn file() -> Value {
        json!({
            "asset": { "version": "2.0" },
            "extensionsUsed": [NAME],
            "extensions": { NAME: {
                "pages": [{ "bufferView": 0, "mimeType": "image/x-exr", "width": 8, "height": 4,
                            "encoding": "irradiance", "content": "full", "scale": 2.0 }],
                "bakedLights": [2], "generator": "luxel" } },
            "accessors": [{ "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] },
                          { "componentType": 5126, "count": 3, "type": "VEC2" }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 1 } }] }],
            "nodes": [
                { "mesh": 0, "name": "Wall",
                  "extensions": { NAME: { "page": 0, "texCoord": 1, "offset": [0.25, 0.5], "scale": [0.5, 0.25] } } },
                { "mesh": 0 },
                { "name": "Lamp" }
            ]
        })
    }

    fn read(file: &Value) -> Result<Baked, Problem> {
        let bytes = serde_json::to_vec(file).unwrap();
        Baked::read(&gltf::Gltf::from_slice_without_validation(&bytes).unwrap().document)
    }

    fn problem(change: impl FnOnce(&mut Value)) -> Problem {
        let mut file = file();
        change(&mut file);
        read(&file).unwrap_err()
    }

    #[test]
    fn rectangles_become_corners() {
        let baked = read(&file()).unwrap();
        assert_eq!(baked.places.len(), 1);
        assert_eq!(baked.places[&0], (0, Rect::new(0.25, 0.5, 0.75, 0.75)));
        assert_eq!(baked.lights, HashSet::from_iter([2]));
        assert_eq!((baked.pages[0].width, baked.pages[0].height, baked.pages[0].scale), (8, 4, 2.0));
    }

    #[test]
    fn a_mirrored_rectangle_stays_mirrored() {
        let mut file = file();
        file["nodes"][0]["extensions"][NAME]["offset"] = json!([0.75, 0.0]);
        file["nodes"][0]["extensions"][NAME]["scale"] = json!([-0.5, 1.0]);
        let (_, rect) = read(&file).unwrap().places[&0];
        assert_eq!((rect.min.x, rect.max.x), (0.75, 0.25));
    }

    #[test]
    fn files_without_lightmap_light_nothing() {
        let mut file = file();
        file.as_object_mut().unwrap().remove("extensions");
        let baked = read(&file).unwrap();
        assert!(baked.places.is_empty() && baked.lights.is_empty());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let node = |file: &mut Value, key: &str, value| file["nodes"][0]["extensions"][NAME][key] = value;
        let page = |file: &mut Value, key: &str, value| file["extensions"][NAME]["pages"][0][key] = value;
        let said = [
            (problem(|f| node(f, "page", json!(3))), "node 0 (Wall) is on page 3, but the file has 1"),
            (problem(|f| node(f, "texCoord", json!(2))), "TEXCOORD_2"),
            (problem(|f| node(f, "scale", json!([0.9, 0.1]))), "node 0 (Wall) reaches beyond its page"),
            (problem(|f| node(f, "offset", json!(null))), "the data of node 0 (Wall) make no sense"),
            (problem(|f| node(f, "offset", json!([1e39, 0]))), "node 0 (Wall) reaches beyond its page"),
            (problem(|f| node(f, "page", json!(-1))), "the data of node 0 (Wall) make no sense"),
            (
                problem(|f| {
                    f["nodes"][0].as_object_mut().unwrap().remove("mesh");
                }),
                "node 0 (Wall) has a rectangle but no mesh",
            ),
            (problem(|f| page(f, "scale", json!(0.0))), "page 0 has the scale 0"),
            (problem(|f| page(f, "encoding", json!("radiance"))), "page 0 holds radiance, not irradiance"),
            (
                problem(|f| page(f, "bufferView", json!(null))),
                "page 0 has to be in a bufferView of the file or at a uri",
            ),
            (problem(|f| page(f, "uri", json!("a.exr"))), "page 0 has to be in a bufferView of the file or at a uri"),
            (problem(|f| f["extensions"][NAME] = json!({})), "the data of the file make no sense"),
            (
                problem(|f| {
                    f["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_1");
                }),
                "TEXCOORD_1",
            ),
        ];
        for (problem, part) in said {
            assert!(problem.contains(part) && !problem.contains('\n'), "{problem:?} does not say {part:?}");
        }
    }
}
