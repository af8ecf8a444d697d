//! What an audit says of maps whose errors are known.

use crate::{
    Blank, both,
    common::{rooms, scenes::unit_room, stage::Stage, true_error},
    laid_out,
};
use glam::Vec3;
use luxel::{
    audit::{Audit, Budget, Interval, Look, Options, Truth},
    lightmaps::Reading,
    math::{hash, unit_float},
    progress::Silent,
    scene::Scene,
};
use std::time::Duration;

/// A furnace: E = 2 at every texel.
fn furnace() -> (Scene, u32) {
    let mut stage = Stage::new();
    let material = stage.material(0.5, 1.0);
    unit_room().all(&mut stage, material, 16);
    laid_out(stage)
}

#[track_caller]
fn holds(i: Option<Interval>, x: f64, widest: f64) {
    let i = i.expect("enough points");
    assert!(i.low <= x && x <= i.high, "{i:?} does not hold {x}");
    assert!(i.high - i.low < widest, "{i:?} is wider than {widest}");
}

/// Quantiles are not exact: noise is taken off by a rule of thumb.
#[track_caller]
fn near(i: Option<Interval>, x: f64) {
    let i = i.expect("enough points");
    assert!((i.value / x - 1.0).abs() < 0.15, "{i:?} is not near {x}");
}

#[test]
fn a_factor_is_found_as_bias_and_as_error() {
    let (scene, edge) = furnace();
    let mut blank = Blank::new(&scene, edge);
    blank.paint(|_| Vec3::splat(2.0 * 1.02));
    let audit = blank.audit(300, 0);
    holds(audit.bias, 0.02, 0.006);
    holds(audit.error, 0.02, 0.008);
    holds(audit.dark, 0.02, 0.008);
    near(audit.median, 0.02);
}

#[test]
fn noise_is_found_as_error_without_bias() {
    let (scene, edge) = furnace();
    let mut blank = Blank::new(&scene, edge);
    // Even in +-.03 sqrt(3): root mean square .03, median .026, 95th percentile .0494.
    let off = |i: usize, c: u32| 0.03 * 3f32.sqrt() * (2.0 * unit_float(hash(i as u32, c)) - 1.0);
    let grey = |i: usize| Vec3::splat(2.0 * (1.0 + off(i, 0)));
    blank.paint(grey);
    let audit = blank.audit(500, 1);
    holds(audit.error, 0.03, 0.006);
    holds(audit.border, 0.03, 0.015);
    holds(audit.bias, 0.0, 0.008);
    near(audit.median, 0.026);
    near(audit.p95, 0.0494);
    // Noise is in look-ups, too, averaged by the filter: (4/9)^2 of its power away from borders.
    let size = audit.texel_size.expect("enough points");
    assert!(size.error.low > 0.01 && size.error.high < 0.03, "{size:?}");
    assert_eq!(size.density_to_halve, None, "texels are not what errs");
}

/// A perfect map has no error that could be told from 0, though every half of every point is noisy.
#[test]
fn a_perfect_map_is_perfect() {
    let (scene, edge) = furnace();
    let mut blank = Blank::new(&scene, edge);
    blank.paint(|_| Vec3::splat(2.0));
    let audit = blank.audit(300, 2);
    holds(audit.error, 0.0, 0.01);
    holds(audit.bias, 0.0, 0.006);
}

/// Points that were kept say what an audit says that forgets them, of the map that they were drawn by and of others; and
/// a map that is given as the truth says it exactly.
#[test]
fn truths_are_kept() {
    let (scene, edge) = furnace();
    let mut blank = Blank::new(&scene, edge);
    blank.paint(|_| Vec3::splat(2.0));
    let options = Options { budget: Budget::Points(300), ..Options::default() };
    let truth = Truth::of(&blank.subject(), &options, &Silent).expect("a truth");
    let figures = |a: &Audit| format!("{:?}", [a.error, a.dark, a.border, a.bias]);
    assert_eq!(figures(&truth.audit(&blank.subject())), figures(&blank.audit(300, 0)));
    let right = blank.lightmaps.clone();
    let off = |i: usize| 0.03 * 3f32.sqrt() * (2.0 * unit_float(hash(i as u32, 0)) - 1.0);
    blank.paint(|i| Vec3::splat(2.0 * (1.05 + off(i))));
    let audit = truth.audit(&blank.subject());
    holds(audit.bias, 0.05, 0.008);
    holds(audit.error, (0.05f64 * 0.05 + 0.03 * 0.03).sqrt(), 0.008);
    let texels = blank.coverage.texels.len();
    let mean = |of: &dyn Fn(f64) -> f64| (0..texels).map(|i| of(f64::from(off(i)) + 0.05)).sum::<f64>() / texels as f64;
    let (bias, error) = (mean(&|x| x), mean(&|x| x * x).sqrt());
    let exact = Audit::against(&blank.subject(), &right);
    let near = |i: Option<Interval>, x: f64| i.is_some_and(|i| (i.value - x).abs() < 1e-6 && i.low == i.high);
    assert!(near(exact.bias, bias) && near(exact.error, error) && exact.points == texels, "{exact:?}");
    // The filter averages noise: between texels less is left than in them.
    let read = |reading| truth.look_ups(&blank.coverage, &blank.lightmaps, reading);
    holds(read(Reading::Constant), error, 0.01);
    holds(read(Reading::Bilinear), 0.0537, 0.01);
}

/// The intervals of bakes of small rooms hold their true errors. (`tools/audit.rs` does it for a hundred.)
#[test]
fn intervals_hold_true_errors() {
    let mut held = true_error::Held::default();
    for seed in 0..10 {
        held += true_error::held(rooms::seeded(seed), seed, 200, 2);
    }
    println!("{held}");
    assert!(held.is_enough(), "{held}");
}

#[test]
fn threads_do_not_matter_and_seeds_do() {
    let (scene, edge) = laid_out(rooms::seeded(3));
    let mut blank = Blank::new(&scene, edge);
    blank.paint(|_| Vec3::splat(0.5));
    let on = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        Audit { seconds: 0.0, ..pool.install(|| blank.audit(70, seed)) }
    };
    let [one, three, other] = [on(1, 0), on(3, 0), on(1, 1)].map(|a| format!("{a:?}"));
    assert_eq!(one, three);
    assert_ne!(one, other);
}

#[test]
fn a_look_that_goes_on_is_a_longer_one() {
    let (scene, edge) = laid_out(rooms::seeded(3));
    let mut blank = Blank::new(&scene, edge);
    blank.paint(|_| Vec3::splat(0.5));
    let subject = blank.subject();
    let (mut steps, mut at_once) = (Look::new(&Options::default()), Look::new(&Options::default()));
    let until = |look: &mut Look, rays| Audit { seconds: 0.0, ..look.until(rays, &subject, &Silent).unwrap() };
    let (first, second) = (until(&mut steps, 1_000_000), until(&mut steps, 2_000_000));
    assert!(first.points >= 16 && second.points > first.points);
    assert_eq!(format!("{second:?}"), format!("{:?}", until(&mut at_once, 2_000_000)));
}

/// A first round is drawn in any case, and no second.
#[test]
fn no_time_is_kept() {
    let (scene, edge) = furnace();
    let budget = Budget::Time(Duration::ZERO);
    let audit = Audit::of(&Blank::new(&scene, edge).subject(), &Options { budget, ..Options::default() }, &Silent);
    assert_eq!(audit.unwrap().points, 16);
}

/// A map of nothing, and one of which too little is drawn.
#[test]
fn too_little_is_said_to_be_so() {
    let (scene, edge) = furnace();
    let mut blank = Blank::new(&scene, edge);
    assert_eq!(blank.audit(9, 0).error, None);
    blank.lightmaps.pages.clear();
    let audit = blank.audit(100, 0);
    assert_eq!((audit.points, audit.error), (0, None));
}

/// Halves do not know of each other: over many texels their errors cancel in the product.
#[test]
fn halves_are_independent() {
    let (scene, edge) = furnace();
    let blank = Blank::new(&scene, edge);
    let found = blank.truth(16);
    let off = |r: &luxel::audit::Reference| r.halves.map(|h| h.x - 2.0);
    let product: f64 = found.iter().map(off).map(|[a, b]| a * b).sum();
    let square: f64 = found.iter().map(off).map(|[a, b]| (a * a + b * b) * 0.5).sum();
    let n = found.len() as f64;
    assert!((product / square).abs() < 4.0 / n.sqrt(), "correlation {}", product / square);
    assert!((found.iter().map(both).sum::<f64>() / n - 2.0).abs() < 0.01);
}
