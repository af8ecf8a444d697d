//! Whether two tracers say the same of the same rays, and who is wrong where they do not.
//!
//! Where hits differ, the nearer one's triangle is tested in double precision. It says that a tracer is wrong only where
//! the ray passes the triangle's edge by more than single precision can be off.

use super::{
    batch::{Caster, Hit, Ray, keyed},
    embree::Scene,
};
use glam::{DVec2, DVec3, Vec3};
use luxel::{
    scene::World,
    trace::{Tracer, rounding},
};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;

/// Distances that differ relatively by less are equal.
const EQUAL: f64 = 1e-6;
/// Distances that differ relatively by less are nearly equal.
const CLOSE: f64 = 1e-4;
/// Triangle tests that brute force may take, and rays at most.
const TESTS: usize = 1_000_000_000;
const MOST: usize = 100_000;

/// How two tracers' answers agree: numbers of rays.
#[derive(Clone, Default, Serialize)]
pub struct Agreement {
    first: String,
    second: String,
    query: &'static str,
    rays: usize,
    /// Same triangle, distance within 1e-6; or both miss.
    equal: usize,
    /// Same triangle; distance within 1e-4, or as far as the rounding of its corners moves it.
    close: usize,
    /// The ray passes an edge within rounding: neighbours that share a corner, or a hit against a miss.
    edge: usize,
    /// Different triangles without common corner, their distances as close.
    coincident: usize,
    /// The ray starts on a triangle within rounding, and only one sees it.
    start: usize,
    /// None of these.
    first_wrong: usize,
    second_wrong: usize,
}

#[derive(Clone, Copy)]
enum Verdict {
    Equal,
    Close,
    Edge,
    Coincident,
    Start,
    FirstWrong,
    SecondWrong,
}

/// Corners of all global triangles.
pub fn corners(world: &World) -> Vec<[Vec3; 3]> {
    let of = |i: usize| (0..world.mesh(i).triangles.len() as u32).map(move |t| world.corners(i, t));
    (0..world.scene.instances.len()).flat_map(of).collect()
}

/// Luxel against each of Embree's scenes on all rays; luxel and Embree against brute force on a sample.
pub fn compare(
    tracer: &Tracer,
    theirs: &[(&str, Scene)],
    corners: &[[Vec3; 3]],
    rays: &[Ray],
    shadow_rays: &[Ray],
) -> Vec<Agreement> {
    let all = |caster: &dyn Caster, rays: &[Ray]| rays.par_iter().map(|r| caster.closest(r)).collect::<Vec<_>>();
    let any = |caster: &dyn Caster, rays: &[Ray]| rays.par_iter().map(|r| caster.occluded(r)).collect::<Vec<_>>();
    let mut out = Vec::new();
    for (name, scene) in theirs {
        let names = ("luxel", *name);
        out.push(closest(names, corners, rays, &all(tracer, rays), &all(scene, rays)));
        let answers = (any(tracer, shadow_rays), any(scene, shadow_rays));
        let hits = |ray: &Ray| (Caster::closest(tracer, ray), scene.closest(ray));
        out.push(occlusion(names, corners, shadow_rays, answers, hits));
    }
    let count = (TESTS / corners.len().max(1)).min(MOST);
    let (rays, shadow_rays) = (sample(rays, count), sample(shadow_rays, count));
    let truth: Vec<Hit> = rays.par_iter().map(|r| brute(corners, r)).collect();
    let segments: Vec<Hit> = shadow_rays.par_iter().map(|r| brute(corners, r)).collect();
    let blocked: Vec<bool> = segments.iter().zip(&shadow_rays).map(|(h, r)| until(*h, r).is_some()).collect();
    let ours: (&str, &dyn Caster) = ("luxel", tracer);
    for (name, caster) in [ours].into_iter().chain(theirs.iter().map(|(name, scene)| (*name, scene as &dyn Caster))) {
        let names = (name, "brute force");
        out.push(closest(names, corners, &rays, &all(caster, &rays), &truth));
        let answers = (any(caster, &shadow_rays), blocked.clone());
        out.push(occlusion(names, corners, &shadow_rays, answers, |r| (caster.closest(r), brute(corners, r))));
    }
    out
}

fn closest(names: (&str, &str), corners: &[[Vec3; 3]], rays: &[Ray], first: &[Hit], second: &[Hit]) -> Agreement {
    let verdicts = (0..rays.len()).into_par_iter().map(|i| verdict(corners, &rays[i], first[i], second[i]));
    Agreement::new(names, "closest", verdicts.collect())
}

/// `hits`: the two tracers' closest hits along the ray, to find out what stands in the way.
fn occlusion(
    names: (&str, &str),
    corners: &[[Vec3; 3]],
    rays: &[Ray],
    (first, second): (Vec<bool>, Vec<bool>),
    hits: impl Fn(&Ray) -> (Hit, Hit) + Sync,
) -> Agreement {
    let of = |i: usize| {
        if first[i] == second[i] {
            return Verdict::Equal;
        }
        let (a, b) = hits(&rays[i]);
        let (a, b) = (until(a, &rays[i]), until(b, &rays[i]));
        // Who contradicts its own closest hit is wrong without further question.
        match (a.is_some() == first[i], b.is_some() == second[i]) {
            (false, _) => Verdict::FirstWrong,
            (_, false) => Verdict::SecondWrong,
            _ => verdict(corners, &rays[i], a, b),
        }
    };
    Agreement::new(names, "any", (0..rays.len()).into_par_iter().map(of).collect())
}

fn until(hit: Hit, ray: &Ray) -> Hit {
    hit.filter(|h| h.0 < ray.t)
}

fn verdict(corners: &[[Vec3; 3]], ray: &Ray, first: Hit, second: Hit) -> Verdict {
    let infinite = (f32::INFINITY, u32::MAX);
    let (a, b) = (first.unwrap_or(infinite), second.unwrap_or(infinite));
    // Embree also reports hits at -0.
    let off = (f64::from(a.0) - f64::from(b.0)).abs() / f64::from(a.0.min(b.0)).max(1e-30);
    if first == second || (a.1 == b.1 && off <= EQUAL) {
        return Verdict::Equal;
    }
    let (near, is_first) = if a.0 <= b.0 { (a, true) } else { (b, false) };
    let triangle = &corners[near.1 as usize];
    let (inside, t, cos) = passage(triangle, ray);
    let rounding = f64::from(rounding(triangle)).max(f64::from(ray.origin.abs().max_element() * f32::EPSILON));
    let close = off <= CLOSE || off * f64::from(near.0) * cos <= rounding;
    if a.1 == b.1 {
        // The same triangle at two distances: who is nearer to the true one is right.
        let first_is_off = (f64::from(a.0) - t).abs() > (f64::from(b.0) - t).abs();
        return if close { Verdict::Close } else { wrong(first_is_off) };
    }
    if close {
        let common = corners[a.1 as usize].iter().any(|c| corners[b.1 as usize].contains(c));
        return if common { Verdict::Edge } else { Verdict::Coincident };
    }
    if inside.abs() <= rounding {
        Verdict::Edge
    } else if t.abs() * cos <= rounding {
        Verdict::Start
    } else {
        // A hit well outside, or elsewhere, was made up by the one who reports it; else the other has overlooked it.
        let elsewhere = (f64::from(near.0) - t).abs() * cos > rounding.max(CLOSE * t);
        wrong(is_first == (inside < 0.0 || elsewhere))
    }
}

fn wrong(first: bool) -> Verdict {
    if first { Verdict::FirstWrong } else { Verdict::SecondWrong }
}

/// How far inside the triangle a ray passes (metres across the ray; negative: outside), where it meets its plane, and
/// the cosine between its direction and the normal there.
fn passage(corners: &[Vec3; 3], ray: &Ray) -> (f64, f64, f64) {
    let d = ray.direction.as_dvec3();
    let (x, y) = d.normalize().any_orthonormal_pair();
    let c = corners.map(|c| c.as_dvec3() - ray.origin.as_dvec3());
    let flat = c.map(|c| DVec2::new(c.dot(x), c.dot(y)));
    let n = (c[1] - c[0]).cross(c[2] - c[0]);
    let edges = [(flat[0], flat[1]), (flat[1], flat[2]), (flat[2], flat[0])];
    let sides = edges.map(|(p, q)| p.perp_dot(q));
    let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
    let distance = |(p, q): (DVec2, DVec2)| {
        let along = q - p;
        let at = (-p.dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
        (p + along * at).length()
    };
    let nearest = edges.into_iter().map(distance).fold(f64::INFINITY, f64::min);
    (if inside { nearest } else { -nearest }, n.dot(c[0]) / n.dot(d), (n.dot(d) / n.length()).abs())
}

/// The closest hit among all triangles, in double precision.
fn brute(corners: &[[Vec3; 3]], ray: &Ray) -> Hit {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best = (f64::INFINITY, 0);
    for (id, c) in corners.iter().enumerate() {
        let [a, b, c] = c.map(|c| c.as_dvec3() - o);
        // Volumes that the ray spans with the edges: their signs say on which side of each it passes.
        let (ad, bd, cd) = (d.cross(a), d.cross(b), d.cross(c));
        let [u, v, w]: [f64; 3] = [bd.dot(c), cd.dot(a), ad.dot(b)];
        let out = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        let n: DVec3 = (b - a).cross(c - a);
        let t = n.dot(a) / n.dot(d);
        if !out && t > 0.0 && t < best.0 {
            best = (t, id as u32);
        }
    }
    (best.0 < f64::INFINITY).then_some((best.0 as f32, best.1))
}

/// `count` of the rays, or all.
fn sample(rays: &[Ray], count: usize) -> Vec<Ray> {
    if rays.len() <= count {
        return rays.to_vec();
    }
    (0..count as u32).map(|k| rays[keyed(k, 0x7361_6d65, rays.len())]).collect()
}

impl Agreement {
    fn new((first, second): (&str, &str), query: &'static str, verdicts: Vec<Verdict>) -> Self {
        let mut a = Agreement { first: first.into(), second: second.into(), query, ..Agreement::default() };
        a.rays = verdicts.len();
        for v in verdicts {
            *match v {
                Verdict::Equal => &mut a.equal,
                Verdict::Close => &mut a.close,
                Verdict::Edge => &mut a.edge,
                Verdict::Coincident => &mut a.coincident,
                Verdict::Start => &mut a.start,
                Verdict::FirstWrong => &mut a.first_wrong,
                Verdict::SecondWrong => &mut a.second_wrong,
            } += 1;
        }
        a
    }
}

impl fmt::Display for Agreement {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Agreement { first, second, query, rays, .. } = self;
        write!(f, "{query}: {first} and {second}: {rays} rays, {} differ", rays - self.equal)?;
        let classes = [
            (self.close, "in distance by less than 1e-4".into()),
            (self.edge, "at an edge".into()),
            (self.coincident, "between coincident surfaces".into()),
            (self.start, "at the ray's start".into()),
            (self.first_wrong, format!("{first} wrong")),
            (self.second_wrong, format!("{second} wrong")),
        ];
        classes.iter().filter(|(count, _)| *count > 0).try_for_each(|(count, what)| write!(f, "; {count} {what}"))
    }
}
