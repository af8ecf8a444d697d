//! [`Figure`]: panels side by side under a title, one legend for all of them, notes at the end.

use super::{Anchor, FAINT, INK, Line, Mark, Paint, Panel, Picture, Series, font};
use glam::Vec2;

/// A whole picture.
pub struct Figure {
    /// In large letters.
    pub title: String,
    /// Below it.
    pub subtitle: String,
    /// Row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row.
    pub columns: usize,
    /// Width and height of a panel.
    pub panel: [f32; 2],
    /// What one should know to read it.
    pub notes: Vec<String>,
}

const MARGIN: f32 = 14.0;
const LEGEND: f32 = 12.0;
const NOTE: f32 = 11.0;
/// From one line of the legend, or of the notes, to the next.
const LEAD: f32 = 19.0;

impl Figure {
    /// Lays it out.
    pub fn picture(&self) -> Picture {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns);
        let width = columns as f32 * self.panel[0] + 2.0 * MARGIN;
        let mut picture = Picture { size: Vec2::new(width, 0.0), shapes: Vec::new(), title: self.title.clone() };
        picture.text(Vec2::new(MARGIN, 28.0), Anchor::Start, 17.0, INK, &self.title);
        let mut y = 36.0;
        for line in wrapped(&self.subtitle, width - 2.0 * MARGIN, LEGEND) {
            y += 16.0;
            picture.text(Vec2::new(MARGIN, y - 3.0), Anchor::Start, LEGEND, FAINT, &line);
        }
        y += 8.0;
        for (i, panel) in self.panels.iter().enumerate() {
            let at = Vec2::new((i % columns) as f32, (i / columns) as f32) * Vec2::from(self.panel);
            let low = at + Vec2::new(MARGIN, y);
            panel.paint(&mut picture, low, low + Vec2::from(self.panel));
        }
        y += rows as f32 * self.panel[1] + 6.0;
        y = self.legend(&mut picture, y, width);
        for line in self.notes.iter().flat_map(|note| wrapped(note, width - 2.0 * MARGIN, NOTE)) {
            y += LEAD - 3.0;
            picture.text(Vec2::new(MARGIN, y - 4.0), Anchor::Start, NOTE, FAINT, &line);
        }
        picture.size.y = (y + 10.0).ceil();
        picture
    }

    /// Each name once; returns where it ends.
    fn legend(&self, picture: &mut Picture, top: f32, width: f32) -> f32 {
        let mut shown: Vec<(&str, Paint, Mark, Line)> = Vec::new();
        for Series { name, paint, mark, line, points } in self.panels.iter().flat_map(|p| &p.series) {
            if !name.is_empty() && !points.is_empty() && !shown.iter().any(|s| s.0 == name) {
                shown.push((name, *paint, *mark, *line));
            }
        }
        let (mut x, mut y) = (MARGIN, top + LEAD);
        for (name, paint, mark, line) in &shown {
            let wide = 34.0 + font::width(name, LEGEND) + 18.0;
            if x > MARGIN && x + wide > width {
                (x, y) = (MARGIN, y + LEAD);
            }
            let middle = Vec2::new(x + 14.0, y - 4.0);
            line.paint(picture, &[middle - Vec2::new(13.0, 0.0), middle + Vec2::new(13.0, 0.0)], *paint);
            mark.paint(picture, middle, *paint);
            picture.text(Vec2::new(x + 34.0, y), Anchor::Start, LEGEND, INK, name);
            x += wide;
        }
        if shown.is_empty() { top } else { y + 6.0 }
    }
}

/// Lines no wider than `width`.
fn wrapped(text: &str, width: f32, size: f32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        match lines.last_mut().filter(|line| font::width(line, size) + font::width(word, size) + size <= width) {
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word.into()),
        }
    }
    lines
}
