//! Baked scenes as Bevy draws them, against luxel's pictures.
//!
//! Needs Vulkan, of a processor if there is no GPU (Debian: mesa-vulkan-drivers), so it runs on request:
//! `LUXEL=../../target/release/luxel cargo test --test picture -- --ignored`.

use bevy::{
    asset::RenderAssetUsages,
    camera::{Exposure, Hdr, RenderTarget},
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    light::GlobalAmbientLight,
    prelude::*,
    render::{
        gpu_readback::{Readback, ReadbackComplete},
        render_resource::{TextureFormat, TextureUsages},
    },
    window::ExitCondition,
};
use half::f16;
use std::{
    path::Path,
    process::Command,
    time::{Duration, Instant},
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// Rows of 16 bit texels whose length needs no padding.
const SIZE: UVec2 = UVec2::new(640, 360);

/// What has come back from the GPU last.
#[derive(Resource, Default)]
struct Drawn(Vec<f32>);

fn luxel(folder: &Path, arguments: &str) {
    let program = std::env::var("LUXEL").expect("LUXEL=../../target/release/luxel cargo test");
    let mut command = Command::new(Path::new(ROOT).join(program));
    let said = command.args(arguments.split_whitespace()).current_dir(folder).output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
}

/// Radiance of each pixel as Bevy draws it, exposed by 1.
fn drawn(folder: &Path) -> Vec<f32> {
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    let assets = AssetPlugin { file_path: folder.to_str().unwrap().into(), ..default() };
    let mut app = App::new();
    app.add_plugins((DefaultPlugins.set(window).set(assets), luxel_bevy::LuxelPlugin));
    app.insert_resource(ClearColor(Color::BLACK)).insert_resource(GlobalAmbientLight::NONE).init_resource::<Drawn>();
    while app.plugins_state() == bevy::app::PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();

    let mut target = Image::new_target_texture(SIZE.x, SIZE.y, TextureFormat::Rgba16Float, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    target.asset_usage = RenderAssetUsages::RENDER_WORLD;
    let target = app.world_mut().resource_mut::<Assets<Image>>().add(target);
    let scene = app.world().resource::<AssetServer>().load(GltfAssetLabel::Scene(0).from_asset("scene.lit.glb"));
    app.world_mut().spawn(WorldAssetRoot(scene));
    let patience = Instant::now();
    let mut frames = 0;
    while frames < 30 {
        app.update();
        assert!(patience.elapsed() < Duration::from_secs(120), "nothing is drawn");
        let mut cameras = app.world_mut().query_filtered::<Entity, With<Camera3d>>();
        let Some(camera) = cameras.iter(app.world()).next() else { continue };
        frames += 1;
        if frames == 1 {
            app.world_mut().entity_mut(camera).insert((
                RenderTarget::from(target.clone()),
                Hdr,
                Msaa::Off,
                Tonemapping::None,
                DebandDither::Disabled,
                // A factor of 1.
                Exposure { ev100: -(1.2f32.log2()) },
            ));
        }
        // Pipelines are made meanwhile.
        std::thread::sleep(Duration::from_millis(50));
        if frames == 20 {
            let read = |done: On<ReadbackComplete>, mut drawn: ResMut<Drawn>| {
                drawn.0 = done.data.chunks_exact(2).map(|x| f16::from_le_bytes([x[0], x[1]]).to_f32()).collect();
            };
            app.world_mut().spawn(Readback::texture(target.clone())).observe(read);
        }
    }
    std::mem::take(&mut app.world_mut().resource_mut::<Drawn>().0)
}

#[test]
#[ignore = "needs Vulkan"]
fn bevy_draws_what_luxel_draws() {
    compare("cornell", [0.002, 0.005, 0.002]);
    // Bevy draws textures without mipmaps.
    compare("room", [0.002, 0.05, 0.005]);
}

/// Largest relative difference in the median, at the 95th percentile, of the means.
fn compare(name: &str, allowed: [f32; 3]) {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(ROOT).join("../../assets").join(format!("{name}.glb"));
    std::fs::copy(scene, folder.path().join("scene.glb")).unwrap();
    luxel(folder.path(), "bake scene.glb --resolution 256 --rays 64 --quiet");
    // A ray through the middle of each pixel, as Bevy draws.
    luxel(folder.path(), &format!("render scene.lit.glb -o a.exr --size {}x{} --samples 1 --quiet", SIZE.x, SIZE.y));
    let bytes = std::fs::read(folder.path().join("a.exr")).unwrap();
    let luxel = image::load_from_memory_with_format(&bytes, image::ImageFormat::OpenExr).unwrap().into_rgba32f();
    let bevy = drawn(folder.path());
    assert_eq!(bevy.len(), luxel.as_raw().len());
    if let Ok(folder) = std::env::var("KEEP") {
        let picture = image::Rgba32FImage::from_raw(SIZE.x, SIZE.y, bevy.clone()).unwrap();
        picture
            .save_with_format(Path::new(&folder).join(format!("{name}.bevy.exr")), image::ImageFormat::OpenExr)
            .unwrap();
        luxel
            .save_with_format(Path::new(&folder).join(format!("{name}.luxel.exr")), image::ImageFormat::OpenExr)
            .unwrap();
    }
    let pairs = || bevy.chunks_exact(4).zip(luxel.pixels()).flat_map(|(b, l)| (0..3).map(move |k| (b[k], l.0[k])));
    let seen: Vec<(f32, f32)> = pairs().filter(|(_, l)| *l > 0.0).collect();
    assert!(seen.len() > 100_000, "{}", seen.len());
    let mut off: Vec<f32> = seen.iter().map(|(b, l)| (b / l - 1.0).abs()).collect();
    off.sort_unstable_by(f32::total_cmp);
    let [median, most] = [50, 95].map(|percent| off[off.len() * percent / 100]);
    let mean = |of: fn(&(f32, f32)) -> f32| seen.iter().map(of).sum::<f32>() / seen.len() as f32;
    let bias = mean(|p| p.0) / mean(|p| p.1) - 1.0;
    println!("{name}: off by {median:.4} in the median, {most:.4} at the 95th percentile, {bias:.4} on average");
    assert!(median < allowed[0] && most < allowed[1] && bias.abs() < allowed[2]);
}
