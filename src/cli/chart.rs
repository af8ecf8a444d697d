//! `luxel chart`: speed against accuracy on a scene, as JSON and pictures.

use super::{
    args,
    bake::{Warnings, start_threads},
    console,
    folder::Folder,
    lights,
    progress::Progress,
    signals,
};
use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    bake,
    chart::{self, Chart, Clock, Given, Peers, Sweep, draw},
    error::{Error, Result},
    files, gltf,
    scene::World,
};
use std::{fmt::Write, path::Path, process::ExitCode};

/// Pixels of a PNG to a unit of its SVG: sharp on fine screens, too.
const PIXELS: f32 = 2.0;

/// Charts as the options say.
pub fn run(args: &args::Chart) -> Result<ExitCode> {
    signals::listen();
    start_threads(args.threads)?;
    let options = options(args)?;
    let folder = Folder::check(&args.output, "chart.json")?;
    let peers = args.peers.as_deref().map(peers).transpose()?;
    let mut said = Warnings::default();
    let reading = gltf::ReadOptions { exclude: args.exclude.clone(), light_scale: args.light.light_scale };
    let gltf::Input { mut scene, document, warnings } = gltf::read(&args.input, &reading)?;
    gltf::check(&document, &scene, args.keep_uv, &args.input)?;
    said.add(warnings);
    said.add(lights::add(&mut scene, args.light.sky.as_ref(), args.light.sun.as_ref())?);
    let observer = Progress::new(args.quiet);
    let chart = Chart::measure(&scene, &options, &observer);
    observer.finish();
    let chart = Chart { peers, ..chart? };
    missing(&chart).iter().for_each(|text| console::warning(text));
    let files = drawn(&chart)?;
    let writing = signals::writing();
    folder.write(&files)?;
    drop(writing);
    console::print(&summary(&chart, &folder.path, &files))?;
    Ok(ExitCode::SUCCESS)
}

fn options(args: &args::Chart) -> Result<chart::Options> {
    let defaults = atlas::Options::default();
    let unwrap = if args.keep_uv { Unwrap::Keep } else { args.unwrap.unwrap_or_default() };
    let density = args.resolution.map_or(defaults.density, Density::Resolution);
    let page_size = defaults.page_size.max(args.resolution.unwrap_or(0));
    let atlas = atlas::Options { unwrap, density, page_size };
    atlas.check()?;
    let sweeps = if args.sweep.is_empty() { Sweep::ALL.to_vec() } else { args.sweep.clone() };
    Ok(chart::Options {
        bake: bake::Options { atlas, max_reflectance: args.light.max_reflectance, ..bake::Options::default() },
        budget: args.budget,
        clock: if args.processor_time { Clock::Processor } else { Clock::Wall },
        sweeps,
        given: args.truth.as_deref().map(|file| given(file, args)).transpose()?,
    })
}

/// A baked file that is taken for the truth.
fn given(file: &Path, args: &args::Chart) -> Result<Given> {
    let document = gltf::open(file)?;
    let reading = gltf::ReadOptions { exclude: args.exclude.clone(), light_scale: args.light.light_scale };
    let gltf::Input { document, scene, .. } = gltf::read_scene(document, &reading)?;
    let gltf::Bound { atlas, lightmaps } = gltf::bound(&document, &scene)?;
    let coverage = Coverage::new(&World::new(&scene), &atlas);
    Ok(Given { file: file.into(), coverage, lightmaps })
}

fn peers(file: &Path) -> Result<Peers> {
    let fail = |problem: String| {
        Error::invalid(file, "the figures of other tools", problem, "luxel chart --help says what the file holds")
    };
    let peers: Peers = serde_json::from_slice(&files::read(file)?).map_err(|e| fail(e.to_string()))?;
    peers.problem().map_or(Ok(peers), |problem| Err(fail(problem)))
}

/// What is not charted: a line a sweep that the budget cut short, a line for each that was refused.
fn missing(chart: &Chart) -> Vec<String> {
    let of = |sweep: Sweep| {
        let own = chart.left_out.iter().filter(move |l| l.sweep == sweep.name());
        let (late, refused): (Vec<_>, Vec<_>) = own.partition(|l| l.refused.is_none());
        let names: Vec<&str> = late.iter().map(|l| l.name.as_str()).collect();
        let late = format!("the budget leaves out {}: {}", sweep.name(), names.join("; "));
        let refused = refused.into_iter().map(move |l| {
            format!("{}, {} is left out: {}", sweep.name(), l.name, l.refused.as_deref().unwrap_or_default())
        });
        (!names.is_empty()).then_some(late).into_iter().chain(refused)
    };
    Sweep::ALL.into_iter().flat_map(of).collect()
}

/// Names and bytes of all files.
fn drawn(chart: &Chart) -> Result<Vec<(String, Vec<u8>)>> {
    let json = serde_json::to_vec_pretty(chart).map_err(|e| Error::writing(Path::new("chart.json"), e.into()))?;
    let mut files = vec![("chart.json".to_owned(), json)];
    for (name, figure) in chart::figures(chart) {
        let picture = figure.picture();
        let file = format!("{name}.png");
        let png = draw::png(&picture, PIXELS).map_err(|e| Error::writing(Path::new(&file), e))?;
        files.push((format!("{name}.svg"), draw::svg(&picture).into_bytes()));
        files.push((file, png));
    }
    Ok(files)
}

/// The points, and what they say together.
fn summary(chart: &Chart, folder: &Path, files: &[(String, Vec<u8>)]) -> String {
    let mut out = String::new();
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let _ = writeln!(out, "output     {}: {}", folder.display(), names.join(", "));
    let percent = |x: Option<f64>| x.map_or("-".into(), |x| format!("{:.2} %", 100.0 * x));
    let _ = writeln!(out, "{:<36} {:>8} {:>9} {:>9} {:>9}", "", "seconds", "error", "dark", "borders");
    for p in &chart.points {
        let (name, seconds) = (format!("{} {}", p.sweep, p.name), p.seconds);
        let [error, dark, border] = [p.error, p.dark, p.border].map(percent);
        let best = if p.pareto { " *" } else { "" };
        let _ = writeln!(out, "{name:<36} {seconds:>8.2} {error:>9} {dark:>9} {border:>9}{best}");
    }
    for s in &chart.solvers {
        let passes = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:.0}"));
        let (exact, sure) = (passes(s.passes_to_error), passes(s.passes_to_tolerance));
        let time = s.seconds_to_tolerance.map_or("-".into(), |t| format!("{t:.2} s"));
        let mut text = format!("{exact} passes to a true error of .001, {sure} until sure, {time}");
        text += &s.fallback.map_or(String::new(), |f| format!(", {f} went on"));
        let text = s.refused.clone().unwrap_or(text);
        let _ = writeln!(out, "{:<18} {:<18} {text}", s.reflectance, s.solver);
    }
    if let Some(power) = chart.scaling {
        let _ = writeln!(out, "seconds grow with texels to the power of {power:.2}");
    }
    for (reading, order) in chart.patches.iter().flat_map(|p| &p.order) {
        let order = order.map_or("unknown".into(), |o| format!("{o:.2}"));
        let _ = writeln!(out, "patches, {reading}: error falls with the power {order} of the edge");
    }
    if let [one, .., all] = &chart.threads[..] {
        let _ = writeln!(out, "{} threads are {:.2} times as fast as one", all.threads, one.seconds / all.seconds);
    }
    out
}
