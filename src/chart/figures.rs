//! The charts: which numbers are drawn how.

use super::{
    Chart, Clock, FactorRun, Point, Reflectance, Sweep,
    draw::{Axis, Datum, Figure, Line, Mark, Paint, Panel, Rule, Series, Unit},
    fit,
};
use crate::{
    lightmaps::Reading,
    radiosity::{Solver, TOLERANCE},
    transport::FormFactors,
};

/// Colours that those who see few of them can tell apart (Okabe and Ito).
const BLUE: Paint = Paint::of(0x00_72b2);
const ORANGE: Paint = Paint::of(0xd5_5e00);
const GREEN: Paint = Paint::of(0x00_9e73);
const PINK: Paint = Paint::of(0xcc_79a7);
const AMBER: Paint = Paint::of(0xe6_9f00);
const SKY: Paint = Paint::of(0x56_b4e9);
const BLACK: Paint = Paint::of(0x22_2222);
const GREY: Paint = Paint::of(0x88_8888);
const GOLD: Paint = Paint::of(0xf0_e442);

const STYLES: [(Paint, Mark); 7] = [
    (BLUE, Mark::Disc),
    (ORANGE, Mark::Square),
    (GREEN, Mark::Triangle),
    (PINK, Mark::Diamond),
    (AMBER, Mark::Disc),
    (SKY, Mark::Square),
    (BLACK, Mark::Triangle),
];

/// Every chart for which there are numbers, and the name of its files.
pub fn figures(chart: &Chart) -> Vec<(&'static str, Figure)> {
    [
        ("error", error(chart)),
        ("solvers", solvers(chart)),
        ("form_factors", form_factors(chart)),
        ("texels", texels(chart)),
        ("patches", patches(chart)),
        ("threads", threads(chart)),
    ]
    .into_iter()
    .filter_map(|(name, figure)| Some((name, figure?)))
    .collect()
}

/// One of the three errors of a point, with its interval.
type Error = fn(&Point) -> [Option<f64>; 3];

/// Error against seconds.
fn error(chart: &Chart) -> Option<Figure> {
    let own = |p: &&Point| p.texels == chart.texels && p.sweep != Sweep::Density.name() && p.error.is_some();
    let points: Vec<&Point> = chart.points.iter().filter(own).collect();
    let peers = chart.peers.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points);
    let seconds = points.iter().map(|p| p.seconds).chain(peers.clone().map(|p| p.seconds));
    let x = Axis::log(seconds_label(chart.clock), Unit::Plain);
    let x = Axis { range: Some(x.scale.range(seconds)), ..x };
    let of: [(&str, Error); 3] = [
        ("all texels", |p| [p.error, p.error_low, p.error_high]),
        ("darker half", |p| [p.dark, p.dark_low, p.dark_high]),
        ("borders of charts", |p| [p.border, p.border_low, p.border_high]),
    ];
    let panels = of.iter().enumerate().map(|(i, (title, error))| Panel {
        title: (*title).into(),
        x: x.clone(),
        y: Axis::log(if i == 0 { "relative error, root mean square" } else { "" }, Unit::Percent),
        series: errors(chart, &points, *error, i),
        rules: Vec::new(),
    });
    let budget = format!("Relative RMS errors with 95 % intervals, against {}.", truth(chart));
    let numbers = "Numbers beside points: rays a texel, pixels of a hemicube's edge, or the error to be reached.";
    let front =
        "Star: a bake without options. Pareto front: of all efforts of luxel none is both faster and more exact.";
    let peers = chart.peers.as_ref().map(|p| p.note.clone());
    let notes = [format!("{budget} {numbers} {front}")].into_iter().chain(peers).collect();
    (!points.is_empty()).then(|| Figure {
        title: "Error against seconds".into(),
        subtitle: subtitle(chart),
        panels: panels.collect(),
        columns: 3,
        panel: [330.0, 360.0],
        notes,
    })
}

fn errors(chart: &Chart, points: &[&Point], error: Error, which: usize) -> Vec<Series> {
    let datum = |p: &Point, label: String| {
        let [y, low, high] = error(p);
        let interval = low.zip(high).map(|(l, h)| [l, h]);
        Some(Datum { x: p.seconds, y: y?, interval, label })
    };
    let mut all = Vec::new();
    let front: Vec<(f64, f64)> = points.iter().filter_map(|p| Some((p.seconds, error(p)[0]?))).collect();
    let front = fit::front(&front).into_iter().map(|(x, y)| Datum { x, y, ..Datum::default() }).collect();
    let front =
        Series { name: "Pareto front".into(), paint: GREEN, mark: Mark::None, line: Line::Broad, points: front };
    all.push(front);
    for (curve, (paint, mark)) in
        chart.peers.iter().flat_map(|p| &p.curves).zip([(BLACK, Mark::Square), (GREY, Mark::Diamond)].iter().cycle())
    {
        let at = |p: &super::PeerPoint| [Some(p.error), p.dark, p.border][which];
        let points = curve
            .points
            .iter()
            .filter_map(|p| Some(Datum { x: p.seconds, y: at(p)?, interval: None, label: p.label.clone() }));
        let points = points.collect();
        all.push(Series { name: curve.name.clone(), paint: *paint, mark: *mark, line: Line::Dashed, points });
    }
    let mut names: Vec<&str> = Vec::new();
    let methods = [Sweep::Rays, Sweep::FormFactors].map(Sweep::name);
    for p in points.iter().filter(|p| methods.contains(&p.sweep)) {
        if !names.contains(&p.series.as_str()) {
            names.push(&p.series);
        }
    }
    for (name, (paint, mark)) in names.into_iter().zip(STYLES.iter().cycle()) {
        let mut own: Vec<&&Point> = points.iter().filter(|p| p.series == name).collect();
        own.sort_by_key(|p| (p.rays, p.entries));
        // Of hemicubes the pixels of an edge.
        let label = |p: &Point| match p.form_factors.split_once(',') {
            Some((_, pixels)) => pixels.into(),
            None => p.rays.to_string(),
        };
        let points = own.iter().filter_map(|p| datum(p, label(p))).collect();
        all.push(Series { name: name.into(), paint: *paint, mark: *mark, line: Line::Solid, points });
    }
    let mut quality: Vec<&&Point> = points.iter().filter(|p| p.sweep == Sweep::Quality.name() && !p.default).collect();
    quality.sort_by(|a, b| b.target.unwrap_or(0.0).total_cmp(&a.target.unwrap_or(0.0)));
    let label = |p: &Point| p.target.map_or(String::new(), |t| format!("{} %", 100.0 * t));
    let quality = quality.iter().filter_map(|p| datum(p, label(p))).collect();
    all.push(Series {
        name: "--quality, its audits included".into(),
        paint: SKY,
        mark: Mark::Ring,
        line: Line::Solid,
        points: quality,
    });
    let default = points.iter().filter(|p| p.default).filter_map(|p| datum(p, String::new())).collect();
    all.push(Series { name: "default".into(), paint: GOLD, mark: Mark::Star, line: Line::None, points: default });
    all
}

/// Residual and true error against entries touched.
fn solvers(chart: &Chart) -> Option<Figure> {
    let painted =
        [(Reflectance::Own, "own reflectances"), (Reflectance::Bright, "all .9"), (Reflectance::White, "all .99")];
    let painted = painted.map(|(r, title)| (r.name(), title)).into_iter();
    let painted: Vec<_> = painted.filter(|(r, _)| chart.solvers.iter().any(|s| s.reflectance == *r)).collect();
    let what = [("true residual", false), ("true error", true)];
    let of_all = |r: &str| {
        let looks = chart
            .solvers
            .iter()
            .filter(move |s| s.reflectance == r)
            .flat_map(|s| s.looks.iter().map(move |l| l.entries as f64 / s.matrix_entries.max(1) as f64));
        Axis::log("passes over the matrix", Unit::Plain).scale.range(looks)
    };
    let panels: Vec<Panel> = what
        .iter()
        .flat_map(|what| painted.iter().map(move |p| (what, p)))
        .map(|((name, is_error), (reflectance, title))| {
            let runs = chart.solvers.iter().filter(|s| s.reflectance == *reflectance);
            let styled = runs.map(|run| {
                let style = Solver::ALL.iter().position(|s| s.name() == run.solver).unwrap_or(0);
                let (paint, _) = STYLES[style % STYLES.len()];
                let passes = |entries: u64| entries as f64 / run.matrix_entries.max(1) as f64;
                let y = |l: &super::Look| if *is_error { l.error } else { l.residual };
                let points = run.looks.iter().map(|l| Datum { x: passes(l.entries), y: y(l), ..Datum::default() });
                // One look is a dot.
                let mark = if run.looks.len() == 1 { Mark::Disc } else { Mark::None };
                let line = if run.solver == Solver::default().name() { Line::Solid } else { Line::Dashed };
                Series { name: run.solver.into(), paint, mark, line, points: points.collect() }
            });
            Panel {
                title: format!("{name}, {title}"),
                x: Axis { range: Some(of_all(reflectance)), ..Axis::log("passes over the matrix", Unit::Plain) },
                y: Axis { range: Some([1e-6, 20.0]), ..Axis::log("over the mean of the darker half", Unit::Power) },
                series: styled.collect(),
                rules: if *is_error { vec![Rule { y: TOLERANCE, label: "tolerance".into() }] } else { Vec::new() },
            }
        })
        .collect();
    let run = chart.solvers.first()?;
    let size = format!("{} unknowns, {} entries a pass", count(run.unknowns as u64), count(run.matrix_entries));
    Some(Figure {
        title: "Solvers: residual and true error against matrix entries touched".into(),
        subtitle: format!("{}; {size}", chart.scene),
        columns: painted.len(),
        panels,
        panel: [330.0, 290.0],
        notes: vec!["Of the worst texel; the truth is the dense solution, or one a million times more exact. The four passes of the bound and all preparations count.".into()],
    })
}

/// Errors of form factors against seconds.
fn form_factors(chart: &Chart) -> Option<Figure> {
    let factors = chart.form_factors.as_ref()?;
    let own = FormFactors::ALL.into_iter().zip(STYLES).map(|(form_factors, (paint, mark))| {
        let runs = factors.runs.iter().filter(|r| r.form_factors == form_factors.name());
        let datum = |r: &FactorRun| Datum { x: r.seconds, y: r.error, interval: None, label: r.effort.to_string() };
        Series { name: form_factors.name().into(), paint, mark, line: Line::Solid, points: runs.map(datum).collect() }
    });
    Some(Figure {
        title: "Form factors: error against seconds".into(),
        subtitle: format!("{}, {} texels, {} threads", chart.scene, count(factors.texels as u64), chart.threads_used),
        panels: vec![Panel {
            title: "between all pairs of texels".into(),
            x: Axis::log("seconds", Unit::Plain),
            y: Axis::log("relative error, root mean square", Unit::Percent),
            series: own.filter(|s| !s.points.is_empty()).collect(),
            rules: Vec::new(),
        }],
        columns: 1,
        panel: [560.0, 360.0],
        notes: vec![format!(
            "Against closed forms, which took {:.1} s. Numbers: rays a row, pixels of a hemicube's edge.",
            factors.seconds
        )],
    })
}

/// Seconds against texels.
fn texels(chart: &Chart) -> Option<Figure> {
    let sizes = fit::sizes(&chart.points);
    if sizes.len() < 2 {
        return None;
    }
    let at = |p: &Point, y: f64| Datum { x: p.texels as f64, y, ..Datum::default() };
    let mut series = vec![Series {
        name: "whole bake".into(),
        paint: BLACK,
        mark: Mark::Disc,
        line: Line::Solid,
        points: sizes
            .iter()
            .map(|p| Datum { label: p.resolution.map_or(String::new(), |n| n.to_string()), ..at(p, p.seconds) })
            .collect(),
    }];
    // Rooms have only the clock on the wall.
    let rooms = if chart.clock == Clock::Wall { rooms(sizes.last().map_or(&[], |p| &p.rooms)) } else { Vec::new() };
    for (room, (paint, mark)) in rooms.into_iter().zip(STYLES.iter()) {
        let of = |p: &Point| p.rooms.iter().find(|r| r.0 == room).map_or(0.0, |r| r.1);
        let points = sizes.iter().map(|p| at(p, of(p))).collect();
        series.push(Series { name: room.into(), paint: *paint, mark: *mark, line: Line::Solid, points });
    }
    let power = chart.scaling.map_or(String::new(), |p| format!("seconds grow with texels to the power of {p:.2}"));
    Some(Figure {
        title: "Seconds against texels".into(),
        subtitle: subtitle(chart),
        panels: vec![Panel {
            title: power,
            x: Axis::log("texels", Unit::Plain),
            y: Axis::log(seconds_label(chart.clock), Unit::Plain),
            series,
            rules: Vec::new(),
        }],
        columns: 1,
        panel: [560.0, 360.0],
        notes: vec![format!("{} rays a texel. The power is that of the three largest.", chart.points[0].rays)],
    })
}

/// Errors against the size of patches.
fn patches(chart: &Chart) -> Option<Figure> {
    let patches = chart.patches.as_ref().filter(|p| p.levels.len() > 1)?;
    let series = Reading::ALL.iter().enumerate().zip(STYLES).map(|((i, reading), (paint, mark))| {
        let datum = |l: &super::Level| {
            let error = l.errors[i].1?;
            Some(Datum {
                x: l.edge,
                y: error.value,
                interval: Some([error.low, error.high]),
                label: l.resolution.to_string(),
            })
        };
        let order = patches.order[i].1.map_or(String::new(), |o| format!(", error ~ edge^{o:.2}"));
        let points = patches.levels.iter().filter_map(datum).collect();
        Series { name: format!("{}{order}", reading.name()), paint, mark, line: Line::Solid, points }
    });
    Some(Figure {
        title: "Size of patches: one value each, and interpolated".into(),
        subtitle: chart.scene.clone(),
        panels: vec![Panel {
            title: "error at points of the surface".into(),
            x: Axis::log("edge of a patch, metres", Unit::Plain),
            y: Axis::log("relative error, root mean square", Unit::Percent),
            series: series.collect(),
            rules: Vec::new(),
        }],
        columns: 1,
        panel: [560.0, 360.0],
        notes: vec![format!(
            "Against an audit at {} points; 95 % intervals. Numbers: edge of the page. {} rays a patch, fewer for more than 2^26 in all. Powers: over all that can be told from noise.",
            count(patches.points as u64),
            patches.levels[0].rays
        )],
    })
}

/// Speed-up by threads.
fn threads(chart: &Chart) -> Option<Figure> {
    let one = chart.threads.first().filter(|_| chart.threads.len() > 1)?;
    let most = chart.threads.last().map_or(1, |t| t.threads) as f64;
    let at = |x: f64, y: f64| Datum { x, y, ..Datum::default() };
    let mut series = vec![Series {
        name: "threads".into(),
        paint: GREY,
        mark: Mark::None,
        line: Line::Dashed,
        points: vec![at(1.0, 1.0), at(most, most)],
    }];
    let whole = chart.threads.iter().map(|t| at(t.threads as f64, one.seconds / t.seconds)).collect();
    series.push(Series { name: "whole bake".into(), paint: BLACK, mark: Mark::Disc, line: Line::Solid, points: whole });
    for (room, (paint, mark)) in rooms(&one.rooms).into_iter().zip(STYLES.iter()) {
        let of = |t: &super::ThreadPoint| t.rooms.iter().find(|r| r.0 == room).map(|r| r.1).filter(|s| *s > 0.0);
        let points = chart.threads.iter().filter_map(|t| Some(at(t.threads as f64, of(one)? / of(t)?))).collect();
        series.push(Series { name: room.into(), paint: *paint, mark: *mark, line: Line::Solid, points });
    }
    Some(Figure {
        title: "Speed-up by threads".into(),
        subtitle: subtitle(chart),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::linear("threads"),
            y: Axis::linear("times as fast as one"),
            series,
            rules: Vec::new(),
        }],
        columns: 1,
        panel: [420.0, 340.0],
        notes: vec!["Wall seconds of the fastest of three bakes each.".into()],
    })
}

/// Rooms that take a twentieth of the time or more.
fn rooms(seconds: &[(&'static str, f64)]) -> Vec<&'static str> {
    let whole: f64 = seconds.iter().map(|s| s.1).sum();
    seconds.iter().filter(|s| s.1 >= 0.05 * whole).map(|s| s.0).collect()
}

fn seconds_label(clock: Clock) -> &'static str {
    match clock {
        Clock::Wall => "seconds",
        Clock::Processor => "processor seconds / threads",
    }
}

fn truth(chart: &Chart) -> String {
    match chart.truth.by.as_str() {
        "audit" => format!("an audit at {} points", count(chart.truth.points as u64)),
        file => format!("the lightmap of {file}"),
    }
}

fn subtitle(chart: &Chart) -> String {
    let Chart { scene, texels, threads_used, .. } = chart;
    format!("{scene}, {} texels, {threads_used} threads, {}", count(*texels as u64), chart.generator)
}

/// Digits in groups of three.
fn count(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    groups.join(" ")
}
