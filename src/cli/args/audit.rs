//! Options of `luxel audit`.

use super::{super::values, Baked, threads};
use clap::{ArgGroup, builder::RangedU64ValueParser};
use std::{path::PathBuf, time::Duration};

const EXAMPLES: &str = "\
Examples:
  luxel audit scene.lit.glb
  luxel audit scene.lit.glb --time 60s --report audit.json
  luxel audit scene.lit.glb --points 2000
      the same figures on any machine

Errors are root mean squares over the mean; in brackets their nominal 95 % confidence intervals.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the input is missing, invalid or not baked; 130 interrupted.";

#[derive(Debug, clap::Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
#[command(group = ArgGroup::new("effort").args(["points", "time"]))]
pub struct Audit {
    #[command(flatten)]
    pub baked: Baked,

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
          value_parser = threads(), allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// Largest diffuse reflectance of a point [default: as the file says]
    #[arg(long, value_name = "R", help_heading = "Light", value_parser = values::reflectance,
          allow_hyphen_values = true)]
    pub max_reflectance: Option<f32>,

    /// Write the figures as JSON to a file, or to stdout (-) instead of the summary
    #[arg(long, value_name = "FILE.json | -", help_heading = "Output")]
    pub report: Option<PathBuf>,

    /// Show no progress; warnings and errors are still shown
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
}
