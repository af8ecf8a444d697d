//! Emitting triangles, and patches that reflect: Lambert's closed form for the few that matter, importance sampling for
//! the many far ones.
//!
//! A binary tree over the emitters gives each texel a cut (after Walter et al., "Lightcuts", 2005): triangles that are
//! near, groups further away. A few triangles are worth their exact unshadowed irradiance times the sampled share that
//! arrives; a longer cut is sampled by what each part may send at most.

use super::{disc::Disc, lambert::Corners};
use crate::{
    atlas::Coverage,
    math::luminance,
    patches::{Faces, Footprint, Patches, SurfacePoint},
    scene::{Material, Mesh, Scene, World},
    trace::rounding,
};
use glam::{Vec2, Vec3};

/// [`Emitters::exact`] of surfaces that shine; of patches that reflect, which are small and many, none.
const EXACT: usize = 16;
/// An inner node is opened while its radius exceeds this share of its distance; of patches that reflect, which are as small as
/// the texel, its radius and the texel's.
const OPEN: f32 = 0.5;
/// A triangle is near if its radius and the texel's exceed this share of its distance.
const NEAR: f32 = 0.25;
/// A patterned emitter's edge is seen as that many parts.
const TEXTURE_PARTS: f32 = 8.0;
/// Points at which a patterned emitter is averaged.
const TEXTURE_POINTS: u32 = 64;

/// All emitting triangles.
#[derive(Default)]
pub(super) struct Emitters {
    triangles: Vec<Emitter>,
    /// Running sum of power; `cumulative[i]` is before triangle i.
    cumulative: Vec<f64>,
    nodes: Vec<Node>,
    /// Most triangles of a cut that are worth their closed form though they are not near.
    exact: usize,
}

struct Emitter {
    corners: [Vec3; 3],
    /// Of their coordinates, metres.
    rounding: f32,
    normal: Vec3,
    area: f32,
    /// Mean radiance L.
    radiance: Vec3,
    /// True if radiance differs from point to point.
    patterned: bool,
    /// Length, in texture coordinates, over which textures are averaged.
    footprint: f32,
    two_sided: bool,
    instance: usize,
    local: u32,
}

struct Node {
    disc: Disc,
    begin: u32,
    end: u32,
    /// Index of the second child (the first follows its parent); 0 for a leaf.
    second: u32,
}

/// One node of a texel's cut.
#[derive(Clone, Copy)]
pub(super) struct Stratum {
    node: u32,
    /// A triangle too near for points on it to stand for it.
    near: bool,
    /// What it may send at most (luminance), for sharing out samples.
    pub weight: f32,
}

/// A sample of a stratum.
pub(super) struct Sample {
    /// The way to the emitter, metres.
    pub way: Vec3,
    /// Unshadowed irradiance that this sample stands for, times the number of samples.
    pub irradiance: Vec3,
    /// The same for the emitter's mean radiance: what the closed form knows.
    pub mean: Vec3,
}

impl Emitters {
    /// Every triangle of the world whose material emits.
    pub fn new(world: &World) -> Self {
        let triangles: Vec<Emitter> = (0..world.scene.instances.len())
            .flat_map(|i| world.mesh(i).primitives.iter().map(move |p| (i, p)))
            .filter(|(_, p)| world.scene.materials[p.material as usize].emits())
            .flat_map(|(i, p)| p.triangles.clone().map(move |t| (i, t)))
            .filter_map(|(i, t)| Emitter::new(world, i, t))
            .collect();
        Self::grown(triangles, EXACT)
    }

    /// The pieces of all patches of which `exitance` is not zero.
    pub fn of_patches(world: &World, coverage: &Coverage, patches: &Patches, exitance: &[Vec3]) -> Self {
        let (mut faces, mut footprint) = (Faces::new(world, coverage), Footprint::default());
        let mut triangles = Vec::new();
        for (i, m) in exitance.iter().enumerate().filter(|(_, m)| **m != Vec3::ZERO) {
            let (texel, back) = patches.texel(i);
            footprint.set(texel, &mut faces);
            // What rays pass through sends nothing.
            let met = patches.area[i] / footprint.area().max(1e-30);
            let radiance = *m * (met * std::f32::consts::FRAC_1_PI);
            triangles.extend(footprint.triangles().filter_map(|t| Emitter::piece(t, back, radiance)));
        }
        Self::grown(triangles, 0)
    }

    /// The tree over `triangles`.
    fn grown(mut triangles: Vec<Emitter>, exact: usize) -> Self {
        let mut nodes = Vec::new();
        if !triangles.is_empty() {
            let n = triangles.len();
            split(&mut triangles, 0, n, &mut nodes);
        }
        let mut cumulative = vec![0.0];
        for e in &triangles {
            cumulative.push(cumulative[cumulative.len() - 1] + f64::from(e.power()));
        }
        Emitters { triangles, cumulative, nodes, exact }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// True if nothing emits.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// True if every triangle is worth its closed form everywhere.
    pub fn are_few(&self) -> bool {
        self.len() <= self.exact
    }

    /// The nodes that light a texel that lies in `receiver`: leaves where they are near, inner nodes further away.
    pub fn cut(&self, receiver: &Disc, cut: &mut Vec<Stratum>) {
        cut.clear();
        if !self.nodes.is_empty() {
            self.descend(0, receiver, cut);
        }
    }

    fn descend(&self, node: u32, receiver: &Disc, cut: &mut Vec<Stratum>) {
        let n = &self.nodes[node as usize];
        let cosines = receiver.cosine(&n.disc) * n.disc.cosine(receiver);
        if cosines <= 0.0 {
            return;
        }
        let distance = receiver.center.distance(n.disc.center).max(n.disc.radius).max(1e-12);
        let leaf = n.second == 0;
        let texel = if self.exact == 0 { receiver.radius } else { 0.0 };
        if !leaf && (self.are_few() || n.disc.radius + texel > OPEN * distance) {
            self.descend(node + 1, receiver, cut);
            self.descend(n.second, receiver, cut);
            return;
        }
        let power = (self.cumulative[n.end as usize] - self.cumulative[n.begin as usize]) as f32;
        let weight = power * cosines / (distance * distance);
        let near = leaf && n.disc.radius + receiver.radius > NEAR * distance;
        if weight > 0.0 {
            cut.push(Stratum { node, near, weight });
        }
    }

    /// Unshadowed irradiance of a leaf at a point, in closed form.
    pub fn exact(&self, s: &Stratum, p: &SurfacePoint) -> Vec3 {
        let e = &self.triangles[self.nodes[s.node as usize].begin as usize];
        e.radiance * (e.projected_solid_angle(p) / p.kept())
    }

    /// True if a texel in `receiver` is as good as its middle to all of some leaves.
    pub fn see_a_point(&self, leaves: &[Stratum], receiver: &Disc) -> bool {
        leaves.iter().all(|s| receiver.is_point_to(&self.nodes[s.node as usize].disc))
    }

    /// Sorts the cut into the triangles that are near or matter most, each worth its closed form, and the rest.
    pub fn divide<'c>(&self, cut: &'c mut [Stratum]) -> (&'c [Stratum], &'c [Stratum]) {
        let leaf = |s: &Stratum| self.nodes[s.node as usize].second == 0;
        cut.sort_unstable_by(|a, b| {
            let by_kind = b.near.cmp(&a.near).then(leaf(b).cmp(&leaf(a)));
            by_kind.then(b.weight.total_cmp(&a.weight))
        });
        let exact = cut.iter().enumerate().take_while(|(i, s)| s.near || (*i < self.exact && leaf(s))).count();
        cut.split_at(exact)
    }

    /// A point of the stratum, seen from `p`; `None` if it sends nothing there.
    pub fn sample(&self, scene: &Scene, s: &Stratum, p: &SurfacePoint, u: Vec2) -> Option<Sample> {
        let n = &self.nodes[s.node as usize];
        let (k, share, part) = if n.second == 0 { (n.begin as usize, u.x, 1.0) } else { self.within(n, u.x)? };
        let e = &self.triangles[k];
        let root = share.sqrt();
        let bary = Vec2::new(root * (1.0 - u.y), root * u.y);
        let [a, b, c] = e.corners;
        let point = a + (b - a) * bary.x + (c - a) * bary.y;
        let side = if (p.position - point).dot(e.normal) >= 0.0 { 1.0 } else { -1.0 };
        if side < 0.0 && !e.two_sided {
            return None;
        }
        let way = point + e.normal * (side * e.rounding) - p.lifted();
        // Cosines, times the way's length.
        let (cos, cos_e) = (way.dot(p.normal), -way.dot(e.normal) * side);
        if cos <= 0.0 || cos_e <= 0.0 || way.dot(p.face) <= 0.0 {
            return None;
        }
        let radiance = if e.patterned { e.radiance_at(scene, bary) } else { e.radiance };
        let square = way.length_squared();
        let weight = (cos / square) * (cos_e / square) * (e.area / (p.kept() * part));
        Some(Sample { way, irradiance: radiance * weight, mean: e.radiance * weight })
    }

    /// The triangle of an inner node at the share `u` of its power, what of that lies inside the triangle (0..=1), and the
    /// triangle's part of the power.
    fn within(&self, n: &Node, u: f32) -> Option<(usize, f32, f32)> {
        let (begin, end) = (self.cumulative[n.begin as usize], self.cumulative[n.end as usize]);
        let at = begin + f64::from(u) * (end - begin);
        let inside = &self.cumulative[n.begin as usize + 1..n.end as usize];
        let k = n.begin as usize + inside.partition_point(|&c| c <= at);
        let power = self.cumulative[k + 1] - self.cumulative[k];
        let share = ((at - self.cumulative[k]) / power) as f32;
        (power > 0.0).then(|| (k, share.clamp(0.0, 1.0), (power / (end - begin)) as f32))
    }
}

impl Emitter {
    fn new(world: &World, instance: usize, local: u32) -> Option<Self> {
        let corners = world.corners(instance, local);
        let cross = world.cross(instance, &corners);
        let mesh = world.mesh(instance);
        let material = &world.scene.materials[mesh.primitives[mesh.primitive_of(local)].material as usize];
        let mut e = Emitter {
            corners,
            rounding: rounding(&corners),
            normal: cross.normalize_or_zero(),
            area: cross.length() * 0.5,
            radiance: material.emission,
            patterned: material.emission_texture.is_some() || material.has_holes(),
            footprint: texture_extent(mesh, material, local) / TEXTURE_PARTS,
            two_sided: material.double_sided,
            instance,
            local,
        };
        if e.patterned {
            let bary = |i: u32| {
                let [x, y, ..] = sobol_burley::sample_4d(i, 0, 0x656d_6974);
                Vec2::new(x.sqrt() * (1.0 - y), x.sqrt() * y)
            };
            let sum: Vec3 = (0..TEXTURE_POINTS).map(|i| e.radiance_at(world.scene, bary(i))).sum();
            e.radiance = sum / TEXTURE_POINTS as f32;
        }
        (e.area > 0.0 && e.radiance.max_element() > 0.0).then_some(e)
    }

    /// A triangle that emits evenly to one side.
    fn piece(mut corners: [Vec3; 3], back: bool, radiance: Vec3) -> Option<Self> {
        if back {
            corners.swap(1, 2);
        }
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let (normal, area) = (cross.normalize_or_zero(), cross.length() * 0.5);
        let (patterned, footprint, two_sided) = (false, 0.0, false);
        (area > 0.0).then_some(Emitter {
            corners,
            rounding: rounding(&corners),
            normal,
            area,
            radiance,
            patterned,
            footprint,
            two_sided,
            instance: 0,
            local: 0,
        })
    }

    fn power(&self) -> f32 {
        luminance(self.radiance).max(1e-20) * self.area
    }

    fn radiance_at(&self, scene: &Scene, bary: Vec2) -> Vec3 {
        let mesh = &scene.meshes[scene.instances[self.instance].mesh as usize];
        let s = scene.surface(mesh, self.local, bary, self.footprint);
        s.emission * (Vec3::ONE - s.transmittance)
    }

    /// Integral of cos over the solid angle above both the face and the shading normal (Lambert's edge sum, 1760).
    fn projected_solid_angle(&self, p: &SurfacePoint) -> f32 {
        let facing = (p.position - self.corners[0]).dot(self.normal);
        // A point of the triangle itself, lifted off by rounding, would see it as all of its hemisphere.
        if facing.abs() <= self.rounding || (facing < 0.0 && !self.two_sided) {
            return 0.0;
        }
        let mut polygon = Corners::new(self.corners.map(|c| c - p.position));
        polygon.clip(p.face);
        if p.normal != p.face {
            polygon.clip(p.normal);
        }
        polygon.edge_sum(p.normal).abs()
    }
}

/// Edge of a square as large as the triangle in the emission texture (or the one that cuts holes); 0 without a texture,
/// or where all of it reads one point or line.
fn texture_extent(mesh: &Mesh, material: &Material, local: u32) -> f32 {
    let slot = material.emission_texture.as_ref().or(material.base_texture.as_ref().filter(|_| material.has_holes()));
    let Some(set) = slot.and_then(|r| mesh.uvs.get(r.set as usize)).filter(|set| !set.is_empty()) else { return 0.0 };
    let [a, b, c] = mesh.triangles[local as usize].map(|v| set[v as usize]);
    (b - a).perp_dot(c - a).abs().sqrt()
}

/// Splits at the median of the longest axis; children follow their parent.
fn split(triangles: &mut [Emitter], begin: usize, end: usize, nodes: &mut Vec<Node>) {
    let part = &mut triangles[begin..end];
    let me = nodes.len();
    let (low, high) = bounds(part.iter().flat_map(|e| e.corners));
    let normal = part.iter().map(|e| e.normal * e.area).sum::<Vec3>().try_normalize().unwrap_or(part[0].normal);
    let mut disc = Disc::around((low + high) * 0.5, normal);
    part.iter().flat_map(|e| e.corners).for_each(|c| disc.take_point(c));
    part.iter().for_each(|e| disc.take_normal(e.normal, e.two_sided));
    nodes.push(Node { disc, begin: begin as u32, end: end as u32, second: 0 });
    if end - begin > 1 {
        let axis = (high - low).max_position();
        let middle = begin + (end - begin) / 2;
        let along = |e: &Emitter| e.corners[0][axis] + e.corners[1][axis] + e.corners[2][axis];
        part.select_nth_unstable_by(middle - begin, |a, b| along(a).total_cmp(&along(b)));
        split(triangles, begin, middle, nodes);
        nodes[me].second = nodes.len() as u32;
        split(triangles, middle, end, nodes);
    }
}

fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(face: Vec3, normal: Vec3) -> SurfacePoint {
        SurfacePoint {
            position: Vec3::ZERO,
            face,
            normal,
            frame: crate::math::Frame::around(normal),
            triangle: 0,
            bary: Vec2::ZERO,
            offset: 0.0,
        }
    }

    #[test]
    fn a_triangle_does_not_light_itself() {
        let corners = [Vec3::new(0.3, 0.1, 0.7), Vec3::new(1.4, 0.9, 1.3), Vec3::new(0.2, 1.7, 2.1)];
        let e = Emitter::piece(corners, false, Vec3::ONE).expect("an area");
        // The same normal, rounded another way.
        let face = (corners[2] - corners[1]).cross(corners[0] - corners[1]).normalize();
        for i in 0..1000 {
            let [x, y, ..] = sobol_burley::sample_4d(i, 0, 0);
            let (b, c) = (x.sqrt() * (1.0 - y), x.sqrt() * y);
            let position = corners[0] + (corners[1] - corners[0]) * b + (corners[2] - corners[0]) * c;
            let p = SurfacePoint { position, ..point(face, face) };
            assert!(e.projected_solid_angle(&p) < 1e-3, "{position}");
        }
    }

    #[test]
    fn a_huge_plane_fills_the_kept_part() {
        // A tilted shading normal keeps (1 + cos a) / 2 of its hemisphere above the face.
        let tilt: f32 = 0.7;
        let n = Vec3::new(libm::sinf(tilt), 0.0, libm::cosf(tilt));
        let p = point(Vec3::Z, n);
        let big = 1e5;
        let quad = [
            Vec3::new(-big, -big, 1.0),
            Vec3::new(big, -big, 1.0),
            Vec3::new(big, big, 1.0),
            Vec3::new(-big, big, 1.0),
        ];
        let mut sum = 0.0;
        for t in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
            let mut c = Corners::new(t);
            c.clip(p.face);
            c.clip(p.normal);
            sum += c.edge_sum(p.normal).abs();
        }
        assert!((sum / std::f32::consts::PI - p.kept()).abs() < 1e-3, "{sum} {}", p.kept());
    }
}
