//! A picture as SVG: paths only, each letter defined once.

use super::{Paint, Picture, Shape, Step, Stroke, font};
use glam::Vec2;
use std::{
    collections::BTreeSet,
    fmt::{self, Write},
};

/// The picture as a document of its own.
pub fn svg(picture: &Picture) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write(picture, &mut out);
    out
}

fn write(picture: &Picture, out: &mut String) -> fmt::Result {
    let Vec2 { x, y } = picture.size;
    writeln!(out, r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {x} {y}" width="{x}" height="{y}">"#)?;
    writeln!(out, "<title>{}</title>", escaped(&picture.title))?;
    writeln!(out, "<defs>")?;
    let words = picture.shapes.iter().filter_map(|s| if let Shape::Text { text, .. } = s { Some(text) } else { None });
    for letter in words.flat_map(|t| t.chars()).collect::<BTreeSet<char>>() {
        // Thousandths: the viewer scales them.
        let outline = path(&font::glyph(letter).steps, 1000.0, 0);
        writeln!(out, r#"<path id="u{:x}" d="{outline}"/>"#, u32::from(letter))?;
    }
    writeln!(out, "</defs>")?;
    writeln!(out, r##"<rect width="{x}" height="{y}" fill="#fff"/>"##)?;
    for shape in &picture.shapes {
        match shape {
            Shape::Path { steps, fill, stroke } => {
                write!(out, r#"<path d="{}""#, path(steps, 1.0, 2))?;
                match fill {
                    Some(fill) => write!(out, "{}", paint("fill", *fill))?,
                    None => write!(out, r#" fill="none""#)?,
                }
                if let Some(stroke) = stroke {
                    write!(out, "{}", outlined(stroke))?;
                }
                writeln!(out, "/>")?;
            }
            Shape::Text { at, text, size, paint: color, upwards } => {
                let turn = if *upwards { " rotate(-90)" } else { "" };
                let (x, y, scale) = (number(at.x, 2), number(at.y, 2), number(size * 1e-3, 5));
                let label = escaped(text);
                write!(
                    out,
                    r#"<g role="img" aria-label="{label}" transform="translate({x} {y}){turn} scale({scale})""#
                )?;
                write!(out, "{}>", paint("fill", *color))?;
                let mut along = 0.0;
                for letter in text.chars() {
                    if letter != ' ' {
                        write!(out, r##"<use href="#u{:x}" x="{}"/>"##, u32::from(letter), number(along, 0))?;
                    }
                    along += font::glyph(letter).advance * 1000.0;
                }
                writeln!(out, "</g>")?;
            }
        }
    }
    writeln!(out, "</svg>")
}

fn path(steps: &[Step], scale: f32, digits: usize) -> String {
    let point = |p: Vec2| format!("{} {}", number(p.x * scale, digits), number(p.y * scale, digits));
    steps.iter().fold(String::new(), |out, step| {
        out + &match step {
            Step::Move(p) => format!("M{}", point(*p)),
            Step::Line(p) => format!("L{}", point(*p)),
            Step::Curve(c, p) => format!("Q{} {}", point(*c), point(*p)),
            Step::Close => "Z".into(),
        }
    })
}

fn paint(name: &str, paint: Paint) -> String {
    let faded =
        if paint.opacity < 1.0 { format!(r#" {name}-opacity="{}""#, number(paint.opacity, 2)) } else { String::new() };
    format!(r##" {name}="#{:06x}"{faded}"##, paint.rgb)
}

fn outlined(stroke: &Stroke) -> String {
    let dash = stroke.dash.map_or(String::new(), |[on, off]| format!(r#" stroke-dasharray="{on} {off}""#));
    let width = number(stroke.width, 2);
    format!(r#"{} stroke-width="{width}" stroke-linejoin="round"{dash}"#, paint("stroke", stroke.paint))
}

/// Without needless zeros.
fn number(x: f32, digits: usize) -> String {
    let text = format!("{x:.digits$}");
    let text = if digits > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

fn escaped(text: &str) -> String {
    let plain = text.replace(|c: char| c.is_control(), " ");
    plain.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
