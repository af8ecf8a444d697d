//! A picture as PNG: the only file that knows tiny-skia.

use super::{Paint, Picture, Shape, Step, Stroke, font};
use crate::pixels;
use glam::{UVec2, Vec2};
use std::io;
use tiny_skia::{FillRule, Path, PathBuilder, Pixmap, StrokeDash, Transform};

/// The picture, `scale` pixels to its unit.
pub fn png(picture: &Picture, scale: f32) -> io::Result<Vec<u8>> {
    let size = (picture.size * scale).ceil().as_uvec2();
    let too_large = || io::Error::new(io::ErrorKind::InvalidInput, "the picture is too large");
    let mut map = Pixmap::new(size.x, size.y).ok_or_else(too_large)?;
    map.fill(tiny_skia::Color::WHITE);
    for shape in &picture.shapes {
        match shape {
            Shape::Path { steps, fill, stroke } => {
                let Some(path) = outline(steps.iter().copied(), |p| p * scale) else { continue };
                if let Some(paint) = fill {
                    map.fill_path(&path, &colour(*paint), FillRule::Winding, Transform::identity(), None);
                }
                if let Some(stroke) = stroke {
                    map.stroke_path(&path, &colour(stroke.paint), &pen(stroke, scale), Transform::identity(), None);
                }
            }
            Shape::Text { at, text, size, paint, upwards } => {
                let mut along = 0.0;
                for letter in text.chars() {
                    let glyph = font::glyph(letter);
                    let place = |p: Vec2| {
                        let p = (p + Vec2::new(along, 0.0)) * *size;
                        (*at + if *upwards { Vec2::new(p.y, -p.x) } else { p }) * scale
                    };
                    if let Some(path) = outline(glyph.steps.iter().copied(), place) {
                        map.fill_path(&path, &colour(*paint), FillRule::Winding, Transform::identity(), None);
                    }
                    along += glyph.advance;
                }
            }
        }
    }
    // On white nothing is transparent.
    let rgb: Vec<[u8; 3]> = map.pixels().iter().map(|p| [p.red(), p.green(), p.blue()]).collect();
    pixels::encode_png(UVec2::new(size.x, size.y), &rgb)
}

fn outline(steps: impl Iterator<Item = Step>, place: impl Fn(Vec2) -> Vec2) -> Option<Path> {
    let mut path = PathBuilder::new();
    for step in steps {
        match step {
            Step::Move(p) => path.move_to(place(p).x, place(p).y),
            Step::Line(p) => path.line_to(place(p).x, place(p).y),
            Step::Curve(c, p) => path.quad_to(place(c).x, place(c).y, place(p).x, place(p).y),
            Step::Close => path.close(),
        }
    }
    path.finish()
}

fn colour(paint: Paint) -> tiny_skia::Paint<'static> {
    let [_, r, g, b] = paint.rgb.to_be_bytes();
    let mut out = tiny_skia::Paint::default();
    out.set_color_rgba8(r, g, b, (paint.opacity * 255.0).round() as u8);
    out
}

fn pen(stroke: &Stroke, scale: f32) -> tiny_skia::Stroke {
    tiny_skia::Stroke {
        width: stroke.width * scale,
        line_join: tiny_skia::LineJoin::Round,
        dash: stroke.dash.and_then(|[on, off]| StrokeDash::new(vec![on * scale, off * scale], 0.0)),
        ..tiny_skia::Stroke::default()
    }
}
