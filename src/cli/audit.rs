//! `luxel audit`, and `luxel bake --audit`: how wrong a lightmap is.

use super::{
    args,
    bake::{Warnings, start_threads},
    console, lights,
    progress::Progress,
    signals, summary,
    values::{self, SkyWish},
};
use luxel::{
    atlas::Coverage,
    audit::{Audit, Budget, Options, Subject},
    bake::{self, Baked},
    error::{Error, Result},
    files,
    gltf::{self, Record},
    progress::Observer,
    scene::World,
    trace::Tracer,
};
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

/// Time of `luxel audit`.
const TIME: Duration = Duration::from_secs(10);
/// Least time of `--audit`, and its share of the bake's.
const LEAST: Duration = Duration::from_secs(2);
const SHARE: f64 = 0.2;

/// Audits a baked file as the options say.
pub fn run(args: &args::Audit) -> Result<ExitCode> {
    signals::listen();
    start_threads(args.threads)?;
    let on_stdout = args.report.as_deref() == Some(Path::new("-"));
    let report = args.report.as_deref().filter(|_| !on_stdout);
    if let Some(file) = report {
        spare(file, &args.input)?;
    }
    let document = gltf::open(&args.input)?;
    let mut said = Warnings::default();
    let record = match gltf::record(&document)? {
        Some(record) => record,
        None => {
            let sentence = "the file does not say under which light it was baked: what is typed is taken";
            said.add(vec![sentence.into()]);
            Record::default()
        }
    };
    let exclude = if args.exclude.is_empty() { record.exclude.clone() } else { args.exclude.clone() };
    let light_scale = args.light_scale.or(record.light_scale).unwrap_or(1.0);
    let gltf::Input { document, mut scene, warnings } =
        gltf::read_scene(document, &gltf::ReadOptions { exclude, light_scale })?;
    said.add(warnings);
    let sky = args.sky.clone().map_or_else(|| recorded_sky(&record, &args.input), |s| Ok(Some(s)))?;
    let parsed = |text: &String| values::sun(text).map_err(|e| misread(&args.input, "sun", &e));
    let sun = args.sun.map_or_else(|| record.sun.as_ref().map(parsed).transpose(), |s| Ok(Some(s)))?;
    said.add(lights::add(&mut scene, sky.as_ref(), sun.as_ref())?);
    let gltf::Bound { atlas, mut lightmaps } = gltf::bound(&document, &scene)?;
    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    for (map, grid) in lightmaps.pages.iter_mut().zip(&coverage.grids) {
        map.covered = grid.iter().map(|t| *t != luxel::atlas::NO_TEXEL).collect();
    }
    let tracer = Tracer::new(world);
    let max_reflectance = args.max_reflectance.or(record.max_reflectance).unwrap_or(0.98).clamp(1e-6, 0.9999);
    let subject = Subject { tracer: &tracer, coverage: &coverage, lightmaps: &lightmaps, max_reflectance };
    let budget = args.points.map_or(Budget::Time(args.time.unwrap_or(TIME)), Budget::Points);
    let observer = Progress::new(args.quiet);
    let audit = Audit::of(&subject, &Options { budget, seed: args.seed, ..Options::default() }, &observer);
    observer.finish();
    let audit = audit?;
    said.add(record.bounces.map(partial).into_iter().collect());
    console::tell(&audit, report, on_stdout, || summary::audit(&audit))?;
    Ok(ExitCode::SUCCESS)
}

/// Audits what was just baked.
pub fn of_bake(baked: &Baked, options: &bake::Options, observer: &dyn Observer) -> Result<Audit> {
    let seconds: f64 = baked.report.seconds.iter().map(|(_, s)| s).sum();
    let time = LEAST.max(Duration::from_secs_f64(SHARE * seconds));
    let Baked { tracer, coverage, lightmaps, .. } = baked;
    let subject = Subject { tracer, coverage, lightmaps, max_reflectance: options.max_reflectance };
    Audit::of(&subject, &Options { budget: Budget::Time(time), ..Options::default() }, observer)
}

/// The warning that a bake was not meant to hold all light.
pub fn partial(bounces: u32) -> String {
    format!("the bake dropped light after {bounces} bounces (--bounces); the audit counts it as missing")
}

/// The sky that the file keeps; a picture is looked for where the bake found it, then beside the baked file.
fn recorded_sky(record: &Record, baked: &Path) -> Result<Option<SkyWish>> {
    let Some(text) = &record.sky else { return Ok(None) };
    let wish = values::sky(text).map_err(|e| misread(baked, "sky", &e))?;
    let SkyWish::Picture(file, scale, rotation) = wish else { return Ok(Some(wish)) };
    let beside = |name: &std::ffi::OsStr| files::folder(baked).join(name);
    let places: Vec<PathBuf> = [file.clone()].into_iter().chain(file.file_name().map(beside)).collect();
    let Some(place) = places.into_iter().find(|p| p.is_file()) else {
        let problem = format!("the picture of the sky, {}, is not there", file.display());
        let remedy = format!("say where it is: --sky FILE,{scale},{rotation}");
        return Err(Error::invalid(baked, "extensions.LUXEL_lightmap, report.light", problem, remedy));
    };
    Ok(Some(SkyWish::Picture(place, scale, rotation)))
}

fn misread(file: &Path, option: &str, problem: &str) -> Error {
    let place = format!("extensions.LUXEL_lightmap, report.light.{option}");
    Error::invalid(file, place, problem, format!("give the one of the bake: --{option}"))
}

/// The report must not take the input's place.
fn spare(report: &Path, input: &Path) -> Result<()> {
    if files::place(report)? == files::place(input)? {
        return Err(Error::Usage(format!("{}: the report would overwrite the baked file", report.display())));
    }
    files::probe(report)
}
