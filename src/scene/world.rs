//! [`World`]: the scene's triangles in world space, by global index.

use super::{Material, Mesh, Scene};
use glam::{DMat3, DVec3, Vec2, Vec3};

/// Every triangle of every instance, placed. A *global triangle* counts through the instances in order; rays report it
/// and texels are found by it. Corners are computed when asked for, always to the same bits.
pub struct World<'s> {
    /// The scene it places.
    pub scene: &'s Scene,
    starts: Vec<u32>,
    frames: Vec<Placing>,
}

struct Placing {
    linear: DMat3,
    translation: DVec3,
    /// Inverse transpose of `linear`, turned so that normals keep pointing to the front.
    normal: DMat3,
    mirrored: bool,
}

impl<'s> World<'s> {
    /// Places the instances of `scene`.
    pub fn new(scene: &'s Scene) -> Self {
        let mut starts = vec![0u32];
        for i in &scene.instances {
            starts.push(starts[starts.len() - 1] + scene.meshes[i.mesh as usize].triangles.len() as u32);
        }
        let frames = scene
            .instances
            .iter()
            .map(|i| {
                let linear = i.transform.matrix3;
                // The cofactor matrix is the inverse transpose up to the determinant, and exists for flat scales too.
                let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
                let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
                let mirrored = linear.determinant() < 0.0;
                // Only directions count: of a size that single precision holds.
                let size = cofactor.to_cols_array().iter().fold(0.0, |m: f64, c| m.max(c.abs())).max(f64::MIN_POSITIVE);
                let normal = cofactor * ((if mirrored { -1.0 } else { 1.0 }) / size);
                Placing { linear, translation: i.transform.translation, normal, mirrored }
            })
            .collect();
        World { scene, starts, frames }
    }

    /// Number of global triangles.
    pub fn len(&self) -> u32 {
        self.starts[self.starts.len() - 1]
    }

    /// True if there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Global triangles of an instance.
    pub fn triangles_of(&self, instance: usize) -> std::ops::Range<u32> {
        self.starts[instance]..self.starts[instance + 1]
    }

    /// Instance of a global triangle, and the triangle's index in the mesh.
    pub fn locate(&self, triangle: u32) -> (usize, u32) {
        let instance = self.starts.partition_point(|&s| s <= triangle) - 1;
        (instance, triangle - self.starts[instance])
    }

    /// Mesh of an instance.
    pub fn mesh(&self, instance: usize) -> &'s Mesh {
        &self.scene.meshes[self.scene.instances[instance].mesh as usize]
    }

    /// Material of a global triangle.
    pub fn material(&self, triangle: u32) -> &'s Material {
        let (instance, t) = self.locate(triangle);
        let mesh = self.mesh(instance);
        &self.scene.materials[mesh.primitives[mesh.primitive_of(t)].material as usize]
    }

    /// Corners of triangle `t` of `instance`, in the mesh's order.
    pub fn corners(&self, instance: usize, t: u32) -> [Vec3; 3] {
        let (mesh, f) = (self.mesh(instance), &self.frames[instance]);
        mesh.triangles[t as usize].map(|v| (f.linear * mesh.positions[v as usize].as_dvec3() + f.translation).as_vec3())
    }

    /// Twice the area times the unit normal of the front, from `corners`.
    pub fn cross(&self, instance: usize, corners: &[Vec3; 3]) -> Vec3 {
        let c = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if self.frames[instance].mirrored { -c } else { c }
    }

    /// Vertex normals of a triangle in world space, as long as they are in the file; `None` if none leaves the `face`'s by
    /// more than rounding.
    pub fn smooth_normals(&self, instance: usize, t: u32, face: Vec3) -> Option<[Vec3; 3]> {
        let (mesh, turn) = (self.mesh(instance), &self.frames[instance].normal);
        let corners = mesh.triangles[t as usize].map(|v| (*turn * mesh.normals[v as usize].as_dvec3()).as_vec3());
        let corner = [Vec2::ZERO, Vec2::X, Vec2::Y];
        corner.iter().any(|&c| shading_normal(&corners, c, face).dot(face) < 1.0 - 1e-6).then_some(corners)
    }
}

/// Unit normal at barycentrics (1 - u - v, u, v) of a triangle with these normals at its `corners`; `face` where there is
/// none, or where it points behind the face.
#[inline]
pub fn shading_normal(corners: &[Vec3; 3], bary: Vec2, face: Vec3) -> Vec3 {
    let [a, b, c] = corners;
    let n = (a * (1.0 - bary.x - bary.y) + b * bary.x + c * bary.y).normalize_or_zero();
    if n.dot(face) > 1e-3 { n } else { face }
}
