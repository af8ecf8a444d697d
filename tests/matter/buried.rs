//! What other geometry buries, and what is only dark.

use crate::{
    PI,
    common::{
        bakes::{grey, shoot, within_sigma},
        exact,
        scenes::{Cuboid, FACES, Face, rectangle, unit_room},
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

/// Over one half of a texel stands a box, over the other hangs a sheet that shows its back: rays from either half meet backs.
///
/// Beside points that are enclosed, one more ray decides about a point whose own met a back: where the sheet fills the share b
/// of what a point sees, up to b^2 of the points are mistaken for enclosed, and what is left is so much brighter.
#[test]
fn below_a_sheet_beside_a_box_a_texel_has_its_open_half() {
    for rays in [64, 1024] {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 1.0, 4);
        let black = stage.material(0.0, 0.0);
        // Columns are a quarter wide: the box ends in the middle of the third.
        let (edge, height) = (0.125, 0.3);
        Cuboid::block(vec3(-2.0, -0.01, -0.5), vec3(edge, height, 0.5)).all(&mut stage, black, 4);
        rectangle(&mut stage, black, [vec3(edge, height, -0.5), Vec3::Z, Vec3::X * 0.375], UVec2::splat(4));
        stage.scene.sky = white(1.0);
        let shot = shoot(stage, rays);
        let corner = |x: f32, y: f32, z: f32| vec3(x, y, z).as_dvec3();
        let [low, high] = [-0.5, 0.5];
        let side = [(0.0, low), (0.0, high), (height, high), (height, low)].map(|(y, z)| corner(edge, y, z));
        let sheet = [(edge, low), (edge, high), (high, high), (high, low)].map(|(x, z)| corner(x, height, z));
        let hidden = |p: DVec3, of: &[DVec3]| exact::element_to_polygon(p, DVec3::Y, of).abs();
        let open = |p: DVec3| 1.0 - hidden(p, &side) - hidden(p, &sheet);
        let mut errors = Vec::new();
        for (i, at) in shot.placed(floor) {
            let p = DVec3::new(at.x - 0.5, 0.0, 0.5 - at.y);
            let (validity, buried) = (f64::from(shot.baked.patches.validity[i]), shot.baked.patches.buried[i]);
            let found = format!("{rays} rays, {p}: validity {validity}, {buried}");
            let from = match p.x {
                x if x < 0.0 => {
                    assert!(buried, "{found}");
                    continue;
                }
                x if x < 0.25 => f64::from(edge),
                _ => 0.25,
            };
            // Points are spread evenly: a line along a cell parts them to within a point for each row of cells.
            let (half, rows) = (if from < 0.25 { 0.5 } else { 1.0 }, libm::sqrt(f64::from(rays)));
            let area = [DVec3::new(from, 0.0, p.z - 0.125), DVec3::X * 0.25 * half, DVec3::Z * 0.25];
            let mistaken = if half < 1.0 { exact::mean_over(area, 16, |p| hidden(p, &sheet).powi(2)) } else { 0.0 };
            let least = half * (1.0 - mistaken);
            assert!(
                (least - 1.0 / rows..=half + 1.0 / rows).contains(&validity) && !buried,
                "{found}, {least} to {half}"
            );
            let share = exact::mean_over(area, 16, open);
            let e = grey(shot.baked.irradiance[i]) / PI;
            let off = e - e.clamp(share, share / (1.0 - mistaken));
            errors.push(off / libm::sqrt(share * (1.0 - share) / f64::from(rays)));
        }
        let within = within_sigma(&errors).unwrap_or_else(|e| panic!("{rays} rays: {e}"));
        println!("{rays} rays: {within:?} sigma");
    }
}

/// A ceiling shows its back, as those do that cameras look through from above. What stands beside a texel in the corner of two
/// boxes encloses its neighbours on the page, whose rays tell of it, too, and not the texel.
#[test]
fn in_a_corner_of_boxes_below_a_ceiling_that_is_a_back_a_texel_is_open() {
    for rays in [4, 16, 64] {
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 2.0, 16);
        let stone = stage.material(0.5, 0.0);
        let room = Cuboid::room(vec3(-1.0, 0.0, -1.0), vec3(1.0, 1.0, 1.0));
        for face in [Face::Left, Face::Right, Face::Back, Face::Front] {
            room.face(&mut stage, face, stone, UVec2::ONE, UVec2::splat(8));
        }
        let ceiling = Cuboid::block(vec3(-1.0, 0.5, -1.0), vec3(1.0, 1.0, 1.0));
        ceiling.face(&mut stage, Face::Top, stone, UVec2::ONE, UVec2::splat(4));
        // Where boxes touch neither has a face.
        let (x, z) = (-0.125, 0.125);
        for (low, high, inner) in [
            ([x, z], [0.625, 0.5], &[Face::Back][..]),
            ([x, -0.625], [0.625, z], &[Face::Front, Face::Left]),
            ([-0.5, -0.625], [x, z], &[Face::Right]),
        ] {
            let block = Cuboid::block(vec3(low[0], -0.01, low[1]), vec3(high[0], 0.4, high[1]));
            for face in FACES.into_iter().filter(|face| !inner.contains(face)) {
                block.face(&mut stage, face, stone, UVec2::ONE, UVec2::splat(4));
            }
        }
        stage.scene.sky = white(1.0);
        let (shot, mut asked) = (shoot(stage, rays), false);
        for i in shot.texels(floor) {
            let p = shot.baked.patches.center[i];
            let inside = |low: f32, high: f32, x: f32| x > low && x < high;
            let under =
                inside(x, 0.625, p.x) && inside(-0.625, 0.5, p.z) || inside(-0.5, x, p.x) && inside(-0.625, z, p.z);
            let (validity, buried) = (shot.baked.patches.validity[i], shot.baked.patches.buried[i]);
            assert!(under == buried && validity == 1.0, "{rays} rays, at {p}: {validity}, {buried}");
            if p.distance(vec3(x, 0.0, z)) < 0.1 && !under {
                // Or others would be asked, too: texels are measured in squares of eight.
                assert_eq!(shot.baked.coverage.texels[i].at % 8, UVec2::ZERO);
                asked = true;
            }
        }
        assert!(asked, "{rays} rays");
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

/// A floor between sheets that show their backs, open above: at one texel in three all of few rays meet backs, but those
/// beside it look out.
#[test]
fn between_sheets_few_rays_enclose_nothing() {
    for (rays, double_sided) in [(4, true), (8, true), (4, false), (8, false)] {
        let mut stage = Stage::new();
        let (floor, sheet) = (stage.material(0.5, 0.0), stage.rgb(Vec3::splat(0.5), Vec3::ZERO, double_sided));
        let floor = unit_room().face(&mut stage, Face::Bottom, floor, UVec2::ONE, UVec2::splat(16));
        for side in [Face::Left, Face::Right, Face::Front, Face::Back] {
            Cuboid { inwards: false, ..unit_room() }.face(&mut stage, side, sheet, UVec2::ONE, UVec2::splat(8));
        }
        stage.scene.sky = white(1.0);
        let shot = shoot(stage, rays);
        let buried = shot.placed(floor).iter().filter(|(i, _)| shot.baked.patches.buried[*i]).count();
        assert!(buried <= 5, "{rays} rays, double-sided {double_sided}: {buried} of 256 texels");
    }
}
