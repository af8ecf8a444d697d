//! [`Point`]: one bake, what it cost and how wrong it is.

use super::{Effort, Trial};
use crate::{
    audit::{Audit, Interval},
    bake::Baked,
    radiosity::Solver,
};
use serde::Serialize;

/// One bake. Errors are relative; none: too few points, or all is dark.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// The sweep it belongs to.
    pub sweep: &'static str,
    /// The series within that.
    pub series: String,
    /// What it is in a few words.
    pub name: String,
    /// True for the effort of a bake without options.
    pub default: bool,
    /// True if no other point of this layout has less error in less time.
    pub pareto: bool,
    /// How rows are measured.
    pub form_factors: String,
    /// Who solved.
    pub solver: &'static str,
    /// Rays a row, those of the last step of a target.
    pub rays: u32,
    /// Whether neighbours use each other's rays.
    pub reuse: bool,
    /// Where rows are measured.
    pub receivers: &'static str,
    /// Edge of the page.
    pub resolution: Option<u32>,
    /// Texels.
    pub texels: usize,
    /// Rows.
    pub rows: usize,
    /// The error that was to be reached.
    pub target: Option<f64>,
    /// Seconds of the whole bake, audits of a target included.
    pub seconds: f64,
    /// Wall seconds by room.
    pub rooms: Vec<(&'static str, f64)>,
    /// Matrix entries that the solver touched.
    pub entries: u64,
    /// Root mean square error over the mean.
    pub error: Option<f64>,
    /// Lower end of its interval.
    pub error_low: Option<f64>,
    /// Upper end.
    pub error_high: Option<f64>,
    /// The same over the darker half.
    pub dark: Option<f64>,
    /// Lower end of its interval.
    pub dark_low: Option<f64>,
    /// Upper end.
    pub dark_high: Option<f64>,
    /// The same over the borders of charts.
    pub border: Option<f64>,
    /// Lower end of its interval.
    pub border_low: Option<f64>,
    /// Upper end.
    pub border_high: Option<f64>,
    /// Mean over the truth's, less 1.
    pub bias: Option<f64>,
}

impl Point {
    pub(super) fn new(trial: &Trial, baked: &Baked, audit: &Audit, seconds: f64) -> Self {
        let report = &baked.report;
        let transport = trial.options.transport;
        let rays = report.target.as_ref().and_then(|t| t.looks.last()).map_or(transport.rays, |look| look.rays);
        let value = |i: Option<Interval>| i.map(|i| i.value);
        let ends = |i: Option<Interval>| [i.map(|i| i.low), i.map(|i| i.high)];
        let ([error_low, error_high], [dark_low, dark_high]) = (ends(audit.error), ends(audit.dark));
        let [border_low, border_high] = ends(audit.border);
        Point {
            sweep: trial.sweep.name(),
            series: trial.series.clone(),
            name: trial.name.clone(),
            default: trial.default,
            pareto: false,
            form_factors: transport.form_factors.to_string(),
            solver: Solver::name(trial.options.radiosity.solver),
            rays,
            reuse: transport.reuse,
            receivers: transport.receivers.name(),
            resolution: super::resolution(&trial.options),
            texels: report.texels,
            rows: report.receivers,
            target: if let Effort::Target(target) = &trial.effort { target.error } else { None },
            seconds,
            rooms: report.seconds.clone(),
            entries: report.solver.entries,
            error: value(audit.error),
            error_low,
            error_high,
            dark: value(audit.dark),
            dark_low,
            dark_high,
            border: value(audit.border),
            border_low,
            border_high,
            bias: value(audit.bias),
        }
    }
}
