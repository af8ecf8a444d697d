mod places;

use super::{
    tree::{Bounds, Tree},
    *,
};
use crate::{
    math::Frame,
    scene::{Instance, Material, Mesh, Primitive, Scene},
};
use glam::DAffine3;

/// A closed box around the origin, faces inward, each a grid of `n` x `n` quads; `clutter` random triangles inside.
fn room(half: Vec3, n: u32, clutter: u32) -> Scene {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let base = mesh.positions.len() as u32;
            for j in 0..=n {
                for i in 0..=n {
                    let mut p = Vec3::ZERO;
                    p[axis] = side;
                    p[u] = 2.0 * i as f32 / n as f32 - 1.0;
                    p[v] = 2.0 * j as f32 / n as f32 - 1.0;
                    mesh.positions.push(p * half);
                }
            }
            for j in 0..n {
                for i in 0..n {
                    let a = base + j * (n + 1) + i;
                    let [p, q, r, s] = [a, a + 1, a + n + 2, a + n + 1];
                    let quads = if side < 0.0 { [[p, q, r], [p, r, s]] } else { [[p, r, q], [p, s, r]] };
                    mesh.triangles.extend(quads);
                }
            }
        }
    }
    for k in 0..clutter {
        let f = |i: u32| unit_float(hash(k, i)) * 1.8 - 0.9;
        let c = Vec3::new(f(0), f(1), f(2)) * half;
        let base = mesh.positions.len() as u32;
        mesh.positions.extend((0..3).map(|i| c + Vec3::new(f(3 + i), f(6 + i), f(9 + i)) * half * 0.1));
        mesh.triangles.push([base, base + 1, base + 2]);
    }
    let (vertices, triangles) = (0..mesh.positions.len() as u32, 0..mesh.triangles.len() as u32);
    mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
    mesh.primitives = vec![Primitive { vertices, triangles, ..Primitive::default() }];
    let instance =
        Instance { name: "room".into(), node: 0, mesh: 0, transform: DAffine3::IDENTITY, texels_per_meter: None };
    Scene { meshes: vec![mesh], instances: vec![instance], materials: vec![Material::default()], ..Scene::default() }
}

fn direction(k: u32) -> Vec3 {
    let z = 2.0 * unit_float(hash(k, 77)) - 1.0;
    let angle = std::f32::consts::TAU * unit_float(hash(k, 78));
    let s = (1.0 - z * z).sqrt();
    Vec3::new(s * libm::cosf(angle), s * libm::sinf(angle), z).normalize()
}

fn inside(k: u32, half: Vec3) -> Vec3 {
    let f = |i| unit_float(hash(k, i)) * 1.9 - 0.95;
    Vec3::new(f(1), f(2), f(3)) * half
}

/// Möller and Trumbore's test in double precision.
fn distance(corners: [Vec3; 3], origin: Vec3, direction: Vec3) -> f64 {
    let [a, b, c] = corners.map(|c| c.as_dvec3());
    let (e1, e2, d, s) = (b - a, c - a, direction.as_dvec3(), origin.as_dvec3() - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    let (u, v) = (s.dot(p) / det, d.dot(s.cross(e1)) / det);
    let t = e2.dot(s.cross(e1)) / det;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 { t } else { f64::INFINITY }
}

fn shoot(tracer: &Tracer, origin: Vec3, direction: Vec3) -> Option<Hit> {
    tracer.closest(&Ray { origin, direction, key: 0, from: NOWHERE })
}

fn through<const N: usize>(tracer: &Tracer, origin: Vec3, direction: Vec3, t: [f32; N]) -> [Vec3; N] {
    let mut through = [Vec3::ZERO; N];
    tracer.transmittance_of_each(&t.map(|t| Segment { origin, direction, t, from: NOWHERE }), &mut through);
    through
}

/// One tracer for each instruction set of this machine.
fn tracers(scene: &Scene) -> Vec<Tracer<'_>> {
    let tracer = |level| Tracer { level, ..Tracer::new(World::new(scene)) };
    Level::available().into_iter().map(tracer).collect()
}

#[test]
fn flat_outer_walls_do_not_ruin_the_tree() {
    let scene = room(Vec3::new(4.0, 1.5, 3.0), 100, 0);
    let world = World::new(&scene);
    let boxes: Vec<Bounds> = (0..world.len()).map(|t| Bounds::of(&world.corners(0, t))).collect();
    let cost = |margin| Tree::new(&boxes, boxes.len(), Vec3::splat(margin)).cost();
    let (cured, plain) = (cost(1e-5), cost(0.0));
    assert!(cured < 0.5 * plain, "expected cost {cured} with the cure, {plain} without");
    assert!(cured < 30.0, "expected cost {cured}");
}

#[test]
fn closest_and_occlusion_agree_with_brute_force() {
    let half = Vec3::new(2.0, 1.0, 3.0);
    let scene = room(half, 3, 400);
    for tracer in tracers(&scene) {
        let world = &tracer.world;
        for k in 0..20_000 {
            let (origin, d) = (inside(k, half), direction(k));
            let at = |t: u32| distance(world.corners(0, t), origin, d);
            let brute = (0..world.len()).map(at).fold(f64::INFINITY, f64::min) as f32;
            let hit = shoot(&tracer, origin, d).expect("the room is closed");
            assert!((hit.t - brute).abs() <= 2e-6 * (1.0 + brute), "ray {k}: {} for {brute}", hit.t);
            assert_eq!(
                through(&tracer, origin, d, [brute * 1.0001, brute * 0.9999]),
                [Vec3::ZERO, Vec3::ONE],
                "ray {k}"
            );
            let [p, q, r] = world.corners(0, hit.triangle);
            let at = p + (q - p) * hit.bary.x + (r - p) * hit.bary.y;
            assert!(at.distance(origin + d * hit.t) < 1e-4, "ray {k}: barycentrics lead to {at}");
            let facing = world.cross(0, &[p, q, r]).dot(d) < 0.0;
            assert_eq!(hit.front, facing, "ray {k}");
        }
    }
}

#[test]
fn a_ray_passes_the_triangle_that_it_starts_on() {
    let half = Vec3::new(2.0, 1.0, 3.0);
    let scene = room(half, 3, 400);
    for tracer in tracers(&scene) {
        for k in 0..2000 {
            let (origin, direction) = (inside(k, half), direction(k));
            let from = shoot(&tracer, origin, direction).expect("the room is closed").triangle;
            let others = (0..tracer.world.len()).filter(|&t| t != from);
            let brute =
                others.map(|t| distance(tracer.world.corners(0, t), origin, direction)).fold(f64::INFINITY, f64::min);
            let t = tracer.closest(&Ray { origin, direction, key: 0, from }).map_or(f64::INFINITY, |h| f64::from(h.t));
            assert!(t == brute || (t - brute).abs() <= 2e-6 * (1.0 + brute), "ray {k}: {t} for {brute}");
            let mut through = [Vec3::ZERO; 2];
            let ways =
                [0.999, 1.001].map(|part| Segment { origin, direction, t: part * brute.min(100.0) as f32, from });
            tracer.transmittance_of_each(&ways, &mut through);
            assert_eq!(through, [Vec3::ONE, if brute < 100.0 { Vec3::ZERO } else { Vec3::ONE }], "ray {k}");
        }
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let half = Vec3::new(2.0, 1.0, 3.0);
    let scene = room(half, 3, 400);
    let tracers = tracers(&scene);
    for k in 0..20_000 {
        let bits = |t: &Tracer| {
            let hit = shoot(t, inside(k, half), direction(k)).expect("the room is closed");
            (hit.t.to_bits(), hit.triangle, hit.bary.to_array().map(f32::to_bits))
        };
        assert!(tracers.iter().all(|t| bits(t) == bits(&tracers[0])), "ray {k}");
    }
}

#[test]
fn rays_together_meet_what_they_meet_alone() {
    // Every triangle twice: of two in one place the same one is reported, whoever walks along.
    let half = Vec3::new(2.0, 1.0, 3.0);
    let mut scene = room(half, 3, 400);
    let mesh = &mut scene.meshes[0];
    mesh.triangles.extend_from_within(..);
    mesh.primitives[0].triangles = 0..mesh.triangles.len() as u32;
    let once = mesh.triangles.len() as u32 / 2;
    for tracer in tracers(&scene) {
        for n in [1, 2, 7, 8, 9, 64, 1000] {
            let ray = |k| Ray { origin: inside(k, half), direction: direction(k), key: 0, from: NOWHERE };
            let rays: Vec<Ray> = (0..n).map(ray).collect();
            let mut hits = vec![None; rays.len()];
            tracer.closest_of_each(&rays, &mut hits);
            for (ray, hit) in rays.iter().zip(hits) {
                let bits = |h: Option<Hit>| h.map(|h| (h.t.to_bits(), h.triangle, h.bary.to_array().map(f32::to_bits)));
                assert_eq!(bits(hit), bits(tracer.closest(ray)));
                assert!(hit.is_some_and(|h| h.triangle < once), "the first of two in one place");
            }
        }
    }
}

#[test]
fn triangles_in_one_place_are_no_burden() {
    // Equal boxes made the tree's builder quadratic, and a ray meets all of them.
    let mut scene = room(Vec3::ONE, 1, 0);
    let mesh = &mut scene.meshes[0];
    mesh.triangles = mesh.triangles.iter().flat_map(|&t| [t; 5_000]).collect();
    mesh.primitives[0].triangles = 0..mesh.triangles.len() as u32;
    let tracer = Tracer::new(World::new(&scene));
    for k in 0..20 {
        let hit = shoot(&tracer, inside(k, Vec3::ONE), direction(k)).expect("the room is closed");
        assert!(hit.front);
    }
}

#[test]
fn hits_close_by_and_along_axes_count() {
    let scene = room(Vec3::ONE, 1, 0);
    let tracer = Tracer::new(World::new(&scene));
    for exponent in 0..22 {
        let gap = libm::exp2f(-(exponent as f32));
        let origin = Vec3::new(1.0 - gap, 0.3, 0.2);
        for d in [Vec3::new(1.0, -0.0, 0.0), Vec3::new(1.0, -0.0, -0.0), Vec3::new(1.0, 0.1, 0.1)] {
            let hit = shoot(&tracer, origin, d).expect("the room is closed");
            assert!((hit.t - gap).abs() <= 1e-6 * gap, "gap {gap} along {d}: {}", hit.t);
            assert_eq!(through(&tracer, origin, d, [f32::INFINITY]), [Vec3::ZERO], "gap {gap} along {d}");
        }
    }
}

#[test]
fn a_closed_mesh_lets_nothing_out() {
    // Rays aimed at shared edges and corners are where a test that is not watertight fails.
    let half = Vec3::new(1.0, 0.7, 1.3);
    let scene = room(half, 7, 0);
    let tracer = Tracer::new(World::new(&scene));
    let positions = &scene.meshes[0].positions;
    for k in 0..100_000u32 {
        let origin = inside(k, half);
        let [a, b] = [4, 5].map(|s| positions[hash(k, s) as usize % positions.len()]);
        let target = match k % 3 {
            0 => origin + direction(k),
            1 => a,
            _ => a + (b - a) * unit_float(hash(k, 6)),
        };
        let d = (target - origin).normalize();
        assert!(shoot(&tracer, origin, d).is_some(), "ray {k} from {origin} along {d} escapes");
    }
}

#[test]
fn mirrored_instances_keep_their_fronts() {
    let mut scene = room(Vec3::ONE, 1, 0);
    scene.instances[0].transform = DAffine3::from_scale(glam::DVec3::new(-1.0, 2.0, 0.5));
    let tracer = Tracer::new(World::new(&scene));
    for k in 0..100 {
        let frame = Frame::around(direction(k));
        let hit = shoot(&tracer, Vec3::ZERO, frame.to_world(Vec3::Z)).expect("the room is closed");
        assert!(hit.front);
    }
}
