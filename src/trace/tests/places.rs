//! Meshes with trees of their own against the same scene with every triangle placed.

use super::*;
use crate::scene::Alpha;
use glam::{DMat3, DQuat, DVec3};

/// A room of clutter and a smaller one, in many places: turned, mirrored, sheared, far off, tiny and flat.
fn instances() -> Scene {
    let mut scene = room(Vec3::new(2.0, 1.0, 3.0), 3, 60);
    scene.meshes.extend(room(Vec3::splat(0.5), 2, 40).meshes);
    // Far from its own origin, and half of it holes.
    let far = &mut scene.meshes[1];
    far.positions.iter_mut().for_each(|p| *p += Vec3::new(300.0, -50.0, 20.0));
    let (count, vertices) = (far.triangles.len() as u32, far.positions.len() as u32);
    let part = |triangles, material| Primitive { vertices: 0..vertices, triangles, material, ..Primitive::default() };
    far.primitives = vec![part(0..count / 2, 0), part(count / 2..count, 1)];
    scene.materials.push(Material { alpha: Alpha::Blend, base_color: glam::Vec4::splat(0.5), ..Material::default() });
    let template = scene.instances.remove(0);
    for k in 0..60u32 {
        let f = |i: u32| f64::from(unit_float(hash(k, i))) * 2.0 - 1.0;
        let turn = DQuat::from_axis_angle(DVec3::new(f(1), f(2), f(3) + 1e-3).normalize(), 3.0 * f(4));
        let size = DVec3::new(f(5), f(6), f(7)) * [1.0, 30.0, 0.01][k as usize % 3];
        let mut linear = DMat3::from_quat(turn) * DMat3::from_diagonal(size);
        linear.x_axis += linear.y_axis * f(8);
        if k == 7 {
            linear.z_axis = DVec3::ZERO;
        }
        let mesh = k % 2;
        let middle = DVec3::new(300.0, -50.0, 20.0) * f64::from(mesh);
        let at = DVec3::new(f(9), f(10), f(11)) * if k % 5 == 0 { 200.0 } else { 10.0 };
        let transform = DAffine3 { matrix3: linear, translation: at - linear * middle };
        scene.instances.push(Instance { mesh, transform, ..template.clone() });
    }
    scene
}

fn forests<'s>(scene: &'s Scene, shared: bool) -> impl Iterator<Item = Tracer<'s>> {
    Level::available().into_iter().map(move |level| {
        let world = World::new(scene);
        Tracer { forest: Forest::new(&world, &vec![shared; scene.meshes.len()]), world, level }
    })
}

/// A ray that starts somewhere, or off a surface as rays of a bake do, into any direction or towards a corner. Some pass
/// the triangle with that corner, as if they started there.
fn ray(world: &World, k: u32) -> Ray {
    let pick = |salt| {
        let (instance, t) = world.locate(hash(k, salt) % world.len());
        (world.triangles_of(instance).start + t, world.corners(instance, t))
    };
    let ((_, here), (aim, there)) = (pick(1), pick(2));
    let normal = (here[1] - here[0]).cross(here[2] - here[0]).normalize_or_zero();
    let origin = match k % 3 {
        0 => direction(k) * 20.0,
        _ => (here[0] + here[1] + here[2]) / 3.0 + normal * rounding(&here),
    };
    let d = if k % 4 == 2 { direction(hash(k, 3)) } else { (there[0] - origin).normalize() };
    Ray { origin, direction: d, key: k, from: if k.is_multiple_of(4) { aim } else { NOWHERE } }
}

fn bits(hit: &Option<Hit>) -> Option<(u32, u32, [u32; 2], bool)> {
    hit.map(|h| (h.t.to_bits(), h.triangle, h.bary.to_array().map(f32::to_bits), h.front))
}

#[test]
fn a_shared_mesh_is_met_as_if_every_triangle_were_placed() {
    let scene = instances();
    let placed = forests(&scene, false).next().expect("the portable one");
    let rays: Vec<Ray> = (0..60_000).map(|k| ray(&placed.world, k)).collect();
    let segments: Vec<Segment> =
        rays.iter().map(|r| Segment { origin: r.origin, direction: r.direction, t: 4.0, from: r.from }).collect();
    let (mut truth, mut open) = (vec![None; rays.len()], vec![Vec3::ZERO; rays.len()]);
    placed.closest_of_each(&rays, &mut truth);
    placed.transmittance_of_each(&segments, &mut open);
    let met = truth.iter().flatten().count();
    let dimmed = open.iter().filter(|o| **o != Vec3::ZERO && **o != Vec3::ONE).count();
    assert!(met > 20_000 && dimmed > 100, "{met} met, {dimmed} dimmed");
    for tracer in forests(&scene, true) {
        let places = tracer.forest.places.len();
        assert!((30..60).contains(&places), "{places} places: the flat and the tiny are none");
        let (mut hits, mut through) = (truth.clone(), open.clone());
        tracer.closest_of_each(&rays, &mut hits);
        tracer.transmittance_of_each(&segments, &mut through);
        for k in 0..rays.len() {
            assert!(hits[k].is_none_or(|h| h.triangle != rays[k].from), "ray {k} meets what it passes");
            assert_eq!(bits(&hits[k]), bits(&truth[k]), "ray {k}: {:?}", rays[k]);
            assert!((through[k] - open[k]).abs().max_element() < 1e-6, "segment {k}: {} for {}", through[k], open[k]);
        }
    }
}

#[test]
fn a_ray_off_a_placed_triangle_does_not_meet_it() {
    let scene = instances();
    let tracer = forests(&scene, true).last().expect("the best one");
    let world = &tracer.world;
    for k in 0..60_000u32 {
        let (instance, t) = world.locate(hash(k, 1) % world.len());
        let corners = world.corners(instance, t);
        let cross = world.cross(instance, &corners);
        let normal = cross.normalize_or_zero();
        let (u, v) = (unit_float(hash(k, 2)), unit_float(hash(k, 3)));
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let origin = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
        let d = direction(k);
        let d = if d.dot(normal) < 0.0 { -d } else { d };
        // Of directions nearly in the plane nobody can say on which side they start.
        if normal == Vec3::ZERO || d.dot(normal) < 0.01 {
            continue;
        }
        let hit = shoot(&tracer, origin + normal * rounding(&corners), d);
        assert!(hit.is_none_or(|h| h.triangle != world.triangles_of(instance).start + t), "ray {k}");
    }
}

#[test]
fn triangles_that_are_flat_where_they_stand_are_left_out() {
    let mut scene = room(Vec3::ONE, 3, 0);
    // Flat in the mesh, flat once placed, solid.
    let base = scene.meshes[0].positions.len() as u32;
    scene.meshes[0]
        .positions
        .extend([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-9, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from));
    scene.meshes[0].triangles.extend([[base, base, base + 1], [base, base + 1, base + 2], [base, base + 1, base + 3]]);
    scene.meshes[0].primitives[0].triangles.end += 3;
    scene.instances[0].transform.translation = DVec3::new(0.0, 100.0, 0.0);
    for tracer in forests(&scene, true) {
        struct Standing<'a>(&'a Forest);
        impl Task for Standing<'_> {
            type Output = Vec<u32>;

            #[inline(always)]
            fn run<S: Lanes>(self) -> Vec<u32> {
                let leaves = self.0.leaves.iter().map(|leaf| self.0.places[0].place::<S>(leaf));
                let lanes = leaves.flat_map(|l| (0..LANES).map(move |k| (l.corners[0][0].0[k], l.ids[k])));
                lanes.filter(|(x, _)| !x.is_nan()).map(|(_, id)| id).collect()
            }
        }
        let mut ids = simd::run(tracer.level, Standing(&tracer.forest));
        ids.sort_unstable();
        assert!(ids.into_iter().eq((0..108).chain([110])));
    }
}

#[test]
fn joined_instances_let_nothing_out() {
    // Each wall of a box is 4 x 4 tiles of one mesh; rays are aimed at their seams and corners.
    let mut scene = room(Vec3::ONE, 1, 0);
    let template = scene.instances.remove(0);
    let n = 5;
    let mesh = &mut scene.meshes[0];
    mesh.positions = (0..n * n).map(|k| Vec3::new((k % n) as f32 / 8.0, (k / n) as f32 / 8.0, 0.0)).collect();
    mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
    let quad = |k: u32| [[k, k + 1, k + n + 1], [k, k + n + 1, k + n]];
    mesh.triangles = (0..n * (n - 1)).filter(|k| k % n < n - 1).flat_map(quad).collect();
    mesh.primitives[0].triangles = 0..mesh.triangles.len() as u32;
    for wall in 0..6 * 16 {
        let (axis, side, i, j) = (wall / 32, wall / 16 % 2, wall % 4, wall / 4 % 4);
        let axes = DMat3::IDENTITY;
        let [x, y, z] = [axes.col((axis + 1) % 3), axes.col((axis + 2) % 3), axes.col(axis)];
        let at = x * (0.5 * i as f64 - 1.0) + y * (0.5 * j as f64 - 1.0) + z * (2.0 * side as f64 - 1.0);
        let transform = DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: at };
        scene.instances.push(Instance { transform, ..template.clone() });
    }
    for tracer in forests(&scene, true) {
        assert_eq!(tracer.forest.places.len(), 96);
        for k in 0..50_000u32 {
            let origin = inside(k, Vec3::ONE);
            let (axis, f) = (k as usize % 3, |i| unit_float(hash(k, i)) * 2.0 - 1.0);
            let mut target = Vec3::new(f(5), f(6), f(7));
            target[axis] = f(8).signum();
            // Onto a seam, or a corner of tiles.
            target[(axis + 1) % 3] = (target[(axis + 1) % 3] * 2.0).round() * 0.5;
            if k & 1 == 0 {
                target[(axis + 2) % 3] = (target[(axis + 2) % 3] * 8.0).round() * 0.125;
            }
            let d = (target - origin).normalize();
            assert!(shoot(&tracer, origin, d).is_some(), "ray {k} from {origin} along {d} escapes");
        }
    }
}

#[test]
fn meshes_placed_again_are_shared_where_it_halves_the_tree() {
    let mut scene = room(Vec3::ONE, 3, 40);
    let template = scene.instances[0].clone();
    let shared = |scene: &Scene| forest::worth_sharing(scene);
    assert_eq!(shared(&scene), [false], "placed once");
    scene.instances.push(template.clone());
    assert_eq!(shared(&scene), [true]);
    scene.meshes.push(room(Vec3::ONE, 1, 0).meshes.remove(0));
    scene.instances.extend([1, 1].map(|mesh| Instance { mesh, ..template.clone() }));
    assert_eq!(shared(&scene), [false, false], "the small one is twice there, and less than half is saved");
    scene.instances.extend([0, 0].map(|mesh| Instance { mesh, ..template.clone() }));
    assert_eq!(shared(&scene), [true, false]);
    let bytes = Tracer::new(World::new(&scene)).bytes();
    assert!(bytes < 120 * (148 + 24) + 4 * 200, "{bytes} bytes");
}
