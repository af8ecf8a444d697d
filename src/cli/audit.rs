//! `luxel audit`, and `luxel bake --audit`: how wrong a lightmap is.

use super::{
    args,
    bake::{Warnings, start_threads},
    baked::{self, Opened},
    console,
    progress::Progress,
    signals, summary,
};
use luxel::{
    atlas::Coverage,
    audit::{Audit, Budget, Options, Subject},
    bake::{self, Baked},
    error::{Error, Result},
    files, gltf,
    progress::Observer,
    scene::World,
    trace::Tracer,
};
use std::{path::Path, process::ExitCode, time::Duration};

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
        spare(file, &args.baked.input)?;
    }
    let mut said = Warnings::default();
    let Opened { document, record, scene, atlas, mut lightmaps } = baked::open(&args.baked, &mut said)?;
    gltf::check_lights(&document)?;
    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    for (map, grid) in lightmaps.pages.iter_mut().zip(&coverage.grids) {
        map.covered = grid.iter().map(|t| *t != luxel::atlas::NO_TEXEL).collect();
    }
    let tracer = Tracer::new(world);
    let max_reflectance = args.max_reflectance.unwrap_or(record.reflectance());
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

/// The report must not take the input's place.
fn spare(report: &Path, input: &Path) -> Result<()> {
    if files::place(report)? == files::place(input)? {
        return Err(Error::Usage(format!("{}: the report would overwrite the baked file", report.display())));
    }
    signals::probe(report)
}
