//! [`Place`]: an instance whose mesh has a tree of its own.
//!
//! Boxes are met in the space of the mesh, with a margin for what that rounds. Triangles are met in the world's: each visit
//! of a leaf puts them there, to the same bits as [`World::corners`](crate::scene::World::corners). So a ray meets what it
//! would meet were every triangle placed beforehand, and instances that join are as tight as one mesh.

use super::{
    EXTENT, MIRRORED,
    slab::{Slab, inverses},
    walk::Triangles,
};
use crate::{
    math::simd::{Eight, LANES, Lanes},
    scene::Instance,
};
use glam::{Mat3, Vec3};

/// Where the tree of a mesh stands.
pub struct Place {
    /// Root of the mesh's tree.
    pub root: u32,
    /// Added to the ids of the mesh's triangles: the first of the instance, and a flag.
    ids: u32,
    /// From the mesh to the world, a row for each axis of the world.
    rows: [[f64; 4]; 3],
    /// The scene tree's units a metre.
    scale: f32,
    /// Where the mesh's boxes count from, in the scene tree's units.
    middle: Vec3,
    /// From there to the mesh.
    back: Mat3,
}

/// From the units of the scene's tree to those of a mesh, `size` long. Nothing where an instance is flat, or has hardly any
/// size beside the scene's rounding.
pub fn way_back(instance: &Instance, size: f32, scale: f32) -> Option<Mat3> {
    let back = (instance.transform.matrix3.inverse() * (1.0 / f64::from(scale))).as_mat3();
    let sane = lengths(&back).to_array().iter().all(|l| LENGTHS.contains(l));
    (sane && margin(&back).max_element() < MOST * size).then_some(back)
}

/// How far a ray that comes by way of `back` may be off among the boxes of a mesh. Were each of the dozen roundings on the
/// way there and through a box off by the most, and all to the same side, they would come to 29 of 2^-24 of the largest
/// coordinate in the scene; the test of a triangle adds a few.
pub fn margin(back: &Mat3) -> Vec3 {
    lengths(back) * (32.0 * f32::EPSILON * EXTENT)
}

/// The longest that a unit along all axes can become along each.
fn lengths(back: &Mat3) -> Vec3 {
    back.x_axis.abs() + back.y_axis.abs() + back.z_axis.abs()
}

/// Lengths at which distances and their inverses stay finite.
const LENGTHS: std::ops::Range<f32> = 1e-9..1e9;

/// Largest margin, by the size of the mesh: boxes much wider than what they hold make rays slow.
const MOST: f32 = 1.0 / 64.0;

impl Place {
    /// An instance with its first global triangle; `middle` is where the boxes of its mesh count from.
    pub fn new(instance: &Instance, first: u32, root: u32, middle: Vec3, scale: f32, back: Mat3) -> Self {
        let (linear, translation) = (instance.transform.matrix3, instance.transform.translation);
        Place {
            root,
            ids: first | if instance.mirrored() { MIRRORED } else { 0 },
            rows: [0, 1, 2].map(|i| [linear.x_axis[i], linear.y_axis[i], linear.z_axis[i], translation[i]]),
            scale,
            middle: ((linear * middle.as_dvec3() + translation) * f64::from(scale)).as_vec3(),
            back,
        }
    }

    /// A ray (in the scene tree's units) among the boxes of the mesh. Distances along it stay what they are.
    #[inline(always)]
    pub fn slab(&self, origin: Vec3, direction: Vec3) -> Slab {
        Slab::new(self.turned(origin - self.middle), inverses(self.turned(direction)))
    }

    #[inline(always)]
    fn turned(&self, v: Vec3) -> Vec3 {
        self.back.x_axis * v.x + self.back.y_axis * v.y + self.back.z_axis * v.z
    }

    /// The triangles of a leaf where they stand in the world, in the tree's units. Those without area there are left out.
    #[inline(always)]
    pub fn place<S: Lanes>(&self, leaf: &Triangles) -> Triangles {
        let [a, b, c] = &leaf.corners;
        let (a, b, c) = (self.corner::<S>(a), self.corner::<S>(b), self.corner::<S>(c));
        let scaled = |[x, y, z]: [S; 3]| {
            let scale = S::splat(self.scale);
            [x.mul(scale).store(), y.mul(scale).store(), z.mul(scale).store()]
        };
        let mut placed = Triangles { corners: [scaled(a), scaled(b), scaled(c)], ids: leaf.ids };
        placed.ids.iter_mut().for_each(|id| *id += self.ids);
        let flat = flat(a, b, c);
        if flat != 0 {
            let lanes = (0..LANES).filter(|k| flat >> k & 1 != 0);
            lanes.for_each(|k| placed.corners[0][0].0[k] = f32::NAN);
        }
        placed
    }

    /// Eight corners in the world, metres.
    #[inline(always)]
    fn corner<S: Lanes>(&self, [x, y, z]: &[Eight; 3]) -> [S; 3] {
        let p = [S::load(x), S::load(y), S::load(z)];
        let [x, y, z] = &self.rows;
        [S::affine(p, x), S::affine(p, y), S::affine(p, z)]
    }
}

/// Lanes of triangles whose [`World::cross`](crate::scene::World::cross) is zero.
#[inline(always)]
fn flat<S: Lanes>(a: [S; 3], b: [S; 3], c: [S; 3]) -> u32 {
    let from = |p: [S; 3]| [p[0].sub(a[0]), p[1].sub(a[1]), p[2].sub(a[2])];
    let (e, f) = (from(b), from(c));
    let cross = |i: usize, j: usize| e[i].mul(f[j]).sub(f[i].mul(e[j]));
    let (x, y, z) = (cross(1, 2), cross(2, 0), cross(0, 1));
    let zero = S::splat(0.0);
    x.max(y).max(z).le(zero) & zero.le(x.min(y).min(z))
}
