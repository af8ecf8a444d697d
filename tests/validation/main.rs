//! The suite of exact answers: builds every case of a validation file from its family and inputs, and compares.
//!
//! The file is `tests/data/validation.json`, or the one that LUXEL_VALIDATION names. One line a case; families that
//! are not known here are skipped and listed. What a comparison allows is the sum of three things, each printed:
//! * the tolerance of the expected value itself;
//! * 3 sigma of the bake's own sampling. A share F measured with N rays has sigma = sqrt(F (1 - F) / N), a mean over n
//!   texels 1 / sqrt(n) of it. Where light comes by several ways, sigma is read from neighbouring texels (second
//!   differences); the smaller of the two holds;
//! * what the shape or the texel size costs, as each family states.
//!
//! Many texels at once: RMS within 3 sigma, the largest within 6.

mod cavities;
mod cornell;
mod factors;
mod rooms;
mod systems;

#[path = "../common/mod.rs"]
mod common;

use serde_json::Value;

/// One case, to be built from its family and inputs.
pub struct Case {
    inputs: Value,
    expected: Value,
    tolerance: Value,
}

/// One number of a case, compared.
pub struct Check {
    what: String,
    got: f64,
    expected: f64,
    /// Of the expected value itself.
    tolerance: f64,
    /// Standard error of the bake.
    sigma: f64,
    /// Cost of tessellation and texel size.
    shape: f64,
}

/// What a family makes of a case: its checks, or what it could not read.
pub type Outcome = Result<Vec<Check>, String>;

/// A family's name and how to build its cases.
type Family = (&'static str, fn(&Case) -> Outcome);

/// The families of tests/data.
const FAMILIES: &[Family] = &[
    ("parallel_equal_rectangles", factors::parallel_equal_rectangles),
    ("parallel_offset_rectangles", factors::parallel_offset_rectangles),
    ("perpendicular_rectangles", factors::perpendicular_rectangles),
    ("perpendicular_common_edge", factors::perpendicular_common_edge),
    ("hinged_rectangles", factors::hinged_rectangles),
    ("coaxial_discs", factors::coaxial_discs),
    ("element_to_polygon", factors::element_to_polygon),
    ("sphere_to_rectangle", factors::sphere_to_rectangle),
    ("sphere_to_disc", factors::sphere_to_disc),
    ("cube_interior", factors::cube_interior),
    ("obstructed_squares", factors::obstructed_squares),
    ("furnace", rooms::furnace),
    ("sphere_cavity_sky", cavities::sphere_cavity_sky),
    ("crater_sun", cavities::crater_sun),
    ("infinite_wedge_sky", cavities::infinite_wedge_sky),
    ("concentric_spheres", systems::concentric_spheres),
    ("infinite_plates", systems::infinite_plates),
    ("prism_lumped", systems::prism),
    ("cube_one_emitter_lumped", systems::cube_one_emitter),
    ("cube_one_emitter", rooms::cube_one_emitter),
    ("point_light_in_cube", rooms::point_light_in_cube),
    ("energy_balance", rooms::energy_balance),
    ("room_published", rooms::room_published),
    ("room_refined", rooms::room_refined),
    ("cornell_no_boxes", cornell::cornell_no_boxes),
];

#[test]
fn validation() {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/validation.json");
    let file = std::env::var("LUXEL_VALIDATION").unwrap_or_else(|_| shipped.into());
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{file}: {e}"));
    let root: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{file}: {e}"));
    let cases = root["cases"].as_array().unwrap_or_else(|| panic!("{file}: no array \"cases\""));
    let (mut ran, mut failed) = (0, Vec::new());
    for case in cases {
        let [name, family] = ["name", "family"].map(|k| case[k].as_str().unwrap_or("?"));
        let Some((_, build)) = FAMILIES.iter().find(|f| f.0 == family) else {
            println!("case {name} ... skipped (unknown family {family})");
            continue;
        };
        let [inputs, expected, tolerance] = ["inputs", "expected", "tolerance"].map(|k| case[k].clone());
        match build(&Case { inputs, expected, tolerance }) {
            Ok(checks) => {
                ran += 1;
                if !told(name, &checks) {
                    failed.push(name);
                }
            }
            Err(problem) => {
                println!("case {name} ... FAILED unreadable: {problem}");
                failed.push(name);
            }
        }
    }
    println!("{ran} of {} cases ran", cases.len());
    assert!(failed.is_empty(), "failed: {failed:?}");
}

/// Prints a case's line, and every number of it that is off; true if none is.
fn told(name: &str, checks: &[Check]) -> bool {
    let worst = checks.iter().max_by(|a, b| a.strain().total_cmp(&b.strain())).expect("a case compares something");
    let number = if checks.len() > 1 { format!(", worst of {}", checks.len()) } else { String::new() };
    let ok = worst.strain() <= 1.0;
    println!("case {name} ... {} {}{number}", if ok { "ok" } else { "FAILED" }, worst.line());
    if !ok {
        checks.iter().filter(|c| c.strain() > 1.0).for_each(|c| println!("    off: {}", c.line()));
    }
    ok
}

impl Check {
    fn allowed(&self) -> f64 {
        self.tolerance + 3.0 * self.sigma + self.shape
    }

    /// Share of what is allowed that the error takes; infinite for NaN.
    fn strain(&self) -> f64 {
        let s = (self.got - self.expected).abs() / self.allowed();
        if s.is_nan() { f64::INFINITY } else { s }
    }

    fn line(&self) -> String {
        let Check { what, got, expected, tolerance, sigma, shape } = self;
        let off = got - expected;
        let allowed = self.allowed();
        format!(
            "got {got:.8} expected {expected:.8} ({what}: off {off:+.1e}, allowed {allowed:.1e} = tolerance \
             {tolerance:.0e} + 3 x sigma {sigma:.1e} + shape {shape:.0e})"
        )
    }

    /// A check of many values by their errors in sigmas: RMS (x 2) and largest against 6.
    fn many(what: &str, errors: &[f64]) -> Self {
        let rms = libm::sqrt(errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64);
        let largest = errors.iter().fold(0.0, |a: f64, e| a.max(e.abs()));
        let what = format!("{what}: {} values, RMS {rms:.2} and largest {largest:.2} sigma", errors.len());
        Check { what, got: (2.0 * rms).max(largest), expected: 0.0, tolerance: 6.0, sigma: 0.0, shape: 0.0 }
    }
}

impl Case {
    /// A number of the inputs.
    fn input(&self, key: &str) -> Result<f64, String> {
        self.inputs[key].as_f64().ok_or_else(|| format!("inputs.{key} is not a number"))
    }

    /// An expected number; the whole field if `key` is empty.
    fn expects(&self, key: &str) -> Result<f64, String> {
        let v = if key.is_empty() { &self.expected } else { &self.expected[key] };
        v.as_f64().ok_or_else(|| format!("expected {key:?} is not a number"))
    }

    /// How exact the expected value is: a number, or "relative x ..." of the value; named where there are several.
    fn tolerance(&self, key: &str, value: f64) -> Result<f64, String> {
        let t = if self.tolerance.is_object() { &self.tolerance[key] } else { &self.tolerance };
        let relative = |s: &str| s.strip_prefix("relative ")?.split_whitespace().next()?.parse::<f64>().ok();
        let read = t.as_f64().or_else(|| Some(relative(t.as_str()?)? * value.abs()));
        read.ok_or_else(|| format!("tolerance {key:?} ({t}) cannot be read"))
    }

    /// The check of expected number `key` (empty: the only one) against `got`.
    fn check(&self, key: &str, got: f64, sigma: f64, shape: f64) -> Result<Check, String> {
        let expected = self.expects(key)?;
        let tolerance = self.tolerance(key, expected)?;
        let what = if key.is_empty() { "value".into() } else { key.into() };
        Ok(Check { what, got, expected, tolerance, sigma, shape })
    }
}

/// A list of vectors in the inputs or expectations.
fn vectors(v: &Value) -> Result<Vec<Vec<f64>>, String> {
    let row = |r: &Value| numbers(r);
    v.as_array().ok_or_else(|| format!("{v} is not a list"))?.iter().map(row).collect()
}

/// A list of numbers.
fn numbers(v: &Value) -> Result<Vec<f64>, String> {
    let one = |n: &Value| n.as_f64().ok_or_else(|| format!("{n} is not a number"));
    v.as_array().ok_or_else(|| format!("{v} is not a list"))?.iter().map(one).collect()
}
