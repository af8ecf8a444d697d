//! Options of `luxel chart`.

use super::{
    super::values,
    Light,
    bake::{edge, unwrappers},
    named, threads,
};
use clap::ArgGroup;
use luxel::{atlas::Unwrap, chart::Sweep};
use std::{path::PathBuf, time::Duration};

const EXAMPLES: &str = "\
Examples:
  luxel chart scene.glb -o charts
  luxel chart scene.glb -o charts --budget 30m --resolution 512 --sky 1,1,1.2
  luxel chart scene.glb -o charts --sweep solvers
  luxel chart scene.glb -o charts --keep-uv --truth long.lit.glb --peers peers.json

DIR gets chart.json, with a point for each bake, and charts as SVG and PNG. The first bake and the truth are done in any
case; sweeps follow in the order of their worth, until no further one fits into the budget.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the input is missing, invalid or unsupported; 130 interrupted, nothing is
written.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
#[command(group = ArgGroup::new("charted").args(["keep_uv", "unwrap"]))]
pub struct Chart {
    /// The scene, .glb or .gltf
    #[arg(value_name = "SCENE")]
    pub input: PathBuf,

    /// The folder of the charts; it is made if it is not there
    #[arg(short, long = "output", value_name = "DIR")]
    pub output: PathBuf,

    /// Time in which sweeps begin, 90s or 10m
    #[arg(long, value_name = "TIME", help_heading = "Effort", default_value = "10m", value_parser = values::time,
          allow_hyphen_values = true)]
    pub budget: Duration,

    /// Only this sweep; may be repeated [default: all]
    #[arg(long, value_name = "NAME", help_heading = "Effort", value_parser = named(Sweep::ALL, Sweep::name))]
    pub sweep: Vec<Sweep>,

    /// Count processor seconds over threads instead of seconds on the wall: for machines that do other work, too
    #[arg(long, help_heading = "Effort")]
    pub processor_time: bool,

    /// Threads, 1 to 1024, as for luxel bake [default: one a processor]
    #[arg(long, value_name = "N", help_heading = "Effort", value_parser = threads(), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// A baked file of the same scene and layout that is taken for the truth [default: a long audit]
    #[arg(long, value_name = "BAKED", help_heading = "Truth")]
    pub truth: Option<PathBuf>,

    /// Figures of other tools on this scene, drawn beside: {"note", "curves": [{"name", "points": [{"label", "seconds",
    /// "error", "dark", "border"}]}]}
    #[arg(long, value_name = "FILE.json", help_heading = "Truth")]
    pub peers: Option<PathBuf>,

    /// Edge of the page, as for luxel bake; sweeps of texels also take multiples of it [default: 1024]
    #[arg(long, value_name = "N", help_heading = "Scene", value_parser = edge(), allow_negative_numbers = true)]
    pub resolution: Option<u32>,

    /// Use the author's TEXCOORD_1 as the lightmap's layout
    #[arg(long, help_heading = "Scene")]
    pub keep_uv: bool,

    /// Who makes the layout, as for luxel bake [default: uvunwrap]
    #[arg(long, value_name = "NAME", help_heading = "Scene", value_parser = named(unwrappers(), Unwrap::name))]
    pub unwrap: Option<Unwrap>,

    /// Leave out nodes, as for luxel bake; may be repeated
    #[arg(long, value_name = "GLOB", help_heading = "Scene", value_parser = values::glob)]
    pub exclude: Vec<String>,

    #[command(flatten)]
    pub light: Light,

    /// Show no progress; warnings and errors are still shown
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
}
