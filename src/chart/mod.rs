//! [`Chart`]: speed against accuracy on any scene, measured and drawn.
//!
//! Every one of [`Chart::points`] is a whole bake. Its error is that at the same points of one long audit ([`Truth`]), so
//! that what is common to all of them cancels; or that against a lightmap which the user takes for the truth, but for sizes
//! of patches. Sweeps run in the order of their worth until a budget of time is used up; what did not fit is named.

pub mod draw;
mod figures;
mod fit;
mod form_factors;
mod patches;
mod peers;
mod point;
mod solvers;
mod sweep;
mod threads;

pub use figures::figures;
pub use form_factors::{FactorRun, Factors};
pub use patches::{Level, Patchwork};
pub use peers::{Curve, PeerPoint, Peers};
pub use point::Point;
pub use solvers::{Look, Reflectance, SolverRun};
pub use sweep::Sweep;
pub use threads::ThreadPoint;

use crate::{
    atlas::{Coverage, Density},
    audit::{self, Audit, Budget, Subject, Truth},
    bake::{self, Baked},
    error::{Error, Result},
    lightmaps::Lightmaps,
    processor,
    progress::{self, Observer},
    scene::Scene,
};
use serde::Serialize;
use std::{
    cell::Cell,
    path::PathBuf,
    time::{Duration, Instant},
};
use sweep::{Effort, Trial};

/// What is charted.
pub struct Options {
    /// What all bakes have in common; its density is that of all sweeps but those of density.
    pub bake: bake::Options,
    /// Wall time in which sweeps begin, truth included. The least is done in any case: one bake and a short audit.
    pub budget: Duration,
    /// What counts as seconds.
    pub clock: Clock,
    /// Sweeps to run. Default: all.
    pub sweeps: Vec<Sweep>,
    /// Taken for the truth instead of an audit.
    pub given: Option<Given>,
}

/// A lightmap that is taken for the truth.
pub struct Given {
    /// Its file, for messages.
    pub file: PathBuf,
    /// Its texels.
    pub coverage: Coverage,
    /// Its values.
    pub lightmaps: Lightmaps,
}

/// What counts as seconds of a bake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// Those on the wall.
    #[default]
    Wall,
    /// Those of this process on all processors, over the number of threads: on machines that do other work, too.
    Processor,
}

/// Everything that was measured.
#[derive(Serialize)]
pub struct Chart {
    /// Program and version.
    pub generator: String,
    /// Name of the scene.
    pub scene: String,
    /// Texels of the layout that most points share.
    pub texels: usize,
    /// Threads.
    pub threads_used: usize,
    /// What counts as seconds.
    pub clock: Clock,
    /// Seconds that were allowed, and that were used.
    pub budget: f64,
    /// Seconds that were used.
    pub seconds: f64,
    /// What the errors are held against.
    pub truth: TruthReport,
    /// Bakes, in the order in which they ran.
    pub points: Vec<Point>,
    /// Solvers on one system, at several reflectances.
    pub solvers: Vec<SolverRun>,
    /// Form factors by estimator.
    pub form_factors: Option<Factors>,
    /// Patch sizes.
    pub patches: Option<Patchwork>,
    /// Power of the number of texels with which seconds grow.
    pub scaling: Option<f64>,
    /// Speed by threads.
    pub threads: Vec<ThreadPoint>,
    /// What is missing.
    pub left_out: Vec<LeftOut>,
    /// Other tools, as the user knows them.
    pub peers: Option<Peers>,
}

/// Something that is not charted.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    /// The sweep it belongs to.
    pub sweep: &'static str,
    /// What it is.
    pub name: String,
    /// Who refused it, and why; none: it did not fit into the budget.
    pub refused: Option<String>,
}

/// What the errors are held against.
#[derive(Serialize)]
pub struct TruthReport {
    /// `audit`, or the name of a file.
    pub by: String,
    /// Points, or texels of the file.
    pub points: usize,
    /// Seconds to find it.
    pub seconds: f64,
}

/// Share of the budget that the truth may take.
const TRUTH: f64 = 0.1;
/// Its limits.
const LEAST: Duration = Duration::from_millis(500);
const MOST: Duration = Duration::from_secs(120);
/// Audits of layouts of their own, in times of the bake, and at least so many seconds.
const OWN: f64 = 2.0;
const OWN_LEAST: f64 = 2.0;

impl Chart {
    /// Measures all sweeps that fit into the budget.
    pub fn measure(scene: &Scene, options: &Options, observer: &dyn Observer) -> Result<Self> {
        let (start, base) = (Instant::now(), &options.bake);
        let mut bench = Bench { scene, options, observer, start, pace: 0.0, told: Cell::new(0) };
        let (first, trials) = sweep::trials(base);
        observer.begin("chart", options.budget.as_millis() as u64);
        let (baked, seconds) = bench.timed(|quiet| bake::bake(scene, base, quiet))?;
        bench.pace = bench.start.elapsed().as_secs_f64();
        let truth = bench.truth(&baked)?;
        let mut chart = Chart {
            generator: concat!("luxel ", env!("CARGO_PKG_VERSION")).into(),
            scene: scene.file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            texels: baked.report.texels,
            threads_used: rayon::current_num_threads(),
            clock: options.clock,
            budget: options.budget.as_secs_f64(),
            seconds: 0.0,
            truth: truth.report(),
            points: vec![Point::new(&first, &baked, &truth.audit(&baked, base), seconds)],
            solvers: Vec::new(),
            form_factors: None,
            patches: None,
            scaling: None,
            threads: Vec::new(),
            left_out: Vec::new(),
            peers: None,
        };
        drop(baked);
        bench.tell(&chart.points[0]);
        for trial in trials.iter().filter(|t| options.sweeps.contains(&t.sweep)) {
            progress::check(observer)?;
            bench.advance();
            if !bench.fits(trial.cost) {
                chart.left_out.push(trial.left_out(None));
                continue;
            }
            match &trial.effort {
                Effort::Solvers => chart.solvers = solvers::compare(&bench)?,
                Effort::FormFactors => {
                    chart.form_factors = form_factors::measure(&bench, &mut chart.left_out)?;
                }
                Effort::Patches => {
                    // Layouts differ, and a lightmap has one only: points of the surface serve all of them.
                    let truth = match &truth {
                        Against::Audit { truth, .. } => truth,
                        Against::Given(_) => &bench.audited(&bake::bake(scene, base, &Quiet(observer))?)?,
                    };
                    chart.patches = Some(patches::measure(&bench, truth, &mut chart.left_out)?);
                }
                Effort::Threads => chart.threads = threads::measure(&bench)?,
                Effort::Bake | Effort::Target(_) => match bench.point(trial, &truth) {
                    Ok(Some(point)) => {
                        bench.tell(&point);
                        chart.points.push(point);
                    }
                    Ok(None) => chart.left_out.push(trial.left_out(None)),
                    // A method that cannot do this, or a layout that is too small or too large, is a finding.
                    Err(refused @ (Error::Usage(_) | Error::Memory { .. } | Error::Invalid { .. })) => {
                        chart.left_out.push(trial.left_out(Some(refused.to_string())));
                    }
                    Err(other) => return Err(other),
                },
            }
        }
        chart.scaling = fit::scaling(&chart.points);
        fit::mark_pareto(&mut chart.points);
        chart.seconds = bench.start.elapsed().as_secs_f64();
        Ok(chart)
    }
}

/// What all sweeps share.
struct Bench<'a> {
    scene: &'a Scene,
    options: &'a Options,
    observer: &'a dyn Observer,
    start: Instant,
    /// Wall seconds of the first bake.
    pace: f64,
    /// Milliseconds of the budget that the observer knows of.
    told: Cell<u64>,
}

impl Bench<'_> {
    /// Runs and counts seconds.
    fn timed<T>(&self, run: impl FnOnce(&dyn Observer) -> Result<T>) -> Result<(T, f64)> {
        let (start, before) = (Instant::now(), processor::seconds());
        let out = run(&Quiet(self.observer))?;
        let wall = start.elapsed().as_secs_f64();
        let threads = rayon::current_num_threads() as f64;
        let used = processor::seconds().zip(before).map(|(after, before)| (after - before) / threads);
        let seconds = if self.options.clock == Clock::Processor { used.unwrap_or(wall) } else { wall };
        Ok((out, seconds))
    }

    /// Wall time that is left.
    fn left(&self) -> Duration {
        self.options.budget.saturating_sub(self.start.elapsed())
    }

    fn advance(&self) {
        let now = self.start.elapsed().as_millis() as u64;
        self.observer.advance(now - self.told.replace(now));
    }

    /// True if what costs so many times the first bake can begin.
    fn fits(&self, cost: f64) -> bool {
        self.left().as_secs_f64() > cost * self.pace
    }

    fn truth(&self, baked: &Baked) -> Result<Against<'_>> {
        if let Some(given) = &self.options.given {
            given.check(baked)?;
            return Ok(Against::Given(given));
        }
        let start = Instant::now();
        let truth = self.audited(baked)?;
        Ok(Against::Audit { truth, seconds: start.elapsed().as_secs_f64() })
    }

    /// A long audit.
    fn audited(&self, baked: &Baked) -> Result<Truth> {
        let time = self.options.budget.mul_f64(TRUTH).clamp(LEAST, MOST);
        let options = audit::Options { budget: Budget::Time(time), ..audit::Options::default() };
        self.observer.plan(&format!("truth: an audit of {:.0} s", time.as_secs_f64()));
        Truth::of(&subject(baked, &self.options.bake), &options, &Quiet(self.observer))
    }

    /// A bake and its error; none if it ran into the end of the budget.
    fn point(&self, trial: &Trial, truth: &Against) -> Result<Option<Point>> {
        let options = &trial.options;
        let (baked, seconds) = self.timed(|quiet| match &trial.effort {
            Effort::Target(target) => {
                let limited = bake::Target { time: Some(self.left()), ..*target };
                bake::bake_to(self.scene, options, &limited, quiet)
            }
            _ => bake::bake(self.scene, options, quiet),
        })?;
        let missed = baked.report.target.as_ref().is_some_and(|t| !t.reached);
        // It may have been the time that stopped it.
        if missed && self.left().as_secs_f64() < seconds {
            return Ok(None);
        }
        let audit = if trial.sweep == Sweep::Density {
            let time = Duration::from_secs_f64((OWN * seconds).max(OWN_LEAST)).min(self.left().max(LEAST));
            let budget = Budget::Time(time);
            let audit = audit::Options { budget, ..audit::Options::default() };
            Audit::of(&subject(&baked, options), &audit, &Quiet(self.observer))?
        } else {
            truth.audit(&baked, options)
        };
        Ok(Some(Point::new(trial, &baked, &audit, seconds)))
    }

    fn tell(&self, point: &Point) {
        let error = point.error.map_or("unknown".into(), |e| format!("{:.2} %", 100.0 * e));
        self.observer.plan(&format!("{}: {}: {:.2} s, error {error}", point.sweep, point.name, point.seconds));
    }
}

/// What errors are held against.
enum Against<'a> {
    Audit { truth: Truth, seconds: f64 },
    Given(&'a Given),
}

impl Against<'_> {
    fn audit(&self, baked: &Baked, options: &bake::Options) -> Audit {
        let subject = subject(baked, options);
        match self {
            Against::Audit { truth, .. } => truth.audit(&subject),
            Against::Given(given) => Audit::against(&subject, &given.lightmaps),
        }
    }

    fn report(&self) -> TruthReport {
        match self {
            Against::Audit { truth, seconds } => {
                TruthReport { by: "audit".into(), points: truth.points(), seconds: *seconds }
            }
            Against::Given(given) => {
                let name = given.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                TruthReport { by: name, points: given.coverage.texels.len(), seconds: 0.0 }
            }
        }
    }
}

impl Given {
    /// The layout must be that of the bakes.
    fn check(&self, baked: &Baked) -> Result<()> {
        let pages = |maps: &Lightmaps| maps.pages.iter().map(|p| p.size).collect::<Vec<_>>();
        let visible = |c: &Coverage, maps: &Lightmaps| {
            let texels = c.texels.iter().filter(|t| (t.page as usize) < maps.pages.len());
            texels.map(|t| (t.page, t.at)).collect::<std::collections::HashSet<_>>()
        };
        let [own, given] = [visible(&baked.coverage, &baked.lightmaps), visible(&self.coverage, &self.lightmaps)];
        let same = own.symmetric_difference(&given).count();
        // Coordinates were rounded when they were written: a texel may be touched or not.
        if pages(&baked.lightmaps) == pages(&self.lightmaps) && same * 100 <= own.len() {
            return Ok(());
        }
        let problem = "is laid out otherwise than the bakes are";
        let remedy = "bake it from the same scene with the same --resolution, --keep-uv, --unwrap and --exclude";
        Err(Error::invalid(&self.file, "the lightmap", problem, remedy))
    }
}

fn subject<'a, 's>(baked: &'a Baked<'s>, options: &bake::Options) -> Subject<'a, 's> {
    let Baked { tracer, coverage, lightmaps, .. } = baked;
    Subject { tracer, coverage, lightmaps, max_reflectance: options.max_reflectance }
}

/// The edge of the page, if there is one of fixed size.
fn resolution(options: &bake::Options) -> Option<u32> {
    match options.atlas.density {
        Density::Resolution(n) => Some(n),
        Density::TexelsPerMeter(_) => None,
    }
}

/// Single bakes are not talked about, but can be stopped.
struct Quiet<'a>(&'a dyn Observer);

impl Observer for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
