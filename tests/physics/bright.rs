//! Bright patches, whose light is sampled beside the rows: once, and no more than it takes.

use super::*;
use glam::Vec3Swizzles;
use luxel::{
    atlas::{Coverage, Unwrap},
    direct::{Bounce, Direct, Sources, sky_cells},
    patches::Patches,
    progress::Silent,
    radiosity::Radiosity,
    scene::{Material, World},
    trace::Tracer,
    transport::Transport,
};

/// A room of one open side under a sky, with a spot on its floor many times brighter than the rest.
pub(super) fn room_with_a_bright_spot(rho: f32, texels: u32) -> Stage {
    let mut stage = Stage::new();
    let wall = stage.material(rho, 0.0);
    for face in FACES.into_iter().filter(|f| *f != Face::Front) {
        unit_room().face(&mut stage, face, wall, UVec2::ONE, UVec2::splat(texels));
    }
    let cone = LightKind::Spot { cos_inner: 0.98, cos_outer: 0.97, radius: 0.0 };
    stage.light(cone, vec3(0.4, 0.9, 0.6), Vec3::NEG_Y, 1.0);
    stage.scene.sky = Sky::Uniform(Vec3::splat(0.01));
    stage
}

/// What a bake finds on its way.
pub(super) struct Rooms {
    coverage: Coverage,
    pub(super) patches: Patches,
    pub(super) transport: Transport,
    pub(super) direct: Direct,
    pub(super) sky: Vec<Vec3>,
    pub(super) gathered: bool,
}

impl Rooms {
    pub(super) fn new(mut stage: Stage, rays: u32) -> Self {
        let (edge, _) = stage.lay_out();
        let layout = atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), page_size: 8192 };
        let scene = &stage.scene;
        let atlas = atlas::unwrap(scene, &layout, &scene.file, &Silent, &mut Vec::new()).expect("a layout");
        let world = World::new(scene);
        let coverage = Coverage::new(&world, &atlas);
        let tracer = Tracer::new(world);
        let mut patches = Patches::new(&tracer.world, &coverage, 0.98);
        let transport =
            Transport::measure(&tracer, &coverage, &mut patches, &transport::Options::of(rays), &Silent).expect("rows");
        let sources = Sources::new(&tracer, &patches);
        let direct = Direct::measure(&tracer, &coverage, &patches, &sources, rays, &Silent).expect("direct light");
        Rooms { sky: sky_cells(&scene.sky), gathered: sources.gathered, coverage, patches, transport, direct }
    }

    /// Indirect light of every patch, with this direct light.
    pub(super) fn indirect(&self, direct: &Direct, bounces: Option<u32>) -> Vec<f64> {
        let options = radiosity::Options { bounces, ..radiosity::Options::default() };
        let (sky, gathered) = (&self.sky, self.gathered);
        let found = Radiosity::solve(&self.transport, &self.patches, direct, sky, gathered, &options, &Silent);
        found.expect("a solution").indirect.iter().map(|e| grey(*e)).collect()
    }

    /// The same light, of which rows carry all that is reflected.
    fn rows_alone(&self) -> Direct {
        Direct { bounce: Bounce::default(), ..self.direct.clone() }
    }
}

/// Light of the first bounce by samples and rows, against rows alone: the same but for the rows' own noise.
#[test]
fn what_bright_patches_reflect_is_counted_once() {
    let (rho, rays) = (0.7, 1024);
    let rooms = Rooms::new(room_with_a_bright_spot(rho, 16), rays);
    let (both, rows_alone) = (&rooms.direct, rooms.rows_alone());

    // Variance of each patch's light from what is sampled, had independent rays found it.
    let sampled = |c: &u32| both.bounce.exitance.get(*c as usize).map_or(0.0, |m| grey(*m));
    let variance = |i: usize| {
        let (columns, n) = (rooms.transport.rows.row(i).columns, f64::from(rays));
        let [sum, squares] = [1, 2].map(|k| columns.iter().map(|c| sampled(c).powi(k)).sum::<f64>());
        (squares - sum * sum / n) / (n * n)
    };
    let n = rooms.patches.len();
    let variance: f64 = (0..n).map(variance).sum();
    let first: f64 = both.bounce.irradiance.iter().map(|e| grey(*e)).sum();
    assert!(first > 50.0 * libm::sqrt(variance), "noise {} hides {first}", libm::sqrt(variance));

    for bounces in [Some(0), Some(1), Some(2), Some(5), None] {
        let [got, expected] = [both, &rows_alone].map(|d| rooms.indirect(d, bounces));
        let (mut sum, mut squares) = (0.0, 0.0);
        for d in got.iter().zip(&expected).map(|(g, e)| g - e) {
            (sum, squares) = (sum + d, squares + d * d);
        }
        // The noise of the first bounce, and what becomes of it later.
        let later: f64 = (0..bounces.unwrap_or(100)).map(|k| libm::pow(rho.into(), k.into())).sum();
        let sigma = libm::sqrt(variance) * later;
        assert!(sum.abs() <= 3.0 * sigma, "{bounces:?} bounces: off by {sum}, sigma {sigma}");
        assert!(squares <= sigma * sigma, "{bounces:?} bounces: RMS {}, sigma {sigma}", libm::sqrt(squares));
    }
}

/// A pane in the sun that most light passes through, and a black wall beside it.
#[test]
fn what_a_bright_pane_reflects_is_counted_once() {
    for (base, transmission) in [(0.5, 0.0), (0.9, 0.9)] {
        let mut stage = Stage::new();
        let black = stage.material(0.0, 0.0);
        let base_color = Vec3::splat(base).extend(1.0);
        let pane = stage.add(Material { base_color, transmission, ..Material::default() });
        rectangle(&mut stage, pane, [vec3(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0], UVec2::splat(16));
        let wall = [vec3(-2.0, 0.05, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0];
        let wall = rectangle(&mut stage, black, wall, uvec2(32, 16));
        rectangle(&mut stage, black, [vec3(-9.0, -2.0, 9.0), Vec3::X * 18.0, Vec3::NEG_Z * 18.0], UVec2::splat(16));
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 10.0);
        let texels = stage.sizes[wall].element_product() as usize;
        let first = stage.sizes[0].element_product() as usize;
        let rooms = Rooms::new(stage, 1024);
        assert!(rooms.direct.bounce.irradiance.iter().any(|e| *e != Vec3::ZERO), "the pane is no bright patch");
        let mean = |direct: &Direct| {
            let found = rooms.indirect(direct, Some(1));
            found[first..first + texels].iter().sum::<f64>() / texels as f64
        };
        let (got, expected) = (mean(&rooms.direct), mean(&rooms.rows_alone()));
        assert!((got / expected - 1.0).abs() < 0.02, "transmission {transmission}: {got} instead of {expected}");
    }
}

/// A black strip that a small lit wall shines on. A lit floor in the strip's own plane sends it nothing, and must not
/// make it noisier.
#[test]
fn what_lies_in_a_texels_plane_takes_no_samples() {
    let noise = |rho: f32| {
        let mut stage = Stage::new();
        let (black, white) = (stage.material(0.0, 0.0), stage.material(0.9, 0.0));
        let floor = stage.material(rho, 0.0);
        let flat = |o: Vec3, x: f32, z: f32| [o, Vec3::X * x, Vec3::NEG_Z * z];
        let strip = rectangle(&mut stage, black, flat(Vec3::ZERO, 2.0, 0.5), uvec2(40, 10));
        rectangle(&mut stage, floor, flat(vec3(0.0, 0.0, 0.5), 2.0, 0.5), uvec2(40, 10));
        rectangle(&mut stage, floor, flat(vec3(0.0, 0.0, -0.5), 2.0, 0.25), uvec2(40, 5));
        let wall = [vec3(0.5, 0.5, -2.0), Vec3::X, Vec3::Y];
        rectangle(&mut stage, white, wall, UVec2::splat(20));
        // Much black ground keeps the mean low: all of the lit wall stands out of it.
        rectangle(&mut stage, black, flat(vec3(-50.0, -1.0, 50.0), 100.0, 100.0), UVec2::splat(16));
        stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, vec3(0.0, -1.0, -1.0), 10.0);
        let (corner, size) = (stage.lay_out().1[strip], stage.sizes[strip]);
        let rooms = Rooms::new(stage, 256);
        let at = |x: u32, y: u32| (y * size.x + x) as usize;
        let mut light = vec![0.0; size.element_product() as usize];
        for (texel, e) in rooms.coverage.texels.iter().zip(&rooms.direct.bounce.irradiance) {
            let p = texel.at.wrapping_sub(corner);
            if p.cmplt(size).all() {
                light[at(p.x, p.y)] = grey(*e);
            }
        }
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        assert!(mean > 0.0, "the wall does not shine on the strip");
        let difference = |x, y| light[at(x - 1, y)] - 2.0 * light[at(x, y)] + light[at(x + 1, y)];
        let squares: f64 =
            (0..10).flat_map(|y| (1..39).map(move |x| (x, y))).map(|(x, y)| difference(x, y).powi(2)).sum();
        libm::sqrt(squares / (6.0 * 380.0)) / mean
    };
    let (alone, beside) = (noise(0.0), noise(0.9));
    // The floor raises the mean, and so the part of the wall's light that is left to rows.
    assert!(beside < 2.0 * alone, "noise {beside} beside a lit floor, {alone} beside a black one");
}

/// Passes over the few blocks of a long table would only repeat its points.
#[test]
fn the_most_rays_are_traced_once() {
    let mut stage = Stage::new();
    let black = stage.material(0.0, 0.0);
    rectangle(&mut stage, black, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(4));
    rectangle(&mut stage, black, [vec3(0.3, 0.5, 0.3), Vec3::Z, Vec3::X], UVec2::splat(4));
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, Vec3::NEG_Y, 1.0);
    let rays = 32768;
    let report = shoot(stage, rays).baked.report;
    // Only the lower square has a shadow on it: probes, what is mixed, edges.
    let most = 32 * 64 + 16 * (u64::from(rays) + 65536);
    assert!(report.rays.shadow <= most, "{} shadow rays, at most {most}", report.rays.shadow);
}

#[test]
fn power_of_a_bright_spot_is_kept() {
    let energy = shoot(room_with_a_bright_spot(0.7, 16), 1024).baked.report.energy;
    assert!(energy.emitted > 0.0 && energy.imbalance.abs() < 3e-3, "{energy:?}");
}

/// Rows are noisier than the spot's light would be with all of them.
#[test]
fn bright_patches_take_fewer_shadow_rays() {
    let rays = 1024;
    let rooms = |reflectance: f32| Rooms::new(room_with_a_bright_spot(reflectance, 16), rays);
    // Where nothing reflects there is the lamp alone.
    let (lamp, all) = (rooms(0.0), rooms(0.7));
    let spot = all.direct.shadow_rays - lamp.direct.shadow_rays;
    let most = u64::from(rays / 2) * all.patches.area.len() as u64;
    assert!(spot > 0 && spot < most, "{spot} shadow rays go to the spot, less than {most} should");
}

/// A lamp hangs half a texel below a ceiling, which shines back on it: what patches as near as that send is no chance.
#[test]
fn between_a_lamp_and_the_ceiling_light_is_even() {
    let mut stage = Stage::new();
    let (wall, lamp) = (stage.material(0.8, 0.0), stage.rgb(Vec3::splat(0.8), Vec3::ONE, true));
    for face in FACES {
        let texels = if face == Face::Top { 64 } else { 8 };
        unit_room().face(&mut stage, face, wall, UVec2::ONE, UVec2::splat(texels));
    }
    rectangle(&mut stage, lamp, [vec3(0.3, 0.991, 0.3), Vec3::X * 0.4, Vec3::Z * 0.4], UVec2::splat(24));
    let Rooms { patches, direct, .. } = Rooms::new(stage, 64);
    let inside = |i: &usize| (patches.center[*i].xz() - 0.5).abs().max_element() < 0.1;
    let backs: Vec<usize> = (patches.fronts..patches.len()).filter(inside).collect();
    let ceiling = (0..patches.fronts).filter(|&i| inside(&i) && patches.center[i].y > 0.999);
    let sent = ceiling.map(|i| grey(direct.bounce.exitance[i])).fold(0.0, f64::max);
    let off = backs.iter().map(|&i| (grey(direct.bounce.irradiance[i]) / sent - 1.0).abs()).fold(0.0, f64::max);
    assert!(backs.len() > 100 && off < 0.1, "{off} of {sent}, {} backs", backs.len());
}
