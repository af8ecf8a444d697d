//! What the commands that open a baked file ask: which, and under which light it was baked.

use super::super::values::{self, SkyWish, SunWish};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Baked {
    /// The baked scene, .glb or .gltf
    #[arg(value_name = "BAKED")]
    pub input: PathBuf,

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

    /// Nodes that were left out of the bake; may be repeated [default: as the file says]
    #[arg(long, value_name = "GLOB", help_heading = "Light", value_parser = values::glob)]
    pub exclude: Vec<String>,
}
