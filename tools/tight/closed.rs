//! Rays from inside closed meshes: none may get out.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use luxel::{
    math::{hash, unit_float},
    scene::{Instance, Material, Mesh, Primitive, Scene, World},
    trace::{Hit, NOWHERE, Ray, Segment, Tracer},
};
use rayon::prelude::*;

/// Rays that a call takes.
const RAYS: usize = 64;

/// Closed meshes around a middle from which all of their inside is seen.
pub fn scenes() -> Vec<(&'static str, Scene)> {
    let skewed = DMat3::from_cols(DVec3::new(1.0, 0.3, 0.0), DVec3::new(0.7, 2.0, 0.1), DVec3::new(-0.4, 0.2, 0.5));
    let turned = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(1.1));
    let far = DVec3::new(1000.0, -2000.0, 500.0);
    let alone = |mesh, linear, at| scene(mesh, vec![(linear, at)]);
    vec![
        ("an icosphere", alone(icosphere(4), turned, DVec3::ZERO)),
        ("an icosphere kilometres from the origin", alone(icosphere(3), turned, far)),
        ("a sphere of strips, 3000 triangles at a pole", alone(strips(3000, 5), turned, DVec3::ZERO)),
        ("a skewed box of slivers, 1 to 200", alone(slivers(200), skewed, DVec3::ZERO)),
        (
            "a box, flat as paper",
            alone(slivers(50), DMat3::from_diagonal(DVec3::new(1.0, 1e-3, 1.0)) * turned, DVec3::ZERO),
        ),
        // The second is met from outside, and keeps the mesh shared.
        (
            "an icosphere as an instance",
            scene(icosphere(3), vec![(skewed, far), (turned * 0.01, far + skewed.x_axis * 0.5)]),
        ),
        (
            "a mirrored one of slivers",
            scene(slivers(100), vec![(skewed * -1.0, far), (turned * 0.01, far - skewed.y_axis * 0.4)]),
        ),
    ]
}

/// Of `count` rays from inside the first instance, those that get out: random ones, and ones aimed at corners and edges.
pub fn escaped(scene: &Scene, count: u64) -> u64 {
    let tracer = Tracer::new(World::new(scene));
    let batch = |first: u64| {
        let rays: Vec<Ray> = (first..count.min(first + RAYS as u64)).map(|k| ray(&tracer.world, k)).collect();
        let segment = |r: &Ray| Segment { origin: r.origin, direction: r.direction, t: f32::INFINITY, from: NOWHERE };
        let segments: Vec<Segment> = rays.iter().map(segment).collect();
        let (mut hits, mut through): ([Option<Hit>; RAYS], _) = ([None; RAYS], [Vec3::ZERO; RAYS]);
        tracer.closest_of_each(&rays, &mut hits[..rays.len()]);
        tracer.transmittance_of_each(&segments, &mut through[..rays.len()]);
        let out = hits[..rays.len()].iter().zip(&through).filter(|(h, t)| h.is_none() || **t != Vec3::ZERO);
        out.count() as u64
    };
    (0..count.div_ceil(RAYS as u64)).into_par_iter().map(|b| batch(b * RAYS as u64)).sum()
}

fn ray(world: &World, k: u64) -> Ray {
    let (key, high) = (k as u32, (k >> 32) as u32);
    let random = |salt: u32| hash(hash(key, salt), high);
    let share = |salt: u32| unit_float(random(salt));
    let corners = |salt: u32| world.corners(0, random(salt) % world.mesh(0).triangles.len() as u32);
    let middle = world.scene.instances[0].transform.translation.as_vec3();
    // Somewhere on the way from the middle to a corner.
    let origin = middle + (corners(1)[0] - middle) * (0.95 * share(2));
    let [a, b, c] = corners(3);
    let target = match k % 4 {
        0 => a,
        1 => a + (b - a) * share(4),
        2 => (a + b + c) / 3.0,
        _ => origin + Vec3::new(share(5), share(6), share(7)) - 0.5,
    };
    Ray { origin, direction: (target - origin).try_normalize().unwrap_or(Vec3::Z), key, from: NOWHERE }
}

/// Around the origin, radius 1, twenty faces split `times` times.
fn icosphere(times: u32) -> Mesh {
    let g = (1.0 + 5f32.sqrt()) / 2.0;
    let corner = |k: usize, x: f32, y: f32| Vec3::from_array([[0.0, x, y], [y, 0.0, x], [x, y, 0.0]][k]).normalize();
    let signs = [(1.0, g), (1.0, -g), (-1.0, g), (-1.0, -g)];
    let mut positions: Vec<Vec3> = (0..3).flat_map(|k| signs.map(|(x, y)| corner(k, x, y))).collect();
    let edge = positions[0].distance(positions[2]) * 1.01;
    let mut triangles = Vec::new();
    for (a, b, c) in (0..12).flat_map(|a| (0..a).flat_map(move |b| (0..b).map(move |c| (a, b, c)))) {
        let p = |k: usize| positions[k];
        if p(a).distance(p(b)).max(p(b).distance(p(c))).max(p(c).distance(p(a))) < edge {
            let inward = (p(b) - p(a)).cross(p(c) - p(a)).dot(p(a)) < 0.0;
            triangles.push(if inward { [a as u32, b as u32, c as u32] } else { [a as u32, c as u32, b as u32] });
        }
    }
    for _ in 0..times {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        let split = |[a, b, c]: [u32; 3]| {
            let (x, y, z) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, x, z], [b, y, x], [c, z, y], [x, y, z]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    mesh(positions, triangles)
}

/// A sphere of `around` strips from pole to pole, each of `down` pieces.
fn strips(around: u32, down: u32) -> Mesh {
    let mut positions = vec![Vec3::Y, Vec3::NEG_Y];
    for k in 1..down {
        let (s, c) = (
            libm::sinf(k as f32 * std::f32::consts::PI / down as f32),
            libm::cosf(k as f32 * std::f32::consts::PI / down as f32),
        );
        let turn = |j: u32| std::f32::consts::TAU * j as f32 / around as f32;
        positions.extend((0..around).map(|j| Vec3::new(s * libm::cosf(turn(j)), c, s * libm::sinf(turn(j)))));
    }
    let mut triangles = Vec::new();
    for j in 0..around {
        let at = |k: u32, j: u32| 2 + (k - 1) * around + j % around;
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([1, at(down - 1, j + 1), at(down - 1, j)]);
        for k in 1..down - 1 {
            triangles.extend([[at(k, j), at(k + 1, j), at(k + 1, j + 1)], [at(k, j), at(k + 1, j + 1), at(k, j + 1)]]);
        }
    }
    mesh(positions, triangles)
}

/// A cube whose four sides are `n` strips each, the ends fans around a corner of the first strip.
fn slivers(n: u32) -> Mesh {
    let ring = |z: f32| {
        (0..4 * n).map(move |k| {
            let (side, s) = (k / n, 2.0 * (k % n) as f32 / n as f32 - 1.0);
            let (x, y) = [(s, -1.0), (1.0, s), (-s, 1.0), (-1.0, -s)][side as usize];
            Vec3::new(x, y, z)
        })
    };
    let mut positions: Vec<Vec3> = ring(-1.0).chain(ring(1.0)).collect();
    positions.extend([Vec3::NEG_Z, Vec3::Z]);
    let m = 4 * n;
    let triangle = |k: u32| {
        let next = (k + 1) % m;
        [[k, m + k, next], [next, m + k, m + next], [2 * m, k, next], [2 * m + 1, m + next, m + k]]
    };
    mesh(positions, (0..m).flat_map(triangle).collect())
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let (vertices, count) = (positions.len() as u32, triangles.len() as u32);
    let primitives = vec![Primitive { vertices: 0..vertices, triangles: 0..count, ..Primitive::default() }];
    Mesh { normals: vec![Vec3::ZERO; positions.len()], positions, triangles, primitives, ..Mesh::default() }
}

fn scene(mesh: Mesh, places: Vec<(DMat3, DVec3)>) -> Scene {
    let instance = |(matrix3, translation)| Instance {
        name: "closed".into(),
        node: 0,
        mesh: 0,
        transform: DAffine3 { matrix3, translation },
        texels_per_meter: None,
    };
    let instances = places.into_iter().map(instance).collect();
    Scene { meshes: vec![mesh], instances, materials: vec![Material::default()], ..Scene::default() }
}
