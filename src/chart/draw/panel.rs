//! [`Panel`]: one coordinate system with what is shown in it.

use super::{Anchor, Axis, FAINT, INK, Paint, Picture, Scale, Stroke, axis::Ruler, labels::Taken};
use glam::Vec2;
use std::f32::consts::TAU;

/// Axes and series.
pub struct Panel {
    /// Above it.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What is shown, the first lowest.
    pub series: Vec<Series>,
    /// Lines across.
    pub rules: Vec<Rule>,
}

/// Points of one kind.
#[derive(Clone)]
pub struct Series {
    /// In the legend; empty: not there.
    pub name: String,
    /// Of marks, lines and labels.
    pub paint: Paint,
    /// At each point.
    pub mark: Mark,
    /// Through the points.
    pub line: Line,
    /// In the order of the line.
    pub points: Vec<Datum>,
}

/// A point.
#[derive(Clone, Default)]
pub struct Datum {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
    /// Ends of the bar that shows how sure y is.
    pub interval: Option<[f64; 2]>,
    /// Beside it.
    pub label: String,
}

/// Shape of a point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// None.
    None,
    /// A disc.
    Disc,
    /// An open circle.
    Ring,
    /// A square.
    Square,
    /// A triangle.
    Triangle,
    /// A square on its corner.
    Diamond,
    /// A large star.
    Star,
}

/// Lines through the points.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// None.
    None,
    /// Solid.
    Solid,
    /// Dashed.
    Dashed,
    /// Broad and faint.
    Broad,
}

/// A line across all.
pub struct Rule {
    /// Where it lies.
    pub y: f64,
    /// On it.
    pub label: String,
}

const TITLE: f32 = 13.0;
const WORDS: f32 = 11.5;
const NUMBERS: f32 = 10.5;
/// Beside the frame: left, top, right, bottom.
pub(super) const LEFT: f32 = 58.0;
const TOP: f32 = 24.0;
const RIGHT: f32 = 8.0;
const BOTTOM: f32 = 40.0;

impl Panel {
    /// Paints it between two corners.
    pub(super) fn paint(&self, picture: &mut Picture, low: Vec2, high: Vec2) {
        let frame = [low + Vec2::new(LEFT, TOP), high - Vec2::new(RIGHT, BOTTOM)];
        let data = || self.series.iter().flat_map(|s| &s.points);
        let ends = |d: &Datum| d.interval.unwrap_or([d.y, d.y]);
        let both = |d: &Datum| self.x.scale.holds(d.x) && self.y.scale.holds(d.y);
        let x = self.x.ruler(data().filter(|d| both(d)).map(|d| d.x));
        let rules = self.rules.iter().map(|r| r.y);
        // Bars may run out of the frame at the lower end. Where they end at 0, the value between is noise: on a scale of
        // factors it has no place, and only the bar is shown.
        let is_noise = |d: &Datum| self.y.scale == Scale::Log && ends(d)[0] <= 0.0;
        let values = |d: &Datum| if is_noise(d) { [ends(d)[1]; 2] } else { [d.y, ends(d)[1]] };
        let y = self.y.ruler(data().filter(|d| both(d)).flat_map(values).chain(rules));
        let middle = (frame[0] + frame[1]) * 0.5;
        picture.text(Vec2::new(middle.x, low.y + 15.0), Anchor::Middle, TITLE, INK, &self.title);
        picture.text(Vec2::new(middle.x, high.y - 8.0), Anchor::Middle, WORDS, INK, &self.x.label);
        picture.text_upwards(Vec2::new(low.x + 12.0, middle.y), WORDS, INK, &self.y.label);
        grid(picture, frame, &x, &y);
        let place = |at: f64, to: f64| {
            let (h, v) = (x.place(at)? as f32, y.place(to)? as f32);
            Some(Vec2::new(frame[0].x + h * (frame[1].x - frame[0].x), frame[1].y - v * (frame[1].y - frame[0].y)))
        };
        let mut taken = Taken::default();
        for rule in &self.rules {
            let ends = x.range.map(|end| place(end, rule.y));
            let [Some(from), Some(to)] = ends else { continue };
            picture.polyline(&[from, to], Stroke { dash: Some([5.0, 4.0]), ..Stroke::solid(FAINT, 1.0) });
            picture.text(from + Vec2::new(5.0, 13.0), Anchor::Start, NUMBERS, FAINT, &rule.label);
            taken.take(from, from + Vec2::new(super::font::width(&rule.label, NUMBERS) + 8.0, 16.0));
        }
        for series in &self.series {
            let shown = series.points.iter().filter(|d| !is_noise(d)).filter_map(|d| place(d.x, d.y));
            let shown: Vec<Vec2> = shown.collect();
            series.line.paint(picture, &shown, series.paint);
            if series.line != Line::None && series.line != Line::Broad {
                taken.take_line(&shown);
            }
            for datum in &series.points {
                let inside = datum.y.clamp(y.range[0], y.range[1]);
                let (Some(at), Some([low, high])) = (place(datum.x, inside), datum.interval) else { continue };
                let upper = place(datum.x, high.min(y.range[1]));
                let lower = place(datum.x, low.max(y.range[0]));
                let ends = [lower.unwrap_or(at), upper.unwrap_or(at)];
                taken.take_line(&ends);
                picture.polyline(&ends, Stroke::solid(series.paint.faded(0.5), 1.2));
            }
            for at in &shown {
                series.mark.paint(picture, *at, series.paint);
                let half = match series.mark {
                    Mark::None => continue,
                    Mark::Star => 8.0,
                    _ => 3.5,
                };
                taken.take(*at - half, *at + half);
            }
        }
        for series in &self.series {
            for datum in series.points.iter().filter(|d| !d.label.is_empty() && !is_noise(d)) {
                if let Some(at) = place(datum.x, datum.y) {
                    taken.label(picture, frame, at, &datum.label, series.paint);
                }
            }
        }
    }
}

fn grid(picture: &mut Picture, frame: [Vec2; 2], x: &Ruler, y: &Ruler) {
    let [low, high] = frame;
    let line = |written: bool| Stroke::solid(Paint::of(if written { 0xd4_d4d4 } else { 0xee_eeee }), 1.0);
    let mut free = f32::NEG_INFINITY;
    for (number, written) in x.ticks() {
        let Some(share) = x.place(number) else { continue };
        let at = low.x + share as f32 * (high.x - low.x);
        picture.polyline(&[Vec2::new(at, low.y), Vec2::new(at, high.y)], line(written));
        let text = x.write(number);
        let half = 0.5 * super::font::width(&text, NUMBERS);
        if written && at - half > free {
            picture.text(Vec2::new(at, high.y + 14.0), Anchor::Middle, NUMBERS, INK, &text);
            free = at + half + 6.0;
        }
    }
    for (number, written) in y.ticks() {
        let Some(share) = y.place(number) else { continue };
        let at = high.y - share as f32 * (high.y - low.y);
        picture.polyline(&[Vec2::new(low.x, at), Vec2::new(high.x, at)], line(written));
        if written {
            picture.text(Vec2::new(low.x - 5.0, at + 3.8), Anchor::End, NUMBERS, INK, &y.write(number));
        }
    }
    let corners = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y), low];
    picture.polyline(&corners, Stroke::solid(Paint::of(0x99_9999), 1.0));
}

impl Line {
    pub(super) fn paint(self, picture: &mut Picture, points: &[Vec2], paint: Paint) {
        let stroke = match self {
            Line::None => return,
            Line::Solid => Stroke::solid(paint, 1.6),
            Line::Dashed => Stroke { dash: Some([6.0, 4.0]), ..Stroke::solid(paint, 1.6) },
            Line::Broad => Stroke::solid(paint.faded(0.25), 8.0),
        };
        if points.len() > 1 {
            picture.polyline(points, stroke);
        }
    }
}

impl Mark {
    pub(super) fn paint(self, picture: &mut Picture, at: Vec2, paint: Paint) {
        let round = |sides: u32, radius: f32, inner: f32, turn: f32| -> Vec<Vec2> {
            (0..sides)
                .map(|i| {
                    let angle = (i as f32 / sides as f32 + turn) * TAU;
                    let r = if i % 2 == 0 { radius } else { inner };
                    at + Vec2::new(libm::sinf(angle), -libm::cosf(angle)) * r
                })
                .collect()
        };
        let edge = Some(Stroke::solid(Paint::of(0xff_ffff), 0.8));
        match self {
            Mark::None => {}
            Mark::Disc => picture.polygon(&round(24, 4.0, 4.0, 0.0), paint, edge),
            Mark::Ring => {
                picture.polygon(&round(24, 3.6, 3.6, 0.0), Paint::of(0xff_ffff), Some(Stroke::solid(paint, 1.6)))
            }
            Mark::Square => picture.polygon(&round(4, 5.0, 5.0, 0.125), paint, edge),
            Mark::Triangle => picture.polygon(&round(3, 5.2, 5.2, 0.0), paint, edge),
            Mark::Diamond => picture.polygon(&round(4, 5.2, 5.2, 0.0), paint, edge),
            Mark::Star => picture.polygon(&round(10, 9.5, 4.2, 0.0), paint, Some(Stroke::solid(INK, 1.0))),
        }
    }
}
