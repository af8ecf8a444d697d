//! The pipeline, one line a room. Touches no file.

mod energy;
mod plan;

use crate::{
    atlas::{self, Atlas, Coverage},
    direct::{Direct, Sources, sky_cells},
    error::Result,
    lightmaps::{Content, Lightmaps, jump_across_seams},
    patches::Patches,
    progress::Observer,
    radiosity::{self, Radiosity},
    report::Report,
    scene::{Scene, World},
    trace::Tracer,
    transport::{self, Transport},
};
use glam::Vec3;
use std::time::Instant;

/// What a bake does. Lights, sky and exclusions are part of the scene.
#[derive(Clone, Debug)]
pub struct Options {
    /// Layout and texel size. Default: uvunwrap, one page of 1024.
    pub atlas: atlas::Options,
    /// How rows are measured. Default: 64 rays each, used again by neighbours.
    pub transport: transport::Options,
    /// Shadow rays a source where a texel sees part of it, 1..=65536; more at edges, fewer elsewhere. Default: 32.
    pub shadow_rays: u32,
    /// Largest reflectance, (0, .9999]. Default: .98.
    pub max_reflectance: f32,
    /// Which light is followed, and how. Default: all bounces, by chebyshev.
    pub radiosity: radiosity::Options,
    /// What the maps hold. Default: full.
    pub content: Content,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            atlas: atlas::Options::default(),
            transport: transport::Options::default(),
            shadow_rays: 32,
            max_reflectance: 0.98,
            radiosity: radiosity::Options::default(),
            content: Content::Full,
        }
    }
}

/// A finished bake, with the rooms that pictures and checks look at again.
pub struct Baked<'s> {
    /// Rays against the scene.
    pub tracer: Tracer<'s>,
    /// Layouts and rectangles.
    pub atlas: Atlas,
    /// Covered texels.
    pub coverage: Coverage,
    /// What they stand for.
    pub patches: Patches,
    /// Irradiance E of each patch, direct and indirect, whatever [`Options::content`] says.
    pub irradiance: Vec<Vec3>,
    /// The pages.
    pub lightmaps: Lightmaps,
    /// What was measured on the way.
    pub report: Report,
}

/// Bakes `scene`.
pub fn bake<'s>(scene: &'s Scene, options: &Options, observer: &dyn Observer) -> Result<Baked<'s>> {
    let mut r = Report::default();
    let mut clock = Clock::start();

    plan::refuse(scene, options, None)?;
    let atlas = clock.time("atlas", || atlas::unwrap(scene, &options.atlas, &scene.file, observer, &mut r.warnings))?;
    plan::refuse(scene, options, Some(&atlas))?;
    let world = World::new(scene);
    let coverage = clock.time("coverage", || Coverage::new(&world, &atlas));
    plan::announce(scene, &atlas, &coverage, options, observer)?;
    let tracer = clock.time("trace", || Tracer::new(world));
    let mut patches = clock.time("patches", || Patches::new(&tracer.world, &coverage, options.max_reflectance));
    let transport = clock
        .time("transport", || Transport::measure(&tracer, &coverage, &mut patches, &options.transport, observer))?;
    let sources = Sources::new(&tracer, &patches);
    let direct = clock
        .time("direct", || Direct::measure(&tracer, &coverage, &patches, &sources, options.shadow_rays, observer))?;
    let sky = sky_cells(&scene.sky);
    let mut radiosity = clock.time("radiosity", || {
        Radiosity::solve(&transport, &patches, &direct, &sky, sources.gathered, &options.radiosity, observer)
    })?;
    r.energy = energy::balance(&patches, &transport, &direct, &sky, &radiosity);
    if options.transport.shares(coverage.texels.len()) {
        clock.time("reuse", || radiosity.reuse(&transport, &tracer, &coverage, &patches, &direct, observer))?;
    }
    let lightmaps = clock.time("lightmaps", || {
        Lightmaps::new(&tracer.world, &atlas, &coverage, &patches, &direct, &radiosity, options.content)
    });

    r.seconds = clock.seconds;
    r.seam_jump_p95 = jump_across_seams(&tracer.world, &atlas, &coverage, &lightmaps);
    plan::describe(&mut r, &tracer, &atlas, &coverage, &patches, &transport, &direct, &lightmaps);
    r.solver = radiosity.report;
    plan::warn(&mut r, options);
    plan::warn_of_broken(&mut r, &lightmaps);
    let irradiance = (0..patches.len()).map(|p| direct.total(p) + radiosity.indirect[p]).collect();
    Ok(Baked { tracer, atlas, coverage, patches, irradiance, lightmaps, report: r })
}

/// Seconds by room.
struct Clock {
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn start() -> Self {
        Clock { seconds: Vec::new() }
    }

    fn time<T>(&mut self, room: &'static str, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let out = run();
        self.seconds.push((room, start.elapsed().as_secs_f64()));
        out
    }
}
