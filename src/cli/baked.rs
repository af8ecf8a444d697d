//! A baked file, opened: its scene under the light of the bake, and its lightmap.

use super::{
    args,
    bake::Warnings,
    lights,
    values::{self, SkyWish},
};
use luxel::{
    atlas::Atlas,
    error::{Error, Result},
    files,
    gltf::{self, Document, Record},
    lightmaps::Lightmaps,
    scene::Scene,
};
use std::path::{Path, PathBuf};

/// What a baked file holds.
pub struct Opened {
    /// The file.
    pub document: Document,
    /// What it says of its bake.
    pub record: Record,
    /// Its scene, lit as in the bake.
    pub scene: Scene,
    /// Where its surfaces lie on the pages.
    pub atlas: Atlas,
    /// The pages.
    pub lightmaps: Lightmaps,
}

/// Opens a baked file; what is typed takes the place of what the file says.
pub fn open(args: &args::Baked, said: &mut Warnings) -> Result<Opened> {
    let document = gltf::open(&args.input)?;
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
    let reading = gltf::ReadOptions { exclude, light_scale };
    let gltf::Input { document, mut scene, warnings } = gltf::read_scene(document, &reading)?;
    said.add(warnings);
    let sky = args.sky.clone().map_or_else(|| recorded_sky(&record, &args.input), |s| Ok(Some(s)))?;
    let parsed = |text: &String| values::sun(text).map_err(|e| misread(&args.input, "sun", &e));
    let sun = args.sun.map_or_else(|| record.sun.as_ref().map(parsed).transpose(), |s| Ok(Some(s)))?;
    said.add(lights::add(&mut scene, sky.as_ref(), sun.as_ref())?);
    let gltf::Bound { atlas, lightmaps } = gltf::bound(&document, &scene)?;
    Ok(Opened { document, record, scene, atlas, lightmaps })
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
