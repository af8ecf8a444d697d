//! Options of `luxel render`.

use super::{
    super::values::{self, CameraWish},
    Baked, threads,
};
use clap::builder::RangedU64ValueParser;
use glam::UVec2;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  luxel render scene.lit.glb -o scene.png
  luxel render scene.lit.glb --camera Entrance --size 1920x1080 -o entrance.png
  luxel render scene.lit.glb --camera 5,1.6,5,8,1.4,8 --samples 8 -o corner.exr

Matt surfaces are looked up in the lightmap, what metals mirror is traced. Dielectrics are matt, as
baked: tracing their gloss takes 30 to 60 times as long and moves pixels by a median of 1 %.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the input is missing, invalid or not baked; 130 interrupted.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Render {
    #[command(flatten)]
    pub baked: Baked,

    /// The picture: .png, exposed for the eye, or .exr, radiance in 32 bits
    #[arg(short, long, value_name = "FILE.png | FILE.exr", required = true, value_parser = values::picture())]
    pub output: PathBuf,

    /// The view: a camera of the file by its name, or eye and target in metres [default: the file's first camera, or one
    /// that shows much of the scene]
    #[arg(long, value_name = "NAME | X,Y,Z,X,Y,Z", value_parser = values::camera, allow_hyphen_values = true)]
    pub camera: Option<CameraWish>,

    /// Width and height in pixels, 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = values::size)]
    pub size: UVec2,

    /// Rays a pixel and axis, 1 to 32: 4 are 16 rays
    #[arg(long, value_name = "N", default_value = "4",
          value_parser = RangedU64ValueParser::<u32>::new().range(1..=32), allow_negative_numbers = true)]
    pub samples: u32,

    /// Paths of each ray where it meets metal, 1 to 65536
    #[arg(long, value_name = "N", default_value = "16",
          value_parser = RangedU64ValueParser::<u32>::new().range(1..=1 << 16), allow_negative_numbers = true)]
    pub paths: u32,

    /// Threads, 1 to 1024, as for luxel bake [default: one a processor]
    #[arg(long, value_name = "N", value_parser = threads(), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// Tell nothing but warnings and errors
    #[arg(long)]
    pub quiet: bool,
}
