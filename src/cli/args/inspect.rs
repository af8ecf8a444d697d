//! Options of `luxel inspect`.

use super::{
    super::values::{self, CameraWish},
    Baked, threads,
};
use clap::builder::RangedU64ValueParser;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  luxel inspect scene.lit.glb -o pictures
  luxel inspect scene.lit.glb -o pictures --points 20000

Writes page0.NAME.png for every page and view.NAME.png on the surface, NAME being density, charts, overlaps, validity,
receivers, rows and error.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the input is missing, invalid or not baked; 130 interrupted.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Inspect {
    #[command(flatten)]
    pub baked: Baked,

    /// The folder for the pictures; it is made if it is missing
    #[arg(short, long, value_name = "DIR", required = true)]
    pub output: PathBuf,

    /// The view: a camera of the file by its name, or eye and target in metres [default: the file's first camera, or one
    /// that shows much of the scene]
    #[arg(long, value_name = "NAME | X,Y,Z,X,Y,Z", value_parser = values::camera, allow_hyphen_values = true)]
    pub camera: Option<CameraWish>,

    /// Texels at which the error is estimated, about, 10 to 16777216
    #[arg(long, value_name = "N", default_value = "4096",
          value_parser = RangedU64ValueParser::<u32>::new().range(10..=1 << 24), allow_negative_numbers = true)]
    pub points: u32,

    /// Threads, 1 to 1024, as for luxel bake [default: one a processor]
    #[arg(long, value_name = "N", value_parser = threads(), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// Tell nothing but warnings and errors
    #[arg(long)]
    pub quiet: bool,
}
