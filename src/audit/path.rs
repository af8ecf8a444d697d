//! Paths of light, walked backwards: next event estimation at every vertex, combined with the directions that meet
//! emitters by the balance heuristic (Veach and Guibas, 1995); Russian roulette.
//!
//! The lightmap under audit serves as a control variate: a path that ends takes the map's value for what it leaves out,
//! one that goes on brings the difference, over its chance. For any map whatever the mean is the same, the light of all
//! bounces; a good map makes it certain sooner.

use super::{
    Subject,
    emitters::{Emitters, surface},
    lamps,
    sky::Bright,
    surface::Place,
};
use crate::{
    lightmaps::Content,
    math::{Random, cosine_hemisphere, hash},
    scene::{Bake, Light},
    trace::{Hit, Ray, Segment},
};
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::PI;

/// Everything that shines, as paths look for it.
pub(super) struct Lights<'s> {
    /// Lights whose first hit the map holds.
    shown: Vec<&'s Light>,
    /// Lights that bounce.
    all: Vec<&'s Light>,
    emitters: Option<Emitters>,
    sky: Option<Bright<'s>>,
}

/// A bundle of paths that are walked together.
#[derive(Default)]
pub(super) struct Bundle {
    paths: Vec<Path>,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    segments: Vec<Segment>,
    shots: Vec<Shot>,
    through: Vec<Vec3>,
    shares: Vec<f32>,
}

/// A path at its last vertex.
struct Path {
    place: Place,
    /// What irradiance here is worth at its beginning.
    weight: Vec3,
    /// Which of the sums it adds to.
    sum: u32,
    random: Random,
}

/// A shadow ray.
struct Shot {
    sum: u32,
    light: Vec3,
    /// Light that is coloured by what it passes; else it passes in grey, as rays that bounce do.
    tinted: bool,
}

/// What the paths from one place have found.
#[derive(Clone, Copy, Default)]
pub(super) struct Sum {
    /// Sum of irradiance.
    pub irradiance: DVec3,
    /// Rays from the place that saw the sky or what shines.
    pub out: u32,
    /// Rays from the place that saw other fronts, and backs of double-sided surfaces.
    pub fronts: u32,
    pub sheets: u32,
}

/// Parts of the paths from a place that are independent of each other, so that products at the place have no bias.
pub(super) const PARTS: usize = 2;

/// Draws of a direction above the face before it is mirrored there.
const DRAWS: u32 = 64;

impl<'s> Lights<'s> {
    pub fn new(subject: &Subject<'_, 's>) -> Self {
        let world = &subject.tracer.world;
        let content = subject.lightmaps.content;
        let of = |keep: &dyn Fn(&Light) -> bool| world.scene.lights.iter().filter(|l| keep(l)).collect();
        Lights {
            shown: of(&|l| l.bake == Bake::Full && content != Content::Indirect),
            all: of(&|l| l.bake != Bake::None),
            emitters: Emitters::new(world),
            sky: Bright::new(&world.scene.sky),
        }
    }
}

/// Where a path's first vertex samples: each part of the paths has points of its own, spread evenly over the texel.
fn first(path: usize, set: u32, seed: u32) -> Vec2 {
    let (i, part) = (path / PARTS, path % PARTS);
    net(i as u32, set, hash(seed, part as u32))
}

/// Point `i` of a net in the unit square; nets of different sets are independent.
pub(super) fn net(i: u32, set: u32, seed: u32) -> Vec2 {
    // The sequence has 2^16 points; then come those of another seed.
    let seed = seed.wrapping_add((i >> 16).wrapping_mul(0x9e37_79b9));
    let [x, y, ..] = sobol_burley::sample_4d(i & 0xffff, set, seed);
    Vec2::new(x, y)
}

impl Bundle {
    /// Walks `each` paths from every place, shared out among its [`PARTS`] of `sums`.
    /// Returns the rays that were traced.
    pub fn walk(
        &mut self,
        subject: &Subject,
        lights: &Lights,
        places: &[Place],
        each: usize,
        seed: u32,
        sums: &mut [Sum],
    ) -> u64 {
        self.paths.clear();
        for i in 0..places.len() * each {
            let sum = (i / each * PARTS + i % PARTS) as u32;
            let random = Random::new(hash(seed, i as u32));
            self.paths.push(Path { place: places[i / each], weight: Vec3::ONE, sum, random });
        }
        let (mut rays, mut depth) = (0, 0);
        while !self.paths.is_empty() {
            rays += self.look_for_lights(subject, lights, depth, seed, sums);
            rays += self.trace(subject, depth, seed);
            if depth == 0 {
                self.count_open(subject, sums);
            }
            if subject.lightmaps.content == Content::Direct {
                break;
            }
            self.go_on(subject, lights, sums);
            depth += 1;
        }
        rays
    }

    /// Adds the light that arrives at the paths' ends straight from its sources.
    fn look_for_lights(&mut self, subject: &Subject, lights: &Lights, depth: u32, seed: u32, sums: &mut [Sum]) -> u64 {
        let world = &subject.tracer.world;
        self.segments.clear();
        self.shots.clear();
        let lamps = if depth == 0 { &lights.shown } else { &lights.all };
        let extended = depth > 0 || subject.lightmaps.content != Content::Direct;
        for (i, path) in self.paths.iter_mut().enumerate() {
            let place = &path.place;
            // The first vertex has points that are spread evenly, over all paths from a texel.
            let mut pair = |set: u32| if depth == 0 { first(i, set, seed) } else { path.random.pair() };
            let mut shoot = |segment: Segment, light: Vec3, tinted: bool| {
                self.segments.push(segment);
                self.shots.push(Shot { sum: path.sum, light, tinted });
            };
            if !lamps.is_empty() {
                let (choice, u) = (pair(1).x, pair(2));
                if let Some(aim) = lamps::aim(place, lamps, choice, u, &mut self.shares) {
                    shoot(aim.segment, aim.irradiance * path.weight, true);
                }
            }
            if !extended {
                continue;
            }
            if let Some(s) = lights.emitters.as_ref().and_then(|e| e.sample(world, place, pair(3))) {
                // pi L for each cosine-distributed direction; both ways to the same point share it.
                let by_cosine = place.density(s.direction);
                let light = s.radiance * (PI * by_cosine / (by_cosine + s.density));
                let segment = place.segment(s.direction, s.distance * (1.0 - 1e-5));
                shoot(segment, light * path.weight, false);
            }
            if let Some(sky) = &lights.sky {
                let direction = sky.direction(pair(4));
                let (by_cosine, by_sky) = (place.density(direction), sky.density(direction));
                if place.faces(direction) && by_sky > 0.0 {
                    let light = world.scene.sky.radiance(direction) * (PI * by_cosine / (by_cosine + by_sky));
                    let segment = place.segment(direction, f32::INFINITY);
                    shoot(segment, light * path.weight, false);
                }
            }
        }
        self.through.resize(self.segments.len(), Vec3::ZERO);
        subject.tracer.transmittance_of_each(&self.segments, &mut self.through);
        for (shot, through) in self.shots.iter().zip(&self.through) {
            let through = if shot.tinted { *through } else { Vec3::splat(through.element_sum() / 3.0) };
            sums[shot.sum as usize].irradiance += (shot.light * through).as_dvec3();
        }
        self.segments.len() as u64
    }

    /// One cosine-distributed ray from the end of each path.
    fn trace(&mut self, subject: &Subject, depth: u32, seed: u32) -> u64 {
        self.rays.clear();
        for (i, path) in self.paths.iter_mut().enumerate() {
            let place = &path.place;
            let frame = place.frame();
            let u = if depth == 0 { first(i, 0, seed) } else { path.random.pair() };
            let mut direction = frame.to_world(cosine_hemisphere(u));
            for _ in 0..DRAWS {
                if direction.dot(place.face) > 0.0 {
                    break;
                }
                direction = frame.to_world(cosine_hemisphere(path.random.pair()));
            }
            direction -= 2.0 * direction.dot(place.face).min(0.0) * place.face;
            let key = path.random.key();
            self.rays.push(place.ray(direction, key));
        }
        self.hits.resize(self.rays.len(), None);
        subject.tracer.closest_of_each(&self.rays, &mut self.hits);
        self.rays.len() as u64
    }

    /// What else is seen from places than backs that do not shine.
    fn count_open(&self, subject: &Subject, sums: &mut [Sum]) {
        for (path, hit) in self.paths.iter().zip(&self.hits) {
            let sum = &mut sums[path.sum as usize];
            let met = hit.map(|h| (h.front, subject.tracer.world.material(h.triangle)));
            match met.filter(|(_, material)| !material.emits()) {
                None => sum.out += 1,
                Some((true, _)) => sum.fronts += 1,
                Some((false, material)) => sum.sheets += u32::from(material.double_sided),
            }
        }
    }

    /// Adds the light that the rays met, and moves the paths that go on to where they ended.
    fn go_on(&mut self, subject: &Subject, lights: &Lights, sums: &mut [Sum]) {
        let world = &subject.tracer.world;
        let mut kept = 0;
        for i in 0..self.paths.len() {
            let (ray, hit) = (self.rays[i], self.hits[i]);
            let path = &mut self.paths[i];
            let by_cosine = path.place.density(ray.direction);
            let sum = &mut sums[path.sum as usize].irradiance;
            let Some(hit) = hit else {
                let by_sky = lights.sky.as_ref().map_or(0.0, |s| s.density(ray.direction));
                let share = if by_sky > 0.0 { by_cosine / (by_cosine + by_sky) } else { 1.0 };
                *sum += (world.scene.sky.radiance(ray.direction) * path.weight * (PI * share)).as_dvec3();
                continue;
            };
            let material = world.material(hit.triangle);
            if material.unlit || (!hit.front && !material.double_sided) {
                continue;
            }
            let s = surface(world, hit.triangle, hit.bary);
            if let (true, Some(emitters)) = (material.emits(), &lights.emitters) {
                let by_light = emitters.density(hit.triangle, &path.place, ray.direction, hit.t);
                *sum += (s.emission * path.weight * (PI * by_cosine / (by_cosine + by_light))).as_dvec3();
            }
            let reflectance = s.reflectance.min(Vec3::splat(subject.max_reflectance));
            let known = subject.known(&hit);
            let weight = path.weight * reflectance;
            *sum += (weight * known).as_dvec3();
            // Every bounce loses light: without a limit on depth, paths end.
            let on = reflectance.max_element();
            if on <= 0.0 || path.random.next() >= on {
                continue;
            }
            path.weight = weight / on;
            *sum -= (path.weight * known).as_dvec3();
            path.place = Place::of(world, &hit);
            self.paths.swap(kept, i);
            kept += 1;
        }
        self.paths.truncate(kept);
    }
}
