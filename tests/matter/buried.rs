//! What other geometry buries, and what is only dark.

use crate::{
    PI,
    common::{
        bakes::{grey, shoot, within_sigma},
        exact,
        scenes::{Cuboid, Face, unit_room},
        stage::Stage,
    },
    greys, plane, white,
};
use glam::{DVec3, UVec2, Vec3, vec3};
use luxel::scene::LightKind;

#[test]
fn a_box_that_stands_in_the_floor_buries_what_it_covers_and_no_more() {
    let (low, high) = (vec3(-0.45, -0.01, -0.5), vec3(0.5, 0.6, 0.5));
    for double_sided in [false, true] {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 2.0, 16);
        let m = stage.rgb(Vec3::ZERO, Vec3::ZERO, double_sided);
        Cuboid::block(low, high).all(&mut stage, m, 8);
        stage.scene.sky = white(1.0);
        let rays = 1024.0;
        let shot = shoot(stage, rays as u32);
        // The upright faces, from the floor up, each with its outward normal.
        let [a, b] = [low, high].map(|p| p.as_dvec3());
        let c = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let wall = |p: DVec3, q: DVec3| [p, q, q.with_y(b.y), p.with_y(b.y)];
        let sides = [
            (DVec3::X, wall(c(b.x, 0., a.z), c(b.x, 0., b.z))),
            (DVec3::NEG_X, wall(c(a.x, 0., a.z), c(a.x, 0., b.z))),
            (DVec3::Z, wall(c(a.x, 0., b.z), c(b.x, 0., b.z))),
            (DVec3::NEG_Z, wall(c(a.x, 0., a.z), c(b.x, 0., a.z))),
        ];
        let open = |p: DVec3| {
            let seen = sides.iter().filter(|(n, w)| (p - w[0]).dot(*n) > 0.0);
            seen.map(|(_, w)| exact::element_to_polygon(p, DVec3::Y, w)).sum::<f64>()
        };
        let half = 1.0 / 16.0;
        let mut errors = Vec::new();
        for (i, at) in shot.placed(floor) {
            let p = DVec3::new(at.x * 2.0 - 1.0, 0.0, 1.0 - at.y * 2.0);
            let covered = |lo: f64, hi: f64, x: f64| ((hi.min(x + half) - lo.max(x - half)) / (2.0 * half)).max(0.0);
            let under = covered(a.x, b.x, p.x) * covered(a.z, b.z, p.z);
            let (validity, e) = (f64::from(shot.baked.patches.validity[i]), grey(shot.baked.irradiance[i]));
            let buried = shot.baked.patches.buried[i];
            if under == 0.0 {
                assert!(validity == 1.0 && !buried, "{p} is open, its validity {validity}");
                let o = p - DVec3::new(half, 0.0, half);
                let share = 1.0 - exact::mean_over([o, DVec3::X * 2.0 * half, DVec3::Z * 2.0 * half], 8, open);
                errors.push((e / PI - share) / libm::sqrt(share * (1.0 - share) / rays).max(1e-3));
            } else if under > 0.999 {
                assert!(buried, "{p} is under the box, its validity {validity}");
            } else {
                let off = (validity - (1.0 - under)).abs();
                assert!(off < 0.15 && !buried, "{p}: validity {validity}, {under} of it is under the box");
            }
        }
        let mean_error = errors.iter().sum::<f64>() / errors.len() as f64;
        let within = within_sigma(&errors).unwrap_or_else(|e| panic!("double-sided {double_sided}: {e}"));
        assert!(mean_error.abs() < 0.5, "double-sided {double_sided}: mean error {mean_error} sigma, {within:?}");
    }
}

/// Of a pillar between floor and ceiling only the sides are modelled.
#[test]
fn a_pillar_without_ends_buries_the_floor_below() {
    for rays in [16, 256] {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 2.0, 16);
        let stone = stage.material(0.5, 0.0);
        let room = Cuboid::room(vec3(-1.0, 0.0, -1.0), vec3(1.0, 2.0, 1.0));
        room.face(&mut stage, Face::Top, stone, UVec2::ONE, UVec2::splat(4));
        let pillar = Cuboid::block(vec3(-0.25, 0.0, -0.25), vec3(0.25, 2.0, 0.25));
        for face in [Face::Left, Face::Right, Face::Back, Face::Front] {
            pillar.face(&mut stage, face, stone, UVec2::ONE, UVec2::splat(8));
        }
        stage.scene.sky = white(1.0);
        let shot = shoot(stage, rays);
        for i in shot.texels(floor) {
            let p = shot.baked.patches.center[i];
            let below = |reach: f32| p.x.abs().max(p.z.abs()) < reach;
            let (validity, buried) = (shot.baked.patches.validity[i], shot.baked.patches.buried[i]);
            let found = format!("{rays} rays, at {p}: {validity}, {buried}");
            // Texels half below it have half.
            assert!(below(0.32) || (validity == 1.0 && !buried), "{found}");
            assert!(!below(0.18) || buried || validity < 0.2, "{found}");
        }
    }
}

#[test]
fn a_room_without_light_stays_black_beside_a_lit_one() {
    let mut stage = Stage::new();
    let wall = stage.material(0.7, 0.0);
    let dark = unit_room().all(&mut stage, wall, 6);
    let lit = Cuboid::room(vec3(1.0, 0.0, 0.0), vec3(2.0, 1.0, 1.0)).all(&mut stage, wall, 6);
    stage.light(LightKind::Point { radius: 0.0 }, vec3(1.5, 0.5, 0.5), Vec3::ZERO, 1.0);
    let shot = shoot(stage, 256);
    for &c in &dark {
        assert_eq!(shot.texels(c).len(), 36);
        assert!(shot.texels(c).iter().all(|i| !shot.baked.patches.buried[*i]), "a dark room is no buried one");
        assert!(shot.lookups(c).iter().all(|e| *e == Vec3::ZERO), "chart {c} of the dark room is lit");
    }
    for &c in &lit {
        let values = shot.lookups(c);
        let least = values.iter().map(|e| e.x).fold(f32::INFINITY, f32::min);
        assert!(least > 0.5 * greys(&shot, c).into_iter().fold(f64::INFINITY, f64::min) as f32, "a gutter is dark");
    }
}
