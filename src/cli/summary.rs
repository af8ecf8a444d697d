//! The result in words: a few aligned lines about the bake, for people.

use luxel::{
    audit::{Audit, Interval, TexelSize},
    report::{PageReport, Report},
};
use std::{fmt::Write, path::Path};

/// A file beside the lit scene, and the exposure it was made with.
pub struct Extra<'a> {
    /// `preview` or `flat`.
    pub name: &'static str,
    /// The file.
    pub file: &'a Path,
    /// Factor from radiance to linear colour.
    pub exposure: f32,
}

/// One line a subject.
pub fn text(report: &Report, audit: Option<&Audit>, out: &Path, extras: &[Extra]) -> String {
    let mut lines = vec![("output", out.display().to_string()), ("pages", pages(&report.pages))];
    lines.push(("texels", format!("{}{}", count(report.texels as u64), density(report))));
    if report.receivers > 0 && report.receivers != report.texels {
        lines.push(("receivers", count(report.receivers as u64)));
    }
    let rays = &report.rays;
    let lost = if rays.traced > 0 { 100.0 * rays.lost as f64 / rays.traced as f64 } else { 0.0 };
    let speed = rays.per_second / 1e6;
    lines.push(("rays", format!("{}, {speed:.2} million a second", count(rays.traced))));
    lines.push(("lost rays", format!("{} ({})", count(rays.lost), percent(lost))));
    lines.push(("seconds", seconds(&report.seconds)));
    lines.push(("solver", solver(report)));
    lines.push(("energy", format!("imbalance {}", percent(100.0 * report.energy.imbalance))));
    if report.peak_memory_mb > 0 {
        lines.push(("memory", format!("{} MB at most", count(report.peak_memory_mb))));
    }
    for Extra { name, file, exposure } in extras {
        lines.push((name, exposed(file, *exposure)));
    }
    lines.extend(audit.into_iter().flat_map(audited));
    lines.push(("warnings", report.warnings.len().to_string()));
    self::lines(&lines)
}

/// A picture alone.
pub fn picture(file: &Path, exposure: f32) -> String {
    lines(&[("picture", exposed(file, exposure))])
}

fn exposed(file: &Path, exposure: f32) -> String {
    format!("{}, exposure {}", file.display(), digits(exposure.into()))
}

/// An audit alone.
pub fn audit(audit: &Audit) -> String {
    lines(&audited(audit))
}

/// Figures and what they were found with.
fn audited(audit: &Audit) -> Vec<(&'static str, String)> {
    let figure = |name: &str, i: Option<Interval>| match i {
        Some(Interval { value, low, high }) => {
            let [value, low, high] = [value, low, high].map(|x| format!("{:.2}", 100.0 * x));
            format!("{name} {value} % ({low} to {high})")
        }
        None => format!("{name} unknown"),
    };
    let errors = [("error", audit.error), ("dark", audit.dark), ("borders", audit.border), ("bias", audit.bias)];
    let spread = [("median", audit.median), ("95th percentile", audit.p95)];
    let list = |all: &[(&str, Option<Interval>)]| all.iter().map(|(n, i)| figure(n, *i)).collect::<Vec<_>>().join(", ");
    let effort = format!("{:.0} % intervals, {} points", 100.0 * audit.level, count(audit.points as u64));
    let left_out = if audit.enclosed > 0 { format!(", {} enclosed", count(audit.enclosed as u64)) } else { "".into() };
    let mut lines = vec![
        ("audit", format!("{}; {effort}{left_out}, {:.2} s", list(&errors), audit.seconds)),
        ("texels off", list(&spread)),
    ];
    if let Some(TexelSize { error, density_to_halve }) = audit.texel_size {
        let remedy = density_to_halve.map(|d| format!("; {d:.1} times the density would halve it"));
        lines.push(("texel size", figure("look-ups at points", Some(error)) + &remedy.unwrap_or_default()));
    }
    lines
}

/// Subjects and what is to be said of them.
pub fn lines(lines: &[(&str, String)]) -> String {
    lines.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "{name:<10} {value}");
        text
    })
}

fn pages(pages: &[PageReport]) -> String {
    let one = |p: &PageReport| format!("{} x {}, {:.0} % used", p.width, p.height, 100.0 * p.utilization);
    match pages {
        [] => "none".into(),
        [page] => format!("1 ({})", one(page)),
        [first, .., last] => format!("{} ({}; ... {})", pages.len(), one(first), one(last)),
    }
}

fn density(report: &Report) -> String {
    let mapped = report.nodes.iter().filter(|n| n.page.is_some()).map(|n| n.texels_per_meter);
    let (low, high) = mapped.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), d| (l.min(d), h.max(d)));
    if low > high {
        return String::new();
    }
    let range = if high <= low * 1.05 { digits(high) } else { format!("{} to {}", digits(low), digits(high)) };
    format!(", {range} a metre")
}

fn seconds(rooms: &[(&'static str, f64)]) -> String {
    let total = rooms.iter().map(|r| r.1).sum::<f64>();
    let each = rooms.iter().map(|(name, s)| format!("{name} {s:.2}")).collect::<Vec<_>>().join(", ");
    format!("{total:.2} ({each})")
}

fn solver(report: &Report) -> String {
    let s = &report.solver;
    if let Some(bounces) = s.bounces {
        return format!("{}, bounces 0 to {bounces}", s.name);
    }
    let (bound, relative) = (s.bound.unwrap_or(0.0), s.relative_bound.unwrap_or(0.0));
    let end = if s.converged { "" } else { ", NOT converged" };
    format!(
        "{}, {} entries touched in {:.2} s, error at most {} W/m2 ({} of the darker half){end}",
        s.name,
        count(s.entries),
        s.seconds,
        digits(bound),
        percent(100.0 * relative)
    )
}

/// Three significant digits.
fn digits(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if !(1e-3..1e6).contains(&a) => format!("{x:.2e}"),
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        a if a >= 1.0 => format!("{x:.2}"),
        _ => format!("{x:.4}"),
    }
}

fn percent(x: f64) -> String {
    format!("{} %", digits(x))
}

/// Digits in groups of three.
fn count(n: u64) -> String {
    let plain = n.to_string();
    let mut grouped = String::new();
    for (i, digit) in plain.chars().enumerate() {
        if i > 0 && (plain.len() - i).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([count(0), count(999), count(1000), count(1234567)], ["0", "999", "1 000", "1 234 567"]);
        assert_eq!([digits(0.0), digits(123.4), digits(0.5), digits(1e-9)], ["0", "123", "0.5000", "1.00e-9"]);
    }

    #[test]
    fn an_empty_report_has_a_summary() {
        let text = text(&Report::default(), Some(&Audit::default()), Path::new("a.lit.glb"), &[]);
        assert!(text.starts_with("output     a.lit.glb\n") && text.ends_with("warnings   0\n"), "{text}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}
