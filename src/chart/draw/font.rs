//! Letters as outlines. `font.ttf` is DejaVu Sans, cut down to the letters of charts (`font.txt` holds its licence).

use super::Step;
use glam::Vec2;
use std::{collections::BTreeMap, sync::OnceLock};
use ttf_parser::{Face, OutlineBuilder};

static FILE: &[u8] = include_bytes!("font.ttf");

/// A letter of size 1, y down, from the base line.
#[derive(Default)]
pub(super) struct Glyph {
    pub advance: f32,
    pub steps: Vec<Step>,
}

/// Width of a line.
pub(super) fn width(text: &str, size: f32) -> f32 {
    text.chars().map(|c| glyph(c).advance).sum::<f32>() * size
}

/// The letter, or a question mark for one that the font does not have.
pub(super) fn glyph(letter: char) -> &'static Glyph {
    static GLYPHS: OnceLock<BTreeMap<char, Glyph>> = OnceLock::new();
    static NONE: Glyph = Glyph { advance: 0.0, steps: Vec::new() };
    let glyphs = GLYPHS.get_or_init(|| Face::parse(FILE, 0).map(|face| all(&face)).unwrap_or_default());
    glyphs.get(&letter).or_else(|| glyphs.get(&'?')).unwrap_or(&NONE)
}

fn all(face: &Face) -> BTreeMap<char, Glyph> {
    let unit = 1.0 / f32::from(face.units_per_em());
    let one = |c: char| {
        let id = face.glyph_index(c)?;
        let mut pen = Pen { unit, steps: Vec::new() };
        face.outline_glyph(id, &mut pen);
        Some((c, Glyph { advance: f32::from(face.glyph_hor_advance(id)?) * unit, steps: pen.steps }))
    };
    (' '..='\u{2fff}').filter_map(one).collect()
}

struct Pen {
    unit: f32,
    steps: Vec<Step>,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> Vec2 {
        Vec2::new(x, -y) * self.unit
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Move(self.at(x, y)));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Line(self.at(x, y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.steps.push(Step::Curve(self.at(x1, y1), self.at(x, y)));
    }

    fn curve_to(&mut self, _: f32, _: f32, _: f32, _: f32, x: f32, y: f32) {
        // TrueType has none.
        self.line_to(x, y);
    }

    fn close(&mut self) {
        self.steps.push(Step::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_have_outlines_and_widths() {
        for letter in "aZ09%.×−½".chars() {
            assert!(glyph(letter).steps.len() > 4 && glyph(letter).advance > 0.3, "{letter}");
        }
        assert!(width("iii", 10.0) < width("WWW", 10.0));
        assert_eq!(width("\u{1f600}", 1.0), width("?", 1.0));
    }
}
