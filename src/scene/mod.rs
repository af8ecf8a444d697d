//! [`Scene`]: what is there to be lit and what lights it. Knows nothing of glTF.
//!
//! Everything is resolved at the door: node trees are flattened to instances, defaults filled in, textures decoded,
//! strips and fans made into triangles. Positions are metres, relative to [`Scene::origin`], so that single precision
//! holds far from the world's origin. Colours are linear Rec. 709.

mod light;
mod material;
mod sky;
mod texture;
mod world;

pub use light::{Bake, Light, LightKind, MAX_LIGHT};
pub use material::{Alpha, Material, Surface};
pub use sky::{Sky, SkyMap};
pub use texture::{Texture, TextureRef, Wrap};
pub use world::{World, shading_normal};

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use std::{ops::Range, path::PathBuf};

/// A static scene. Build one by hand or with [`crate::gltf::read`]; the rest of luxel never changes it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Where it came from, for messages.
    pub file: PathBuf,
    /// World position (metres) of this scene's (0, 0, 0).
    pub origin: DVec3,
    /// Meshes in their own space.
    pub meshes: Vec<Mesh>,
    /// Meshes placed in the world.
    pub instances: Vec<Instance>,
    /// Materials that primitives name.
    pub materials: Vec<Material>,
    /// Textures that materials name.
    pub textures: Vec<Texture>,
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// What rays see that leave the scene.
    pub sky: Sky,
    /// The file's cameras, for pictures.
    pub cameras: Vec<Camera>,
}

/// Triangles that share vertices; the unit that is unwrapped once and may be placed several times.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name for messages, for example `mesh 3 "Wall"`.
    pub name: String,
    /// Index of the mesh in the source document.
    pub source: u32,
    /// Object space, metres before the instance's transform; finite.
    pub positions: Vec<Vec3>,
    /// Unit length, one a vertex; zero where the vertex has none (the face normal is used).
    pub normals: Vec<Vec3>,
    /// Texture coordinate sets: `uvs[set][vertex]`, each set empty or one a vertex (zero where a primitive lacks it).
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear vertex colours, empty or one a vertex (white where a primitive lacks them).
    pub colors: Vec<Vec4>,
    /// Vertex indices; counter-clockwise is the front. Degenerate triangles are kept, so the order is the file's.
    pub triangles: Vec<[u32; 3]>,
    /// The parts of `triangles` by material, in order and without gaps.
    pub primitives: Vec<Primitive>,
}

/// A run of a mesh's triangles with one material.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Index among the source mesh's primitives, for messages and for writing back.
    pub source: u32,
    /// Its triangles in [`Mesh::triangles`].
    pub triangles: Range<u32>,
    /// Its vertices in [`Mesh::positions`]; no other primitive uses them.
    pub vertices: Range<u32>,
    /// Index in [`Scene::materials`].
    pub material: u32,
    /// Bit s is set if the file has texture coordinate set s for this primitive.
    pub uv_sets: u32,
}

/// A mesh placed in the world: the unit that has a rectangle of lightmap.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name for messages, for example `node 7 "Lamp"`.
    pub name: String,
    /// Index of the node in the source document: where the lightmap is bound.
    pub node: u32,
    /// Index in [`Scene::meshes`].
    pub mesh: u32,
    /// Object space to this scene's space ([`Scene::origin`] taken off). A negative determinant mirrors.
    pub transform: DAffine3,
    /// Lightmap density wished for this instance, texels per metre; 0: no map of its own, but it still reflects.
    pub texels_per_meter: Option<f64>,
}

/// A camera of the file.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name of the camera or of its node.
    pub name: String,
    /// Position in this scene's space.
    pub eye: Vec3,
    /// Unit view direction.
    pub forward: Vec3,
    /// Unit up direction.
    pub up: Vec3,
    /// Vertical field of view, radians.
    pub yfov: f32,
}

impl Mesh {
    /// Index of the primitive that holds triangle `t` of this mesh.
    pub fn primitive_of(&self, t: u32) -> usize {
        self.primitives.partition_point(|p| p.triangles.end <= t)
    }
}

impl Instance {
    /// True if the transform mirrors, which turns the winding around.
    pub fn mirrored(&self) -> bool {
        self.transform.matrix3.determinant() < 0.0
    }
}
