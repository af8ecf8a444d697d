//! [`Patches`]: what each texel stands for, and which patch a ray has hit.
//!
//! Fronts come first, in the order of [`Coverage`]; a back patch exists for each double-sided texel whose back a ray has
//! met, so that no light seeps through a sheet.

mod enclosed;
mod footprint;

pub use enclosed::{Enclosure, Met};
pub use footprint::{Cell, Face, Faces, Footprint, SurfacePoint};

use crate::{
    atlas::{Coverage, NO_PAGE},
    math::PointTable,
    scene::World,
    trace::Hit,
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Structure of arrays, one entry a patch.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    /// World area that rays meet, m^2: without holes and without the share that is let through.
    pub area: Vec<f32>,
    /// A point on the surface near the texel's middle.
    pub center: Vec<Vec3>,
    /// Unit face normal (of the largest piece); turned around for backs.
    pub normal: Vec<Vec3>,
    /// Diffuse reflectance, capped.
    pub reflectance: Vec<Vec3>,
    /// Emitted exitance M = pi L, W/m^2.
    pub exitance: Vec<Vec3>,
    /// Share of the surface that other geometry does not enclose, (0, 1]; 1 before rays have looked.
    pub validity: Vec<f32>,
    /// True where other geometry encloses all of it.
    pub buried: Vec<bool>,
    /// Number of fronts: the covered texels.
    pub fronts: usize,
    /// The texel of each back patch; patch `fronts + k` is the back of `backs[k]`.
    pub backs: Vec<u32>,
    /// Area whose reflectance was capped, m^2.
    pub capped_area: f64,
    /// Area more than half metallic, m^2.
    pub metallic_area: f64,
}

/// What a ray sees at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The front of a texel.
    Front(u32),
    /// The back of a double-sided texel.
    Back(u32),
    /// The back of a single-sided surface, or one that is not lit: nothing comes from there.
    Dark,
    /// A surface that no texel covers.
    Lost,
}

/// Points a texel over which material properties are averaged where they vary.
const MATERIAL_POINTS: usize = 16;

struct Front {
    area: f32,
    center: Vec3,
    normal: Vec3,
    reflectance: Vec3,
    exitance: Vec3,
    capped: bool,
    metallic: bool,
}

impl Patches {
    /// Averages the materials over every covered texel. `max_reflectance` caps each channel.
    pub fn new(world: &World, coverage: &Coverage, max_reflectance: f32) -> Self {
        let table = PointTable::of_places(MATERIAL_POINTS, 0x6d61_7465);
        let fronts: Vec<Front> = (0..coverage.texels.len())
            .into_par_iter()
            .map_init(
                || (Faces::new(world, coverage), Footprint::default()),
                |(faces, footprint), t| {
                    footprint.set(t, faces);
                    front(world, coverage, &table, footprint, t, max_reflectance)
                },
            )
            .collect();
        let area_of = |pick: fn(&Front) -> bool| fronts.iter().filter(|f| pick(f)).map(|f| f64::from(f.area)).sum();
        Patches {
            area: fronts.par_iter().map(|f| f.area).collect(),
            center: fronts.par_iter().map(|f| f.center).collect(),
            normal: fronts.par_iter().map(|f| f.normal).collect(),
            reflectance: fronts.par_iter().map(|f| f.reflectance).collect(),
            exitance: fronts.par_iter().map(|f| f.exitance).collect(),
            validity: vec![1.0; fronts.len()],
            buried: vec![false; fronts.len()],
            fronts: fronts.len(),
            backs: Vec::new(),
            capped_area: area_of(|f| f.capped),
            metallic_area: area_of(|f| f.metallic),
        }
    }

    /// Adds the backs of `texels`.
    pub fn add_backs(&mut self, texels: &[u32]) {
        for &t in texels {
            let t = t as usize;
            self.area.push(self.area[t]);
            self.center.push(self.center[t]);
            self.normal.push(-self.normal[t]);
            self.reflectance.push(self.reflectance[t]);
            self.exitance.push(self.exitance[t]);
            self.validity.push(1.0);
            self.buried.push(false);
        }
        self.backs.extend_from_slice(texels);
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// True if nothing is covered.
    pub fn is_empty(&self) -> bool {
        self.area.is_empty()
    }

    /// The texel of a patch, and whether the patch is its back.
    pub fn texel(&self, patch: usize) -> (usize, bool) {
        if patch < self.fronts { (patch, false) } else { (self.backs[patch - self.fronts] as usize, true) }
    }
}

/// True if one smooth surface may hold both of two places, each a position and a unit normal, at most `apart` metres from
/// each other.
pub fn continues([p, n]: [Vec3; 2], [q, m]: [Vec3; 2], apart: f32) -> bool {
    let way = q - p;
    n.dot(m) > SMOOTH && way.length_squared() < apart * apart && way.dot(n).abs() < SLOPE * way.length()
}

/// Cosine between the normals of one smooth surface, at least.
pub const SMOOTH: f32 = 0.9;
/// Slope of the way between two places of one smooth surface, at most.
const SLOPE: f32 = 0.3;

/// The patch that a hit meets.
#[inline]
pub fn seen(coverage: &Coverage, hit: &Hit) -> Seen {
    let charted = &coverage.charted[hit.triangle as usize];
    if charted.page == NO_PAGE || (!hit.front && !charted.double_sided) {
        return Seen::Dark;
    }
    match coverage.texel_near(charted, charted.at(hit.bary)) {
        None => Seen::Lost,
        Some(t) if hit.front => Seen::Front(t),
        Some(t) => Seen::Back(t),
    }
}

fn front(
    world: &World,
    coverage: &Coverage,
    table: &PointTable,
    footprint: &Footprint,
    texel: usize,
    max_reflectance: f32,
) -> Front {
    let at = coverage.texels[texel].at;
    let (mut reflectance, mut emission, mut weight, mut dielectric) = (Vec3::ZERO, Vec3::ZERO, 0.0, 0.0);
    let mut add = |triangle: u32, bary: Vec2, size: f32, share: f32| {
        let (instance, t) = world.locate(triangle);
        let s = world.scene.surface(world.mesh(instance), t, bary, size);
        // Rays meet this share of it. What it reflects and emits is counted for those that do.
        let met = share * (1.0 - s.transmittance.element_sum() / 3.0);
        reflectance += s.reflectance * met;
        emission += s.emission * met;
        dielectric += s.dielectric * met;
        weight += met;
    };
    let uniform = |face: &Face| {
        let (instance, t) = world.locate(face.triangle);
        world.scene.is_uniform(world.mesh(instance), t)
    };
    if footprint.faces().iter().all(uniform) {
        footprint.shares().for_each(|(face, share)| add(face.triangle, Vec2::ZERO, 0.0, share));
    } else {
        let points = table.block(at.x, at.y, 0);
        let share = 1.0 / points.len() as f32;
        for p in points.iter().map(|point| footprint.point(point.place)) {
            add(p.triangle, p.bary, texture_footprint(world, coverage, p.triangle) * share.sqrt(), share);
        }
    }
    let mean = 1.0 / f32::max(weight, 1e-6);
    let (reflectance, emission) = (reflectance * mean, emission * mean);
    Front {
        area: footprint.area() * weight,
        center: footprint.middle().position,
        normal: footprint.normal(),
        reflectance: reflectance.min(Vec3::splat(max_reflectance)),
        exitance: emission * std::f32::consts::PI,
        capped: reflectance.max_element() > max_reflectance,
        metallic: weight > 0.0 && dielectric * mean < 0.5,
    }
}

/// Length, in texture coordinates, of one texel of the lightmap on this triangle. Where textures read several sets, the
/// shortest: noise of a finer level averages out, light from beyond the texel would stay.
fn texture_footprint(world: &World, coverage: &Coverage, triangle: u32) -> f32 {
    let (instance, t) = world.locate(triangle);
    let mesh = world.mesh(instance);
    let material = world.material(triangle);
    let m = material;
    let slots = [&m.base_texture, &m.metallic_texture, &m.transmission_texture, &m.emission_texture];
    let sets = slots.into_iter().flatten().map(|slot| mesh.uvs.get(slot.set as usize).filter(|set| !set.is_empty()));
    let texture = |set: Option<&Vec<Vec2>>| {
        let [a, b, c] = mesh.triangles[t as usize].map(|v| set.map_or(Vec2::ZERO, |set| set[v as usize]));
        (b - a).perp_dot(c - a).abs()
    };
    let [p, q, r] = coverage.charted[triangle as usize].corners;
    let lightmap = (q - p).perp_dot(r - p).abs();
    let least = sets.map(texture).reduce(f32::min).unwrap_or(0.0);
    if lightmap > 0.0 { (least / lightmap).sqrt() } else { 0.0 }
}
