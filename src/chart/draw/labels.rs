//! Small labels beside their points, where there is room.

use super::{Anchor, Paint, Picture, font};
use glam::Vec2;

/// Rectangles that are taken.
#[derive(Default)]
pub(super) struct Taken(Vec<[Vec2; 2]>);

const SIZE: f32 = 10.0;
/// From a point's middle to its label.
const GAP: f32 = 7.0;

impl Taken {
    /// Nothing else goes here.
    pub fn take(&mut self, low: Vec2, high: Vec2) {
        self.0.push([low, high]);
    }

    /// Along a line.
    pub fn take_line(&mut self, points: &[Vec2]) {
        for pair in points.windows(2) {
            let steps = (pair[0].distance(pair[1]) / 5.0).ceil().max(1.0) as u32;
            for i in 0..=steps {
                let p = pair[0].lerp(pair[1], i as f32 / steps as f32);
                self.take(p - 1.5, p + 1.5);
            }
        }
    }

    fn is_free(&self, low: Vec2, high: Vec2) -> bool {
        self.0.iter().all(|[l, h]| low.x > h.x || high.x < l.x || low.y > h.y || high.y < l.y)
    }

    /// Writes `text` beside `at`, within `frame`; nothing where there is no room for it.
    pub fn label(&mut self, picture: &mut Picture, frame: [Vec2; 2], at: Vec2, text: &str, paint: Paint) {
        let size = Vec2::new(font::width(text, SIZE), SIZE * 0.8);
        // Corners of the box, in the order in which they please.
        let beside =
            [(0.0, -1.0), (0.0, 1.0), (1.0, -0.7), (-1.0, -0.7), (1.0, 0.7), (-1.0, 0.7), (1.0, 0.0), (-1.0, 0.0)];
        for (reach, (x, y)) in [1.0, 1.7].into_iter().flat_map(|reach| beside.map(|b| (reach, b))) {
            let towards = Vec2::new(x, y);
            let low = at + towards * GAP * reach + (towards * 0.5 - 0.5) * size;
            let high = low + size;
            let inside = low.cmpge(frame[0] + 2.0).all() && high.cmple(frame[1] - 2.0).all();
            if inside && self.is_free(low - 1.0, high + 1.0) {
                self.take(low, high);
                picture.text(Vec2::new(low.x, high.y), Anchor::Start, SIZE, paint, text);
                return;
            }
        }
    }
}
