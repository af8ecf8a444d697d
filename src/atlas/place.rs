//! Rectangles onto pages: how large each instance's is, and where it lies. Whole texels, nothing turned.
//!
//! Knows sizes only, not what lies in a rectangle. Every rectangle keeps [`PADDING`] empty texels around it.

use super::{PADDING, Page, Placement};
use crate::scene::{Instance, Mesh, Scene};
use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use guillotiere::{SimpleAtlasAllocator, size2};
use rayon::prelude::*;

/// Density of hidden rectangles, relative to the visible ones'.
pub(super) const HIDDEN_DENSITY: f64 = 1.0 / 8.0;

/// What an instance has of the lightmap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// A rectangle on a page of the file.
    Mapped,
    /// A coarse rectangle on a hidden page: it reflects, but has no map of its own.
    Hidden,
    /// Nothing: all its materials are unlit, or it has no area.
    Unlit,
}

/// What the scene's instances are to the lightmap.
#[derive(Clone, Debug)]
pub(super) struct Instances {
    /// The role of each.
    pub roles: Vec<Role>,
    /// Area of each in the world, m^2.
    pub areas: Vec<f64>,
}

impl Instances {
    /// Of `scene`.
    pub fn of(scene: &Scene) -> Instances {
        let area = |i: &Instance| world_area(&scene.meshes[i.mesh as usize], i);
        let areas: Vec<f64> = scene.instances.par_iter().map(area).collect();
        let role = |(i, &area): (&Instance, &f64)| {
            let primitives = &scene.meshes[i.mesh as usize].primitives;
            let lit = primitives.iter().any(|p| !p.triangles.is_empty() && !is_unlit(scene, p.material));
            match i.texels_per_meter {
                _ if !lit || area <= 0.0 => Role::Unlit,
                Some(t) if t <= 0.0 => Role::Hidden,
                _ => Role::Mapped,
            }
        };
        Instances { roles: scene.instances.iter().zip(&areas).map(role).collect(), areas }
    }
}

/// True if `material` exists and is unlit.
pub(super) fn is_unlit(scene: &Scene, material: u32) -> bool {
    scene.materials.get(material as usize).is_some_and(|m| m.unlit)
}

/// Area of `mesh` in the world as `instance` places it, m^2.
fn world_area(mesh: &Mesh, instance: &Instance) -> f64 {
    let m = instance.transform.matrix3;
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
        (m * (b - a)).cross(m * (c - a)).length() * 0.5
    };
    let sum: f64 = mesh.triangles.iter().map(area).sum();
    if sum.is_finite() { sum } else { 0.0 }
}

/// Texels that the mapped instances take at least at `density`, on pages of edge `page`.
pub(super) fn least_texels(scene: &Scene, density: f64, page: u32) -> f64 {
    let Instances { roles, areas } = Instances::of(scene);
    let bounds = |m: &Mesh| {
        let end = |f: fn(Vec3, Vec3) -> Vec3| m.positions.iter().copied().reduce(f).unwrap_or_default().as_dvec3();
        end(Vec3::max) - end(Vec3::min)
    };
    let most = f64::from(inner(page));
    let extents: Vec<DVec3> = scene.meshes.par_iter().map(bounds).collect();
    let texels = |i: usize| {
        let instance = &scene.instances[i];
        let DVec3 { x, y, z } = extents[instance.mesh as usize];
        let corners = [(x, y), (-x, y), (x, -y), (-x, -y)].map(|(x, y)| DVec3::new(x, y, z));
        let diagonal = corners.map(|c| (instance.transform.matrix3 * c).length()).into_iter().fold(0.0, f64::max);
        // A page that is full to the last texel does not exist; half of it is always in use.
        let density = instance.texels_per_meter.unwrap_or(density).min(0.95 * most / diagonal);
        (areas[i] * density * density).min(0.5 * most * most)
    };
    (0..roles.len()).filter(|&i| roles[i] == Role::Mapped).map(texels).sum()
}

/// An instance's rectangle before its size in texels is known.
#[derive(Clone, Debug)]
pub(super) struct Demand {
    /// Index of the instance.
    pub instance: usize,
    /// Width and height of the layout's unit square in metres of the instance's surface.
    pub extent: DVec2,
    /// Least texels along the longer edge.
    pub least: u32,
    /// The instance's own density, texels per metre, in place of the general one.
    pub own: Option<f64>,
}

impl Demand {
    /// Size without padding at the general density `d`, at most `limit` along an edge; true if that lowered it.
    fn texels(&self, d: f64, limit: u32) -> (UVec2, bool) {
        let longest = self.extent.max_element();
        if longest <= 0.0 {
            return (UVec2::ONE, false);
        }
        let wish = self.own.unwrap_or(d).max(f64::from(self.least) / longest);
        let most = f64::from(limit) / longest;
        // Less a hair: a size meant to be whole, but for rounding, stays.
        let size = (self.extent * wish.min(most) - 0.01).ceil();
        (size.as_uvec2().clamp(UVec2::ONE, UVec2::splat(limit)), wish > most * (1.0 + 1e-9))
    }
}

/// Rectangles on pages.
#[derive(Debug, Default)]
pub(super) struct Packed {
    /// Where each demand's layout lies, in the demands' order.
    pub placements: Vec<Placement>,
    /// The pages.
    pub pages: Vec<Page>,
    /// General density, texels per metre.
    pub density: f64,
    /// Instances whose density was lowered, because a page is smaller than they are.
    pub lowered: Vec<usize>,
}

/// One page of edge `edge` at the density that fills it; more pages where the least sizes do not fit one.
pub(super) fn fill(demands: &[Demand], edge: u32) -> Packed {
    let area: f64 = demands.iter().filter(|d| d.own.is_none()).map(|d| d.extent.element_product()).sum();
    let full = if area > 0.0 { f64::from(edge) / area.sqrt() } else { 1.0 };
    let fits = |d: f64| at_density(demands, d, edge, 1);
    let (mut low, mut high) = (0.0, full);
    let mut best = None;
    for _ in 0..24 {
        let d = if low > 0.0 { (low * high).sqrt() } else { high * 0.5 };
        match fits(d) {
            Some(spots) => (low, best) = (d, Some(spots)),
            None => high = d,
        }
        if high < low * 1.002 {
            break;
        }
    }
    let density = if best.is_some() { low } else { full * 0.5 };
    let spots = best.or_else(|| at_density(demands, density, edge, usize::MAX)).unwrap_or_default();
    finish(demands, spots, density, &[UVec2::splat(edge)], false)
}

/// As many pages, of at most `edge`, as `density` needs; cropped to what is used, in multiples of four texels.
pub(super) fn spread(demands: &[Demand], density: f64, edge: u32, hidden: bool) -> Packed {
    if demands.is_empty() {
        return Packed { density, ..Packed::default() };
    }
    let padded = |d: &Demand| d.texels(density, inner(edge)).0 + 2 * PADDING;
    let area: f64 = demands.iter().map(|d| padded(d).as_dvec2().element_product()).sum();
    let mut side = (area.sqrt() as u32).clamp(1, edge);
    let spots = loop {
        let longest = demands.iter().map(|d| padded(d).max_element()).max().unwrap_or(1);
        side = side.max(longest);
        match on_pages(demands, density, edge, side, if side < edge { 1 } else { usize::MAX }) {
            Some(spots) => break spots,
            None if side >= edge => break Vec::new(),
            None => side = (side + side / 12 + 1).min(edge),
        }
    };
    let pages = spots.iter().map(|s| s.page + 1).max().unwrap_or(0) as usize;
    let mut sizes = vec![UVec2::ZERO; pages];
    for s in &spots {
        let size = &mut sizes[s.page as usize];
        *size = size.max(s.at + s.size + 2 * PADDING);
    }
    let crop = |s: &UVec2| UVec2::new(s.x.next_multiple_of(4), s.y.next_multiple_of(4)).min(UVec2::splat(edge.max(1)));
    let sizes: Vec<UVec2> = sizes.iter().map(crop).collect();
    finish(demands, spots, density, &sizes, hidden)
}

/// Largest edge of a rectangle on a page of edge `edge`.
fn inner(edge: u32) -> u32 {
    edge.saturating_sub(2 * PADDING).max(1)
}

/// A rectangle's place: its corner with padding, its size without.
#[derive(Clone, Copy, Debug)]
struct Spot {
    page: u32,
    at: UVec2,
    size: UVec2,
    lowered: bool,
}

fn at_density(demands: &[Demand], density: f64, edge: u32, most: usize) -> Option<Vec<Spot>> {
    on_pages(demands, density, edge, edge, most)
}

/// Packs onto at most `most` pages of edge `side`; sizes are limited by `edge`.
fn on_pages(demands: &[Demand], density: f64, edge: u32, side: u32, most: usize) -> Option<Vec<Spot>> {
    let mut spots: Vec<Spot> = demands
        .iter()
        .map(|d| d.texels(density, inner(edge)))
        .map(|(size, lowered)| Spot { page: 0, at: UVec2::ZERO, size, lowered })
        .collect();
    let mut order: Vec<usize> = (0..spots.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse((spots[i].size.max_element(), spots[i].size.min_element())), i));
    let mut pages: Vec<SimpleAtlasAllocator> = Vec::new();
    // The first page that may still have room for what is left.
    let mut first = 0;
    for i in order {
        let padded = spots[i].size + 2 * PADDING;
        let size = size2(padded.x as i32, padded.y as i32);
        let mut found = (first..pages.len()).find_map(|p| Some((p, pages[p].allocate(size)?)));
        if found.is_none() {
            if pages.len() >= most {
                return None;
            }
            // Full pages are not asked again for ever: a few open ones are enough.
            first = pages.len().saturating_sub(8);
            pages.push(SimpleAtlasAllocator::new(size2(side as i32, side as i32)));
            let p = pages.len() - 1;
            found = Some((p, pages[p].allocate(size)?));
        }
        let (page, r) = found?;
        spots[i].page = page as u32;
        spots[i].at = UVec2::new(r.min.x as u32, r.min.y as u32);
    }
    Some(spots)
}

/// `sizes`: of each page; the last one repeats.
fn finish(demands: &[Demand], spots: Vec<Spot>, density: f64, sizes: &[UVec2], hidden: bool) -> Packed {
    let size_of = |page: usize| sizes.get(page).or(sizes.last()).copied().unwrap_or(UVec2::ONE);
    let count = spots.iter().map(|s| s.page as usize + 1).max().unwrap_or(0);
    let place = |s: &Spot| {
        let page = size_of(s.page as usize).as_dvec2();
        let offset = (s.at + PADDING).as_dvec2() / page;
        let scale = s.size.as_dvec2() / page;
        Placement { page: s.page, offset: offset.as_vec2(), scale: scale.as_vec2() }
    };
    Packed {
        placements: spots.iter().map(place).collect(),
        pages: (0..count).map(|p| Page { size: size_of(p), hidden }).collect(),
        density,
        lowered: spots.iter().zip(demands).filter(|(s, _)| s.lowered).map(|(_, d)| d.instance).collect(),
    }
}

/// The whole page as one rectangle: layouts in page coordinates.
pub(super) fn whole_page(page: u32) -> Placement {
    Placement { page, offset: Vec2::ZERO, scale: Vec2::ONE }
}

/// Says which instances had their density lowered.
pub(super) fn warn_lowered(scene: &Scene, lowered: &[usize], edge: u32, warnings: &mut Vec<String>) {
    let Some(&first) = lowered.first() else { return };
    let others = match lowered.len() {
        1 => String::new(),
        n => format!(" and {} more", n - 1),
    };
    warnings.push(format!(
        "{}{others}: larger than a page of {edge} texels; the density was lowered to fit (see --page-size)",
        scene.instances[first].name
    ));
}
