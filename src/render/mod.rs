//! [`View`]: a lit scene as a camera sees it, the second pass of a radiosity method.
//!
//! View rays look the radiosity of matt surfaces up in the lightmap. What metals mirror depends on the eye: it is traced
//! for each view ray, by paths that end at matt surfaces and go on at metals (Sillion and Puech, "A General Two-Pass
//! Method Integrating Specular and Diffuse Reflection", 1989). Dielectrics are matt, as they were baked: the few per cent
//! that they mirror are in their diffuse reflectance already.
//!
//! A surface without a map is estimated by paths as well, and lamps that the map leaves to the engine are drawn. Backs of
//! single-sided surfaces are looked through, as pictures do. The same picture on any number of threads.

mod ggx;
mod lamps;
mod stored;

pub use stored::{of_bake, of_file};

use crate::{
    audit::{emitters::Emitters, surface::Place},
    math::{Random, cosine_hemisphere, hash},
    preview::Sight,
    scene::{Light, Surface},
    trace::{Hit, NOWHERE, Ray, Tracer},
};
use ggx::Metal;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Irradiance where a ray ended; `None` where no map knows it.
type Known<'k> = dyn Fn(&Hit) -> Option<Vec3> + Sync + 'k;

/// What view rays ask.
pub struct View<'v, 's> {
    tracer: &'v Tracer<'s>,
    known: Box<Known<'v>>,
    /// Lamps whose first hit is not known.
    left_out: Vec<&'s Light>,
    emitters: Option<Emitters>,
    /// Paths from a view ray that meets metal.
    pub paths: u32,
}

/// Surfaces that a path meets at most, backs that it looks through included.
const LONGEST: u32 = 64;
/// Surfaces after which chance may end a path.
const SURE: u32 = 3;

impl<'v, 's> View<'v, 's> {
    /// A view of what `tracer` meets, in the light that is `known` and that of lamps whose first hit this leaves out.
    fn new(tracer: &'v Tracer<'s>, known: Box<Known<'v>>, left_out: &dyn Fn(&Light) -> bool, paths: u32) -> Self {
        let left_out = tracer.world.scene.lights.iter().filter(|lamp| left_out(lamp)).collect();
        View { tracer, known, left_out, emitters: Emitters::new(&tracer.world), paths }
    }

    /// What a ray from `origin` in unit `direction` sees.
    pub fn sight(&self, origin: Vec3, direction: Vec3) -> Option<Sight> {
        let key = direction.to_array().map(f32::to_bits).into_iter().fold(0, hash);
        let hit = self.tracer.closest(&Ray { origin, direction, key, from: NOWHERE })?;
        let world = &self.tracer.world;
        let material = world.material(hit.triangle);
        let front = hit.front || material.double_sided;
        let radiance = if material.unlit {
            self.color(&hit)
        } else if front {
            self.leaving(&hit, -direction, key)
        } else {
            Vec3::ZERO
        };
        Some(Sight { distance: hit.t, front, radiance, unlit: material.unlit })
    }

    /// Radiance that leaves a front towards unit `back`: what is known, and the mean of paths where that is not all.
    fn leaving(&self, hit: &Hit, back: Vec3, key: u32) -> Vec3 {
        let mut random = Random::new(hash(key, 0x7669_6577));
        let vertex = self.vertex(hit, back);
        let known = vertex.surface.emission + self.reflected(&vertex, &mut random);
        if vertex.lobes() == Vec2::ZERO {
            return known;
        }
        known + (0..self.paths).map(|k| self.path(vertex, key, k)).sum::<Vec3>() / self.paths as f32
    }

    fn vertex(&self, hit: &Hit, back: Vec3) -> Vertex {
        let world = &self.tracer.world;
        let (instance, t) = world.locate(hit.triangle);
        let surface = world.scene.surface(world.mesh(instance), t, hit.bary, 0.0);
        Vertex { place: Place::of(world, hit), surface, irradiance: (self.known)(hit), back }
    }

    /// What a matt surface reflects of the light that is known.
    fn reflected(&self, vertex: &Vertex, random: &mut Random) -> Vec3 {
        let Vertex { surface, place, irradiance, .. } = vertex;
        match irradiance {
            Some(mapped) if surface.reflectance != Vec3::ZERO => {
                let lamps = lamps::irradiance(self.tracer, place, &self.left_out, random);
                surface.reflectance * (*mapped + lamps) / PI
            }
            _ => Vec3::ZERO,
        }
    }

    /// What path `index` from a vertex finds beyond that.
    fn path(&self, mut vertex: Vertex, key: u32, index: u32) -> Vec3 {
        let world = &self.tracer.world;
        let mut random = Random::new(hash(key, index));
        let (mut sum, mut weight) = (Vec3::ZERO, Vec3::ONE);
        for step in 0..LONGEST {
            let lobes = vertex.lobes();
            let all = lobes.element_sum();
            if all <= 0.0 {
                break;
            }
            // Paths of a view ray spread evenly over what it mirrors.
            let u = if step == 0 { net(index, key) } else { random.pair() };
            let mirrors = random.next() * all < lobes.x;
            weight *= all / if mirrors { lobes.x } else { lobes.y };
            let lobe = vertex.lobe(mirrors);
            let place = vertex.place;
            let sample = lobe.sample(&place, u);
            sum += weight * self.lamplight(&place, &lobe, sample.map(|s| s.0), &mut random);
            sum += weight * self.emitted(&place, &lobe, &mut random);
            let Some((direction, share)) = sample else { break };
            let mut ray = place.ray(direction, random.key());
            weight *= share;
            let Some(hit) = self.front(&mut ray) else {
                sum += weight * world.scene.sky.radiance(direction);
                break;
            };
            if world.material(hit.triangle).unlit {
                sum += weight * self.color(&hit);
                break;
            }
            vertex = self.vertex(&hit, -direction);
            // Emitters are looked for, too: the balance heuristic.
            let by_lobe = lobe.density(&place, direction);
            let distance = vertex.place.position.distance(place.position);
            let by_light =
                self.emitters_for(&lobe).map_or(0.0, |e| e.density(hit.triangle, &place, direction, distance));
            sum += weight * vertex.surface.emission * (by_lobe / (by_lobe + by_light).max(f32::MIN_POSITIVE));
            sum += weight * self.reflected(&vertex, &mut random);
            if step >= SURE {
                let on = weight.max_element().min(1.0);
                if random.next() >= on {
                    break;
                }
                weight /= on;
            }
        }
        if sum.is_finite() { sum } else { Vec3::ZERO }
    }

    /// Light of lamps that goes on at a place; `sample`: a direction that the lobe has drawn.
    fn lamplight(&self, place: &Place, lobe: &Lobe, sample: Option<Vec3>, random: &mut Random) -> Vec3 {
        match lobe {
            Lobe::Metal(metal) => lamps::mirrored(self.tracer, place, metal, sample, random),
            Lobe::Matt(reflectance) => {
                let all = self.tracer.world.scene.lights.iter().collect::<Vec<_>>();
                *reflectance * lamps::irradiance(self.tracer, place, &all, random) / PI
            }
        }
    }

    /// What is looked for; a mirror finds it by itself.
    fn emitters_for(&self, lobe: &Lobe) -> Option<&Emitters> {
        let mirror = matches!(lobe, Lobe::Metal(metal) if metal.is_smooth());
        self.emitters.as_ref().filter(|_| !mirror)
    }

    /// The share of emitters' light that is found by looking for them.
    fn emitted(&self, place: &Place, lobe: &Lobe, random: &mut Random) -> Vec3 {
        let world = &self.tracer.world;
        let sample = self.emitters_for(lobe).and_then(|e| e.sample(world, place, random.pair()));
        let Some(s) = sample else { return Vec3::ZERO };
        let light = lobe.shine(place, s.direction) * s.radiance / (s.density + lobe.density(place, s.direction));
        let mut ray = place.ray(s.direction, random.key());
        let seen = light != Vec3::ZERO && {
            let met = self.front(&mut ray).map(|hit| Place::of(world, &hit).position.distance(place.position));
            met.is_none_or(|distance| distance > s.distance * 0.9999)
        };
        if seen { light } else { Vec3::ZERO }
    }

    /// The first front along a ray.
    fn front(&self, ray: &mut Ray) -> Option<Hit> {
        for _ in 0..LONGEST {
            let hit = self.tracer.closest(ray)?;
            if hit.front || self.tracer.world.material(hit.triangle).double_sided {
                return Some(hit);
            }
            ray.origin += ray.direction * hit.t;
            ray.from = hit.triangle;
        }
        None
    }

    fn color(&self, hit: &Hit) -> Vec3 {
        let world = &self.tracer.world;
        let (instance, t) = world.locate(hit.triangle);
        world.scene.base_color(world.mesh(instance), t, hit.bary, 0.0).truncate()
    }
}

/// Where a path stands.
#[derive(Clone, Copy)]
struct Vertex {
    place: Place,
    surface: Surface,
    irradiance: Option<Vec3>,
    /// Unit vector to where the path comes from.
    back: Vec3,
}

impl Vertex {
    /// How much light goes on by mirroring, and by diffuse reflection that no map knows.
    fn lobes(&self) -> Vec2 {
        let matt = if self.irradiance.is_none() { self.surface.reflectance.max_element() } else { 0.0 };
        Vec2::new(self.surface.mirror.max_element(), matt)
    }

    fn lobe(&self, mirrors: bool) -> Lobe {
        let Surface { mirror, reflectance, dielectric, roughness, .. } = self.surface;
        if mirrors {
            Lobe::Metal(Metal::new(self.place.normal, self.back, mirror, 1.0 - dielectric, roughness))
        } else {
            Lobe::Matt(reflectance)
        }
    }
}

/// How light goes on at a vertex.
enum Lobe {
    Metal(Metal),
    Matt(Vec3),
}

impl Lobe {
    /// A direction, and what of the light from there goes on.
    fn sample(&self, place: &Place, u: Vec2) -> Option<(Vec3, Vec3)> {
        let drawn = match self {
            Lobe::Metal(metal) => metal.sample(u),
            Lobe::Matt(reflectance) => Some((place.frame().to_world(cosine_hemisphere(u)), *reflectance)),
        };
        drawn.filter(|(direction, _)| direction.dot(place.face) > 0.0)
    }

    /// Density of directions, by solid angle.
    fn density(&self, place: &Place, d: Vec3) -> f32 {
        match self {
            Lobe::Metal(metal) => metal.density(d),
            Lobe::Matt(_) => d.dot(place.normal).max(0.0) / PI,
        }
    }

    /// Radiance that goes on, for irradiance across the beam from unit direction `d`.
    fn shine(&self, place: &Place, d: Vec3) -> Vec3 {
        match self {
            Lobe::Metal(metal) => metal.shine(d),
            Lobe::Matt(reflectance) => *reflectance * (d.dot(place.normal).max(0.0) / PI),
        }
    }
}

/// Point `index` of the net `key` in the unit square.
fn net(index: u32, key: u32) -> Vec2 {
    let [x, y, ..] = sobol_burley::sample_4d(index & 0xffff, 0, key);
    Vec2::new(x, y)
}
