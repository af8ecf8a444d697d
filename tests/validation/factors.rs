//! Form factors, by rows and through a bake: surface 1 receives, surface 2 emits M = 1, both black, so that F12 is the
//! share of 1's rows that ends on 2, and the mean of E over 1.
//!
//! Receivers have about 1024 texels of 1024 rays; a mean of texels is exact, so texel size costs nothing but hemicubes.
//! Those have 256, closed forms, which look at every pair, 64. What a hemicube may be off is known in closed form, too: its
//! one point for a texel, and the pixels that the outline of the emitter crosses ([`exact::aliasing`]).

use crate::common::{
    bakes::{Shot, grey, shoot},
    exact,
    scenes::{Ball, Cuboid, FACES, Face, disc, polygon, rectangle, unit_room},
    stage::{Chart, Stage},
    ways::Way,
};
use crate::{Case, Check, Outcome, Problem, numbers, vectors};
use glam::{DVec3, DVec4, UVec2, Vec3, uvec2, vec3};
use luxel::{
    atlas::Coverage,
    patches::{Faces, Footprint, Patches},
    progress::Silent,
    scene::World,
    trace::Tracer,
    transport::{self, FormFactors, Transport},
};
use std::collections::HashSet;

const RAYS: u32 = 1024;
/// What closed forms may be off: texels are in single precision.
const EXACT: f64 = 1e-6;
const EMITTER: UVec2 = UVec2::splat(4);

/// Black receivers and emitters.
fn black() -> (Stage, u32, u32) {
    let mut stage = Stage::new();
    let receiver = stage.material(0.0, 0.0);
    let emitter = stage.material(0.0, 1.0);
    (stage, receiver, emitter)
}

/// Mean of E over charts, and its standard error: that of counted rays, or what the texels show if that is less.
pub fn share(shot: &Shot, charts: &[Chart], rays: u32) -> (f64, f64) {
    let (area, mean) = shot.mean(charts);
    let (mut counted, mut shown) = (0.0, 0.0);
    for c in charts {
        let noise = shot.noise(*c).x;
        for i in shot.texels(*c) {
            let (a, f) = (f64::from(shot.baked.patches.area[i]) / area, grey(shot.baked.irradiance[i]).clamp(0.0, 1.0));
            counted += a * a * f * (1.0 - f) / f64::from(rays);
            shown += a * a * noise * noise;
        }
    }
    (mean.x, libm::sqrt(counted.min(shown)))
}

/// About 1024 texels for a rectangle.
fn texels(case: &Case, a: f64, b: f64) -> UVec2 {
    let density = f64::from(case.along(32)) / libm::sqrt(a * b);
    uvec2((a * density).round().max(4.0) as u32, (b * density).round().max(4.0) as u32)
}

fn v(x: f64, y: f64, z: f64) -> Vec3 {
    vec3(x as f32, y as f32, z as f32)
}

/// F from rectangle 1 (corner, edge, edge; its front is s x t) to rectangle 2.
fn between(case: &Case, one: [Vec3; 3], two: [Vec3; 3]) -> Outcome {
    let (mut stage, receiver, emitter) = black();
    let n = texels(case, f64::from(one[1].length()), f64::from(one[2].length()));
    let chart = rectangle(&mut stage, receiver, one, n);
    rectangle(&mut stage, emitter, two, EMITTER);
    finish(case, stage, chart, 0.0)
}

fn finish(case: &Case, stage: Stage, receiver: Chart, shape: f64) -> Outcome {
    let shot = seen(case, stage);
    let mut checks = Found::new(case, &shot, &[receiver])?.checks(case, "", 1.0, shape)?;
    if case.way() == Way::default() && shape == 0.0 {
        checks.push(texel_by_texel(&shot, receiver)?);
    }
    Ok(checks)
}

/// Rays of every texel against closed forms.
fn texel_by_texel(shot: &Shot, chart: Chart) -> Result<Check, Problem> {
    let [drawn, exact] = [FormFactors::Rays, FormFactors::Analytic].map(|f| rows(shot, f));
    let (drawn, exact) = (drawn?, exact?);
    let apart = |i: usize| (drawn[i] - exact[i]) / libm::sqrt(exact[i] * (1.0 - exact[i]) / f64::from(RAYS));
    let errors: Vec<f64> = shot.texels(chart).into_iter().filter(|&i| exact[i] > 0.0).map(apart).collect();
    Ok(Check::many("rays against closed forms", &errors))
}

/// A bake by the default; by others only its texels count.
fn seen(case: &Case, stage: Stage) -> Shot {
    shoot(stage, if case.way() == Way::default() { RAYS } else { 1 })
}

/// What a point sees of what emits: the form factor, and the [`exact::outline`].
type View<'a> = &'a dyn Fn(DVec3, DVec3) -> (f64, f64);

/// The view of convex emitters that nothing hides.
fn of_emitters(shot: &Shot) -> impl Fn(DVec3, DVec3) -> (f64, f64) + use<> {
    let emits = |material: u32| shot.scene.materials[material as usize].emission != Vec3::ZERO;
    let meshes = shot.scene.meshes.iter().filter(|mesh| emits(mesh.primitives[0].material));
    let corners = meshes.flat_map(|m| m.triangles.iter().map(|t| t.map(|v| m.positions[v as usize].as_dvec3())));
    let triangles: Vec<[DVec3; 3]> = corners.collect();
    move |p, normal| {
        let faces = |t: &&[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).dot(p - t[0]) > 0.0;
        let seen: Vec<&[DVec3; 3]> = triangles.iter().filter(faces).collect();
        let key = |[a, b]: [DVec3; 2]| [a.to_array(), b.to_array()].map(|c| c.map(f64::to_bits));
        let edges = || seen.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let all: HashSet<_> = edges().map(key).collect();
        // Of an edge that is run through both ways, both sides emit.
        let outline: Vec<_> = edges().filter(|[a, b]| !all.contains(&key([*b, *a]))).collect();
        let factor = seen.iter().map(|t| exact::element_to_polygon(p, normal, *t)).sum();
        (factor, exact::outline(p, normal, &outline))
    }
}

/// The middle of a texel, next to which its hemicube stands.
fn middle(world: &World, coverage: &Coverage, texel: usize) -> DVec3 {
    let footprint = Footprint::of(texel, &mut Faces::new(world, coverage));
    let weighed = |[a, b, c]: [Vec3; 3]| {
        let area = (b - a).cross(c - a).length();
        ((a + b + c) / 3.0 * area).as_dvec3().extend(f64::from(area))
    };
    let sum: DVec4 = footprint.triangles().map(weighed).sum();
    sum.truncate() / sum.w
}

/// F of some charts by this case's estimator, and through a bake if that is the default.
struct Found {
    by_rows: f64,
    /// Standard error by what is counted: rays, or pixels that the outline crosses.
    sigma: f64,
    /// By the points on which hemicubes stand.
    at_points: Option<f64>,
    /// Value and standard error.
    baked: Option<(f64, f64)>,
}

impl Found {
    fn new(case: &Case, shot: &Shot, charts: &[Chart]) -> Result<Self, Problem> {
        Found::of(case, shot, charts, &of_emitters(shot))
    }

    fn of(case: &Case, shot: &Shot, charts: &[Chart], view: View) -> Result<Self, Problem> {
        let by_texel = rows(shot, case.way().form_factors)?;
        let patches = &shot.baked.patches;
        let area = |i: usize| f64::from(patches.area[i]);
        let texels: Vec<usize> = charts.iter().flat_map(|c| shot.texels(*c)).collect();
        let all: f64 = texels.iter().map(|&i| area(i)).sum();
        let mean = |of: &dyn Fn(usize) -> f64| texels.iter().map(|&i| area(i) * of(i)).sum::<f64>() / all;
        let world = World::new(&shot.scene);
        let seen = |i: usize| view(middle(&world, &shot.baked.coverage, i), patches.normal[i].as_dvec3());
        let variance = |i: usize| match case.way().form_factors {
            FormFactors::Rays => by_texel[i] * (1.0 - by_texel[i]) / f64::from(RAYS),
            FormFactors::Hemicube { resolution } => exact::aliasing(resolution, seen(i).1).powi(2),
            FormFactors::Analytic => 0.0,
        };
        let sigma = libm::sqrt(texels.iter().map(|&i| area(i) * area(i) * variance(i)).sum::<f64>()) / all;
        let hemicube = matches!(case.way().form_factors, FormFactors::Hemicube { .. });
        let at_points = hemicube.then(|| mean(&|i| seen(i).0));
        let baked = (case.way() == Way::default()).then(|| share(shot, charts, RAYS));
        Ok(Found { by_rows: mean(&|i| by_texel[i]), sigma, at_points, baked })
    }

    /// Against expected number `key`, which is `ratio` times F.
    fn checks(&self, case: &Case, key: &str, ratio: f64, shape: f64) -> Outcome {
        let exact = if case.way().form_factors == FormFactors::Analytic { EXACT } else { 0.0 };
        let (sigma, expected) = (self.sigma * ratio, case.expects(key)?);
        let one_point = self.at_points.map_or(0.0, |f| (ratio * f - expected).abs());
        let allowed = shape + exact + one_point;
        let rows = Check { what: "rows".into(), ..case.check(key, self.by_rows * ratio, sigma, allowed)? };
        let mut checks = vec![rows];
        if let Some((got, sigma)) = self.baked {
            checks.push(Check { what: "baked".into(), ..case.check(key, got * ratio, sigma * ratio, shape)? });
        }
        Ok(checks)
    }
}

/// Share of every texel's row that ends on what emits.
fn rows(shot: &Shot, form_factors: FormFactors) -> Result<Vec<f64>, Problem> {
    let tracer = Tracer::new(World::new(&shot.scene));
    let coverage = &shot.baked.coverage;
    let mut patches = Patches::new(&tracer.world, coverage, 0.98);
    let options = transport::Options { form_factors, reuse: false, ..transport::Options::of(RAYS) };
    let measured = Transport::measure(&tracer, coverage, &mut patches, &options, &Silent);
    let transport = measured.map_err(Problem::Refused)?;
    transport.validate(&patches)?;
    let emits = |c: u32| patches.exitance.get(c as usize).is_some_and(|m| *m != Vec3::ZERO);
    let share = |i: usize| transport.rows.row(i).sum(|c| f64::from(u8::from(emits(c))));
    Ok((0..patches.fronts).map(share).collect())
}

pub fn parallel_equal_rectangles(case: &Case) -> Outcome {
    let (a, b, gap) = (case.input("a")?, case.input("b")?, case.input("gap")?);
    let one = [Vec3::ZERO, v(a, 0.0, 0.0), v(0.0, b, 0.0)];
    between(case, one, [v(0.0, 0.0, gap), v(0.0, b, 0.0), v(a, 0.0, 0.0)])
}

pub fn parallel_offset_rectangles(case: &Case) -> Outcome {
    let i = |key| case.input(key);
    let (x, y, z) = (i("x1")?, i("y1")?, i("z")?);
    let one = [v(x, y, 0.0), v(i("x2")? - x, 0.0, 0.0), v(0.0, i("y2")? - y, 0.0)];
    let (a, b) = (i("a1")?, i("b1")?);
    between(case, one, [v(a, b, z), v(0.0, i("b2")? - b, 0.0), v(i("a2")? - a, 0.0, 0.0)])
}

pub fn perpendicular_rectangles(case: &Case) -> Outcome {
    let i = |key| case.input(key);
    let (x, y) = (i("x1")?, i("y1")?);
    let one = [v(x, y, 0.0), v(i("x2")? - x, 0.0, 0.0), v(0.0, i("y2")? - y, 0.0)];
    let (a, z) = (i("a1")?, i("z1")?);
    between(case, one, [v(0.0, a, z), v(0.0, i("a2")? - a, 0.0), v(0.0, 0.0, i("z2")? - z)])
}

pub fn perpendicular_common_edge(case: &Case) -> Outcome {
    let (h, w, l) = (case.input("h")?, case.input("w")?, case.input("l")?);
    let floor = [Vec3::ZERO, v(w, 0.0, 0.0), v(0.0, l, 0.0)];
    between(case, floor, [Vec3::ZERO, v(0.0, l, 0.0), v(0.0, 0.0, h)])
}

pub fn hinged_rectangles(case: &Case) -> Outcome {
    let (a, b, angle) = (case.input("a")?, case.input("b")?, case.input("angle_deg")?.to_radians());
    let edge = case.input("common_edge")?;
    let up = v(b * libm::cos(angle), 0.0, b * libm::sin(angle));
    between(case, [Vec3::ZERO, v(a, 0.0, 0.0), v(0.0, edge, 0.0)], [Vec3::ZERO, v(0.0, edge, 0.0), up])
}

/// Discs are 128-gons of the circle's area: what is left is below (2 pi / 128)^2 / 6 of F.
pub fn coaxial_discs(case: &Case) -> Outcome {
    let (r1, r2, h) = (case.input("r1")?, case.input("r2")?, case.input("h")?);
    let (mut stage, receiver, emitter) = black();
    let chart = disc(&mut stage, receiver, [Vec3::ZERO, Vec3::X, Vec3::Y], r1, 128, case.along(36));
    disc(&mut stage, emitter, [v(0.0, 0.0, h), Vec3::Y, Vec3::X], r2, 128, case.along(8));
    finish(case, stage, chart, 4e-4 * case.expects("")?)
}

/// The point is a square of side .01; what that changes is integrated from the closed form.
pub fn element_to_polygon(case: &Case) -> Outcome {
    let point = DVec3::from_slice(&numbers(&case.inputs["point"])?);
    let normal = DVec3::from_slice(&numbers(&case.inputs["normal"])?).normalize();
    let mut corners: Vec<DVec3> = vectors(&case.inputs["polygon"])?.iter().map(|p| DVec3::from_slice(p)).collect();
    let front = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if front.dot(point - corners[0]) < 0.0 {
        corners.reverse();
    }
    let (s, t) = normal.any_orthonormal_pair();
    let (s, t) = if s.cross(t).dot(normal) > 0.0 { (s * 0.01, t * 0.01) } else { (t * 0.01, s * 0.01) };
    let square = [point - s / 2.0 - t / 2.0, s, t];
    let mean = exact::mean_over(square, 32, |p| exact::element_to_polygon(p, normal, &corners));
    let (mut stage, receiver, emitter) = black();
    let chart = rectangle(&mut stage, receiver, square.map(|p| p.as_vec3()), UVec2::splat(case.along(32)));
    polygon(&mut stage, emitter, &corners.iter().map(|p| p.as_vec3()).collect::<Vec<_>>(), 4);
    finish(case, stage, chart, (mean - exact::element_to_polygon(point, normal, &corners)).abs())
}

/// Share of a ball's output that meets a chart: A E / A_ball. The ball has 64 x 32 facets, half as many each way for
/// closed forms: below facet^2 / 8 of F.
fn from_ball(case: &Case, radius: f64, build: impl Fn(&mut Stage, u32) -> Chart) -> Outcome {
    let (mut stage, receiver, emitter) = black();
    let chart = build(&mut stage, receiver);
    let n = if case.way().form_factors == FormFactors::Analytic { 16 } else { 32 };
    let ball = Ball::whole(Vec3::ZERO, radius, uvec2(2 * n, n), false);
    let source = ball.build(&mut stage, emitter);
    let ratio = stage.area(chart) / stage.area(source);
    let shape = ball.facet() * ball.facet() / 8.0 * case.expects("")?;
    let shot = seen(case, stage);
    Found::new(case, &shot, &[chart])?.checks(case, "", ratio, shape)
}

pub fn sphere_to_rectangle(case: &Case) -> Outcome {
    let (a, b, d) = (case.input("a")?, case.input("b")?, case.input("d")?);
    from_ball(case, d / 2.0, |stage, receiver| {
        rectangle(stage, receiver, [v(0.0, 0.0, d), v(0.0, b, 0.0), v(a, 0.0, 0.0)], texels(case, a, b))
    })
}

pub fn sphere_to_disc(case: &Case) -> Outcome {
    let (r, h) = (case.input("R")?, case.input("h")?);
    from_ball(case, h / 2.0, |stage, receiver| {
        disc(stage, receiver, [v(0.0, 0.0, h), Vec3::Y, Vec3::X], r, 128, case.along(36))
    })
}

pub fn cube_interior(case: &Case) -> Outcome {
    let side = case.input("cube")? as f32;
    let (mut stage, receiver, emitter) = black();
    let room = Cuboid { high: Vec3::splat(side), ..unit_room() };
    let mut face = |f: Face| {
        let (material, n) = if f == Face::Top { (emitter, EMITTER) } else { (receiver, UVec2::splat(case.along(24))) };
        room.face(&mut stage, f, material, UVec2::ONE, n)
    };
    let [left, right, bottom, _, back, front] = FACES.map(&mut face);
    let shot = seen(case, stage);
    let found = |charts: &[Chart]| Found::new(case, &shot, charts);
    let mut checks = found(&[bottom])?.checks(case, "opposite", 1.0, 0.0)?;
    checks.extend(found(&[left, right, back, front])?.checks(case, "adjacent", 1.0, 0.0)?);
    Ok(checks)
}

/// Whether two texels see each other is sampled, too, by 16 segments, from texels of 16 different sets of points.
pub fn obstructed_squares(case: &Case) -> Outcome {
    let [x, y] = ["blocker_x", "blocker_y"].map(|k| numbers(&case.inputs[k]));
    let (x, y, z) = (x?, y?, case.input("blocker_z")?);
    let (mut stage, receiver, emitter) = black();
    let chart = rectangle(&mut stage, receiver, [Vec3::ZERO, Vec3::X, Vec3::Y], UVec2::splat(32));
    rectangle(&mut stage, emitter, [Vec3::Z, Vec3::Y, Vec3::X], EMITTER);
    let blocker = [v(x[0], y[0], z), v(x[1] - x[0], 0.0, 0.0), v(0.0, y[1] - y[0], 0.0)];
    rectangle(&mut stage, receiver, blocker, EMITTER);
    let sampled = case.way().form_factors == FormFactors::Analytic;
    let sigma = if sampled { 0.5 / 16.0 * case.expects("")? } else { 0.0 };
    let shot = seen(case, stage);
    // The blocker hides a rectangle, where its shadow falls on the emitter.
    let shadow = |p: DVec3| {
        let on = |p: f64, edge: f64| (p + (edge - p) / z).clamp(0.0, 1.0);
        let corner = |i: usize, j: usize| DVec3::new(on(p.x, x[i]), on(p.y, y[j]), 1.0);
        [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
    };
    let whole = of_emitters(&shot);
    let view = |p: DVec3, normal: DVec3| {
        let (hidden, (factor, outline)) = (shadow(p), whole(p, normal));
        let edges = [0, 1, 2, 3].map(|k| [hidden[k], hidden[(k + 1) % 4]]);
        (factor - exact::element_to_polygon(p, normal, &hidden), outline + exact::outline(p, normal, &edges))
    };
    let checks = Found::of(case, &shot, &[chart], &view)?.checks(case, "", 1.0, 0.0)?.into_iter();
    Ok(checks.map(|check| Check { sigma: check.sigma + sigma, ..check }).collect())
}

/// Facets of half the size leave a quarter of the error: a ball in closed forms.
#[test]
fn curved_surfaces_converge_as_h2() {
    let expected = 1.0 / 24.0;
    let error = |n: u32| {
        let (mut stage, receiver, emitter) = black();
        let chart = rectangle(&mut stage, receiver, [Vec3::Z, Vec3::Y, Vec3::X], UVec2::splat(4));
        let ball = Ball::whole(Vec3::ZERO, 0.5, uvec2(2 * n, n), false);
        let source = ball.build(&mut stage, emitter);
        let ratio = stage.area(chart) / stage.area(source);
        let shot = shoot(stage, 1);
        let by_texel = rows(&shot, FormFactors::Analytic).unwrap_or_else(|_| panic!("{n} facets are refused"));
        let sum: f64 = shot.texels(chart).iter().map(|&i| f64::from(shot.baked.patches.area[i]) * by_texel[i]).sum();
        (ratio * sum / shot.mean(&[chart]).0 - expected).abs()
    };
    let errors = [6, 12, 24].map(error);
    println!("a ball of 2n x n facets, n = 6, 12, 24, is off by {errors:?}");
    for halved in errors.windows(2).map(|e| e[0] / e[1]) {
        assert!((3.5..4.5).contains(&halved), "{errors:?}");
    }
}
