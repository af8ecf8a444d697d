//! What every unwrapper that makes charts of its own must keep.

use crate::{scenes::*, unwrapped};
use glam::{DVec2, DVec3, Vec3};
use luxel::{
    atlas::{Atlas, Coverage, Density, NO_CHART, Options, PADDING, Unwrap},
    bake::bake,
    error::Error,
    progress::{Observer, Silent},
    scene::{Primitive, Scene, World},
};
use std::path::Path;

/// The unwrappers of this build.
fn all() -> Vec<Unwrap> {
    if cfg!(feature = "xatlas") { vec![Unwrap::Uvunwrap, Unwrap::Xatlas] } else { vec![Unwrap::Uvunwrap] }
}

fn each(scene: &Scene, density: Density, check: impl Fn(Atlas, Vec<String>)) {
    for unwrap in all() {
        let (atlas, warnings) = unwrapped(scene, &Options { unwrap, density, page_size: 512 }).unwrap();
        padded(&atlas, scene);
        check(atlas, warnings);
    }
}

/// Corners of instance `i`'s charted triangles in texels, with their charts.
fn triangles(atlas: &Atlas, scene: &Scene, i: usize) -> Vec<([DVec2; 3], u32)> {
    let Some(p) = atlas.placements[i] else { return Vec::new() };
    let layout = &atlas.layouts[scene.instances[i].mesh as usize];
    let size = atlas.pages[p.page as usize].size.as_dvec2();
    let at = |v: u32| (p.offset.as_dvec2() + p.scale.as_dvec2() * layout.uv[v as usize].as_dvec2()) * size;
    let shown = layout.triangles.iter().zip(&layout.charts).filter(|(_, c)| **c != NO_CHART);
    shown.map(|(t, &c)| (t.map(at), c)).collect()
}

/// True if `t` reaches into the texel at `at`, by more than rounding.
fn touches(t: &[DVec2; 3], at: DVec2) -> bool {
    let half = 0.5 - 1e-2;
    let mut axes = vec![DVec2::X, DVec2::Y];
    axes.extend((0..3).map(|k| (t[(k + 1) % 3] - t[k]).perp()));
    axes.iter().all(|a| {
        let (middle, reach) = (a.dot(at + 0.5), half * (a.x.abs() + a.y.abs()));
        let along = t.map(|p| a.dot(p));
        let (min, max) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
        min <= middle + reach && max >= middle - reach
    })
}

/// No texel within the padding of a chart belongs to another one, nor lies outside the page.
fn padded(atlas: &Atlas, scene: &Scene) {
    let sizes: Vec<_> = atlas.pages.iter().map(|p| p.size.as_ivec2()).collect();
    let mut owners: Vec<Vec<(u32, u32)>> = sizes.iter().map(|s| vec![(u32::MAX, 0); (s.x * s.y) as usize]).collect();
    let mut texels = Vec::new();
    for i in 0..scene.instances.len() {
        for (t, chart) in triangles(atlas, scene, i) {
            let page = atlas.placements[i].unwrap().page as usize;
            let min = t[0].min(t[1]).min(t[2]).floor().as_ivec2();
            let max = t[0].max(t[1]).max(t[2]).floor().as_ivec2();
            for y in min.y..=max.y {
                for x in min.x..=max.x {
                    if touches(&t, DVec2::new(x.into(), y.into())) {
                        assert!(x >= 0 && y >= 0 && x < sizes[page].x && y < sizes[page].y);
                        owners[page][(y * sizes[page].x + x) as usize] = (i as u32, chart);
                        texels.push((page, x, y, (i as u32, chart)));
                    }
                }
            }
        }
    }
    let reach = 2 * PADDING as i32;
    for (page, x, y, own) in texels {
        let s = sizes[page];
        assert!(x >= 2 && y >= 2 && x < s.x - 2 && y < s.y - 2, "{own:?} at {x} {y} of {s} lacks its border");
        for v in (y - reach).max(0)..=(y + reach).min(s.y - 1) {
            for u in (x - reach).max(0)..=(x + reach).min(s.x - 1) {
                let other = owners[page][(v * s.x + u) as usize];
                assert!(other.0 == u32::MAX || other == own, "{own:?} at {x} {y} is too near to {other:?} at {u} {v}");
            }
        }
    }
}

/// Texels per metre of instance `i`.
fn density(atlas: &Atlas, scene: &Scene, i: usize) -> f64 {
    let flat: f64 = triangles(atlas, scene, i).iter().map(|(t, _)| (t[1] - t[0]).perp_dot(t[2] - t[0]).abs()).sum();
    let instance = &scene.instances[i];
    let mesh = &scene.meshes[instance.mesh as usize];
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| instance.transform.transform_point3(mesh.positions[v as usize].as_dvec3()));
        (b - a).cross(c - a).length()
    };
    (flat / mesh.triangles.iter().map(area).sum::<f64>()).sqrt()
}

fn near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 0.1
}

#[test]
fn a_cube_fills_its_page() {
    let scene = scene(vec![cube()], &[(0, DVec3::ONE)]);
    each(&scene, Density::Resolution(128), |atlas, warnings| {
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((atlas.pages.len(), atlas.pages[0].size.to_array()), (1, [128, 128]));
        // Flat ones, or faces unfolded.
        assert!((2..=6).contains(&atlas.layouts[0].chart_count), "{}", atlas.layouts[0].chart_count);
        let used = density(&atlas, &scene, 0).powi(2) * 6.0 / 128.0 / 128.0;
        // Faces unfolded into strips leave corners empty.
        assert!(used > 0.4, "{used}");
    });
}

#[test]
fn instances_of_one_mesh_have_rectangles_by_area() {
    let scales =
        [DVec3::ONE, DVec3::splat(2.0), DVec3::splat(0.5), DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, 1.0, 3.0)];
    let mut placed: Vec<(u32, DVec3)> = scales.iter().map(|&s| (0, s)).collect();
    placed.push((1, DVec3::ONE));
    let scene = scene(vec![cube(), sphere(12)], &placed);
    each(&scene, Density::TexelsPerMeter(20.0), |atlas, warnings| {
        assert!(warnings.is_empty() && atlas.pages.len() == 1, "{warnings:?}");
        for i in 0..placed.len() {
            assert!(near(density(&atlas, &scene, i), 20.0), "{i}: {}", density(&atlas, &scene, i));
        }
    });
    each(&scene, Density::Resolution(256), |atlas, _| {
        let d: Vec<f64> = (0..placed.len()).map(|i| density(&atlas, &scene, i)).collect();
        assert!(d.iter().all(|&x| near(x, d[0])), "{d:?}");
    });
}

#[test]
fn a_node_may_have_its_own_density() {
    let mut scene = scene(vec![cube(), sphere(12)], &[(0, DVec3::ONE), (1, DVec3::ONE), (0, DVec3::ONE)]);
    scene.instances[1].texels_per_meter = Some(11.0);
    scene.instances[2].texels_per_meter = Some(40.0);
    each(&scene, Density::TexelsPerMeter(20.0), |atlas, _| {
        let d = [0, 1, 2].map(|i| density(&atlas, &scene, i));
        assert!(near(d[0], 20.0) && near(d[1], 11.0) && near(d[2], 40.0), "{d:?}");
    });
    each(&scene, Density::Resolution(256), |atlas, warnings| {
        let d = [0, 1, 2].map(|i| density(&atlas, &scene, i));
        assert!(warnings.is_empty() && near(d[1], 11.0) && near(d[2], 40.0) && d[0] > 30.0, "{d:?}");
    });
}

#[test]
fn hidden_instances_are_coarse_and_on_hidden_pages() {
    let mut scene = scene(vec![cube(), sphere(12)], &[(0, DVec3::ONE), (1, DVec3::splat(3.0)), (0, DVec3::ONE)]);
    scene.instances[1].texels_per_meter = Some(0.0);
    scene.instances[2].texels_per_meter = Some(0.0);
    each(&scene, Density::TexelsPerMeter(40.0), |atlas, _| {
        assert_eq!(atlas.pages.iter().map(|p| p.hidden).collect::<Vec<_>>(), [false, true]);
        assert!(near(density(&atlas, &scene, 0), 40.0));
        assert!(near(density(&atlas, &scene, 1), 5.0), "{}", density(&atlas, &scene, 1));
    });
    scene.instances[0].texels_per_meter = Some(0.0);
    each(&scene, Density::Resolution(256), |atlas, _| assert!(atlas.pages.len() == 1 && atlas.pages[0].hidden));
}

#[test]
fn large_nodes_are_lowered_and_several_pages_made() {
    let scene = scene(vec![cube()], &[(0, DVec3::ONE), (0, DVec3::splat(8.0)), (0, DVec3::splat(1.5))]);
    each(&scene, Density::TexelsPerMeter(100.0), |atlas, warnings| {
        assert!(warnings.len() == 1 && warnings[0].contains("node 1"), "{warnings:?}");
        assert!(atlas.pages.len() > 1 && atlas.pages.iter().all(|p| p.size.max_element() <= 512));
        assert!(near(density(&atlas, &scene, 0), 100.0) && density(&atlas, &scene, 1) > 15.0);
    });
}

#[test]
fn pages_are_added_where_one_cannot_hold_all() {
    let scene = scene(vec![cube(), sphere(6)], &(0..120).map(|i| (i % 2, DVec3::ONE)).collect::<Vec<_>>());
    each(&scene, Density::Resolution(64), |atlas, warnings| {
        assert!(atlas.pages.len() > 1 && warnings.iter().any(|w| w.contains("added")), "{warnings:?}");
        assert!(atlas.pages.iter().all(|p| p.size.to_array() == [64, 64]));
    });
}

#[test]
fn a_page_grows_where_a_node_does_not_fit() {
    let scene = scene(vec![cube(), confetti(200)], &[(0, DVec3::ONE), (1, DVec3::ONE)]);
    each(&scene, Density::Resolution(32), |atlas, warnings| {
        let [said] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(said.starts_with("node 1: its 200 charts ") && said.contains("--resolution"), "{said}");
        assert!(atlas.pages.iter().all(|p| p.size.to_array() == [128, 128]), "{:?}", atlas.pages);
    });
    for density in [Density::Resolution(32), Density::TexelsPerMeter(1.0)] {
        let options = Options { density, page_size: 32, ..Options::default() };
        let error = unwrapped(&scene, &options).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{error}");
        assert!(error.to_string().contains("node 1") && error.to_string().contains("--page-size"), "{error}");
    }
}

#[test]
fn degenerate_triangles_and_meshes_do_no_harm() {
    let mut flat = cube();
    flat.triangles.extend([[0, 0, 1], [2, 2, 2], [0, 1, 1]]);
    flat.primitives[0].triangles = 0..15;
    let mut none = cube();
    none.positions.iter_mut().for_each(|p| *p = Vec3::new(p.x, 0.0, 0.0));
    let mut tiny = cube();
    tiny.positions.iter_mut().for_each(|p| *p = Vec3::splat(1e6) + *p * 1e-25);
    let needle = mesh("needle", vec![Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-12, 0.0)], vec![], vec![[0, 1, 2]]);
    let all = vec![flat, none, tiny, needle];
    let scene = scene(all, &[(0, DVec3::ONE), (1, DVec3::ONE), (2, DVec3::ONE), (3, DVec3::ONE), (0, DVec3::X)]);
    for d in [Density::Resolution(128), Density::TexelsPerMeter(10.0)] {
        each(&scene, d, |atlas, _| {
            assert_eq!(atlas.layouts[0].charts[12..], [NO_CHART; 3]);
            assert!(atlas.placements[0].is_some() && atlas.placements[1].is_none() && atlas.placements[4].is_none());
        });
    }
}

#[test]
fn vertices_stay_by_primitive_and_unlit_ones_have_no_chart() {
    let mut m = cube();
    m.primitives = vec![
        Primitive { triangles: 0..6, vertices: 0..12, ..m.primitives[0].clone() },
        Primitive { triangles: 6..12, vertices: 12..24, material: 1, source: 1, ..m.primitives[0].clone() },
    ];
    let mut scene = scene(vec![m], &[(0, DVec3::ONE)]);
    scene.materials.push(scene.materials[0].clone());
    each(&scene, Density::Resolution(64), |_, _| {});
    scene.materials[1].unlit = true;
    each(&scene, Density::Resolution(64), |atlas, _| {
        assert!(atlas.layouts[0].charts[..6].iter().all(|&c| c != NO_CHART));
        assert!(atlas.layouts[0].charts[6..].iter().all(|&c| c == NO_CHART));
    });
}

#[test]
fn threads_change_nothing() {
    let scene = scene(vec![cube(), sphere(20)], &[(0, DVec3::ONE), (1, DVec3::ONE), (1, DVec3::splat(0.7))]);
    for unwrap in all() {
        let on = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            let options = Options { unwrap, density: Density::Resolution(256), page_size: 512 };
            format!("{:?}", pool.install(|| unwrapped(&scene, &options).unwrap()))
        };
        assert_eq!(on(1), on(2));
    }
}

/// Whatever looks at it stops.
struct Stop;

impl Observer for Stop {
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_cancelled_observer_stops_it() {
    let scene = scene(vec![cube()], &[(0, DVec3::ONE)]);
    let result = luxel::atlas::unwrap(&scene, &Options::default(), Path::new("x"), &Stop, &mut Vec::new());
    assert!(matches!(result, Err(Error::Interrupted)));
}

/// More than an atlas can hold, so that it is refused on any machine; charts that were begun would stop at once.
#[test]
fn what_cannot_fit_is_refused_before_charts_are_made() {
    let scene = scene(vec![cube()], &[(0, DVec3::ONE); 100]);
    let atlas = Options { density: Density::TexelsPerMeter(20_000.0), page_size: 32768, ..Options::default() };
    let result = bake(&scene, &luxel::bake::Options { atlas, ..Default::default() }, &Stop);
    assert!(matches!(result.err(), Some(Error::Usage(_))));
}

#[test]
fn more_nodes_than_pages_have_room_for_are_refused() {
    // 144 to a page of 64 x 64: 278 pages.
    let scene = scene(vec![square("mesh \"Leaf\"", [0.0; 2], [1.0; 2])], &vec![(0, DVec3::ONE); 40_000]);
    let one_page = Density::Resolution(64);
    for (density, page_size, named) in [
        (one_page, 4096, "--resolution"),
        // Typed alone, it is the page's edge, too.
        (one_page, 64, "--page-size"),
        (Density::TexelsPerMeter(0.5), 64, "--page-size"),
    ] {
        let options = Options { density, page_size, ..Options::default() };
        let error = unwrapped(&scene, &options).unwrap_err();
        let said = error.to_string();
        assert!(said.contains("40000 nodes, 5 x 5 texels each at least, need 278 pages"), "{said}");
        assert!(error.exit_code() == 2 && said.contains(&format!("\n  raise {named} to 128, ")), "{said}");
    }
}

/// Rooms that begin, in their order.
#[derive(Default)]
struct Rooms(std::sync::Mutex<Vec<&'static str>>);

impl Observer for Rooms {
    fn begin(&self, room: &'static str, _total: u64) {
        self.0.lock().unwrap().push(room);
    }
}

#[test]
fn charts_and_packing_say_that_they_begin() {
    let rooms = Rooms::default();
    let scene = scene(vec![cube()], &[(0, DVec3::ONE)]);
    luxel::atlas::unwrap(&scene, &Options::default(), Path::new("x"), &rooms, &mut Vec::new()).unwrap();
    assert_eq!(*rooms.0.lock().unwrap(), ["atlas: charts", "atlas: packing"]);
}

#[test]
fn senseless_sizes_are_refused() {
    let scene = scene(vec![cube()], &[(0, DVec3::ONE)]);
    for density in [Density::Resolution(0), Density::TexelsPerMeter(0.0), Density::TexelsPerMeter(f64::NAN)] {
        let options = Options { density, ..Options::default() };
        let error = luxel::atlas::unwrap(&scene, &options, Path::new("x"), &Silent, &mut Vec::new()).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
    }
    let options = Options { density: Density::TexelsPerMeter(1e6), ..Options::default() };
    let result = unwrapped(&scene, &options);
    assert!(result.is_ok_and(|(_, w)| w[0].contains("lowered")));
    if !cfg!(feature = "xatlas") {
        let options = Options { unwrap: Unwrap::Xatlas, ..Options::default() };
        assert!(unwrapped(&scene, &options).unwrap_err().to_string().contains("--features xatlas"));
    }
}

#[test]
fn the_texels_told_beforehand_are_no_more_than_come() {
    let strip = mesh(
        "mesh \"Strip\"",
        [[0.0, 0.0], [100.0, 0.0], [100.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        vec![],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let meshes = vec![cube(), sphere(12), strip, confetti(20)];
    let scene = scene(meshes, &[(0, DVec3::ONE), (1, DVec3::new(1.0, 2.0, 1.0)), (2, DVec3::ONE), (3, DVec3::ONE)]);
    for (density, page_size) in [(20.0, 4096), (50.0, 256), (5000.0, 256)] {
        let options = Options { density: Density::TexelsPerMeter(density), page_size, ..Options::default() };
        let (atlas, _) = unwrapped(&scene, &options).unwrap();
        let told = luxel::atlas::least_texels(&scene, &options);
        let came = Coverage::new(&World::new(&scene), &atlas).texels.len() as u64;
        println!("{density} on {page_size}: {told} told, {came} came");
        assert!(told <= came && told > came / 20, "{density} on {page_size}: {told} told, {came} came");
    }
}
