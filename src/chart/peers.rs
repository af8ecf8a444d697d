//! Other tools' figures on the same scene, as the user knows them.

use serde::{Deserialize, Serialize};

/// A file of figures.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Peers {
    /// How they were measured, for the chart's notes.
    pub note: String,
    /// One a tool.
    pub curves: Vec<Curve>,
}

/// A tool's way from fast to exact.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// In the order of their effort.
    pub points: Vec<PeerPoint>,
}

/// One run of it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PeerPoint {
    /// Its effort in a word.
    pub label: String,
    /// Seconds.
    pub seconds: f64,
    /// Root mean square error over the mean.
    pub error: f64,
    /// The same over the darker half.
    pub dark: Option<f64>,
    /// The same over the borders of charts.
    pub border: Option<f64>,
}

impl Peers {
    /// What is wrong with the numbers.
    pub fn problem(&self) -> Option<String> {
        let wrong = |x: f64| !(x.is_finite() && x > 0.0);
        let bad = |p: &PeerPoint| [Some(p.seconds), Some(p.error), p.dark, p.border].into_iter().flatten().any(wrong);
        let of = |c: &Curve| c.points.iter().find(|p| bad(p)).map(|p| format!("{:?}, {:?}", c.name, p.label));
        self.curves.iter().find_map(of).map(|place| format!("{place}: numbers must be finite and above 0"))
    }
}
