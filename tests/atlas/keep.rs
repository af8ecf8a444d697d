//! `--keep-uv`.

use crate::{scenes::*, unwrapped};
use glam::{DVec3, UVec2, Vec2};
use luxel::{
    atlas::{Atlas, Density, NO_CHART, Options, Unwrap},
    error::Error,
    scene::{Mesh, Scene},
};

fn keep(scene: &Scene, density: Density) -> Result<(Atlas, Vec<String>), Error> {
    unwrapped(scene, &Options { unwrap: Unwrap::Keep, density, page_size: 1024 })
}

fn refused(mesh: Mesh) -> String {
    let error = keep(&scene(vec![mesh], &[(0, DVec3::ONE)]), Density::Resolution(64)).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    error.to_string()
}

#[test]
fn disjoint_layouts_are_one_page() {
    let two = vec![square("a", [0.0, 0.0], [0.5, 1.0]), square("b", [0.5, 0.0], [1.0, 1.0])];
    let scene = scene(two, &[(0, DVec3::ONE), (1, DVec3::ONE)]);
    let (atlas, warnings) = keep(&scene, Density::Resolution(100)).unwrap();
    assert!(atlas.kept && warnings.is_empty(), "{warnings:?}");
    assert_eq!(atlas.pages.len(), 1);
    assert_eq!(atlas.pages[0].size, UVec2::splat(100));
    for p in &atlas.placements {
        let p = p.unwrap();
        assert_eq!((p.page, p.offset, p.scale), (0, Vec2::ZERO, Vec2::ONE));
    }
    assert_eq!(atlas.layouts[0].source, [0, 1, 2, 3]);
    assert_eq!(atlas.layouts[0].charts, [0, 0]);
    // Two square metres fill the page: its edge stands for 1.414 m.
    let (atlas, _) = keep(&scene, Density::TexelsPerMeter(50.0)).unwrap();
    assert_eq!(atlas.pages[0].size, UVec2::splat(72));
    let (atlas, warnings) = keep(&scene, Density::TexelsPerMeter(5000.0)).unwrap();
    assert_eq!((atlas.pages[0].size, warnings.len()), (UVec2::splat(1024), 1));
}

#[test]
fn a_mesh_used_twice_has_rectangles_by_area() {
    let scene = scene(
        vec![square("a", [0.0, 0.0], [1.0, 1.0])],
        &[(0, DVec3::ONE), (0, DVec3::splat(2.0)), (0, DVec3::new(-0.5, 0.5, 0.5))],
    );
    let (atlas, warnings) = keep(&scene, Density::TexelsPerMeter(40.0)).unwrap();
    assert!(warnings.is_empty() && atlas.pages.len() == 1, "{warnings:?}");
    let size = |i: usize| atlas.placements[i].unwrap().scale * atlas.pages[0].size.as_vec2();
    for (i, n) in [(0, 40.0), (1, 80.0), (2, 20.0)] {
        assert!((size(i) - n).abs().max_element() < 1e-3, "{}", size(i));
        let corner = atlas.placements[i].unwrap().offset * atlas.pages[0].size.as_vec2();
        assert!((corner - corner.round()).abs().max_element() < 1e-3, "{corner}");
    }
    let (atlas, _) = keep(&scene, Density::Resolution(256)).unwrap();
    assert_eq!((atlas.pages.len(), atlas.pages[0].size), (1, UVec2::splat(256)));
    assert!(size(1).x > 70.0);
}

#[test]
fn overlapping_layouts_have_rectangles_of_their_own() {
    let both = vec![square("a", [0.0, 0.0], [0.6, 1.0]), square("b", [0.5, 0.0], [1.0, 1.0])];
    let (atlas, _) = keep(&scene(both, &[(0, DVec3::ONE), (1, DVec3::ONE)]), Density::Resolution(100)).unwrap();
    assert_ne!(atlas.placements[0].unwrap().offset, atlas.placements[1].unwrap().offset);
}

#[test]
fn what_cannot_be_a_lightmap_is_named() {
    let mut folded = square("mesh 3 \"Fold\"", [0.0, 0.0], [1.0, 1.0]);
    folded.uvs[1][3] = Vec2::new(1.0, 0.1);
    let text = refused(folded);
    assert!(text.contains("mesh 3 \"Fold\"") && text.contains("overlaps itself"), "{text}");
    assert!(text.contains("--keep-uv"), "{text}");
    assert!(refused(square("far", [0.0, 0.0], [1.5, 1.0])).contains("outside [0, 1]"));
    assert!(refused(square("flat", [0.5, 0.5], [0.5, 0.5])).contains("no area"));
    let mut none = square("none", [0.0, 0.0], [1.0, 1.0]);
    none.primitives[0].uv_sets = 1;
    assert!(refused(none).contains("no TEXCOORD_1"));
    let mut broken = square("nan", [0.0, 0.0], [1.0, 1.0]);
    broken.uvs[1][0].x = f32::NAN;
    assert!(refused(broken).contains("not a finite"));
}

#[test]
fn slight_overlap_is_a_warning() {
    // A triangle of area 3e-5 inside the square's uv.
    let mut m = square("a", [0.0, 0.0], [1.0, 1.0]);
    m.positions.extend_from_within(..3);
    m.uvs[1].extend([[0.6, 0.2], [0.60775, 0.2], [0.6, 0.20775]].map(Vec2::from));
    m.triangles.push([4, 5, 6]);
    m.primitives[0].triangles = 0..3;
    m.primitives[0].vertices = 0..7;
    let (_, warnings) = keep(&scene(vec![m.clone()], &[(0, DVec3::ONE)]), Density::Resolution(64)).unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("0.0030 %"), "{warnings:?}");
    m.uvs[1][5].x = 0.65;
    assert!(refused(m).contains("triangles 0 and 2"));
}

#[test]
fn charts_are_connected_by_corners_in_uv() {
    let mut m = square("a", [0.0, 0.0], [1.0, 1.0]);
    // Split vertices of one chart, then a triangle without area.
    m.positions.extend_from_within(..);
    m.uvs[1].extend_from_within(..);
    m.triangles[1] = [4, 6, 7];
    m.triangles.push([0, 0, 1]);
    m.primitives[0].triangles = 0..3;
    m.primitives[0].vertices = 0..8;
    let (atlas, _) = keep(&scene(vec![m.clone()], &[(0, DVec3::ONE)]), Density::Resolution(64)).unwrap();
    assert_eq!(atlas.layouts[0].charts, [0, 0, NO_CHART]);
    // Torn apart.
    let mut torn = m;
    torn.uvs[1][4..].iter_mut().for_each(|c| *c *= 0.999);
    torn.uvs[1][..4].iter_mut().for_each(|c| c.x = 0.01 + c.x * 0.99);
    torn.uvs[1][..4].iter_mut().for_each(|c| c.y *= 0.98);
    let (atlas, _) = keep(&scene(vec![torn], &[(0, DVec3::ONE)]), Density::Resolution(64)).unwrap();
    assert_eq!(atlas.layouts[0].chart_count, 2);
}

#[test]
fn hidden_instances_have_coarse_hidden_pages() {
    let two = vec![square("a", [0.0, 0.0], [0.5, 1.0]), square("b", [0.5, 0.0], [1.0, 1.0])];
    let mut scene = scene(two, &[(0, DVec3::ONE), (1, DVec3::ONE)]);
    scene.instances[0].texels_per_meter = Some(0.0);
    let (atlas, _) = keep(&scene, Density::Resolution(128)).unwrap();
    assert_eq!(atlas.pages.iter().map(|p| p.hidden).collect::<Vec<_>>(), [false, true]);
    assert_eq!(atlas.pages[0].size, UVec2::splat(128));
    assert!(atlas.pages[1].size.max_element() <= 40, "{:?}", atlas.pages[1]);
    scene.materials[0].unlit = true;
    let (atlas, _) = keep(&scene, Density::Resolution(128)).unwrap();
    assert!(atlas.placements.iter().all(Option::is_none) && atlas.pages.is_empty());
}

#[test]
fn hidden_instances_need_no_coordinates() {
    let mut scene = scene(vec![square("a", [0.0, 0.0], [1.0, 1.0]), cube()], &[(0, DVec3::ONE), (1, DVec3::ONE)]);
    scene.instances[1].texels_per_meter = Some(0.0);
    let (atlas, warnings) = keep(&scene, Density::Resolution(64)).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(atlas.pages.iter().map(|p| p.hidden).collect::<Vec<_>>(), [false, true]);
    let [shown, hidden] = [0, 1].map(|i| atlas.placements[i].unwrap());
    assert_eq!((shown.page, hidden.page), (0, 1));
    assert_eq!(atlas.layouts[1].triangles.len(), 12);
    assert!(atlas.layouts[1].charts.iter().all(|c| *c != NO_CHART));
    // The same mesh shown elsewhere has the author's coordinates for both.
    scene.instances[1].mesh = 0;
    let (atlas, _) = keep(&scene, Density::Resolution(64)).unwrap();
    assert_eq!(atlas.layouts[0].source, [0, 1, 2, 3]);
    assert_eq!(atlas.pages.iter().map(|p| p.hidden).collect::<Vec<_>>(), [false, true]);
}
