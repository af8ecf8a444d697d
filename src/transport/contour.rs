//! `factor`: how much two polygons exchange, unhindered, in closed form but for one integral.
//!
//! Stokes' theorem turns the double area integral of cos cos' / (pi r^2) into one over both outlines, of ln r / 2 pi
//! (Moon, "The Scientific Basis of Illuminating Engineering", 1936). Of each pair of edges the inner integral is in closed
//! form (Mitalas and Stephenson, "Fortran IV Programs to Calculate Radiant Energy Interchange Factors", 1966), the outer
//! by adaptive Gauss quadrature: polygons may touch.

use glam::DVec3;
use std::f64::consts::TAU;

/// A convex polygon of one plane.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    pub corners: Vec<DVec3>,
    /// Unit normal of its front, about which its corners run counterclockwise.
    pub normal: DVec3,
}

/// Quadrature ends where halves change the whole by less than this share of the product of the edges' lengths.
const TOLERANCE: f64 = 1e-10;
/// Share of a length below which differences of the inner integral are not looked at.
const ROUNDING: f64 = 1e-14;
/// Edges that are so many times their lengths apart need no halves.
const FAR: f64 = 4.0;
/// Halvings, at most.
const DEPTH: u32 = 18;

/// A F of either: the area of one times the share that it sees of the other. `rounding`: what is no farther in front of a
/// plane lies in it.
pub(super) fn factor(a: &Polygon, b: &Polygon, rounding: f64) -> f64 {
    let (a, b) = (above(a, b, rounding), above(b, a, rounding));
    if a.len() < 3 || b.len() < 3 {
        return 0.0;
    }
    let edges = |p: &[DVec3]| (0..p.len()).map(|k| [p[k], p[(k + 1) % p.len()]]).collect::<Vec<_>>();
    let others = edges(&b);
    let pairs = edges(&a).into_iter().flat_map(|e| others.iter().map(move |o| exchange(e, *o)));
    (pairs.sum::<f64>() / TAU).max(0.0)
}

/// What of `polygon` lies in front of the plane of `other`; nothing, unless some of it is there.
fn above(polygon: &Polygon, other: &Polygon, rounding: f64) -> Vec<DVec3> {
    let height = |p: DVec3| (p - other.corners[0]).dot(other.normal);
    let c = &polygon.corners;
    if c.iter().all(|p| height(*p) <= rounding) {
        return Vec::new();
    }
    if c.iter().all(|p| height(*p) >= 0.0) {
        return c.clone();
    }
    let mut kept = Vec::with_capacity(c.len() + 1);
    for (k, &q) in c.iter().enumerate() {
        let p = c[(k + c.len() - 1) % c.len()];
        let (from, to) = (height(p), height(q));
        if (from > 0.0) != (to > 0.0) {
            kept.push(p.lerp(q, from / (from - to)));
        }
        if to > 0.0 {
            kept.push(q);
        }
    }
    kept
}

/// The integral of ln r over two edges, times the cosine between them.
fn exchange([a, b]: [DVec3; 2], other: [DVec3; 2]) -> f64 {
    let (way, across) = (b - a, other[1] - other[0]);
    let (length, width) = (way.length(), across.length());
    if length == 0.0 || width == 0.0 {
        return 0.0;
    }
    let (way, across) = (way / length, across / width);
    let cos = way.dot(across);
    if cos.abs() < 1e-12 {
        return 0.0;
    }
    let at = |s: f64| inner(a + way * s - other[0], across, width);
    let whole = gauss(&at, 0.0, length);
    let apart = (a + b - other[0] - other[1]) / 2.0;
    if apart.length_squared() > FAR * FAR * (length + width) * (length + width) {
        return cos * whole;
    }
    // Of edges that are far shorter than they are apart, differences are rounded off.
    let reach = apart.length() + length + width;
    cos * adapted(&at, 0.0, length, whole, length * (TOLERANCE * width + ROUNDING * reach), DEPTH)
}

fn adapted(f: &impl Fn(f64) -> f64, from: f64, to: f64, whole: f64, tolerance: f64, depth: u32) -> f64 {
    let middle = from.midpoint(to);
    let halves = [gauss(f, from, middle), gauss(f, middle, to)];
    if depth == 0 || (halves[0] + halves[1] - whole).abs() <= tolerance {
        return halves[0] + halves[1];
    }
    adapted(f, from, middle, halves[0], tolerance, depth - 1) + adapted(f, middle, to, halves[1], tolerance, depth - 1)
}

/// Gauss' rule of four points.
fn gauss(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    const RULE: [[f64; 2]; 2] =
        [[0.339_981_043_584_856_26, 0.652_145_154_862_546_1], [0.861_136_311_594_052_6, 0.347_854_845_137_453_85]];
    let (middle, half) = (from.midpoint(to), (to - from) / 2.0);
    RULE.iter().map(|[x, w]| w * (f(middle - x * half) + f(middle + x * half))).sum::<f64>() * half
}

/// The integral of ln r from a point to the segment of `width` along `across`, which starts at minus `p` of it.
fn inner(p: DVec3, across: DVec3, width: f64) -> f64 {
    let foot = p.dot(across);
    let height = (p - across * foot).length();
    let to = |u: f64| {
        let square = u * u + height * height;
        // u ln r goes to 0 with r.
        let log = if square > 0.0 { 0.5 * u * libm::log(square) } else { 0.0 };
        log - u + height * libm::atan2(u, height)
    };
    to(width - foot) - to(-foot)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(o: [f64; 3], s: [f64; 3], t: [f64; 3]) -> Polygon {
        let [o, s, t] = [o, s, t].map(DVec3::from_array);
        Polygon { corners: vec![o, o + s, o + s + t, o + t], normal: s.cross(t).normalize() }
    }

    /// An edge without length to speak of, as at the pole of a ball, takes no time.
    #[test]
    fn tiny_edges_end() {
        let floor = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let mut upright = rectangle([0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        upright.corners.insert(1, DVec3::new(1e-12, 1e-9, 1e-12));
        upright.corners.insert(4, DVec3::new(1e-9, 1e-10, 1.0));
        assert!((factor(&floor, &upright, 1e-9) - 0.2000437761).abs() < 1e-7);
    }

    #[test]
    fn howells_squares() {
        let floor = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let opposed = rectangle([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        let close = rectangle([0.0, 0.0, 0.1], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        let upright = rectangle([0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        // Goes on below the floor, where nothing is seen of it.
        let deeper = rectangle([0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]);
        for (other, expected) in
            [(&opposed, 0.1998248957), (&close, 0.8269945224), (&upright, 0.2000437761), (&deeper, 0.2000437761)]
        {
            for f in [factor(&floor, other, 1e-9), factor(other, &floor, 1e-9)] {
                assert!((f - expected).abs() < 1e-9, "{f} {expected}");
            }
        }
        assert_eq!(factor(&floor, &rectangle([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), 1e-9), 0.0);
        assert_eq!(factor(&floor, &rectangle([2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), 1e-9), 0.0);
    }
}
