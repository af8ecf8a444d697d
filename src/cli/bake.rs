//! `luxel bake`: read, bake, write, tell.

use super::{
    args, audit, camera, console, lights, outputs,
    outputs::Outputs,
    pictures,
    progress::Progress,
    signals,
    summary::{self, Extra},
    units,
};
use luxel::{
    atlas,
    audit::Audit,
    bake::{self, Baked, Options, Quality, Target},
    error::{Error, Result},
    files, gltf, memory, preview, radiosity,
    report::{LightReport, Report, TargetReport},
    scene::{Camera, Scene},
    transport::{self, FormFactors},
};
use serde::Serialize;
use std::process::ExitCode;

/// Bakes as the options say.
pub fn run(args: &args::Bake) -> Result<ExitCode> {
    signals::listen();
    check_effort(args)?;
    let options = options(args)?;
    start_threads(args.threads)?;
    let outputs = outputs::resolve(args)?;
    let reading = gltf::ReadOptions { exclude: args.exclude.clone(), light_scale: args.light.light_scale };
    let gltf::Input { document, mut scene, warnings } = gltf::read(&args.input, &reading)?;
    outputs.spare(&document)?;
    gltf::check(&document, &scene, args.keep_uv, &outputs.scene)?;
    let mut said = Warnings::default();
    said.add(warnings);
    said.add(lights::add(&mut scene, args.light.sky.as_ref(), args.light.sun.as_ref())?);
    said.add(units::differ(&scene).into_iter().collect());
    let camera = camera::choose(&scene, args.camera.as_ref())?;

    let observer = Progress::new(args.quiet);
    let baked = match target(args) {
        Some(target) => bake::bake_to(&scene, &options, &target, &observer),
        None => bake::bake(&scene, &options, &observer),
    };
    observer.finish();
    let mut baked = baked?;
    let audited = args.audit && baked.audit.is_none();
    let audit = audited.then(|| audit::of_bake(&baked, &options, &observer)).transpose()?.or(baked.audit.take());
    observer.finish();
    if let (true, Some(bounces)) = (args.audit, options.radiosity.bounces) {
        said.add(vec![audit::partial(bounces)]);
    }
    baked.report.light = Some(light(args));
    let missed = baked.report.target.as_ref().and_then(missed);
    said.add(missed.into_iter().collect());
    said.add(std::mem::take(&mut baked.report.warnings));
    baked.report.warnings = said.all.clone();

    let written = write(args, &document, &scene, &baked, camera, &outputs)?;
    said.add(written.said.warnings);
    let notes = written.said.notes;
    notes.iter().filter(|_| !args.quiet).for_each(|text| console::information(text));
    let report = Report { warnings: said.all, notes, peak_memory_mb: memory::peak_mb(), ..baked.report };
    tell(&Told { report: &report, audit: audit.as_ref() }, &outputs, &written.extras)?;
    let typed = args.error.is_some() || args.quality.is_some();
    let reached = report.target.as_ref().is_none_or(|t| t.reached || !typed);
    Ok(ExitCode::from(if reached { u8::from(args.strict && !report.warnings.is_empty()) } else { TARGET_MISSED }))
}

/// The output is written, but not as good as the user typed.
const TARGET_MISSED: u8 = 4;

/// What is to be reached; `None` where the effort is fixed.
fn target(args: &args::Bake) -> Option<Target> {
    let error = args.error.or(args.quality.map(Quality::error));
    let fixed = args.rays.is_some() || args.bounces.is_some() || args.form_factors != FormFactors::Rays;
    let typed = error.is_some() || args.time.is_some();
    (!fixed).then_some(if typed { Target::typed(error, args.time) } else { Target::default() })
}

/// Refuses efforts that an estimator does not have.
fn check_effort(args: &args::Bake) -> Result<()> {
    let typed = |given: bool, name: &'static str| given.then_some(name);
    let [error, time, quality] = [
        typed(args.error.is_some(), "--error"),
        typed(args.time.is_some(), "--time"),
        typed(args.quality.is_some(), "--quality"),
    ];
    let rays = typed(args.rays.is_some(), "--rays");
    let name = args.form_factors.name();
    let (option, problem) = match args.form_factors {
        FormFactors::Rays => return Ok(()),
        FormFactors::Hemicube { .. } => (
            error.or(time).or(quality).or(rays),
            format!("the effort of --form-factors {name} is its resolution, --form-factors {name},N"),
        ),
        FormFactors::Analytic => {
            (error.or(time).or(quality), format!("--form-factors {name} has no effort that could grow to a target"))
        }
    };
    let Some(option) = option else { return Ok(()) };
    Err(Error::Usage(format!("{option}: {problem}\n  leave {option} out, or use --form-factors rays")))
}

/// The warning that the error was not reached.
fn missed(target: &TargetReport) -> Option<String> {
    let (error, last) = (target.error?, target.looks.last()?);
    let found = match (last.error, last.low, last.high) {
        (Some(error), Some(low), Some(high)) => {
            let [error, low, high] = [error, low, high].map(|x| format!("{:.1}", 100.0 * x));
            format!("{error} % ({low} to {high})")
        }
        _ => "unknown: too few points can be seen".into(),
    };
    let rays = last.rays;
    let text = format!("the error of {} % was not reached: with {rays} rays a texel it is {found}", 100.0 * error);
    (!target.reached).then_some(text)
}

/// What the user should know, each sentence once, on stderr as soon as it is known.
#[derive(Default)]
pub struct Warnings {
    /// All that was said.
    pub all: Vec<String>,
}

impl Warnings {
    /// Says what is new.
    pub fn add(&mut self, sentences: Vec<String>) {
        for sentence in sentences {
            if !self.all.contains(&sentence) {
                console::warning(&sentence);
                self.all.push(sentence);
            }
        }
    }
}

fn options(args: &args::Bake) -> Result<Options> {
    let defaults = atlas::Options::default();
    let unwrap = if args.keep_uv { atlas::Unwrap::Keep } else { args.unwrap.unwrap_or_default() };
    let density = match (args.texels_per_meter, args.resolution) {
        (Some(t), _) => atlas::Density::TexelsPerMeter(t),
        (None, Some(n)) => atlas::Density::Resolution(n),
        (None, None) => defaults.density,
    };
    let edge = if let atlas::Density::Resolution(n) = density { n } else { 0 };
    let page_size = match args.page_size {
        None => defaults.page_size.max(edge),
        Some(size) if args.resolution.is_some_and(|n| n > size) => {
            let what = format!("--page-size {size} is smaller than the one page of --resolution {edge}");
            return Err(Error::Usage(format!("{what}\n  leave one of them out, or use --texels-per-meter")));
        }
        Some(size) => size,
    };
    // A small --page-size alone makes the default page smaller, too.
    let density = match density {
        atlas::Density::Resolution(n) => atlas::Density::Resolution(n.min(page_size)),
        other => other,
    };
    let atlas = atlas::Options { unwrap, density, page_size };
    atlas.check()?;
    let radiosity = radiosity::Options { solver: args.solver, bounces: args.bounces };
    let all = Options::default();
    let (form_factors, reuse, receivers) = (args.form_factors, !args.no_reuse, args.receivers);
    let transport = transport::Options { form_factors, reuse, receivers, ..all.transport };
    let (max_reflectance, content) = (args.light.max_reflectance, args.content);
    let options = Options { atlas, transport, max_reflectance, radiosity, content, ..all };
    Ok(args.rays.map_or(options.clone(), |rays| options.with_rays(rays)))
}

/// Starts as many threads as are wished for.
pub fn start_threads(threads: Option<usize>) -> Result<()> {
    let Some(n) = threads else { return Ok(()) };
    // Hundreds of threads on a few processors spend their time waking one another.
    let most = 4 * std::thread::available_parallelism().map_or(1, |n| n.get());
    let started = rayon::ThreadPoolBuilder::new().num_threads(n.min(most)).build_global();
    started.map_err(|e| Error::Usage(format!("--threads {n}: {e}\n  try fewer threads")))
}

struct Written<'a> {
    said: gltf::Remarks,
    extras: Vec<Extra<'a>>,
}

/// Pictures are painted first, while one can still stop; then everything is written.
fn write<'a>(
    args: &args::Bake,
    document: &gltf::Document,
    scene: &Scene,
    baked: &Baked,
    camera: Option<Camera>,
    outputs: &'a Outputs,
) -> Result<Written<'a>> {
    let preview = |file| {
        let picture = pictures::preview(scene, baked, camera);
        pictures::encode(&picture, file).map(|bytes| (file, bytes, picture.exposure))
    };
    let picture = outputs.preview.as_deref().map(preview).transpose()?;
    let flat = outputs.flat.as_deref().map(|file| (file, preview::flat(baked)));
    let _writing = signals::writing();
    let Baked { atlas, lightmaps, report, .. } = baked;
    let (float, sidecar, strip_lights) = (args.float, args.sidecar, args.strip_lights);
    let writing = gltf::WriteOptions { float, sidecar, strip_lights };
    let mut said = gltf::write(document, scene, atlas, lightmaps, report, &writing, &outputs.scene)?;
    let mut extras = Vec::new();
    if let Some((file, bytes, exposure)) = picture {
        files::write_whole(file, |out| out.write_all(&bytes))?;
        extras.push(Extra { name: "preview", file, exposure });
    }
    if let Some((file, (pages, exposure))) = flat {
        said.notes.extend(gltf::write_flat(document, scene, atlas, &pages, exposure, file)?);
        extras.push(Extra { name: "flat", file, exposure });
    }
    Ok(Written { said, extras })
}

/// The report's JSON, and the audit's in it.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    report: &'a Report,
    #[serde(skip_serializing_if = "Option::is_none")]
    audit: Option<&'a Audit>,
}

/// The options that an audit of the lit file has to know.
fn light(args: &args::Bake) -> LightReport {
    LightReport {
        sky: args.light.sky.as_ref().map(ToString::to_string),
        sun: args.light.sun.as_ref().map(ToString::to_string),
        light_scale: args.light.light_scale,
        max_reflectance: args.light.max_reflectance,
        exclude: args.exclude.clone(),
    }
}

fn tell(told: &Told, outputs: &Outputs, extras: &[Extra]) -> Result<()> {
    let text = || summary::text(told.report, told.audit, &outputs.scene, extras);
    console::tell(told, outputs.report.as_deref(), outputs.report_on_stdout, text)
}
