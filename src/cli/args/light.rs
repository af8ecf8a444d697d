//! The light under which a scene is baked, for the commands that bake.

use super::super::values::{self, SkyWish, SunWish};

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Light")]
pub struct Light {
    /// Radiance of the sky, one colour or an equirectangular picture (.exr, .hdr; +Y up, centre towards -Z), with a
    /// factor and a rotation about +Y in degrees [default: black]
    #[arg(long, value_name = "R,G,B | FILE[,SCALE[,ROTATION]]", value_parser = values::sky, allow_hyphen_values = true)]
    pub sky: Option<SkyWish>,

    /// A sun: azimuth from +Z towards +X and elevation above the horizon in degrees, lux across the beam, and the
    /// disc's diameter in degrees [default: none; ANGLE .53]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,LUX[,ANGLE]", value_parser = values::sun, allow_hyphen_values = true)]
    pub sun: Option<SunWish>,

    /// Factor on the file's punctual lights, 0 to 1e9
    #[arg(long, value_name = "X", default_value = "1", value_parser = values::light_scale, allow_hyphen_values = true)]
    pub light_scale: f32,

    /// Largest diffuse reflectance, above 0, at most .9999; more is capped
    #[arg(long, value_name = "R", default_value = ".98", value_parser = values::reflectance, allow_hyphen_values = true)]
    pub max_reflectance: f32,
}
