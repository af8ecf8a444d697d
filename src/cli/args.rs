//! The options, their help and their ranges.

use super::values::{self, CameraWish, SkyWish, SunWish};
use clap::{
    ArgGroup, Parser, Subcommand,
    builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser},
};
use luxel::{
    atlas::{PAGE_EDGES, Unwrap},
    lightmaps::Content,
    radiosity::Solver,
};
use std::{path::PathBuf, time::Duration};

/// Bakes global illumination into glTF scenes: glTF in, the same glTF with HDR lightmaps out.
#[derive(Debug, Parser)]
#[command(name = "luxel", version, arg_required_else_help = true, after_help = EXAMPLE)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLE: &str = "Example: luxel bake scene.glb --sun 40,35,100000 --sky 4000,5000,7000 --preview scene.png";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bake the light of a scene into lightmaps
    Bake(Box<Bake>),
    /// Measure how wrong the lightmaps of a baked file are, by a path tracer that knows nothing of how they were made
    Audit(Box<Audit>),
}

const EXAMPLES: &str = "\
Examples:
  luxel bake scene.glb
      writes scene.lit.glb, with one lightmap of 1024 x 1024
  luxel bake scene.gltf -o lit/scene.glb --texels-per-meter 32 --sky sky.hdr,1.5,90 --sun 40,35,100000
      as many pages as 32 texels per metre need, under a picture of the sky and a sun
  luxel bake scene.glb --report - --quiet > report.json

Exit codes: 0 done; 1 failed, or done with warnings under --strict; 2 wrong usage; 3 the input is missing, invalid or
unsupported; 4 done, but the error that was typed is not reached; 130 interrupted.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
#[command(group = ArgGroup::new("size").args(["resolution", "texels_per_meter"]))]
#[command(group = ArgGroup::new("layout").args(["keep_uv", "unwrap"]))]
pub struct Bake {
    /// The scene, .glb or .gltf
    #[arg(value_name = "IN")]
    pub input: PathBuf,

    /// The lit scene, .glb or .gltf; it may be IN [default: IN.lit.glb or IN.lit.gltf]
    #[arg(short, long = "output", value_name = "OUT")]
    pub output: Option<PathBuf>,

    /// One page of N x N texels, the density chosen to fill it, 16 to 32768; where it cannot hold all charts, pages are
    /// added, or made larger for a node that does not fit [default: 1024]
    #[arg(long, value_name = "N", help_heading = "Size", value_parser = edge(),
          allow_negative_numbers = true)]
    pub resolution: Option<u32>,

    /// Texels per metre, above 0, on as many pages as needed
    #[arg(long, value_name = "T", help_heading = "Size", value_parser = values::density, allow_hyphen_values = true)]
    pub texels_per_meter: Option<f64>,

    /// Largest edge of a page in texels, 16 to 32768 [default: 4096, or --resolution if that is more]
    #[arg(long, value_name = "N", help_heading = "Size", value_parser = edge(),
          allow_negative_numbers = true)]
    pub page_size: Option<u32>,

    /// Use the author's TEXCOORD_1 as the lightmap's layout
    #[arg(long, help_heading = "Size")]
    pub keep_uv: bool,

    /// Who makes the layout; xatlas needs the cargo feature of that name [default: uvunwrap]
    #[arg(long, value_name = "NAME", help_heading = "Size", value_parser = named(unwrappers(), Unwrap::name))]
    pub unwrap: Option<Unwrap>,

    /// Leave out nodes whose name matches, with all that is below them (*, ?, [a-z], {a,b}); may be repeated
    #[arg(long, value_name = "GLOB", help_heading = "Size", value_parser = values::glob)]
    pub exclude: Vec<String>,

    /// Error of the lightmap's texels to reach, root mean square over the mean: 2% or .02, above 0. A path tracer that
    /// knows nothing of the bake measures it; if it is not reached, the exit code is 4 (0, with a warning, if this option
    /// was not typed) [default: 2%]
    #[arg(long, value_name = "E", help_heading = "Effort", value_parser = values::share, allow_hyphen_values = true,
          conflicts_with_all = ["quality", "rays", "bounces"])]
    pub error: Option<f64>,

    /// Refine until the time is up, 60s or 10m, or --error or --quality is reached, if one is given, too
    #[arg(long, value_name = "TIME", help_heading = "Effort", value_parser = values::time, allow_hyphen_values = true,
          conflicts_with_all = ["rays", "bounces"])]
    pub time: Option<Duration>,

    /// --error by a name: preview is 10%, medium 3%, high 1%
    #[arg(long, value_name = "NAME", help_heading = "Effort", value_parser = named(Quality::ALL, Quality::name),
          conflicts_with_all = ["rays", "bounces"])]
    pub quality: Option<Quality>,

    /// Rays a texel for indirect light, 1 to 65536, instead of an error to reach. Up to 64, and up to 2^26 in all,
    /// neighbours use each other's rays, which is worth four to eight times as many [with --bounces: 64]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<u32>::new().range(1..=65536), allow_negative_numbers = true)]
    pub rays: Option<u32>,

    /// Bounces after which light is dropped, 0 to 65536, whatever the solver; 0: direct light only, of emissive surfaces
    /// and the sky, too [default: all bounces, with a bound on the error]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<u32>::new().range(0..=65536))]
    pub bounces: Option<u32>,

    /// Threads, 1 to 1024, but never more than four a processor; the result does not depend on them [default: one a
    /// processor]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// Radiance of the sky, one colour or an equirectangular picture (.exr, .hdr; +Y up, centre towards -Z), with a
    /// factor and a rotation about +Y in degrees [default: black]
    #[arg(long, value_name = "R,G,B | FILE[,SCALE[,ROTATION]]", help_heading = "Light",
          value_parser = values::sky, allow_hyphen_values = true)]
    pub sky: Option<SkyWish>,

    /// A sun: azimuth from +Z towards +X and elevation above the horizon in degrees, lux across the beam, and the
    /// disc's diameter in degrees [default: none; ANGLE .53]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,LUX[,ANGLE]", help_heading = "Light",
          value_parser = values::sun, allow_hyphen_values = true)]
    pub sun: Option<SunWish>,

    /// Factor on the file's punctual lights, 0 to 1e9
    #[arg(long, value_name = "X", help_heading = "Light", default_value = "1",
          value_parser = values::light_scale, allow_hyphen_values = true)]
    pub light_scale: f32,

    /// Largest diffuse reflectance, above 0, at most .9999; more is capped
    #[arg(long, value_name = "R", help_heading = "Light", default_value = ".98",
          value_parser = values::reflectance, allow_hyphen_values = true)]
    pub max_reflectance: f32,

    /// What the maps hold: all light, first-hit light of lights and sun, or everything else
    #[arg(long, value_name = "NAME", help_heading = "Light", default_value = Content::default().name(),
          value_parser = named(Content::ALL, Content::name))]
    pub content: Content,

    /// Who solves for the light of all bounces; the result is the same within the error bound
    #[arg(long, value_name = "NAME", help_heading = "Method", default_value = Solver::default().name(),
          value_parser = named(Solver::ALL, Solver::name))]
    pub solver: Solver,

    /// Each texel uses its own rays only, not those of its neighbours
    #[arg(long, help_heading = "Method")]
    pub no_reuse: bool,

    /// Also write a picture of the baked scene, 960 x 540
    #[arg(long, value_name = "FILE.png", help_heading = "Output", value_parser = values::png())]
    pub preview: Option<PathBuf>,

    /// The preview's view: a camera of the file by its name, or eye and target in metres [default: the file's first
    /// camera, or one that shows much of the scene]
    #[arg(long, value_name = "NAME | X,Y,Z,X,Y,Z", help_heading = "Output", requires = "preview",
          value_parser = values::camera, allow_hyphen_values = true)]
    pub camera: Option<CameraWish>,

    /// Also write a file that looks lit in every glTF viewer: unlit materials with the light in PNG textures
    #[arg(long, value_name = "FILE.glb", help_heading = "Output", value_parser = values::glb())]
    pub flat: Option<PathBuf>,

    /// Also write the lightmaps as EXR files and a JSON beside OUT
    #[arg(long, help_heading = "Output")]
    pub sidecar: bool,

    /// Take the baked lights out of the file, for loaders that do not know LUXEL_lightmap
    #[arg(long, help_heading = "Output")]
    pub strip_lights: bool,

    /// Store 32 bits a channel instead of 16
    #[arg(long, help_heading = "Output")]
    pub float: bool,

    /// Write the report as JSON to a file, or to stdout (-) instead of the summary
    #[arg(long, value_name = "FILE.json | -", help_heading = "Output")]
    pub report: Option<PathBuf>,

    /// Also measure how wrong the lightmap is, for a fifth of the bake's time or 2 s, whatever is more (see luxel audit);
    /// a bake to a target does so anyway
    #[arg(long, help_heading = "Output")]
    pub audit: bool,

    /// Show no progress; warnings and errors are still shown
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,

    /// End with exit code 1 if there are warnings; the output is written all the same
    #[arg(long, help_heading = "Output")]
    pub strict: bool,
}

const AUDIT_EXAMPLES: &str = "\
Examples:
  luxel audit scene.lit.glb
  luxel audit scene.lit.glb --time 60s --report audit.json
  luxel audit scene.lit.glb --points 2000
      the same figures on any machine

Errors are root mean squares over the mean; in brackets their nominal 95 % confidence intervals.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the input is missing, invalid or not baked; 130 interrupted.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = AUDIT_EXAMPLES)]
#[command(group = ArgGroup::new("effort").args(["points", "time"]))]
pub struct Audit {
    /// The baked scene, .glb or .gltf
    #[arg(value_name = "BAKED")]
    pub input: PathBuf,

    /// Points on the surface, 10 to 16777216
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<u32>::new().range(10..=1 << 24), allow_negative_numbers = true)]
    pub points: Option<u32>,

    /// As many points as fit into a time, 20s or 1.5m [default: 10s]
    #[arg(long, value_name = "TIME", help_heading = "Effort", value_parser = values::time, allow_hyphen_values = true)]
    pub time: Option<Duration>,

    /// Other seeds draw other points
    #[arg(long, value_name = "N", help_heading = "Effort", default_value = "0")]
    pub seed: u32,

    /// Threads, 1 to 1024, as for luxel bake [default: one a processor]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<usize>::new().range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// The sky of the bake, as for luxel bake [default: as the file says]
    #[arg(long, value_name = "R,G,B | FILE[,SCALE[,ROTATION]]", help_heading = "Light",
          value_parser = values::sky, allow_hyphen_values = true)]
    pub sky: Option<SkyWish>,

    /// The sun of the bake, as for luxel bake [default: as the file says]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,LUX[,ANGLE]", help_heading = "Light",
          value_parser = values::sun, allow_hyphen_values = true)]
    pub sun: Option<SunWish>,

    /// Factor on the file's punctual lights [default: as the file says]
    #[arg(long, value_name = "X", help_heading = "Light", value_parser = values::light_scale,
          allow_hyphen_values = true)]
    pub light_scale: Option<f32>,

    /// Largest diffuse reflectance of a point [default: as the file says]
    #[arg(long, value_name = "R", help_heading = "Light", value_parser = values::reflectance,
          allow_hyphen_values = true)]
    pub max_reflectance: Option<f32>,

    /// Nodes that were left out of the bake; may be repeated [default: as the file says]
    #[arg(long, value_name = "GLOB", help_heading = "Light", value_parser = values::glob)]
    pub exclude: Vec<String>,

    /// Write the figures as JSON to a file, or to stdout (-) instead of the summary
    #[arg(long, value_name = "FILE.json | -", help_heading = "Output")]
    pub report: Option<PathBuf>,

    /// Show no progress; warnings and errors are still shown
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
}

/// Targets by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    Preview,
    Medium,
    High,
}

impl Quality {
    pub const ALL: [Quality; 3] = [Quality::Preview, Quality::Medium, Quality::High];

    pub fn name(self) -> &'static str {
        match self {
            Quality::Preview => "preview",
            Quality::Medium => "medium",
            Quality::High => "high",
        }
    }

    /// Relative error.
    pub fn error(self) -> f64 {
        match self {
            Quality::Preview => 0.1,
            Quality::Medium => 0.03,
            Quality::High => 0.01,
        }
    }
}

fn edge() -> RangedU64ValueParser<u32> {
    let (least, most) = PAGE_EDGES.into_inner();
    RangedU64ValueParser::new().range(u64::from(least)..=u64::from(most))
}

/// One of a closed set, by its name.
fn named<T: Copy + Send + Sync + 'static>(
    all: impl IntoIterator<Item = T>,
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let all: Vec<T> = all.into_iter().collect();
    let parser = PossibleValuesParser::new(all.iter().map(|t| name(*t)));
    parser.try_map(move |text| all.iter().copied().find(|t| name(*t) == text).ok_or("no such name"))
}

/// The layouts are made by one of these, or are the author's.
fn unwrappers() -> impl Iterator<Item = Unwrap> {
    Unwrap::ALL.into_iter().filter(|u| *u != Unwrap::Keep)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(options: &[&str]) -> Result<Bake, clap::Error> {
        match Args::try_parse_from(["luxel", "bake", "a.glb"].iter().chain(options))?.command {
            Command::Bake(bake) => Ok(*bake),
            Command::Audit(_) => unreachable!("it says bake"),
        }
    }

    #[test]
    fn the_options_are_sound() {
        Args::command().debug_assert();
    }

    #[test]
    fn defaults_are_those_of_the_library() {
        let (bake, options) = (parse(&[]).unwrap(), luxel::bake::Options::default());
        assert_eq!((bake.rays, !bake.no_reuse), (None, options.transport.reuse));
        assert_eq!(bake.max_reflectance, options.max_reflectance);
        assert_eq!((bake.solver, bake.bounces), (options.radiosity.solver, options.radiosity.bounces));
        assert_eq!(bake.content, options.content);
    }

    #[test]
    fn what_is_out_of_range_is_wrong_usage() {
        let wrong: &[&[&str]] = &[
            &["--resolution", "15"],
            &["--page-size", "8"],
            &["--resolution", "32769"],
            &["--resolution", "1024", "--texels-per-meter", "4"],
            &["--texels-per-meter", "0"],
            &["--texels-per-meter", "nan"],
            &["--texels-per-meter", "-3"],
            &["--keep-uv", "--unwrap", "xatlas"],
            &["--unwrap", "blender"],
            &["--exclude", "[a"],
            &["--rays", "0"],
            &["--rays", "65537"],
            &["--threads", "0"],
            &["--max-reflectance", "1"],
            &["--light-scale", "-1"],
            &["--light-scale", "inf"],
            &["--content", "half"],
            &["--camera", "Main"],
            &["--preview", "a.jpg"],
            &["--flat", "a.gltf"],
            &["--bounces", "-1"],
            &["--bounces", "1.5"],
            &["--bounces", "65537"],
            &["--bounces", "all"],
            &["--solver", "magic"],
            &["--solver", "Jacobi"],
            &["--solver", ""],
            &["--error", "0"],
            &["--error", "2%", "--rays", "4"],
            &["--time", "0"],
            &["--quality", "best"],
            &["--quality", "high", "--bounces", "2"],
            &["b.glb"],
        ];
        for options in wrong {
            let error = parse(options).expect_err(&format!("{options:?}"));
            assert_eq!(error.exit_code(), 2, "{options:?}");
        }
    }

    #[test]
    fn every_member_of_a_set_has_a_name() {
        for solver in Solver::ALL {
            assert_eq!(parse(&["--solver", solver.name()]).unwrap().solver, solver);
        }
        for content in Content::ALL {
            assert_eq!(parse(&["--content", content.name()]).unwrap().content, content);
        }
        for unwrap in unwrappers() {
            assert_eq!(parse(&["--unwrap", unwrap.name()]).unwrap().unwrap, Some(unwrap));
        }
        assert!(parse(&["--unwrap", Unwrap::Keep.name()]).is_err());
    }

    #[test]
    fn the_help_names_the_limits_of_pages() {
        let (least, most) = PAGE_EDGES.into_inner();
        let help = Args::command().find_subcommand_mut("bake").unwrap().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(help.matches(&format!("{least} to {most}")).count(), 2, "{help}");
    }

    #[test]
    fn negative_numbers_are_values() {
        for option in ["--resolution", "--page-size", "--rays", "--threads"] {
            let said = parse(&[option, "-1"]).unwrap_err().to_string();
            assert!(said.contains(&format!("invalid value '-1' for '{option}")), "{said}");
        }
        let bake = parse(&["--sun", "-90,45,1000", "--preview", "a.png", "--camera", "-1,0,0,0,0,0"]).unwrap();
        assert!(bake.sun.is_some() && bake.camera.is_some());
    }
}
