//! [`Tree`]: a bounding volume hierarchy with eight children a node. The only place that knows the BVH crate.
//!
//! obvhs builds a binary tree (PLOC and reinsertion); which of its nodes stay is chosen so that the expected cost of a ray
//! is least (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017).

use crate::math::{
    hash,
    simd::{Eight, LANES},
    unit_float,
};
use glam::Vec3;
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
};
use std::time::Duration;

/// Nodes, root first.
#[derive(Default)]
pub struct Tree {
    pub nodes: Vec<Node>,
    /// Primitives of each leaf, then [`NOTHING`].
    pub leaves: Vec<[u32; LANES]>,
}

/// Boxes of eight children and where they are.
#[derive(Clone)]
#[repr(C, align(32))]
pub struct Node {
    /// Least and largest x, y, z of each child.
    pub bounds: [[Eight; 3]; 2],
    /// Index of a node, of a leaf with [`LEAF`] set, or of what stands alone with [`PLACE`] set.
    pub children: [u32; LANES],
}

/// A lane of a leaf without a primitive.
pub const NOTHING: u32 = u32::MAX;

/// Marks a child that is a leaf.
pub const LEAF: u32 = 1 << 31;

/// Marks a child that stands alone.
pub const PLACE: u32 = 1 << 30;

/// A box.
#[derive(Clone, Copy)]
pub struct Bounds {
    pub min: Vec3,
    pub max: Vec3,
}

/// Cost of visiting a leaf relative to that of a node.
const LEAF_COST: f32 = 1.0;

impl Bounds {
    /// No point.
    pub const NONE: Bounds = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Around a triangle.
    pub fn of([a, b, c]: &[Vec3; 3]) -> Self {
        Bounds { min: a.min(*b).min(*c), max: a.max(*b).max(*c) }
    }

    /// Around both.
    pub fn with(self, o: Bounds) -> Self {
        Bounds { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    /// Largest coordinate.
    pub fn extent(&self) -> f32 {
        if self.min.x > self.max.x { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }
}

impl Tree {
    /// Over boxes of primitives, each made wider by a margin that serves twice. It covers the rounding of the box test, or
    /// rays would slip through at edges between flat boxes. And it keeps centroids off the scene's maximum planes: obvhs
    /// 0.4 sorts one that lies there to the opposite side, which ruins the tree of a room with flat outer walls.
    ///
    /// Primitives from `alone` on share no leaf: they are children of nodes themselves.
    pub fn new(boxes: &[Bounds], alone: usize, margin: Vec3) -> Self {
        if boxes.is_empty() {
            return Tree { nodes: vec![Node::empty()], ..Tree::default() };
        }
        let wider = |(i, b): (usize, &Bounds)| {
            let margin = margin * (1.0 + unit_float(hash(i as u32, 0x6d61_7267)));
            Aabb { min: (b.min - margin).into(), max: (b.max + margin).into() }
        };
        let params = BvhBuildParams {
            max_prims_per_leaf: 1,
            post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
            ..BvhBuildParams::medium_build()
        };
        let boxes: Vec<Aabb> = boxes.iter().enumerate().map(wider).collect();
        Collapse::new(&build_bvh2(&boxes, params, &mut Duration::default()), alone).tree()
    }

    /// Expected number of nodes and leaves that a random ray through the root's box visits.
    #[cfg(test)]
    pub fn cost(&self) -> f32 {
        let area = |node: &Node, lane: usize| {
            let size = |axis: usize| (node.bounds[1][axis].0[lane] - node.bounds[0][axis].0[lane]).max(0.0);
            size(0) * size(1) + size(1) * size(2) + size(2) * size(0)
        };
        let least = |axis: usize| self.nodes[0].bounds[0][axis].0.iter().copied().fold(f32::INFINITY, f32::min);
        let most = |axis: usize| self.nodes[0].bounds[1][axis].0.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let root = [0, 1, 2].map(|axis| most(axis) - least(axis));
        let all: f32 = self.nodes.iter().map(|n| (0..LANES).map(|lane| area(n, lane)).sum::<f32>()).sum();
        all / (root[0] * root[1] + root[1] * root[2] + root[2] * root[0])
    }
}

struct Collapse<'a> {
    binary: &'a Bvh2,
    /// Primitives from here on share no leaf.
    alone: usize,
    /// For each binary node: least cost as 1..=7 roots at most; the first as a node or leaf of its own.
    costs: Vec<[f32; LANES - 1]>,
    /// Primitives under it; more than a leaf holds if one of them shares none.
    counts: Vec<u32>,
}

impl<'a> Collapse<'a> {
    fn new(binary: &'a Bvh2, alone: usize) -> Self {
        let n = binary.nodes.len();
        let mut this = Collapse { binary, alone, costs: vec![[0.0; LANES - 1]; n], counts: vec![0; n] };
        let mut order = Vec::with_capacity(n);
        let mut stack = vec![0usize];
        while let Some(i) = stack.pop() {
            order.push(i);
            let node = &binary.nodes[i];
            if !node.is_leaf() {
                stack.extend([node.first_index as usize, node.first_index as usize + 1]);
            }
        }
        for &i in order.iter().rev() {
            this.settle(i);
        }
        this
    }

    fn settle(&mut self, i: usize) {
        let node = &self.binary.nodes[i];
        let area = node.aabb().half_area();
        if node.is_leaf() {
            self.counts[i] = if self.stands_alone(i).is_some() { LANES as u32 + 1 } else { node.prim_count };
            self.costs[i] = [area * LEAF_COST; LANES - 1];
            return;
        }
        let (l, r) = (node.first_index as usize, node.first_index as usize + 1);
        self.counts[i] = self.counts[l] + self.counts[r];
        let mut costs = [0.0; LANES - 1];
        let inner = area + self.spread(l, r, LANES);
        costs[0] = if self.counts[i] as usize <= LANES { inner.min(area * LEAF_COST) } else { inner };
        for k in 2..LANES {
            costs[k - 1] = self.spread(l, r, k).min(costs[k - 2]);
        }
        self.costs[i] = costs;
    }

    /// The primitive of a binary leaf, counted from those that share none.
    fn stands_alone(&self, i: usize) -> Option<usize> {
        let node = &self.binary.nodes[i];
        let first = node.is_leaf().then(|| self.binary.primitive_indices[node.first_index as usize] as usize)?;
        first.checked_sub(self.alone)
    }

    /// Least cost of two nodes as `k` roots at most.
    fn spread(&self, l: usize, r: usize, k: usize) -> f32 {
        let (l, r) = (&self.costs[l], &self.costs[r]);
        (1..k).map(|j| l[j - 1] + r[k - j - 1]).fold(f32::INFINITY, f32::min)
    }

    fn is_leaf(&self, i: usize) -> bool {
        let node = &self.binary.nodes[i];
        node.is_leaf() || {
            let area = node.aabb().half_area();
            self.counts[i] as usize <= LANES && area * LEAF_COST <= self.costs[i][0]
        }
    }

    fn tree(&self) -> Tree {
        let mut tree = Tree::default();
        if self.is_leaf(0) {
            let leaf = self.leaf(0, &mut tree);
            tree.nodes.push(Node::empty());
            tree.nodes[0].set(0, self.binary.nodes[0].aabb(), leaf);
            return tree;
        }
        tree.nodes.push(Node::empty());
        let mut open = vec![(0usize, 0usize)];
        let mut roots = Vec::new();
        while let Some((binary, wide)) = open.pop() {
            roots.clear();
            let node = &self.binary.nodes[binary];
            self.roots(node.first_index as usize, node.first_index as usize + 1, LANES, &mut roots);
            for (lane, &i) in roots.iter().enumerate() {
                let child = if self.is_leaf(i) {
                    self.leaf(i, &mut tree)
                } else {
                    tree.nodes.push(Node::empty());
                    open.push((i, tree.nodes.len() - 1));
                    tree.nodes.len() as u32 - 1
                };
                tree.nodes[wide].set(lane, self.binary.nodes[i].aabb(), child);
            }
        }
        tree
    }

    /// The best way to stand for two nodes by `k` roots at most.
    fn roots(&self, l: usize, r: usize, k: usize, out: &mut Vec<usize>) {
        let j = (1..k).min_by(|&a, &b| {
            let cost = |j: usize| self.costs[l][j - 1] + self.costs[r][k - j - 1];
            cost(a).total_cmp(&cost(b))
        });
        let j = j.unwrap_or(1);
        self.expand(l, j, out);
        self.expand(r, k - j, out);
    }

    fn expand(&self, i: usize, k: usize, out: &mut Vec<usize>) {
        let mut k = k;
        while k > 1 && self.costs[i][k - 1] == self.costs[i][k - 2] {
            k -= 1;
        }
        if k == 1 {
            out.push(i);
        } else {
            let node = &self.binary.nodes[i];
            self.roots(node.first_index as usize, node.first_index as usize + 1, k, out);
        }
    }

    fn leaf(&self, i: usize, tree: &mut Tree) -> u32 {
        if let Some(primitive) = self.stands_alone(i) {
            return PLACE | primitive as u32;
        }
        let (mut primitives, mut count) = ([NOTHING; LANES], 0);
        let mut stack = vec![i];
        while let Some(i) = stack.pop() {
            let node = &self.binary.nodes[i];
            let first = node.first_index as usize;
            if node.is_leaf() {
                let own = &self.binary.primitive_indices[first..first + node.prim_count as usize];
                primitives[count..count + own.len()].copy_from_slice(own);
                count += own.len();
            } else {
                stack.extend([first, first + 1]);
            }
        }
        tree.leaves.push(primitives);
        LEAF | (tree.leaves.len() as u32 - 1)
    }
}

impl Node {
    /// No child: boxes that no ray meets.
    fn empty() -> Self {
        let (min, max) = (Eight([f32::INFINITY; LANES]), Eight([f32::NEG_INFINITY; LANES]));
        Node { bounds: [[min; 3], [max; 3]], children: [0; LANES] }
    }

    fn set(&mut self, lane: usize, bounds: &Aabb, child: u32) {
        for axis in 0..3 {
            self.bounds[0][axis].0[lane] = bounds.min[axis];
            self.bounds[1][axis].0[lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }
}
