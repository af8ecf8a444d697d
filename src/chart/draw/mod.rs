//! Pictures of lines and words, as SVG and as PNG. Letters are outlines of one font that comes along: both look
//! the same on every machine.

mod axis;
mod figure;
mod font;
mod labels;
mod panel;
mod png;
mod svg;

pub use axis::{Axis, Scale, Unit};
pub use figure::Figure;
pub use panel::{Datum, Line, Mark, Panel, Rule, Series};
pub use png::png;
pub use svg::svg;

use glam::Vec2;

/// Shapes in the order in which they are painted, on white; (0, 0) is the top left corner.
pub struct Picture {
    size: Vec2,
    shapes: Vec<Shape>,
    /// What it shows, for those who cannot see it.
    title: String,
}

enum Shape {
    Path { steps: Vec<Step>, fill: Option<Paint>, stroke: Option<Stroke> },
    Text { at: Vec2, text: String, size: f32, paint: Paint, upwards: bool },
}

/// A step of an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Move(Vec2),
    Line(Vec2),
    /// Control point and end.
    Curve(Vec2, Vec2),
    Close,
}

/// A colour (sRGB) and its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// 0xRRGGBB.
    pub rgb: u32,
    /// 0 to 1.
    pub opacity: f32,
}

#[derive(Clone, Copy)]
struct Stroke {
    paint: Paint,
    width: f32,
    /// Lengths of dashes and of the gaps between; none: solid.
    dash: Option<[f32; 2]>,
}

/// Where a text's point lies in it.
#[derive(Clone, Copy, PartialEq)]
enum Anchor {
    Start,
    Middle,
    End,
}

const INK: Paint = Paint::of(0x22_2222);
const FAINT: Paint = Paint::of(0x66_6666);

impl Paint {
    /// An opaque colour.
    pub const fn of(rgb: u32) -> Self {
        Paint { rgb, opacity: 1.0 }
    }

    /// The same colour, `opacity` of it.
    pub const fn faded(self, opacity: f32) -> Self {
        Paint { opacity, ..self }
    }
}

impl Picture {
    fn polyline(&mut self, points: &[Vec2], stroke: Stroke) {
        let step = |(i, p): (usize, &Vec2)| if i == 0 { Step::Move(*p) } else { Step::Line(*p) };
        let steps = points.iter().enumerate().map(step).collect();
        self.shapes.push(Shape::Path { steps, fill: None, stroke: Some(stroke) });
    }

    fn polygon(&mut self, corners: &[Vec2], fill: Paint, stroke: Option<Stroke>) {
        let step = |(i, p): (usize, &Vec2)| if i == 0 { Step::Move(*p) } else { Step::Line(*p) };
        let steps = corners.iter().enumerate().map(step).chain([Step::Close]).collect();
        self.shapes.push(Shape::Path { steps, fill: Some(fill), stroke });
    }

    fn text(&mut self, at: Vec2, anchor: Anchor, size: f32, paint: Paint, text: &str) {
        let at = Vec2::new(at.x - anchor.share() * font::width(text, size), at.y);
        self.shapes.push(Shape::Text { at, text: text.into(), size, paint, upwards: false });
    }

    /// Reads upwards, centred at `at`.
    fn text_upwards(&mut self, at: Vec2, size: f32, paint: Paint, text: &str) {
        let at = Vec2::new(at.x, at.y + 0.5 * font::width(text, size));
        self.shapes.push(Shape::Text { at, text: text.into(), size, paint, upwards: true });
    }
}

impl Anchor {
    fn share(self) -> f32 {
        match self {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        }
    }
}

impl Stroke {
    fn solid(paint: Paint, width: f32) -> Self {
        Stroke { paint, width, dash: None }
    }
}
