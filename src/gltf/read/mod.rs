//! glTF in: a file to the [`Document`] as it is and the [`Scene`] it describes.
//!
//! Everything is resolved here, and everything is checked here: whatever the file's bytes, the answer is a valid scene
//! or an [`crate::error::Error`] that names the part, the problem and a remedy. Nothing is allocated by a number that the
//! file merely claims; nothing recurses by the file's depth.
//!
//! glTF 2.0; <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>.

mod accessors;
mod baked;
mod cameras;
mod container;
mod extensions;
mod lights;
mod materials;
mod meshes;
mod nodes;
mod source;
mod textures;
mod warnings;
mod wishes;

pub use baked::{Bound, Record, bound, check_lights, record};

use crate::{
    error::{Error, Result},
    gltf::Document,
    scene::{Instance, Mesh, Scene, Sky},
};
use glam::DVec3;
use materials::Materials;
use nodes::Placed;
use source::Source;
use std::{collections::HashMap, path::Path};
use warnings::Warnings;

/// Largest extent of a scene (metres): beyond, areas and distances squared overflow single precision.
const MAX_EXTENT: f64 = 1e9;

/// What of a file becomes the scene.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Name patterns (`*`, `?`, `[a-z]`, `{a,b}`) of nodes to leave out with all that is below them. Default: none.
    pub exclude: Vec<String>,
    /// Multiplies the file's punctual lights, 0 or more. Default: 1.
    pub light_scale: f32,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { exclude: Vec::new(), light_scale: 1.0 }
    }
}

/// What was read.
#[derive(Clone, Debug)]
pub struct Input {
    /// The file as it is.
    pub document: Document,
    /// What it describes, with a black sky. (The white one for a scene without any light is the command line's.)
    pub scene: Scene,
    /// What the user should know, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads the glTF file (.glb or .gltf) at `path`.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Input> {
    read_scene(open(path)?, options)
}

/// Opens the glTF file (.glb or .gltf) at `path`, and looks no further.
pub fn open(path: &Path) -> Result<Document> {
    container::open(path)
}

/// Reads the scene that `document` describes.
pub fn read_scene(document: Document, options: &ReadOptions) -> Result<Input> {
    let mut warnings = Warnings::default();
    let scene = scene(&Source::new(&document)?, options, &mut warnings)?;
    Ok(Input { document, scene, warnings: warnings.sentences() })
}

fn scene(source: &Source, options: &ReadOptions, warnings: &mut Warnings) -> Result<Scene> {
    let placed = nodes::place(source, options, warnings)?;
    let mut materials = Materials::new(source);
    let (meshes, mut instances) = lit(source, &placed, &mut materials, warnings)?;
    if instances.is_empty() {
        let left_out = warnings.sentences().join("\n  ");
        let remedy = match (left_out.is_empty(), options.exclude.is_empty()) {
            (false, _) => left_out,
            (true, false) => "--exclude may leave out too much; if it does not, export the meshes too".into(),
            (true, true) => "export the meshes too".into(),
        };
        return Err(Error::invalid(source.file, "scene", "there is no triangle to light", remedy));
    }
    let origin = centre(source, &meshes, &instances)?;
    for instance in &mut instances {
        instance.transform.translation -= origin;
    }
    let lights = lights::read(source, &placed, origin, options.light_scale, warnings)?;
    let cameras = cameras::read(source, &placed, origin)?;
    let (materials, textures) = materials.finish(warnings)?;
    let file = source.file.into();
    Ok(Scene { file, origin, meshes, instances, materials, textures, lights, sky: Sky::Black, cameras })
}

/// The nodes that cast and receive, and their meshes, each read once.
fn lit(
    source: &Source,
    placed: &[Placed],
    materials: &mut Materials,
    warnings: &mut Warnings,
) -> Result<(Vec<Mesh>, Vec<Instance>)> {
    let (mut meshes, mut instances): (Vec<Mesh>, Vec<Instance>) = Default::default();
    let mut read: HashMap<usize, Option<u32>> = HashMap::new();
    let (mut triangles, mut total) = (0u64, meshes::Total::default());
    for p in placed {
        let Some(index) = source.nodes[p.node].mesh.map(|m| m.value()) else { continue };
        let name = source.node_name(p.node);
        source.part(&source.meshes, index, "mesh", &name)?;
        if !nodes::is_lit(source, p, index, warnings) {
            continue;
        }
        if extensions::extension(source.value("nodes", p.node), extensions::INSTANCING).is_some() {
            return Err(extensions::refused(source.file, extensions::INSTANCING, &name));
        }
        let mesh = match read.get(&index) {
            Some(known) => *known,
            None => {
                let mesh = meshes::read(source, index, materials, &mut total, warnings)?;
                let at = mesh.map(|mesh| {
                    meshes.push(mesh);
                    meshes.len() as u32 - 1
                });
                read.insert(index, at);
                at
            }
        };
        let Some(mesh) = mesh else { continue };
        let m = p.world.matrix3;
        if [m.x_axis.cross(m.y_axis), m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis)] == [DVec3::ZERO; 3] {
            warnings.about(name, "is scaled to nothing and left out");
            continue;
        }
        triangles += meshes[mesh as usize].triangles.len() as u64;
        if triangles > u64::from(u32::MAX) {
            return Err(source.invalid(name, "the scene has more than 4 thousand million triangles"));
        }
        let texels_per_meter = p.wishes.texels_per_meter;
        instances.push(Instance { name, node: p.node as u32, mesh, transform: p.world, texels_per_meter });
    }
    Ok((meshes, instances))
}

/// Centre of the box around the instances' boxes in the world.
fn centre(source: &Source, meshes: &[Mesh], instances: &[Instance]) -> Result<DVec3> {
    let boxes: Vec<[DVec3; 2]> = meshes.iter().map(|m| bounds(m.positions.iter().map(|p| p.as_dvec3()))).collect();
    let mut ends = Vec::new();
    for instance in instances {
        let own = boxes[instance.mesh as usize];
        let corner = |i: usize| DVec3::new(own[i & 1].x, own[i >> 1 & 1].y, own[i >> 2].z);
        let placed = bounds((0..8).map(|i| instance.transform.transform_point3(corner(i))));
        if !(placed.iter().all(|p| p.is_finite()) && (placed[1] - placed[0]).max_element() <= MAX_EXTENT) {
            return Err(too_large(source, &instance.name));
        }
        ends.extend(placed);
    }
    let [low, high] = bounds(ends.into_iter());
    if (high - low).max_element() > MAX_EXTENT {
        return Err(too_large(source, "scene"));
    }
    Ok((low + high) * 0.5)
}

fn too_large(source: &Source, place: &str) -> Error {
    let remedy = "scale it down, or leave out what lies so far away: lengths are metres";
    Error::invalid(source.file, place, format!("is larger than {MAX_EXTENT:e} metres"), remedy)
}

fn bounds(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}
