//! Option values: text to numbers and wishes, with messages that say what is expected.

use glam::{DVec3, UVec2, Vec3};
use luxel::{files::has_extension, transport::FormFactors};
use std::{
    fmt,
    path::{Path, PathBuf},
    time::Duration,
};

/// `--sky`.
#[derive(Clone, Debug, PartialEq)]
pub enum SkyWish {
    /// The same radiance everywhere.
    Uniform(Vec3),
    /// A picture, its factor and its rotation (degrees).
    Picture(PathBuf, f32, f32),
}

/// `--sun`; angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunWish {
    /// From +Z towards +X.
    pub azimuth: f64,
    /// Above the horizon.
    pub elevation: f64,
    /// Across the beam.
    pub lux: f32,
    /// Diameter of the disc.
    pub angle: f32,
}

impl fmt::Display for SkyWish {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            SkyWish::Uniform(l) => write!(f, "{},{},{}", l.x, l.y, l.z),
            SkyWish::Picture(file, scale, rotation) => write!(f, "{},{scale},{rotation}", file.display()),
        }
    }
}

impl fmt::Display for SunWish {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{},{},{},{}", self.azimuth, self.elevation, self.lux, self.angle)
    }
}

/// `--camera`.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraWish {
    /// A camera of the file.
    Named(String),
    /// From a point to a point of the world.
    At(DVec3, DVec3),
}

type Parsed<T> = Result<T, String>;

/// An estimator by its name, hemicubes with their resolution after a comma.
pub fn form_factors(text: &str) -> Parsed<FormFactors> {
    if let Some(number) = text.strip_prefix("hemicube,") {
        let resolution = number.parse().ok().filter(|n: &u32| n.is_multiple_of(2) && (4..=512).contains(n));
        let resolution = resolution.ok_or("a hemicube has an even number of pixels along its edge, 4 to 512")?;
        return Ok(FormFactors::Hemicube { resolution });
    }
    let names = FormFactors::ALL.map(FormFactors::name).join(", ");
    let named = FormFactors::ALL.into_iter().find(|f| f.name() == text);
    named.ok_or_else(|| format!("not one of {names}; hemicube may have its pixels along an edge after a comma"))
}

/// Texels per metre.
pub fn density(text: &str) -> Parsed<f64> {
    let t = number(text)?;
    if t > 0.0 && t <= 1e6 { Ok(t) } else { Err("expected a number above 0, at most 1000000".into()) }
}

/// Factor on lights.
pub fn light_scale(text: &str) -> Parsed<f32> {
    within(number(text)?, 0.0, 1e9, "the factor").map(|x| x as f32)
}

/// A time: `20s`, `1.5m`; without a unit, seconds.
pub fn time(text: &str) -> Parsed<Duration> {
    let (digits, unit) = match text.strip_suffix('m') {
        Some(minutes) => (minutes, 60.0),
        None => (text.strip_suffix('s').unwrap_or(text), 1.0),
    };
    within(number(digits)? * unit, 0.01, 86400.0, "the time in seconds").map(Duration::from_secs_f64)
}

/// A share, as a number or in per cent; above 0, at most 1.
pub fn share(text: &str) -> Parsed<f64> {
    let (digits, unit) = text.strip_suffix('%').map_or((text, 1.0), |digits| (digits, 0.01));
    let share = number(digits)? * unit;
    if share > 0.0 && share <= 1.0 { Ok(share) } else { Err("expected a share above 0, at most 100%".into()) }
}

/// Largest reflectance.
pub fn reflectance(text: &str) -> Parsed<f32> {
    let r = number(text)?;
    if r > 0.0 && r <= 0.9999 { Ok(r as f32) } else { Err("expected a number above 0, at most .9999".into()) }
}

/// A name pattern.
pub fn glob(text: &str) -> Parsed<String> {
    globset::Glob::new(text).map(|_| text.to_owned()).map_err(|e| e.to_string())
}

/// A PNG file's name.
pub fn png() -> impl clap::builder::TypedValueParser<Value = PathBuf> {
    use clap::builder::TypedValueParser;
    clap::builder::PathBufValueParser::new().try_map(|p| with_extension(p, "png"))
}

/// A picture's name, for the eye (PNG) or for reckoning (EXR).
pub fn picture() -> impl clap::builder::TypedValueParser<Value = PathBuf> {
    use clap::builder::TypedValueParser;
    clap::builder::PathBufValueParser::new().try_map(|path| match has_extension(&path, &["png", "exr"]) {
        true => Ok(path),
        false => Err("the name must end in .png or .exr"),
    })
}

/// Width and height, `960x540`.
pub fn size(text: &str) -> Parsed<UVec2> {
    let edge = |edge: &str| edge.parse().ok().filter(|n| (1..=16384).contains(n));
    let size = text.split_once('x').and_then(|(w, h)| Some(UVec2::new(edge(w)?, edge(h)?)));
    size.ok_or_else(|| "expected width and height, 1 to 16384, as in 960x540".into())
}

/// A GLB file's name.
pub fn glb() -> impl clap::builder::TypedValueParser<Value = PathBuf> {
    use clap::builder::TypedValueParser;
    clap::builder::PathBufValueParser::new().try_map(|p| with_extension(p, "glb"))
}

fn with_extension(path: PathBuf, extension: &str) -> Parsed<PathBuf> {
    if has_extension(&path, &[extension]) {
        Ok(path)
    } else {
        Err(format!("expected a file name that ends in .{extension}"))
    }
}

/// `R,G,B` or `FILE[,SCALE[,ROTATION]]`; the file's name may hold commas, as it ends in .exr or .hdr.
pub fn sky(text: &str) -> Parsed<SkyWish> {
    let picture = |name: &str| has_extension(Path::new(name), &["exr", "hdr"]);
    if picture(text) {
        return Ok(SkyWish::Picture(text.into(), 1.0, 0.0));
    }
    let (rest, last) = text.rsplit_once(',').unwrap_or(("", text));
    if picture(rest) {
        return Ok(SkyWish::Picture(rest.into(), scale(last)?, 0.0));
    }
    if let Some((rest, middle)) = rest.rsplit_once(',').filter(|(rest, _)| picture(rest)) {
        return Ok(SkyWish::Picture(rest.into(), scale(middle)?, number(last)? as f32 % 360.0));
    }
    let expected = "expected three numbers R,G,B, or a picture FILE[,SCALE[,ROTATION]] that ends in .exr or .hdr";
    let numbers = numbers(text).map_err(|e| format!("{expected} ({e})"))?;
    match numbers[..] {
        [r, g, b] => {
            let c = [r, g, b].map(|x| within(x, 0.0, 1e9, "the radiance").map(|x| x as f32));
            let [r, g, b] = c;
            Ok(SkyWish::Uniform(Vec3::new(r?, g?, b?)))
        }
        _ => Err(expected.into()),
    }
}

fn scale(text: &str) -> Parsed<f32> {
    within(number(text)?, 0.0, 1e9, "the sky's factor").map(|x| x as f32)
}

/// `AZIMUTH,ELEVATION,LUX[,ANGLE]`.
pub fn sun(text: &str) -> Parsed<SunWish> {
    let (azimuth, elevation, lux, angle) = match numbers(text)?[..] {
        [azimuth, elevation, lux] => (azimuth, elevation, lux, 0.53),
        [azimuth, elevation, lux, angle] => (azimuth, elevation, lux, angle),
        _ => return Err("expected AZIMUTH,ELEVATION,LUX or AZIMUTH,ELEVATION,LUX,ANGLE".into()),
    };
    Ok(SunWish {
        azimuth: azimuth % 360.0,
        elevation: within(elevation, -90.0, 90.0, "the elevation in degrees")?,
        lux: within(lux, 0.0, 1e9, "the illuminance in lux")? as f32,
        angle: within(angle, 0.0, 90.0, "the disc's diameter in degrees")? as f32,
    })
}

/// Six numbers are eye and target, everything else is a name.
pub fn camera(text: &str) -> Parsed<CameraWish> {
    match numbers(text) {
        Ok(n) if n.len() == 6 => {
            let (eye, target) = (DVec3::new(n[0], n[1], n[2]), DVec3::new(n[3], n[4], n[5]));
            let far = eye.abs().max(target.abs()).max_element() > 1e9;
            if far || (target - eye).length() < 1e-9 {
                return Err("expected an eye and another target, at most 1e9 metres away".into());
            }
            Ok(CameraWish::At(eye, target))
        }
        Ok(n) if n.len() > 1 => Err(format!("expected six numbers, eye and target, not {}", n.len())),
        _ => Ok(CameraWish::Named(text.to_owned())),
    }
}

fn numbers(text: &str) -> Parsed<Vec<f64>> {
    text.split(',').map(number).collect()
}

fn number(text: &str) -> Parsed<f64> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{}` is not a finite number", text.trim())),
    }
}

fn within(x: f64, low: f64, high: f64, what: &str) -> Parsed<f64> {
    if (low..=high).contains(&x) { Ok(x) } else { Err(format!("{what} must be {low} to {high}, not {x}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skies() {
        let picture = |name: &str, scale, rotation| Ok(SkyWish::Picture(name.into(), scale, rotation));
        assert_eq!(sky("1,.5,2e3"), Ok(SkyWish::Uniform(Vec3::new(1.0, 0.5, 2000.0))));
        assert_eq!(sky("a.hdr"), picture("a.hdr", 1.0, 0.0));
        assert_eq!(sky("C:/my sky, noon.EXR,2"), picture("C:/my sky, noon.EXR", 2.0, 0.0));
        assert_eq!(sky("a,1,2.hdr,.5,-90"), picture("a,1,2.hdr", 0.5, -90.0));
        assert_eq!(sky("a.hdr,2.exr"), picture("a.hdr,2.exr", 1.0, 0.0));
        for wrong in
            ["", "1", "1,2", "1,2,3,4", "-1,0,0", "nan,0,0", "inf,0,0", "a.png", "a.hdr,x", "a.hdr,-1", "a.hdr,1,2,3"]
        {
            assert!(sky(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn wishes_are_read_as_they_are_written() {
        for text in ["1,0.5,2000", "C:/my sky, noon.EXR,2,-90"] {
            let wish = sky(text).unwrap();
            assert_eq!(sky(&wish.to_string()), Ok(wish));
        }
        let wish = sun("-30,45.1,1e5").unwrap();
        assert_eq!(sun(&wish.to_string()), Ok(wish));
    }

    #[test]
    fn times() {
        assert_eq!((time("20s"), time("1.5m")), (Ok(Duration::from_secs(20)), Ok(Duration::from_secs(90))));
        assert_eq!(time(".5"), Ok(Duration::from_millis(500)));
        for wrong in ["", "0", "-1s", "nan", "1h", "1e9"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shares() {
        assert_eq!((share("2%"), share(".02"), share("100%")), (Ok(0.02), Ok(0.02), Ok(1.0)));
        for wrong in ["", "%", "0", "-1%", "101%", "nan", "2 %%"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn suns() {
        let expected = SunWish { azimuth: -30.0, elevation: 45.0, lux: 1e5, angle: 0.53 };
        assert_eq!(sun("-30,45,1e5"), Ok(expected));
        assert_eq!(sun("-30, 45, 1e5, 0"), Ok(SunWish { angle: 0.0, ..expected }));
        for wrong in ["", "1,2", "1,91,3", "1,2,-3", "1,2,3,91", "1,2,3,4,5", "a,2,3", "nan,2,3"] {
            assert!(sun(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn cameras() {
        assert_eq!(camera("-1,0,0,0,0,2"), Ok(CameraWish::At(DVec3::NEG_X, DVec3::new(0.0, 0.0, 2.0))));
        assert_eq!(camera("Main, front"), Ok(CameraWish::Named("Main, front".into())));
        assert_eq!(camera("2"), Ok(CameraWish::Named("2".into())));
        assert!(camera("1,2,3,1,2,3").is_err() && camera("1,2,3").is_err());
    }
}
