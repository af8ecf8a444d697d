//! Options of `luxel bake`.

use super::{
    super::values::{self, CameraWish},
    Light, named, threads,
};
use clap::{ArgGroup, builder::RangedU64ValueParser};
use luxel::{
    atlas::{PAGE_EDGES, Unwrap},
    bake::Quality,
    lightmaps::Content,
    radiosity::Solver,
    transport::{FormFactors, Receivers},
};
use std::{path::PathBuf, time::Duration};

const EXAMPLES: &str = "\
Examples:
  luxel bake scene.glb
      writes scene.lit.glb, with one lightmap of 1024 x 1024
  luxel bake scene.gltf -o lit/scene.glb --texels-per-meter 32 --sky sky.hdr,1.5,90 --sun 40,35,100000
      as many pages as 32 texels per metre need, under a picture of the sky and a sun
  luxel bake scene.glb --report - --quiet > report.json

What is refused ends with exit code 2 and the reason (1: too little memory). No option keeps what texels see of each
other for a bake in another light: that is for the library.

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
    /// added, or made larger for a node that does not fit; nodes that would need over 256 are refused [default: 1024]
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

    /// --error by a name: preview is 10%, medium 3%, high 1%. Refuses --error
    #[arg(long, value_name = "NAME", help_heading = "Effort", value_parser = named(Quality::ALL, Quality::name),
          conflicts_with_all = ["rays", "bounces"])]
    pub quality: Option<Quality>,

    /// Rays a texel for indirect light, 1 to 65536, and twice as many shadow rays a source, 8 at least, fewer beyond 64. Up to 64, or up to 2^28 in all, neighbours use each other's rays, which
    /// is worth four to eight times as many; texels with too few neighbours for it have 4 N, or 16 N and 64 N where rays differ much. A fixed effort: refuses --error, --time and --quality [with --bounces: 64]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<u32>::new().range(1..=65536), allow_negative_numbers = true)]
    pub rays: Option<u32>,

    /// Bounces after which light is dropped, 0 to 65536, whatever the solver; 0: direct light only, of emissive surfaces
    /// and the sky, too. Refuses --error, --time and --quality: audits count all light [default: all bounces, with a bound
    /// on the error]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = RangedU64ValueParser::<u32>::new().range(0..=65536))]
    pub bounces: Option<u32>,

    /// Threads, 1 to 1024, but never more than four a processor; the result does not depend on them [default: one a
    /// processor]
    #[arg(long, value_name = "N", help_heading = "Effort",
          value_parser = threads(), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    #[command(flatten)]
    pub light: Light,

    /// What the maps hold: all light, first-hit light of lights and sun, or everything else
    #[arg(long, value_name = "NAME", help_heading = "Light", default_value = Content::default().name(),
          value_parser = named(Content::ALL, Content::name))]
    pub content: Content,

    /// Who measures how much texels see of each other: rays; hemicube, with N pixels along its edge, even, 4 to 512, one ray
    /// each (64 if N is left out); analytic, closed forms between flat faces. The last two are what rays are held against.
    /// hemicube refuses --error, --time, --quality and --rays: its effort is N. analytic refuses --error, --time and
    /// --quality: its effort cannot grow; it refuses smooth normals, more than 2048 patches, with the backs that rays meet,
    /// and more than 3072 pieces of triangles in texels
    #[arg(long, value_name = "rays | hemicube[,N] | analytic", help_heading = "Method",
          default_value_t = FormFactors::default(), value_parser = values::form_factors)]
    pub form_factors: FormFactors,

    /// Who solves for the light of all bounces; the result is the same within the error bound. direct refuses more than 4096
    /// receivers, with the backs that rays meet; conjugate-gradient refuses --receivers auto: it has no symmetric form. With
    /// --bounces there is nothing to solve
    #[arg(long, value_name = "NAME", help_heading = "Method", default_value = Solver::default().name(),
          value_parser = named(Solver::ALL, Solver::name))]
    pub solver: Solver,

    /// Texels at which indirect light is measured: all, or those near other surfaces, at corners and where the surface
    /// bends; between them it is interpolated. Direct light is measured at all texels in any case
    #[arg(long, value_name = "NAME", help_heading = "Method", default_value = Receivers::default().name(),
          value_parser = named(Receivers::ALL, Receivers::name))]
    pub receivers: Receivers,

    /// Each texel uses its own rays only, not those of its neighbours, as it does without --form-factors rays
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

pub(super) fn edge() -> RangedU64ValueParser<u32> {
    let (least, most) = PAGE_EDGES.into_inner();
    RangedU64ValueParser::new().range(u64::from(least)..=u64::from(most))
}

/// The layouts are made by one of these, or are the author's.
pub(super) fn unwrappers() -> impl Iterator<Item = Unwrap> {
    Unwrap::ALL.into_iter().filter(|u| *u != Unwrap::Keep)
}
