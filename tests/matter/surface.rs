//! What is shone upon: reflectance, holes, unlit and unmapped surfaces, backs.

use crate::{
    PI, black, close,
    common::{
        bakes::{Shot, grey, options, parts, shoot, spread, unwrapped, worst},
        exact,
        scenes::{Cuboid, FACES, Face, rectangle, unit_room},
        stage::{Chart, Stage, Surface},
    },
    corners, greys, mean, part, plane, sheet, white,
};
use glam::{DVec3, UVec2, Vec2, Vec3, Vec4, vec2, vec3};
use luxel::{
    atlas::{self, Density},
    scene::{Alpha, LightKind, Material, Primitive},
};

#[test]
fn reflectance_is_a_mean_of_products() {
    let mut stage = Stage::new();
    let n = 8;
    // A colour from black to half green at the vertices.
    let plain = stage.add(Material { base_color: vec3(0.9, 0.6, 0.3).extend(1.0), ..Material::default() });
    let shaded = sheet(&mut stage, plain, Vec3::ZERO, 1.0, n);
    let ends = [Vec4::ZERO, vec3(1.0, 0.5, 1.0).extend(1.0)];
    stage.scene.meshes[shaded].colors = vec![ends[0], ends[1], ends[0], ends[1]];
    // Metal everywhere, half metal, and metal just where the colour is bright.
    let metal = stage.add(Material { metallic: 1.0, ..Material::default() });
    let bare = sheet(&mut stage, metal, vec3(2.0, 0.0, 0.0), 1.0, n);
    let half = stage.add(Material { metallic: 0.5, ..Material::default() });
    let halved = sheet(&mut stage, half, vec3(4.0, 0.0, 0.0), 1.0, n);
    let split = |stage: &mut Stage, k: u32, at: f32| {
        let base = stage.picture(UVec2::splat(k), |x, _| if x % 2 == 0 { [255; 4] } else { [51, 51, 51, 255] });
        let metallic =
            stage.picture(UVec2::splat(k), |x, _| if x % 2 == 0 { [0, 0, 255, 255] } else { [0, 0, 0, 255] });
        let (base_texture, metallic_texture) = (Some(base), Some(metallic));
        let base_color = Vec4::ONE;
        let m =
            stage.add(Material { base_color, base_texture, metallic: 1.0, metallic_texture, ..Material::default() });
        let chart = sheet(stage, m, vec3(at, 0.0, 0.0), 1.0, n);
        stage.paint(chart);
        chart
    };
    // Two columns a texel: one of bright metal, one of dark paint.
    let striped = split(&mut stage, 2 * n, 6.0);
    stage.scene.sky = white(1.0);
    let shot = shoot(stage, 16);
    let rho = |i: usize| shot.baked.patches.reflectance[i];
    for (i, at) in shot.placed(shaded) {
        let expected = vec3(0.9, 0.3, 0.3) * at.x as f32;
        assert!(rho(i).abs_diff_eq(expected, 5e-3), "vertex colour at {at}: {} instead of {expected}", rho(i));
    }
    assert!(shot.texels(bare).into_iter().all(|i| rho(i) == Vec3::ZERO), "a metal reflects no diffuse light");
    assert!(shot.texels(halved).into_iter().all(|i| rho(i).abs_diff_eq(Vec3::splat(0.4), 1e-6)));
    let stripes: Vec<f64> = shot.texels(striped).into_iter().map(|i| grey(rho(i))).collect();
    let (mean, off) = spread(&stripes);
    // Sixteen points a texel: a few more may fall on one column than on the other.
    assert!((mean - 0.1).abs() < 0.002 && off < 0.02, "bright metal beside dark paint: {mean} +- {off}");
    let area = shot.baked.report.reflectance.metallic_area;
    assert!((1.0..2.1).contains(&area), "{area} m^2 are metallic");
}

#[test]
fn each_texture_is_read_on_its_own_coordinates() {
    let mut stage = Stage::new();
    // The base colour repeats a thousand times; the emission is one picture over the page, dark on the left.
    let base = stage.picture(UVec2::splat(8), |_, _| [255; 4]);
    let half = stage.picture(UVec2::new(64, 1), |x, _| if x < 32 { [0, 0, 0, 255] } else { [255; 4] });
    let material = stage.add(Material {
        base_texture: Some(base),
        emission: Vec3::ONE,
        emission_texture: Some(luxel::scene::TextureRef { set: 1, ..half }),
        ..Material::default()
    });
    let chart = sheet(&mut stage, material, Vec3::ZERO, 1.0, 16);
    stage.paint(chart);
    stage.scene.meshes[chart].uvs[0].iter_mut().for_each(|uv| *uv *= 1000.0);
    let shot = shoot(stage, 1);
    let edge = shot.baked.atlas.pages[0].size.x as f32;
    for i in shot.texels(chart) {
        let from_middle = shot.baked.coverage.texels[i].at.x as f32 + 0.5 - edge / 2.0;
        let expected = if from_middle < 0.0 { 0.0 } else { PI };
        let off = grey(shot.baked.patches.exitance[i]) - expected;
        assert!(from_middle.abs() < 1.0 || off.abs() < 1e-3, "{from_middle} texels from the middle: off by {off}");
    }
}

/// A plane of 1 m under a black square of 1 m, 1 m above, of this material.
fn under(material: impl Fn(&mut Stage) -> Material, light: impl Fn(&mut Stage)) -> (Shot, Chart) {
    let mut stage = Stage::new();
    let floor = plane(&mut stage, Vec3::ZERO, 1.0, 8);
    let m = material(&mut stage);
    let m = stage.add(m);
    let cover = sheet(&mut stage, m, Vec3::Y, 1.0, 4);
    stage.paint(cover);
    light(&mut stage);
    (shoot(stage, 1024), floor)
}

fn holed(stage: &mut Stage) -> Material {
    let half = stage.picture(UVec2::new(2, 1), |x, _| if x == 0 { [255, 255, 255, 0] } else { [255; 4] });
    Material { base_texture: Some(half), alpha: Alpha::Mask(0.5), ..black() }
}

fn sky(stage: &mut Stage) {
    stage.scene.sky = white(1.0);
}

fn noon(stage: &mut Stage) {
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 5.0);
}

/// Mean over the plane of edge 1 of a form factor to part of the cover.
fn covered(u: [f32; 2]) -> f64 {
    let cover = part(corners(Vec3::Y, 1.0), u, [0.0, 1.0]);
    let floor = corners(Vec3::ZERO, 1.0).map(|v| v.as_dvec3());
    exact::mean_over(floor, 32, |p| exact::element_to_polygon(p, DVec3::Y, &cover))
}

#[test]
fn masked_holes_let_light_through() {
    let (shot, floor) = under(holed, noon);
    for (i, at) in shot.placed(floor) {
        let expected = if at.x < 0.5 { 5.0 } else { 0.0 };
        assert!((grey(shot.baked.irradiance[i]) - expected).abs() < 1e-4, "sun at {at}");
    }
    let (shot, floor) = under(holed, sky);
    close("sky past half a cover", mean(&shot, floor), PI * (1.0 - covered([0.5, 1.0])), 0.005);
}

#[test]
fn blended_sheets_take_their_share() {
    for double_sided in [false, true] {
        let veil = |_: &mut Stage| Material {
            base_color: Vec3::ZERO.extend(0.25),
            alpha: Alpha::Blend,
            double_sided,
            ..Material::default()
        };
        let (shot, floor) = under(veil, noon);
        close("sun behind a veil", mean(&shot, floor), 0.75 * 5.0, 0.01);
        let (shot, floor) = under(veil, sky);
        close("sky past a veil", mean(&shot, floor), PI * (1.0 - 0.25 * covered([0.0, 1.0])), 0.005);
        let mut stage = Stage::new();
        let floor = plane(&mut stage, Vec3::ZERO, 1.0, 8);
        let m = veil(&mut stage);
        let m = stage.add(m);
        Cuboid::block(Vec3::splat(-1.0), Vec3::ONE).all(&mut stage, m, 4);
        sky(&mut stage);
        close("sky through a box of veils", mean(&shoot(stage, 1024), floor), 0.75 * PI, 0.01);
    }
}

#[test]
fn transmission_tints_direct_light() {
    let tint = vec3(1.0, 0.5, 0.25);
    let glass = |_: &mut Stage| Material { base_color: tint.extend(1.0), transmission: 0.8, ..Material::default() };
    let (shot, floor) = under(glass, noon);
    let expected = tint * 0.8 * 5.0;
    for e in shot.values(floor) {
        assert!(e.abs_diff_eq(expected, 1e-3), "{e} instead of {expected}");
    }
}

#[test]
fn unlit_surfaces_block_and_do_no_more() {
    let sign = |_: &mut Stage| Material { unlit: true, emission: Vec3::splat(50.0), ..Material::default() };
    let (shot, floor) = under(sign, sky);
    close("sky past a sign", mean(&shot, floor), PI * (1.0 - covered([0.0, 1.0])), 0.005);
    assert!(shot.baked.atlas.placements[1].is_none(), "an unlit surface has a map");
    let (shot, floor) = under(sign, noon);
    assert!(greys(&shot, floor).iter().all(|e| *e == 0.0), "sun through a sign");
}

/// An unlit square below a lit one, in one mesh, with the same lightmap coordinates.
fn half_lit(unlit_first: bool) -> Stage {
    let mut stage = Stage::new();
    let lit = stage.material(0.5, 0.0);
    let unlit = stage.add(Material { unlit: true, ..Material::default() });
    let mut s = Surface { size: UVec2::splat(8), ..Surface::default() };
    let order = if unlit_first { [unlit, lit] } else { [lit, unlit] };
    for (k, m) in order.into_iter().enumerate() {
        let [o, u, v] = corners(if m == lit { Vec3::ZERO } else { vec3(0.1, -0.5, 0.2) }, 1.0);
        s.positions.extend([o, o + u, o + u + v, o + v]);
        s.uv.extend([Vec2::ZERO, vec2(8.0, 0.0), Vec2::splat(8.0), vec2(0.0, 8.0)]);
        s.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|v| v + 4 * k as u32)));
    }
    let chart = stage.surface("half lit", lit, s);
    let primitive = |k: u32| Primitive {
        source: k,
        triangles: 2 * k..2 * k + 2,
        vertices: 4 * k..4 * k + 4,
        material: order[k as usize],
        uv_sets: 2,
    };
    stage.scene.meshes[chart].primitives = vec![primitive(0), primitive(1)];
    stage.scene.sky = white(1.0);
    stage
}

#[test]
fn an_unlit_part_of_a_mesh_leaves_the_lit_one_alone() {
    for unlit_first in [false, true] {
        let shot = shoot(half_lit(unlit_first), 256);
        let texels = shot.texels(0);
        assert_eq!(texels.len(), 64, "unlit first {unlit_first}");
        for i in texels {
            close("kept uv, area", shot.baked.patches.area[i].into(), 1.0 / 64.0, 1e-4);
            close("kept uv, irradiance", grey(shot.baked.irradiance[i]), PI, 1e-5);
            close("kept uv, reflectance", grey(shot.baked.patches.reflectance[i]), 0.5, 1e-5);
        }
        let baked = unwrapped(half_lit(unlit_first), 32, 256);
        let area: f64 = baked.patches.area[..baked.patches.fronts].iter().map(|a| f64::from(*a)).sum();
        close("unwrapped, area", area, 1.0, 1e-3);
        assert!(worst(baked.irradiance.iter().map(|e| grey(*e)), PI) < 1e-5, "unwrapped, irradiance");
    }
}

#[test]
fn a_wall_without_a_map_still_reflects() {
    // The right wall is lit by a light near it, and is red.
    let bake = |density: Option<f64>| {
        let mut stage = Stage::new();
        let (grey, red) = (stage.material(0.3, 0.0), stage.rgb(vec3(0.9, 0.1, 0.1), Vec3::ZERO, false));
        for face in FACES {
            let m = if face == Face::Right { red } else { grey };
            unit_room().face(&mut stage, face, m, UVec2::ONE, UVec2::splat(16));
        }
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.6, 0.5, 0.5), Vec3::ZERO, 1.0);
        stage.scene.instances[1].texels_per_meter = density;
        stage.lay_out();
        let mut options = options(1024);
        options.atlas = atlas::Options { density: Density::TexelsPerMeter(16.0), ..options.atlas };
        let baked = parts(&stage.scene, &options);
        let visible: Vec<usize> = (0..baked.atlas.pages.len()).filter(|p| !baked.atlas.pages[*p].hidden).collect();
        assert_eq!(visible.len(), baked.lightmaps.pages.len());
        let (mut on_wall, mut floor, mut area) = (0, DVec3::ZERO, 0.0);
        for (i, t) in baked.coverage.texels.iter().enumerate() {
            let (p, n) = (baked.patches.center[i], baked.patches.normal[i]);
            on_wall += usize::from(n.x < -0.9 && p.x > 0.99 && visible.contains(&(t.page as usize)));
            if n.y > 0.9 {
                floor += baked.irradiance[i].as_dvec3() * f64::from(baked.patches.area[i]);
                area += f64::from(baked.patches.area[i]);
            }
        }
        (on_wall, floor / area)
    };
    let ((some, with), (none, without)) = (bake(None), bake(Some(0.0)));
    assert!(some >= 256 && none == 0, "{some} and {none} texels on the wall");
    assert!(with.x > 1.1 * with.y, "the wall bleeds");
    for c in 0..2 {
        close("floor", without[c], with[c], 0.01);
    }
}

#[test]
fn a_double_sided_sheet_in_a_furnace_has_two_sides() {
    let mut stage = Stage::new();
    let (rho, m) = (0.7, 0.3);
    let wall = stage.material(rho, m);
    let leaf = stage.rgb(Vec3::splat(rho), Vec3::splat(m), true);
    unit_room().all(&mut stage, wall, 12);
    sheet(&mut stage, leaf, Vec3::splat(0.5), 0.6, 12);
    let shot = shoot(stage, 256);
    assert!(shot.baked.patches.backs.len() >= 140, "{} backs", shot.baked.patches.backs.len());
    assert_eq!(shot.baked.irradiance.len(), shot.baked.patches.len());
    let off = worst(shot.baked.irradiance.iter().map(|e| grey(*e)), f64::from(m) / (1.0 - f64::from(rho)));
    assert!(off < 1e-3, "off by {off}");
}

#[test]
fn a_room_of_inverted_double_sided_walls_is_the_same_room() {
    let faces = |inwards: bool| {
        let mut stage = Stage::new();
        let wall = stage.rgb(Vec3::splat(0.6), Vec3::ZERO, true);
        Cuboid { inwards, ..unit_room() }.all(&mut stage, wall, 12);
        let block = stage.material(0.5, 0.0);
        let charts = Cuboid::block(vec3(0.3, 0.2, 0.3), vec3(0.6, 0.5, 0.7)).all(&mut stage, block, 6);
        stage.light(LightKind::Point { radius: 0.0 }, vec3(0.8, 0.8, 0.2), Vec3::ZERO, 1.0);
        let shot = shoot(stage, 1024);
        charts.into_iter().map(|c| mean(&shot, c)).collect::<Vec<_>>()
    };
    let (inwards, outwards) = (faces(true), faces(false));
    for k in 0..6 {
        close(&format!("{:?} of the block", FACES[k]), outwards[k], inwards[k], 0.01);
    }
}

#[test]
fn a_plate_close_to_a_ceiling_gives_no_more_than_it_emits() {
    // The borders of texels run along the plate's edge, or not.
    for (rho, m, edge) in [(0.5, 1.0, 0.6), (0.0, 3.0, 0.6), (0.5, 1.0, 0.5)] {
        let mut stage = Stage::new();
        let (ceiling, plate) = (stage.material(rho, 0.0), stage.rgb(Vec3::splat(rho), Vec3::splat(m), true));
        let down = |y: f32, a: f32| [vec3(-a / 2.0, y, -a / 2.0), Vec3::X * a, Vec3::Z * a];
        let above = rectangle(&mut stage, ceiling, down(1.0, 1.0), UVec2::splat(10));
        rectangle(&mut stage, plate, down(0.999, edge), UVec2::splat(6));
        let shot = shoot(stage, 1024);
        let bound = f64::from(m) / (1.0 - f64::from(rho * rho));
        for i in shot.texels(above) {
            let p = shot.baked.patches.center[i];
            let e = grey(shot.baked.irradiance[i]);
            assert!(e <= 1.02 * bound, "at {p}: {e}, at most {bound}");
            if edge == 0.6 && p.x.abs().max(p.z.abs()) < 0.19 {
                close(&format!("over the plate at {p}"), e, bound, 0.02);
            }
        }
    }
}
