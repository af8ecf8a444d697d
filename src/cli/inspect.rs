//! `luxel inspect`: pictures of what a lightmap is like.

use super::{
    args,
    bake::{Warnings, start_threads},
    baked::{self, Opened},
    camera, console,
    folder::Folder,
    pictures, signals, summary,
};
use glam::Vec3;
use luxel::{
    atlas::{Coverage, NO_PAGE},
    audit::Subject,
    error::{Error, Result},
    inspect::{Inspection, Layer},
    math::srgb,
    pixels::encode_png,
    preview::{Cast, Sight},
    progress::Silent,
    render,
    scene::World,
    trace::{NOWHERE, Ray, Tracer},
    transport,
};
use std::{path::Path, process::ExitCode};

/// Colour of what no map covers, linear.
const BARE: Vec3 = Vec3::splat(0.01);

/// Inspects as the options say.
pub fn run(args: &args::Inspect) -> Result<ExitCode> {
    signals::listen();
    start_threads(args.threads)?;
    let folder = Folder::check(&args.output, "page0.png")?;
    let mut said = Warnings::default();
    let Opened { scene, atlas, lightmaps, record, .. } = baked::open(&args.baked, &mut said)?;
    let wish = camera::choose(&scene, args.camera.as_ref())?;

    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    let camera = wish.unwrap_or_else(|| {
        let view = render::of_file(&tracer, &coverage, &lightmaps, 1);
        camera::find(&scene, &|o, d| view.sight(o, d), pictures::aspect())
    });
    let max_reflectance = record.reflectance();
    let subject = Subject { tracer: &tracer, coverage: &coverage, lightmaps: &lightmaps, max_reflectance };
    // Geometry alone chose them, so they are chosen again.
    let receivers = record
        .adaptive_rays
        .map(|rays| transport::adaptive_receivers(&tracer, &coverage, rays, &Silent))
        .transpose()?;
    let inspection = Inspection::new(subject, &atlas, args.points as usize, receivers);
    let (mut told, mut files) = (Vec::new(), Vec::new());
    for layer in Layer::ALL {
        let painted = inspection.paint(layer);
        for (page, grid) in coverage.grids.iter().enumerate() {
            let color = |t: &u32| srgb(painted.colors.get(*t as usize).copied().unwrap_or(BARE));
            let texels: Vec<[u8; 3]> = grid.iter().map(color).collect();
            let name = format!("page{page}.{}.png", layer.name());
            let bytes = encode_png(coverage.sizes[page], &texels).map_err(|e| Error::writing(Path::new(&name), e))?;
            files.push((name, bytes));
        }
        let cast = |origin, direction| on_surface(&tracer, &coverage, &painted.colors, origin, direction);
        let picture = pictures::plain(&cast as &Cast, &camera);
        let name = format!("view.{}.png", layer.name());
        files.push((name.clone(), pictures::encode(&picture, Path::new(&name))?));
        told.push((layer.name(), painted.legend));
    }
    let writing = signals::writing();
    folder.write(&files)?;
    drop(writing);
    if !args.quiet {
        console::print(&summary::lines(&told))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The colour of the texel that a ray meets, darker where the surface turns away.
fn on_surface(tracer: &Tracer, coverage: &Coverage, colors: &[Vec3], origin: Vec3, direction: Vec3) -> Option<Sight> {
    let hit = tracer.closest(&Ray { origin, direction, key: 0, from: NOWHERE })?;
    let charted = &coverage.charted[hit.triangle as usize];
    let texel = if charted.page == NO_PAGE { None } else { coverage.texel_near(charted, charted.at(hit.bary)) };
    let color = texel.map_or(BARE, |t| colors[t as usize]);
    let world = &tracer.world;
    let (instance, local) = world.locate(hit.triangle);
    let face = world.cross(instance, &world.corners(instance, local)).normalize_or_zero();
    let shade = 0.5 + 0.5 * face.dot(direction).abs();
    let front = hit.front || world.material(hit.triangle).double_sided;
    Some(Sight { distance: hit.t, front, radiance: color * shade, unlit: true })
}
