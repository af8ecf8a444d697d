//! [`Forest`]: a tree over the scene, and one over each mesh that is not worth repeating in it.

use super::{
    EXTENT, HOLES, MIRRORED,
    place::{self, Place},
    rounding,
    tree::{Bounds, LEAF, NOTHING, Node, PLACE, Tree},
    walk::Triangles,
};
use crate::{
    math::simd::{Eight, LANES},
    scene::{Instance, Mesh, Scene, World},
};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// All trees in one.
pub struct Forest {
    pub nodes: Vec<Node>,
    pub leaves: Vec<Triangles>,
    /// Instances of meshes with trees of their own.
    pub places: Vec<Place>,
    /// Root of the tree over the scene.
    pub root: u32,
    /// The scene tree's units a metre: a power of two, so that scaling rounds nothing.
    pub scale: f32,
}

/// Fewest triangles of a mesh with a tree of its own. Places of less are slower than their triangles.
const FEWEST: usize = 32;

/// Which meshes should have trees of their own: those that are placed again, if that makes the triangles stored half as many.
/// Caches like that so much that rays become faster, by a tenth where half a million triangles are saved, by two fifths
/// where four million are. But rays among the scene's other triangles become slower by a few hundredths.
pub fn worth_sharing(scene: &Scene) -> Vec<bool> {
    let uses = uses(scene);
    let again = uses.iter().zip(&scene.meshes).map(|(&uses, m)| uses > 1 && m.triangles.len() >= FEWEST);
    let again: Vec<bool> = again.collect();
    let few = 2 * stored(scene, &again) <= stored(scene, &vec![false; again.len()]);
    if few { again } else { vec![false; again.len()] }
}

/// Triangles in all trees.
pub fn stored(scene: &Scene, shared: &[bool]) -> usize {
    let times = uses(scene).into_iter().zip(shared).map(|(uses, &shared)| if shared { 1 } else { uses });
    times.zip(&scene.meshes).map(|(times, mesh)| times * mesh.triangles.len()).sum()
}

/// How often each mesh is placed.
fn uses(scene: &Scene) -> Vec<usize> {
    let mut uses = vec![0; scene.meshes.len()];
    scene.instances.iter().for_each(|i| uses[i.mesh as usize] += 1);
    uses
}

/// A triangle in the units of its tree.
struct Triangle {
    corners: [Vec3; 3],
    id: u32,
}

/// A mesh with a tree of its own: where its root is, and where its boxes count from.
struct Shared {
    root: u32,
    middle: Vec3,
}

impl Forest {
    /// Over all triangles that have area. Meshes that are `shared` get trees of their own where they can be placed.
    pub fn new(world: &World, shared: &[bool]) -> Self {
        let scene = world.scene;
        let instances = 0..scene.instances.len();
        let bounds: Vec<Bounds> = instances.clone().into_par_iter().map(|i| bounds_of(world, i)).collect();
        let extent = bounds.iter().fold(0.0f32, |m, b| m.max(b.extent()));
        let scale = if extent > 0.0 { libm::exp2f(libm::floorf(libm::log2f(EXTENT / extent))) } else { 1.0 };
        let mut forest = Forest { nodes: Vec::new(), leaves: Vec::new(), places: Vec::new(), root: 0, scale };

        let sizes: Vec<f32> = scene.meshes.iter().zip(shared).map(|(m, &s)| if s { size(m) } else { 0.0 }).collect();
        let way_back = |i: &Instance| place::way_back(i, sizes[i.mesh as usize], scale);
        let ways: Vec<Option<Mat3>> = scene.instances.iter().map(way_back).collect();
        let mut margins = vec![Vec3::ZERO; scene.meshes.len()];
        for (instance, back) in scene.instances.iter().zip(&ways) {
            let margin = &mut margins[instance.mesh as usize];
            *margin = back.as_ref().map_or(*margin, |b| margin.max(place::margin(b)));
        }
        let meshes = scene.meshes.par_iter().zip(margins);
        let meshes: Vec<_> =
            meshes.map(|(m, margin)| (margin != Vec3::ZERO).then(|| tree_of(world, m, margin))).collect();
        let meshes: Vec<Option<Shared>> = meshes
            .into_iter()
            .map(|m| m.map(|(tree, triangles, middle)| Shared { root: forest.plant(tree, &triangles), middle }))
            .collect();
        let mut alone = Vec::new();
        for (i, (instance, back)) in scene.instances.iter().zip(&ways).enumerate() {
            let (Some(mesh), Some(back)) = (&meshes[instance.mesh as usize], back) else { continue };
            alone.push(Bounds { min: bounds[i].min * scale, max: bounds[i].max * scale });
            forest.places.push(Place::new(instance, world.triangles_of(i).start, mesh.root, mesh.middle, scale, *back));
        }

        let others = instances.into_par_iter().filter(|&i| ways[i].is_none());
        let triangles: Vec<Triangle> = others.flat_map_iter(|i| triangles_of(world, i, scale)).collect();
        let mut boxes: Vec<Bounds> = triangles.par_iter().map(|t| Bounds::of(&t.corners)).collect();
        boxes.extend(alone);
        let tree = Tree::new(&boxes, triangles.len(), Vec3::splat(scale * rounding(&[Vec3::splat(extent); 3])));
        forest.root = forest.plant(tree, &triangles);
        forest
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..]) + size_of_val(&self.places[..])
    }

    /// Adds a tree; returns its root.
    fn plant(&mut self, tree: Tree, triangles: &[Triangle]) -> u32 {
        let (root, leaf) = (self.nodes.len() as u32, self.leaves.len() as u32);
        self.leaves.par_extend(tree.leaves.par_iter().map(|leaf| Triangles::new(leaf, triangles)));
        self.nodes.par_extend(tree.nodes.into_par_iter().map(|mut node| {
            for child in &mut node.children {
                *child += if *child & LEAF != 0 {
                    leaf
                } else if *child & PLACE != 0 {
                    0
                } else {
                    root
                };
            }
            node
        }));
        root
    }
}

impl Triangles {
    fn new(leaf: &[u32; LANES], triangles: &[Triangle]) -> Self {
        let mut block = Triangles { corners: [[Eight([f32::NAN; LANES]); 3]; 3], ids: [0; LANES] };
        for (lane, &i) in leaf.iter().enumerate().filter(|(_, i)| **i != NOTHING) {
            let t = &triangles[i as usize];
            for (c, p) in t.corners.iter().enumerate() {
                for axis in 0..3 {
                    block.corners[c][axis].0[lane] = p[axis];
                }
            }
            block.ids[lane] = t.id;
        }
        block
    }
}

/// The longest edge of the box around a mesh.
fn size(mesh: &Mesh) -> f32 {
    let box_of = |b: Bounds, p: &Vec3| b.with(Bounds { min: *p, max: *p });
    let bounds = mesh.positions.iter().fold(Bounds::NONE, box_of);
    (bounds.max - bounds.min).max_element()
}

/// Around an instance.
fn bounds_of(world: &World, instance: usize) -> Bounds {
    let corners = (0..world.mesh(instance).triangles.len() as u32).map(|t| world.corners(instance, t));
    corners.fold(Bounds::NONE, |b, c| b.with(Bounds::of(&c)))
}

/// The triangles of an instance that have area, in the units of the scene's tree.
fn triangles_of<'a>(world: &'a World, instance: usize, scale: f32) -> impl Iterator<Item = Triangle> + 'a {
    let mirrored = if world.scene.instances[instance].mirrored() { MIRRORED } else { 0 };
    let first = world.triangles_of(instance).start;
    flagged(world, world.mesh(instance)).filter_map(move |(t, flags)| {
        let corners = world.corners(instance, t);
        let solid = world.cross(instance, &corners) != Vec3::ZERO;
        solid.then(|| Triangle { corners: corners.map(|c| c * scale), id: (first + t) | mirrored | flags })
    })
}

/// A tree over a mesh, boxes from the middle of the mesh, and its triangles where the file has them.
fn tree_of(world: &World, mesh: &Mesh, margin: Vec3) -> (Tree, Vec<Triangle>, Vec3) {
    let corners = |t: u32| mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
    let triangles: Vec<Triangle> =
        flagged(world, mesh).map(|(t, flags)| Triangle { corners: corners(t), id: t | flags }).collect();
    let bounds = triangles.iter().fold(Bounds::NONE, |b, t| b.with(Bounds::of(&t.corners)));
    let middle = bounds.min * 0.5 + bounds.max * 0.5;
    let boxes: Vec<Bounds> = triangles.par_iter().map(|t| Bounds::of(&t.corners.map(|c| c - middle))).collect();
    let tree = Tree::new(&boxes, boxes.len(), margin);
    (tree, triangles, middle)
}

/// The triangles of a mesh and whether they have holes.
fn flagged<'a>(world: &'a World, mesh: &'a Mesh) -> impl Iterator<Item = (u32, u32)> + 'a {
    mesh.primitives.iter().flat_map(move |p| {
        let holes = if world.scene.materials[p.material as usize].has_holes() { HOLES } else { 0 };
        p.triangles.clone().map(move |t| (t, holes))
    })
}
