//! The pipeline, one line a room. Touches no file.

mod energy;
mod plan;
mod target;

pub use target::{Quality, Target, bake_to};

use crate::{
    atlas::{self, Atlas, Coverage},
    audit::Audit,
    direct::{Direct, Kept, Sources, sky_cells},
    error::Result,
    lightmaps::{Content, Lightmaps},
    memory,
    patches::Patches,
    progress::Observer,
    radiosity::{self, Radiosity},
    report::{EnergyReport, Report},
    scene::{Scene, World},
    trace::Tracer,
    transport::{self, Stats, Transport},
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
    /// Shadow rays a source where a texel sees part of it, 1..=65536; more at edges, fewer elsewhere. Default: 128.
    pub shadow_rays: u32,
    /// Largest reflectance, (0, .9999]. Default: .98.
    pub max_reflectance: f32,
    /// Which light is followed, and how. Default: all bounces, by anderson.
    pub radiosity: radiosity::Options,
    /// What the maps hold. Default: full.
    pub content: Content,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            atlas: atlas::Options::default(),
            transport: transport::Options::default(),
            shadow_rays: 128,
            max_reflectance: 0.98,
            radiosity: radiosity::Options::default(),
            content: Content::Full,
        }
    }
}

impl Options {
    /// The same with so many rays a row, and as many shadow rays as keep step: twice as many, but enough to find edges, and
    /// fewer beyond 64 rays, as errors at edges fall faster than those of rows.
    pub fn with_rays(self, rays: u32) -> Self {
        let transport = transport::Options { rays, ..self.transport };
        let twice = rays.saturating_mul(2);
        let in_step = 2.0 * ROWS_IN_STEP * libm::pow(f64::from(rays) / ROWS_IN_STEP, STEP);
        Options { transport, shadow_rays: twice.min(in_step as u32).clamp(LEAST_SHADOW_RAYS, 1 << 16), ..self }
    }
}

/// Shadow rays a source, at least, however few rays rows have.
const LEAST_SHADOW_RAYS: u32 = 8;
/// Rays a row beyond which shadow rays grow with this power of them: errors of rows fall with the power .45 of the rays, at
/// edges with .625.
const ROWS_IN_STEP: f64 = 64.0;
const STEP: f64 = 0.72;

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
    /// How wrong the pages are, where a target asked for it.
    pub audit: Option<Audit>,
}

/// Bakes `scene` with the effort that the options say.
pub fn bake<'s>(scene: &'s Scene, options: &Options, observer: &dyn Observer) -> Result<Baked<'s>> {
    let mut ground = Ground::new(scene, options, observer)?;
    let lit = ground.light(options, None, observer)?;
    Ok(ground.baked(lit, options))
}

/// What does not depend on the effort.
struct Ground<'s> {
    tracer: Tracer<'s>,
    atlas: Atlas,
    coverage: Coverage,
    /// Before rays have looked; taken by the light, unless more effort may follow.
    patches: Patches,
    warnings: Vec<String>,
    clock: Clock,
    /// True if more effort may follow, which what is measured is kept for.
    grows: bool,
    /// Memory (MB) that was taken before rooms took theirs.
    taken_mb: u64,
}

/// What does.
struct Lit {
    patches: Patches,
    transport: Transport,
    /// Rays beside those of rows.
    added: Stats,
    direct: Direct,
    /// Shadow rays, if more may join.
    shadows: Kept,
    radiosity: Radiosity,
    energy: EnergyReport,
    lightmaps: Lightmaps,
}

impl<'s> Ground<'s> {
    fn new(scene: &'s Scene, options: &Options, observer: &dyn Observer) -> Result<Self> {
        let (mut warnings, mut clock) = (Vec::new(), Clock::default());
        plan::refuse(scene, options, None)?;
        let atlas =
            clock.time("atlas", || atlas::unwrap(scene, &options.atlas, &scene.file, observer, &mut warnings))?;
        plan::refuse(scene, options, Some(&atlas))?;
        let world = World::new(scene);
        plan::refuse_flat(&world)?;
        observer.begin("coverage", 0);
        let coverage = clock.time("coverage", || Coverage::new(&world, &atlas));
        let taken_mb = memory::resident_mb();
        plan::announce(scene, &atlas, &coverage, options, taken_mb, observer)?;
        observer.begin("trace", 0);
        let tracer = clock.time("trace", || Tracer::new(world));
        let patches = clock.time("patches", || Patches::new(&tracer.world, &coverage, options.max_reflectance));
        Ok(Ground { tracer, atlas, coverage, patches, warnings, clock, grows: false, taken_mb })
    }

    /// Keeps the rows and shadow rays of `before`, if it can.
    fn light(&mut self, options: &Options, before: Option<Lit>, observer: &dyn Observer) -> Result<Lit> {
        let Ground { tracer, atlas, coverage, clock, grows, .. } = self;
        let rows = &options.transport;
        let (kept, mut patches, mut shadows) = match before.filter(|lit| lit.transport.can_refine(rows)) {
            Some(Lit { transport, patches, shadows, .. }) => (Some(transport), patches, shadows),
            None if *grows => (None, self.patches.clone(), Kept::default()),
            None => {
                debug_assert!(!self.patches.is_empty(), "a bake that does not grow is lit once");
                (None, std::mem::take(&mut self.patches), Kept::default())
            }
        };
        let transport = clock.time("transport", || match kept {
            Some(transport) => transport.refine(tracer, coverage, &mut patches, rows, observer),
            None => Transport::measure(tracer, coverage, &mut patches, rows, observer),
        })?;
        let sources = Sources::new(tracer, &patches);
        let direct = clock.time("direct", || {
            Direct::refine(&mut shadows, tracer, coverage, &patches, &sources, options.shadow_rays, observer)
        })?;
        if !*grows {
            shadows = Kept::default();
        }
        let sky = sky_cells(&tracer.world.scene.sky);
        let mut radiosity = clock.time("radiosity", || {
            Radiosity::solve(&transport, &patches, &direct, &sky, sources.gathered, &options.radiosity, observer)
        })?;
        let energy = energy::balance(&patches, &transport, &direct, &sky, &radiosity);
        let mut added = Stats::default();
        if !transport.eyes.is_empty() {
            added =
                clock.time("reuse", || radiosity.reuse(&transport, tracer, coverage, &patches, &direct, observer))?;
        }
        let lightmaps = clock.time("lightmaps", || {
            Lightmaps::new(&tracer.world, atlas, coverage, &patches, &direct, &radiosity, options.content)
        });
        Ok(Lit { patches, transport, added, direct, shadows, radiosity, energy, lightmaps })
    }

    fn baked(mut self, lit: Lit, options: &Options) -> Baked<'s> {
        let (warnings, seconds) = (std::mem::take(&mut self.warnings), std::mem::take(&mut self.clock.seconds));
        let mut report = Report { warnings, seconds, ..Report::default() };
        plan::describe(&mut report, &self, &lit, options);
        plan::warn(&mut report, &self.tracer, options);
        let Ground { tracer, atlas, coverage, .. } = self;
        let Lit { patches, direct, radiosity, lightmaps, .. } = lit;
        let irradiance = (0..patches.len()).map(|p| direct.total(p) + radiosity.indirect[p]).collect();
        Baked { tracer, atlas, coverage, patches, irradiance, lightmaps, report, audit: None }
    }
}

/// Seconds by room, in the order in which they first ran.
#[derive(Default)]
struct Clock {
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn time<T>(&mut self, room: &'static str, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let out = run();
        let seconds = start.elapsed().as_secs_f64();
        match self.seconds.iter_mut().find(|s| s.0 == room) {
            Some(sum) => sum.1 += seconds,
            None => self.seconds.push((room, seconds)),
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadow_rays_follow_the_rays() {
        let shadow_rays = |rays: u32| Options::default().with_rays(rays).shadow_rays;
        assert_eq!([1, 8, 9, 64, 256, 1 << 16].map(shadow_rays), [8, 16, 18, 128, 347, 18820]);
        assert_eq!(shadow_rays(transport::Options::default().rays), Options::default().shadow_rays);
    }
}
