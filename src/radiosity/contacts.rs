//! Contacts: light from surfaces nearer than a texel.
//!
//! A texel reflects as one value. From far away nobody can tell, but where a wall stands on a floor that is lit up to half a
//! texel from it, the wall sees the lit half, or the dark one. So, at texels whose rays end nearer than the texel that they
//! meet is long, more rays are shot, and those that end near go on as paths: direct light is sampled there, and another ray
//! tells what arrives by bounces, from the solution, or from the next point if that is near, too (final gathering's second
//! gather: Jensen, "Global Illumination using Photon Maps", 1996; split at a distance: Arikan, Forsyth and O'Brien, "Fast and
//! Detailed Approximate Global Illumination by Irradiance Decomposition", 2005).
//!
//! What a path brings takes the place of what the texel it met had brought. The mean of the difference is added where it is
//! no noise: elsewhere shared rays know better.

use crate::{
    direct::{Direct, Sampler, Sources},
    error::Result,
    math::{PointTable, Random, cell_of, cosine_hemisphere, hash, luminance, unit_float},
    patches::{Enclosure, Footprint, Seen, SurfacePoint, seen},
    progress::{Observer, check},
    trace::{Hit, Ray},
    transport::{Neighbours, Stats},
};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::{collections::HashMap, f32::consts::TAU, ops::Range};

/// Length of a ray, in edges of the texel that it meets, below which that is near: all of one that stands at its edge.
const NEAR: f32 = 1.5;
/// Added where centres are compared instead: half a diagonal.
const OFF_CENTER: f32 = 0.7;
/// Share of a row that must be near.
const LEAST: f64 = 0.02;
/// Rays over those of a row, 65536 at most, shot in two lots: the first, a quarter, tells whether the rest is worth it.
const LOTS: usize = 4;
/// Variances of its mean, and of that of the first lot, above which a difference is no noise.
const SURE: f32 = 16.0;
const LIKELY: f32 = 1.0;
/// Near points that a path goes through at most.
const DEPTH: usize = 3;
/// Texels that one task takes.
const CHUNK: usize = 16;
/// Draws of a direction above the face before it is mirrored there.
const DRAWS: usize = 16;

pub(super) struct Contacts<'a> {
    neighbours: Neighbours<'a>,
    sources: &'a Sources<'a>,
    /// Exitance of patches and cells of the sky, as rows and samples carried it.
    carried: Vec<Vec3>,
    max_reflectance: f32,
    /// The patch of each texel's back.
    backs: HashMap<u32, usize>,
    enclosure: Enclosure<'a>,
    /// Points of both lots.
    table: PointTable,
}

/// Where a task works.
struct Desk<'a> {
    footprint: Footprint<'a>,
    sampler: Sampler,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    traced: u64,
}

/// Sums over the rays of a texel.
#[derive(Default)]
struct Tally {
    rays: f32,
    sum: Vec3,
    /// Of squared luminance, of differences and of what was carried: few paths that all end in the dark may have missed the
    /// part that is lit, so that they agree is no proof.
    squares: f32,
}

impl Tally {
    /// The mean, if its square is more than so many of its variances.
    fn mean(&self, variances: f32) -> Option<Vec3> {
        let mean = self.sum / self.rays.max(1.0);
        let square = luminance(mean).powi(2);
        let variance = (self.squares / self.rays.max(1.0) - square).max(0.0) / self.rays.max(1.0);
        (square > variances * variance).then_some(mean)
    }
}

impl<'a> Contacts<'a> {
    /// `gathered`: radiosity of every column as rows carried it.
    pub fn new(
        neighbours: Neighbours<'a>,
        sources: &'a Sources<'a>,
        gathered: &[Vec3],
        direct: &Direct,
        max_reflectance: f32,
    ) -> Self {
        let sampled = |c: usize| direct.bounce.exitance.get(c).copied().unwrap_or_default();
        let carried = gathered.iter().enumerate().map(|(c, b)| *b + sampled(c)).collect();
        let patches = neighbours.patches;
        let backs = patches.backs.iter().enumerate().map(|(k, &texel)| (texel, patches.fronts + k)).collect();
        let enclosure = Enclosure::new(neighbours.tracer, neighbours.coverage);
        let rays = neighbours.transport.rays as usize * LOTS;
        let table = PointTable::of_directions(0..rays.min(1 << 16), 0x636f_6e74);
        Contacts { neighbours, sources, carried, max_reflectance, backs, enclosure, table }
    }

    /// Adds what is found to the irradiance of patches; returns the rays that it took.
    pub fn refine(&self, irradiance: &mut [Vec3], observer: &dyn Observer) -> Result<Stats> {
        let Neighbours { transport, tracer, coverage, patches } = self.neighbours;
        let fronts = transport.receivers.partition_point(|&patch| (patch as usize) < patches.fronts);
        let some: Vec<u32> =
            (0..fronts).into_par_iter().filter(|&r| self.touches(r)).map(|r| transport.receivers[r]).collect();
        observer.begin("contacts", some.len() as u64);
        let chunk = |some: &[u32]| {
            if observer.cancelled() {
                return (Vec::new(), 0);
            }
            let footprint = Footprint::new(&tracer.world, coverage);
            let mut desk =
                Desk { footprint, sampler: Sampler::default(), rays: Vec::new(), hits: Vec::new(), traced: 0 };
            let found: Vec<Option<Vec3>> = some.iter().map(|&t| self.texel(t, &mut desk)).collect();
            observer.advance(some.len() as u64);
            (found, desk.traced + desk.sampler.rays)
        };
        let done: Vec<(Vec<Option<Vec3>>, u64)> = some.par_chunks(CHUNK).map(chunk).collect();
        check(observer)?;
        for (&patch, found) in some.iter().zip(done.iter().flat_map(|d| &d.0)) {
            let e = &mut irradiance[patch as usize];
            *e = (*e + found.unwrap_or_default()).max(Vec3::ZERO);
        }
        Ok(Stats { traced: done.iter().map(|d| d.1).sum(), ..Stats::default() })
    }

    /// True if something is near that a receiver's row holds.
    fn touches(&self, receiver: usize) -> bool {
        let Neighbours { transport, patches, .. } = self.neighbours;
        let patch = transport.receivers[receiver] as usize;
        let near = |column: u32| {
            let at = patches.center.get(column as usize);
            at.is_some_and(|at| {
                let far = (NEAR + OFF_CENTER) * patches.area[column as usize].sqrt();
                at.distance_squared(patches.center[patch]) < far * far
            })
        };
        !patches.buried[patch] && transport.rows.row(receiver).sum(|column| f64::from(u8::from(near(column)))) > LEAST
    }

    /// What is to be added at a texel.
    fn texel(&self, texel: u32, desk: &mut Desk) -> Option<Vec3> {
        desk.footprint.set(texel as usize);
        let all = self.table.block_len();
        let mut tally = Tally::default();
        self.shoot(texel, 0..all.div_ceil(LOTS), desk, &mut tally);
        tally.mean(LIKELY)?;
        self.shoot(texel, all.div_ceil(LOTS)..all, desk, &mut tally);
        tally.mean(SURE)
    }

    fn shoot(&self, texel: u32, part: Range<usize>, desk: &mut Desk, tally: &mut Tally) {
        let Neighbours { tracer, coverage, patches, .. } = self.neighbours;
        let at = coverage.texels[texel as usize].at;
        let points = &self.table.block(at.x, at.y, 0)[part.clone()];
        let mut places: Vec<SurfacePoint> = points.iter().map(|point| desk.footprint.point(point.place)).collect();
        let mut directions: Vec<Vec3> = points.iter().map(|point| point.direction).collect();
        if patches.validity[texel as usize] < 1.0 {
            let enclosed = self.enclosure.holds(&places, at, Vec2::X, &mut 0);
            let open = |i: &usize| !enclosed[*i];
            (places, directions) = (0..places.len()).filter(open).map(|i| (places[i], directions[i])).unzip();
        }
        // Of its own, so that no pattern repeats.
        let turn = turn(unit_float(hash(texel, 0x7475_7261)));
        let key = |k: usize| hash(hash(texel, (part.start + k) as u32), 0x6e65_6172);
        desk.rays.clear();
        let aimed = places.iter().zip(&directions).enumerate();
        desk.rays.extend(
            aimed.map(|(k, (p, d))| {
                p.ray(above(p, p.frame.turned(turn).to_world(*d), &mut Random::new(!key(k))), key(k))
            }),
        );
        desk.hits.clear();
        desk.hits.resize(desk.rays.len(), None);
        tracer.closest_of_each(&desk.rays, &mut desk.hits);
        desk.traced += desk.rays.len() as u64;
        tally.rays += desk.rays.len() as f32;
        for k in 0..desk.rays.len() {
            let Some((hit, column)) = desk.hits[k].and_then(|hit| Some((hit, self.column(&hit)?))) else { continue };
            if self.is_near(&hit, column) {
                let difference = self.path(hit, &mut Random::new(key(k)), desk) - self.carried[column];
                tally.sum += difference;
                tally.squares += luminance(difference).powi(2) + luminance(self.carried[column]).powi(2);
            }
        }
    }

    /// One sample of the exitance of a near point where a ray has ended.
    fn path(&self, mut hit: Hit, random: &mut Random, desk: &mut Desk) -> Vec3 {
        let Neighbours { tracer, patches, .. } = self.neighbours;
        let world = &tracer.world;
        let (mut sum, mut weight) = (Vec3::ZERO, Vec3::ONE);
        for depth in 1.. {
            let (instance, local) = world.locate(hit.triangle);
            let surface = world.scene.surface(world.mesh(instance), local, hit.bary, 0.0);
            if self.sources.gathered {
                sum += weight * surface.emission * std::f32::consts::PI;
            }
            weight *= surface.reflectance.min(Vec3::splat(self.max_reflectance));
            let p = SurfacePoint::met(world, &hit);
            sum += weight * desk.sampler.irradiance(tracer, self.sources, &p, random);
            let direction = above(&p, p.frame.to_world(cosine_hemisphere(random.pair())), random);
            desk.traced += 1;
            let Some(next) = tracer.closest(&p.ray(direction, random.key())) else {
                return sum + weight * self.carried[patches.len() + cell_of(direction) as usize];
            };
            let Some(column) = self.column(&next) else { break };
            if depth == DEPTH || !self.is_near(&next, column) {
                return sum + weight * self.carried[column];
            }
            hit = next;
        }
        sum
    }

    /// The patch that a ray has met, if light comes from there.
    fn column(&self, hit: &Hit) -> Option<usize> {
        match seen(self.neighbours.coverage, hit) {
            Seen::Front(texel) => Some(texel as usize),
            Seen::Back(texel) => self.backs.get(&texel).copied(),
            Seen::Dark | Seen::Lost => None,
        }
    }

    fn is_near(&self, hit: &Hit, column: usize) -> bool {
        hit.t < NEAR * self.neighbours.patches.area[column].sqrt()
    }
}

/// A direction about the shading normal, drawn again while it lies below the face.
fn above(p: &SurfacePoint, direction: Vec3, random: &mut Random) -> Vec3 {
    let again = (0..DRAWS).map(|_| p.frame.to_world(cosine_hemisphere(random.pair())));
    let mut draws = std::iter::once(direction).chain(again);
    let above = draws.find(|d| p.normal == p.face || d.dot(p.face) > 0.0);
    above.unwrap_or(direction - 2.0 * direction.dot(p.face).min(0.0) * p.face)
}

/// Cosine and sine of a share of the circle.
fn turn(share: f32) -> Vec2 {
    Vec2::new(libm::cosf(TAU * share), libm::sinf(TAU * share))
}
