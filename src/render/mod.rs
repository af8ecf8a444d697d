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
    math::{Frame, cosine_hemisphere, hash, unit_float},
    patches::SurfacePoint,
    preview::Sight,
    scene::{Light, Surface, World, shading_normal},
    trace::{Hit, NOWHERE, Ray, Tracer, rounding},
};
use ggx::Metal;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Irradiance where a ray ended; `None` where no map knows it.
pub type Known<'k> = dyn Fn(&Hit) -> Option<Vec3> + Sync + 'k;

/// What view rays ask.
pub struct View<'v, 's> {
    /// Rays against the scene.
    pub tracer: &'v Tracer<'s>,
    /// The lightmap.
    pub known: Box<Known<'v>>,
    /// Lamps whose first hit it leaves out.
    pub left_out: Vec<&'s Light>,
    /// Paths from a view ray that meets metal.
    pub paths: u32,
}

/// Surfaces that a path meets at most, backs that it looks through included.
const LONGEST: u32 = 64;
/// Surfaces after which chance may end a path.
const SURE: u32 = 3;

/// Numbers in [0, 1) that look random.
struct Random(u32, u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.1 += 1;
        unit_float(hash(self.0, self.1))
    }

    fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }
}

impl View<'_, '_> {
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
        let mut random = Random(hash(key, 0x7669_6577), 0);
        let vertex = self.vertex(hit, back);
        let known = self.known(&vertex, &mut random);
        if vertex.lobes() == Vec2::ZERO {
            return known;
        }
        known + (0..self.paths).map(|k| self.path(vertex, key, k)).sum::<Vec3>() / self.paths as f32
    }

    fn vertex(&self, hit: &Hit, back: Vec3) -> Vertex {
        let world = &self.tracer.world;
        let (instance, t) = world.locate(hit.triangle);
        let surface = world.scene.surface(world.mesh(instance), t, hit.bary, 0.0);
        Vertex { place: place(world, hit), surface, irradiance: (self.known)(hit), back }
    }

    /// What needs no path: emission, and the light that is known, on what is matt.
    fn known(&self, vertex: &Vertex, random: &mut Random) -> Vec3 {
        let Vertex { surface, place, irradiance, .. } = vertex;
        let Some(mapped) = irradiance else { return surface.emission };
        let lamps = if surface.reflectance == Vec3::ZERO {
            Vec3::ZERO
        } else {
            lamps::irradiance(self.tracer, place, &self.left_out, random)
        };
        surface.emission + surface.reflectance * (*mapped + lamps) / PI
    }

    /// What path `index` from a vertex finds beyond that.
    fn path(&self, mut vertex: Vertex, key: u32, index: u32) -> Vec3 {
        let world = &self.tracer.world;
        let mut random = Random(hash(key, index), 0);
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
            let Vertex { place, surface, .. } = &vertex;
            let direction = if mirrors {
                let metal = vertex.metal();
                sum += weight * lamps::mirrored(self.tracer, place, &metal, &mut random);
                let Some((direction, share)) = metal.sample(u) else { break };
                weight *= share;
                direction
            } else {
                let lamps = &world.scene.lights.iter().collect::<Vec<_>>();
                sum += weight * surface.reflectance * lamps::irradiance(self.tracer, place, lamps, &mut random) / PI;
                weight *= surface.reflectance;
                place.frame.to_world(cosine_hemisphere(u))
            };
            if direction.dot(place.face) <= 0.0 {
                break;
            }
            let mut ray = place.ray(direction, hash(random.0, random.1 ^ 0x8000_0000));
            let Some(hit) = self.front(&mut ray) else {
                sum += weight * world.scene.sky.radiance(direction);
                break;
            };
            if world.material(hit.triangle).unlit {
                sum += weight * self.color(&hit);
                break;
            }
            vertex = self.vertex(&hit, -direction);
            sum += weight * self.known(&vertex, &mut random);
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
    place: SurfacePoint,
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

    fn metal(&self) -> Metal {
        let Surface { mirror, dielectric, roughness, .. } = self.surface;
        Metal::new(self.place.normal, self.back, mirror, 1.0 - dielectric, roughness)
    }
}

/// The point where a ray ended, on the side that it met.
fn place(world: &World, hit: &Hit) -> SurfacePoint {
    let (instance, local) = world.locate(hit.triangle);
    let corners = world.corners(instance, local);
    let [a, b, c] = corners;
    let face = world.cross(instance, &corners).normalize_or_zero();
    let smooth = world.smooth_normals(instance, local, face);
    let normal = smooth.map_or(face, |corners| shading_normal(&corners, hit.bary, face));
    let position = a + (b - a) * hit.bary.x + (c - a) * hit.bary.y;
    let (frame, offset) = (Frame::around(normal), rounding(&corners));
    let front = SurfacePoint { position, face, normal, frame, triangle: hit.triangle, bary: hit.bary, offset };
    if hit.front { front } else { front.reversed() }
}

/// Point `index` of the net `key` in the unit square.
fn net(index: u32, key: u32) -> Vec2 {
    let [x, y, ..] = sobol_burley::sample_4d(index & 0xffff, 0, key);
    Vec2::new(x, y)
}
