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
//!
//! Everything runs by every estimator; systems and closed rooms by every solver on the rows of each. What hemicubes and
//! closed forms take long for has fewer texels. Closed forms refuse scenes that are too large for them, or shaded smoothly.

mod cavities;
mod cornell;
mod factors;
mod rooms;
mod systems;

#[path = "../common/mod.rs"]
mod common;

use common::{
    bakes::{Shot, options},
    exact,
    stage::Stage,
    ways::{Runs, Way},
};
use luxel::{bake::Options, error::Error, radiosity::Solver, transport::FormFactors};
use serde_json::Value;

/// One case, to be built from its family and inputs.
pub struct Case<'a> {
    inputs: Value,
    expected: Value,
    tolerance: Value,
    runs: &'a Runs,
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

/// What a family makes of a case: its checks, or why there are none.
pub type Outcome = Result<Vec<Check>, Problem>;

/// Why there are no checks.
pub enum Problem {
    /// The case could not be read.
    Unreadable(String),
    /// The bake was.
    Refused(Error),
}

impl From<String> for Problem {
    fn from(text: String) -> Self {
        Problem::Unreadable(text)
    }
}

impl From<&str> for Problem {
    fn from(text: &str) -> Self {
        Problem::Unreadable(text.into())
    }
}

/// A family's name, by which ways it runs, and how to build its cases.
type Family = (&'static str, Ways, fn(&Case) -> Outcome);

#[derive(Clone, Copy)]
enum Ways {
    /// Every estimator with its default parameters: form factors, which no solver changes.
    Factors,
    /// Every estimator.
    Estimators,
    /// Every solver by every estimator.
    All,
    /// One: the family runs every solver itself, and needs no estimator.
    Own,
}

impl Ways {
    fn each(self) -> (Vec<FormFactors>, Vec<Solver>) {
        let in_rooms = |f: FormFactors| match f {
            FormFactors::Hemicube { .. } => FormFactors::Hemicube { resolution: ROOM_PIXELS },
            other => other,
        };
        let (all, default) = (FormFactors::ALL, vec![Solver::default()]);
        match self {
            Ways::Factors => (all.to_vec(), default),
            Ways::Estimators => (all.map(in_rooms).to_vec(), default),
            Ways::All => (all.map(in_rooms).to_vec(), Solver::ALL.to_vec()),
            Ways::Own => (vec![FormFactors::default()], default),
        }
    }
}

/// Pixels of hemicubes in rooms: what fewer of them cost shows in neighbouring texels, or is bounded by [`Case::share`].
const ROOM_PIXELS: u32 = 32;

/// The families of tests/data.
const FAMILIES: &[Family] = &[
    ("parallel_equal_rectangles", Ways::Factors, factors::parallel_equal_rectangles),
    ("parallel_offset_rectangles", Ways::Factors, factors::parallel_offset_rectangles),
    ("perpendicular_rectangles", Ways::Factors, factors::perpendicular_rectangles),
    ("perpendicular_common_edge", Ways::Factors, factors::perpendicular_common_edge),
    ("hinged_rectangles", Ways::Factors, factors::hinged_rectangles),
    ("coaxial_discs", Ways::Factors, factors::coaxial_discs),
    ("element_to_polygon", Ways::Factors, factors::element_to_polygon),
    ("sphere_to_rectangle", Ways::Factors, factors::sphere_to_rectangle),
    ("sphere_to_disc", Ways::Factors, factors::sphere_to_disc),
    ("cube_interior", Ways::Factors, factors::cube_interior),
    ("obstructed_squares", Ways::Factors, factors::obstructed_squares),
    ("furnace", Ways::All, rooms::furnace),
    ("sphere_cavity_sky", Ways::Estimators, cavities::sphere_cavity_sky),
    ("crater_sun", Ways::Estimators, cavities::crater_sun),
    ("infinite_wedge_sky", Ways::Estimators, cavities::infinite_wedge_sky),
    ("concentric_spheres", Ways::Own, systems::concentric_spheres),
    ("infinite_plates", Ways::Own, systems::infinite_plates),
    ("prism_lumped", Ways::Own, systems::prism),
    ("cube_one_emitter_lumped", Ways::Own, systems::cube_one_emitter),
    ("cube_one_emitter", Ways::All, rooms::cube_one_emitter),
    ("point_light_in_cube", Ways::All, rooms::point_light_in_cube),
    ("energy_balance", Ways::All, rooms::energy_balance),
    ("room_published", Ways::Estimators, rooms::room_published),
    ("room_refined", Ways::Estimators, rooms::room_refined),
    ("cornell_no_boxes", Ways::Estimators, cornell::cornell_no_boxes),
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
        let Some((_, ways, build)) = FAMILIES.iter().find(|f| f.0 == family) else {
            println!("case {name} ... skipped (unknown family {family})");
            continue;
        };
        ran += 1;
        let (estimators, solvers) = ways.each();
        for form_factors in estimators {
            let mut runs = Runs::new(form_factors);
            for &solver in &solvers {
                let runs = runs.by(solver);
                let [inputs, expected, tolerance] = ["inputs", "expected", "tolerance"].map(|k| case[k].clone());
                let line = runs.way.name().map_or(name.to_string(), |way| format!("{name} by {way}"));
                let ok = match build(&Case { inputs, expected, tolerance, runs }) {
                    Ok(checks) => told(&line, &checks),
                    Err(Problem::Refused(Error::Usage(reason))) if runs.way != Way::default() => {
                        println!("case {line} ... refused: {}", reason.lines().next().unwrap_or_default());
                        true
                    }
                    Err(Problem::Refused(error)) => {
                        println!("case {line} ... FAILED {error}");
                        false
                    }
                    Err(Problem::Unreadable(problem)) => {
                        println!("case {line} ... FAILED unreadable: {problem}");
                        false
                    }
                };
                if !ok {
                    failed.push(line);
                }
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

impl Case<'_> {
    /// Bakes a stage by this case's way.
    fn shoot(&self, stage: Stage, rays: u32) -> Result<Shot, Problem> {
        self.shoot_with(stage, options(rays))
    }

    fn shoot_with(&self, stage: Stage, options: Options) -> Result<Shot, Problem> {
        self.runs.shoot(stage, options).map_err(Problem::Refused)
    }

    fn way(&self) -> Way {
        self.runs.way
    }

    /// Texels along an edge: `side` for rays, fewer where rows take longer.
    fn along(&self, side: u32) -> u32 {
        match self.way().form_factors {
            FormFactors::Rays => side,
            FormFactors::Hemicube { .. } => side / 2,
            FormFactors::Analytic => side / 4,
        }
    }

    /// Facets along an edge of a cavity.
    fn facets(&self, n: u32) -> u32 {
        if matches!(self.way().form_factors, FormFactors::Hemicube { .. }) { n / 2 } else { n }
    }

    /// What one point for a texel costs a value in a room with `n` texels along its shortest edge.
    fn one_point(&self, value: f64, n: u32) -> f64 {
        let hemicube = matches!(self.way().form_factors, FormFactors::Hemicube { .. });
        if hemicube { exact::one_point(n as usize) * value.abs() } else { 0.0 }
    }

    /// Standard error of what a row sees: a share `f` by so many rays, or all within an outline of length `outline` at most.
    fn share(&self, f: f64, rays: u32, outline: f64) -> f64 {
        match self.way().form_factors {
            FormFactors::Hemicube { resolution } => exact::aliasing(resolution, outline),
            // Closed forms leave the sky to rays.
            FormFactors::Rays | FormFactors::Analytic => libm::sqrt(f * (1.0 - f) / f64::from(rays)),
        }
    }

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
