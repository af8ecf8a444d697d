//! `luxel render`: a picture of a baked file.

use super::{
    args,
    bake::{Warnings, start_threads},
    baked::{self, Opened},
    camera, console, pictures, signals, summary,
};
use luxel::{
    atlas::Coverage,
    error::{Error, Result},
    files,
    lightmaps::Content,
    render,
    scene::World,
    trace::Tracer,
};
use std::process::ExitCode;

/// Renders as the options say.
pub fn run(args: &args::Render) -> Result<ExitCode> {
    signals::listen();
    start_threads(args.threads)?;
    let file = &args.output;
    if files::place(file)? == files::place(&args.baked.input)? {
        return Err(Error::Usage(format!("{}: the picture would overwrite the baked file", file.display())));
    }
    signals::probe(file)?;
    let mut said = Warnings::default();
    let Opened { scene, atlas, lightmaps, .. } = baked::open(&args.baked, &mut said)?;
    if lightmaps.content == Content::Direct {
        said.add(vec!["the file holds direct light only: the picture lacks the rest".into()]);
    }
    let camera = camera::choose(&scene, args.camera.as_ref())?;
    let world = World::new(&scene);
    let coverage = Coverage::new(&world, &atlas);
    let tracer = Tracer::new(world);
    pictures::fits(args.size, file)?;
    let mut view = render::of_file(&tracer, &coverage, &lightmaps, args.paths);
    let picture = pictures::paint(&scene, &mut view, camera, args.size, args.samples);
    let bytes = pictures::encode(&picture, file)?;
    let writing = signals::writing();
    files::write_whole(file, |out| out.write_all(&bytes))?;
    drop(writing);
    if !args.quiet {
        console::print(&summary::picture(file, picture.exposure))?;
    }
    Ok(ExitCode::SUCCESS)
}
