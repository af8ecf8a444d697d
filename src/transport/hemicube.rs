//! Rows by hemicubes (Cohen and Greenberg, "The Hemi-Cube", 1985): half a cube about one point of the texel, and what is
//! seen through the middle of each of its pixels counts with the pixel's delta form factor.
//!
//! A ray stands for a pixel, in place of the z-buffer. What that method is known for stays: patches smaller than a pixel
//! are met or missed (aliasing; each texel's cube is turned about the normal by an angle of its own, so that it is grain,
//! not plaid), and one point stands for its texel, which tells where patches are near.

use super::{
    Options, Stats, Transport,
    receiver::Receiver,
    rows::{BLOCK, Block, DARK},
    sight::Sight,
    waves::{self, Desk, Done, Method, Task},
};
use crate::{
    atlas::Coverage,
    error::Result,
    math::PointTable,
    patches::{Patches, Seen, SurfacePoint},
    progress::Observer,
    trace::Tracer,
};
use glam::{Vec2, Vec3};
use std::f64::consts::TAU;

/// Measures the receivers of `transport`, and the backs that are met.
pub(super) fn measure(
    tracer: &Tracer,
    coverage: &Coverage,
    patches: &mut Patches,
    transport: &mut Transport,
    resolution: u32,
    options: &Options,
    observer: &dyn Observer,
) -> Result<()> {
    let hemicube = Hemicube {
        sight: Sight::new(tracer, coverage),
        pixels: pixels(resolution),
        table: PointTable::of_places(PLACES, 0x6865_6d69),
    };
    waves::measure(&hemicube, patches, transport, options, observer)
}

/// Places of a texel that are looked at where its middle may be enclosed.
const PLACES: usize = 16;

struct Hemicube<'a> {
    sight: Sight<'a>,
    pixels: Vec<Pixel>,
    table: PointTable,
}

struct Pixel {
    /// Unit direction through its middle, about +z.
    direction: Vec3,
    /// Delta form factor.
    factor: f64,
}

/// The pixels of the top and of the four sides; their factors sum to 1.
fn pixels(resolution: u32) -> Vec<Pixel> {
    let n = resolution as i32;
    let edge = |k: i32| f64::from(2 * k - n) / f64::from(n);
    let mut pixels = Vec::with_capacity(3 * (n * n) as usize);
    // Over a rectangle, from its integral to each corner.
    let over = |f: fn(f64, f64) -> f64, [i, j]: [i32; 2]| {
        let [x, y] = [[edge(i), edge(i + 1)], [edge(j), edge(j + 1)]];
        let factor = f(x[1], y[1]) - f(x[0], y[1]) - f(x[1], y[0]) + f(x[0], y[0]);
        (Vec2::new(x[0].midpoint(x[1]) as f32, y[0].midpoint(y[1]) as f32), factor)
    };
    for at in (0..n).flat_map(|j| (0..n).map(move |i| [i, j])) {
        let (p, factor) = over(top, at);
        pixels.push(Pixel { direction: p.extend(1.0).normalize(), factor });
    }
    for side in [Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y] {
        for at in (n / 2..n).flat_map(|j| (0..n).map(move |i| [i, j])) {
            let (p, factor) = over(wall, at);
            let direction = (side + side.perp() * p.x).extend(p.y).normalize();
            pixels.push(Pixel { direction, factor });
        }
    }
    pixels
}

/// Form factor of the rectangle from over the point to (x, y), at height 1 (Howell B-3); odd in both.
fn top(x: f64, y: f64) -> f64 {
    let half = |x: f64, y: f64| {
        let r = (1.0 + x * x).sqrt();
        x / r * libm::atan(y / r)
    };
    (half(x, y) + half(y, x)) / TAU
}

/// Form factor of the rectangle from beside the point to (x, z), upright at distance 1 (Howell B-4); odd in x.
fn wall(x: f64, z: f64) -> f64 {
    let r = (1.0 + z * z).sqrt();
    (libm::atan(x) - libm::atan(x / r) / r) / TAU
}

impl Method for Hemicube<'_> {
    fn sight(&self) -> &Sight<'_> {
        &self.sight
    }

    fn block<'s>(&'s self, desk: &mut Desk<'s>, task: &Task, observer: &dyn Observer) -> Done {
        let mut done = Done::default();
        let (receivers, _) = desk.clear(&self.table, &task.texels, task.back);
        for receiver in receivers {
            if observer.cancelled() {
                return done;
            }
            self.row(receiver, &mut done);
            observer.advance(1);
        }
        done.block.shrink();
        done
    }
}

impl Hemicube<'_> {
    /// Stands on the place that is nearest to the texel's middle; on the nearest open one if that is enclosed.
    fn row(&self, receiver: &Receiver, done: &mut Done) {
        let places = self.table.block(receiver.at.x, receiver.at.y, 0).iter().map(|p| p.place);
        let mut points: Vec<SurfacePoint> = places.map(|place| receiver.surface(place)).collect();
        let middle = points.iter().map(|p| p.position).sum::<Vec3>() / PLACES as f32;
        let far = |p: &SurfacePoint| p.position.distance_squared(middle);
        // The middle may lie at the border of several pieces, where it may look past what encloses all of them.
        let whole = receiver.middle();
        if points.iter().all(|p| far(&whole) < far(p)) {
            points.push(whole);
        }
        points.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let mut view = self.view(receiver, &points[0], &mut done.stats);
        let (mut validity, mut buried) = (1.0, false);
        if !view.behind.is_empty() {
            let enclosed = self.sight.holds(receiver, &points, &mut 0);
            let open = enclosed.iter().filter(|enclosed| !**enclosed).count();
            match enclosed.iter().position(|enclosed| !enclosed) {
                Some(0) => {}
                Some(k) => view = self.view(receiver, &points[k], &mut done.stats),
                None => buried = true,
            }
            validity = if buried { 1.0 } else { open as f32 / points.len() as f32 };
        }
        for (seen, pixel) in view.behind {
            view.columns.push((self.sight.column(seen, &mut done.stats), pixel));
        }
        done.validity.push(validity);
        done.buried.push(buried);
        self.push(view.columns, &mut done.block);
    }

    /// What is seen from a point.
    fn view(&self, receiver: &Receiver, p: &SurfacePoint, stats: &mut Stats) -> View {
        let mut view = View::default();
        let frame = p.frame.turned(receiver.turn_of_its_own());
        let (mut rays, mut hits) = (Vec::with_capacity(BLOCK), vec![None; BLOCK]);
        for (first, pixels) in (0..).step_by(BLOCK).zip(self.pixels.chunks(BLOCK)) {
            let ray = |(k, pixel): (u32, &Pixel)| p.ray(frame.to_world(pixel.direction), receiver.key.wrapping_add(k));
            rays.clear();
            rays.extend((first..).zip(pixels).map(ray));
            self.sight.tracer.closest_of_each(&rays, &mut hits[..rays.len()]);
            // Directions below the face, where that is shaded smoothly, do not count.
            let above = (first..).zip(rays.iter().zip(&hits)).filter(|(_, (ray, _))| ray.direction.dot(p.face) > 0.0);
            for (pixel, (ray, hit)) in above {
                match self.sight.end(ray, hit, stats).column {
                    Ok(column) => view.columns.push((column, pixel)),
                    Err(seen) => view.behind.push((seen, pixel)),
                }
            }
        }
        view
    }

    /// Appends a row: an entry for each column, over what counts of the hemisphere.
    fn push(&self, mut columns: Vec<(u32, u32)>, block: &mut Block) {
        columns.sort_unstable();
        let factor = |(_, pixel): &(u32, u32)| self.pixels[*pixel as usize].factor;
        let all: f64 = columns.iter().map(factor).sum();
        let lit = columns.partition_point(|c| c.0 != DARK);
        let entry = |same: &[(u32, u32)]| (same[0].0, (same.iter().map(factor).sum::<f64>() / all) as f32);
        block.push_weighted(columns[..lit].chunk_by(|a, b| a.0 == b.0).map(entry));
    }
}

/// Columns by pixel.
#[derive(Default)]
struct View {
    columns: Vec<(u32, u32)>,
    /// Seen by pixels if the point is open.
    behind: Vec<(Seen, u32)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delta_factors_are_those_of_the_hemisphere() {
        for resolution in [4, 64, 256] {
            let pixels = pixels(resolution);
            assert_eq!(pixels.len() as u32, 3 * resolution * resolution);
            let sum: f64 = pixels.iter().map(|p| p.factor).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{resolution}: {sum}");
            assert!(pixels.iter().all(|p| p.factor > 0.0 && p.direction.z > 0.0));
        }
        // Cohen and Greenberg's own, of a pixel's middle: 1 / (pi (x^2 + y^2 + 1)^2) and z / (pi (y^2 + z^2 + 1)^2).
        // Of a pixel's middle only: off by h^2 / 24 of their Laplacian, at most 16 times themselves (walls, at their feet).
        let edge = 2.0 / 256.0;
        let most = 16.0 * edge * edge / 24.0 + 4.0 * f64::from(f32::EPSILON);
        let pixels = pixels(256);
        for p in pixels.iter().step_by(101) {
            let cos = f64::from(p.direction.z);
            let far = 1.0 / f64::from(p.direction.abs().max_element());
            // Projected to distance 1: area times cos cos' / (pi r^2), with cos' = 1 / r.
            let expected = edge * edge * cos / (std::f64::consts::PI * far.powi(3));
            assert!((p.factor / expected - 1.0).abs() < most, "{:?}: {} {expected}", p.direction, p.factor);
        }
    }
}
