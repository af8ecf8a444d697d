//! Rooms baked in full, held against an unbiased path tracer. `tests/data/README.md` says where the truth is from; the
//! scorer itself is tested against figures of an independent one.

mod common {
    pub mod npz;
    pub mod score;
}

use common::score::{self, Metrics, Truth};
use glam::{DVec3, UVec2, Vec2, Vec3, dvec3};
use luxel::{
    atlas::{self, Atlas, Density, Layout, Placement, Unwrap},
    bake::{self, Baked},
    lightmaps::{Content, Lightmaps, Map},
    math::luminance,
    progress::Silent,
    scene::Scene,
    transport::{self, Receivers},
};
use std::path::PathBuf;

/// Of which neighbours use each other's.
const RAYS: u32 = 256;

#[test]
fn authors_layout_agrees_with_the_path_tracer() {
    assert_within(&in_authors_layout("cornell"), [0.02, 0.035, 0.03], 0.003);
}

/// Reflectance .97: .1 % of the light lost at each bounce would show as 3 %.
#[test]
fn bright_room_agrees_with_the_path_tracer() {
    assert_within(&in_authors_layout("bright"), [0.01, 0.01, 0.01], 0.003);
}

/// Two spots, two points (one of each with a radius), a table on thin legs.
#[test]
fn furnished_room_agrees_with_the_path_tracer() {
    assert_within(&in_authors_layout("furnished"), [0.02, 0.035, 0.03], 0.003);
}

/// Sun and sky through a window: most of the light has met a few bright patches. With fewer shadow rays a few texels on the
/// sun's edge would decide about the bias.
#[test]
fn sunlit_room_agrees_with_the_path_tracer() {
    let (scene, truth) = read("window");
    let options =
        bake::Options { transport: transport::Options::of(RAYS), shadow_rays: RAYS, ..bake::Options::default() };
    let baked = bake_with(&scene, &truth, Unwrap::Keep, options);
    assert_within(&Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth)), [0.03, 0.03, 0.03], 0.003);
}

#[test]
fn own_unwrap_agrees_with_the_path_tracer() {
    let (scene, truth) = read("cornell");
    let baked = bake(&scene, &truth, Unwrap::Uvunwrap);
    let found = Metrics::new(&truth, &score::probe(&scene, &baked.atlas, &baked.lightmaps, &truth));
    assert_within(&found, [0.026, 0.045, 0.05], 0.003);
}

/// 32 rays used again against the same rays used once: half the error at most, in the dark and at
/// borders, too. The sofa's back stands open on its seat: what is inside must not be mixed with what is outside.
#[test]
fn rays_used_again_stand_for_many() {
    for name in ["cornell", "furnished"] {
        let (scene, truth) = read(name);
        let [again, once] = [true, false].map(|reuse| {
            let transport = transport::Options { reuse, ..transport::Options::of(32) };
            let baked =
                bake_with(&scene, &truth, Unwrap::Keep, bake::Options { transport, ..bake::Options::default() });
            Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth))
        });
        println!("{name}: {again}, used once {once}");
        assert_within(&again, [0.5 * once.rrmse, 0.5 * once.dark, 0.5 * once.border], 0.003);
    }
}

/// One ray does not tell how noisy it is: that must not be taken for certainty.
#[test]
fn one_ray_is_shared() {
    let (scene, truth) = read("cornell");
    let [again, once] = [true, false].map(|reuse| {
        let transport = transport::Options { reuse, ..transport::Options::of(1) };
        let baked = bake_with(&scene, &truth, Unwrap::Keep, bake::Options { transport, ..bake::Options::default() });
        Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth))
    });
    println!("{again}, used once {once}");
    assert!(again.rrmse < 0.25 * once.rrmse && again.dark < 0.25 * once.dark && again.border < 0.25 * once.border);
}

/// Directions of neighbours are one net. Turned texel by texel the errors are .0115, .0222 and .0172, with places for a net
/// in their stead .0109, .0226 and .0174, where chance brings own noise back .0121, .0169 and .0148.
#[test]
fn few_rays_of_neighbours_stand_for_many() {
    let (scene, truth) = read("cornell");
    let baked = bake_with(&scene, &truth, Unwrap::Keep, bake::Options::default().with_rays(8));
    assert_within(&Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth)), [0.011, 0.02, 0.016], 0.003);
}

/// Squares of 6 x 6 texels share their rays; from one to the next the light must not change more than within one.
#[test]
fn rays_used_again_leave_no_steps() {
    let (scene, truth) = read("cornell");
    let transport = transport::Options::of(16);
    let options = bake::Options { transport, content: Content::Indirect, ..bake::Options::default() };
    let baked = bake_with(&scene, &truth, Unwrap::Keep, options);
    let page = &baked.lightmaps.pages[0];
    let light: Vec<f32> = page.irradiance.iter().map(|&e| luminance(e)).collect();
    // Squared differences and their number: beside a border of squares, and elsewhere.
    let mut changes = [(0.0, 0); 2];
    for (at, beside) in light.windows(2).enumerate() {
        let ([a, b], x) = ([beside[0], beside[1]], at % page.size.x as usize);
        // Corners of the room are no noise.
        if a > 0.0 && b > 0.0 && (a - b).abs() < 0.1 * a.max(b) {
            let (sum, count) = &mut changes[usize::from(x % 6 == 5)];
            *sum += ((a - b) / (a + b)).powi(2);
            *count += 1;
        }
    }
    let [within, between] = changes.map(|(sum, count)| sum / count as f32);
    println!("{within} within, {between} between");
    assert!(between < 1.3 * within, "{between} between squares, {within} within");
}

/// A square lamp's shadows from 8 rays a texel, which neighbours in a penumbra share. Unshared it takes 29 rays a texel on
/// average, and the errors are .0118, .0222 and .0092.
#[test]
fn soft_shadows_take_few_rays() {
    let (scene, truth) = read("cornell");
    let transport = transport::Options::of(RAYS);
    let options = bake::Options { transport, shadow_rays: 8, ..bake::Options::default() };
    let baked = bake_with(&scene, &truth, Unwrap::Keep, options);
    let found = Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth));
    assert_within(&found, [0.0105, 0.02, 0.0105], 0.003);
    let rays = baked.report.rays.shadow as f64 / baked.report.texels as f64;
    println!("{rays} shadow rays a texel");
    assert!(rays < 26.0, "{rays} shadow rays a texel");
}

/// Beside a window's frame the sky is hidden by degrees: what neighbours see of it must not be taken for one's own. The mean of
/// a map of 64 rays is off by .0006 by chance, so several tell the bias.
#[test]
fn rays_used_again_keep_the_shade_of_a_reveal() {
    let (scene, truth) = read("window");
    let bias = [48, 56, 64, 72].map(|rays| {
        // So many that the sun's edge does not hide it.
        let options =
            bake::Options { transport: transport::Options::of(rays), shadow_rays: 128, ..bake::Options::default() };
        let baked = bake_with(&scene, &truth, Unwrap::Keep, options);
        let found = Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth));
        assert_within(&found, [0.034, 0.03, 0.034], 0.005);
        found.bias
    });
    let mean = bias.iter().sum::<f64>() / 4.0;
    assert!(mean.abs() < 0.003, "{mean}: {bias:?}");
}

/// Rows at some of the texels, of a quarter of the rays: within the bounds of all texels.
#[test]
fn adaptive_receivers_keep_the_bounds() {
    let scenes = [("cornell", [0.011, 0.022, 0.0135]), ("furnished", [0.02, 0.035, 0.03]), ("window", [0.05; 3])];
    for (name, bounds) in scenes {
        let (scene, truth) = read(name);
        let transport = transport::Options { receivers: Receivers::Auto, ..transport::Options::of(RAYS / 4) };
        let baked = bake_with(&scene, &truth, Unwrap::Keep, bake::Options { transport, ..bake::Options::default() });
        println!("{name}: {} receivers, {} texels", baked.report.receivers, baked.report.texels);
        assert!(name != "cornell" || baked.report.receivers * 2 < baked.report.texels);
        assert_within(&Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth)), bounds, 0.003);
    }
}

/// The figures are those that a scorer in another language gave for the same values.
#[test]
fn metrics_are_those_of_the_other_scorer() {
    let (scene, truth) = read("cornell");
    let off = |i: usize, c: usize| 1.0 + 0.02 * (((i * 7 + c * 3) % 11) as f64 - 4.5);
    let noisy = |(i, t): (usize, &score::TruthTexel)| Some(t.irradiance * dvec3(off(i, 0), off(i, 1), off(i, 2)));
    let values: Vec<Option<DVec3>> = truth.texels.iter().enumerate().map(noisy).collect();
    let figures = [0.0904408, 0.0802684, 0.0863877, 0.0101653, 0.0270022, 0.0617963];
    assert_figures(&Metrics::new(&truth, &values), figures, 1e-6);

    let (atlas, maps) = chequered(&scene, truth.resolution);
    let by_texel = [2.3857300, 4.8563872, 2.5723889, 1.5252583, 1.8339187, 11.0642656];
    assert_figures(&Metrics::new(&truth, &score::texels(&maps, &truth)), by_texel, 1e-6);
    let by_point = [1.9514352, 4.0993924, 2.1675783, 1.5270876, 1.8777772, 10.8668260];
    assert_figures(&Metrics::new(&truth, &score::probe(&scene, &atlas, &maps, &truth)), by_point, 1e-5);
}

#[test]
fn surface_without_lightmap_is_missing() {
    let (scene, truth) = read("cornell");
    let (mut atlas, maps) = chequered(&scene, truth.resolution);
    atlas.placements[0] = None;
    let missing = Metrics::new(&truth, &score::probe(&scene, &atlas, &maps, &truth)).missing;
    assert!(missing > 0 && missing < truth.texels.len(), "{missing} texels");
}

fn read(name: &str) -> (Scene, Truth) {
    let data = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let scene = score::read_scene(&data.join(name).with_extension("glb")).expect("the scene");
    (scene, Truth::read(&data.join(name).with_extension("npz")).expect("the truth"))
}

fn in_authors_layout(name: &str) -> Metrics {
    let (scene, truth) = read(name);
    let baked = bake(&scene, &truth, Unwrap::Keep);
    Metrics::new(&truth, &score::texels(&baked.lightmaps, &truth))
}

fn assert_within(found: &Metrics, [all, dark, border]: [f64; 3], bias: f64) {
    println!("{found}");
    assert!(found.rrmse <= all && found.dark <= dark && found.border <= border, "{found}");
    assert!(found.bias.abs() <= bias, "{found}");
    assert_eq!(found.missing, 0, "{found}");
}

fn bake<'s>(scene: &'s Scene, truth: &Truth, unwrap: Unwrap) -> Baked<'s> {
    let transport = transport::Options::of(RAYS);
    bake_with(scene, truth, unwrap, bake::Options { transport, ..bake::Options::default() })
}

fn bake_with<'s>(scene: &'s Scene, truth: &Truth, unwrap: Unwrap, options: bake::Options) -> Baked<'s> {
    let density = Density::Resolution(truth.resolution as u32);
    let atlas = atlas::Options { unwrap, density, ..atlas::Options::default() };
    bake::bake(scene, &bake::Options { atlas, ..options }, &Silent).expect("a bake")
}

/// The author's layout and a map of numbers that change from texel to texel.
fn chequered(scene: &Scene, size: usize) -> (Atlas, Lightmaps) {
    let layout = |mesh: &luxel::scene::Mesh| Layout {
        uv: mesh.uvs[1].clone(),
        triangles: mesh.triangles.clone(),
        ..Layout::default()
    };
    let whole_page = Some(Placement { page: 0, offset: Vec2::ZERO, scale: Vec2::ONE });
    let atlas = Atlas {
        layouts: scene.meshes.iter().map(layout).collect(),
        placements: vec![whole_page; scene.instances.len()],
        kept: true,
        ..Atlas::default()
    };
    let number = |i: usize, c: usize| ((i % size * 7 + i / size * 13 + c * 5) % 17) as f32 * 0.125;
    let irradiance = (0..size * size).map(|i| Vec3::new(number(i, 0), number(i, 1), number(i, 2))).collect();
    let map = Map { size: UVec2::splat(size as u32), irradiance, ..Map::default() };
    (atlas, Lightmaps { pages: vec![map], ..Lightmaps::default() })
}

fn assert_figures(m: &Metrics, expected: [f64; 6], tolerance: f64) {
    let found = [m.rrmse, m.dark, m.border, m.bias, m.median, m.p95];
    let close = found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= tolerance * e.abs().max(1.0));
    assert!(close, "{found:.7?}, not {expected:.7?}");
    assert_eq!(m.missing, 0);
}
