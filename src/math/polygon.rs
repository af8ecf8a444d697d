//! Small convex polygons in the plane: clipping to a unit cell or triangle (Sutherland and Hodgman, 1974) and area.

use glam::DVec2;

/// A convex polygon of at most eight corners.
#[derive(Clone, Copy, Debug)]
pub struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    /// A triangle, in either winding.
    pub fn triangle(t: [DVec2; 3]) -> Self {
        Self::of(t)
    }

    /// A convex quadrangle, in either winding.
    pub fn quadrangle(q: [DVec2; 4]) -> Self {
        Self::of(q)
    }

    fn of<const N: usize>(some: [DVec2; N]) -> Self {
        let mut corners = [DVec2::ZERO; 8];
        corners[..N].copy_from_slice(&some);
        Polygon { corners, count: N }
    }

    /// Its corners in order.
    pub fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// The part inside [min.x, min.x + 1] x [min.y, min.y + 1].
    pub fn clipped_to_cell(&self, min: DVec2) -> Self {
        self.clipped_to_strip(1, min.y).clipped_to_strip(0, min.x)
    }

    /// The part between `min` and `min + 1` along an axis.
    #[inline]
    pub fn clipped_to_strip(&self, axis: usize, min: f64) -> Self {
        self.clipped(|c| c[axis] - min).clipped(|c| min + 1.0 - c[axis])
    }

    /// The part in which both coordinates are positive and their sum is below 1: of a polygon in barycentrics, the part in the
    /// triangle.
    pub fn clipped_to_triangle(&self) -> Self {
        self.clipped(|c| c.x).clipped(|c| c.y).clipped(|c| 1.0 - c.x - c.y)
    }

    /// Its image, by a map that is affine.
    pub fn map(mut self, to: impl Fn(DVec2) -> DVec2) -> Self {
        self.corners[..self.count].iter_mut().for_each(|c| *c = to(*c));
        self
    }

    /// Area, positive.
    pub fn area(&self) -> f64 {
        let c = self.corners();
        let Some(&a) = c.first() else { return 0.0 };
        c.windows(2).map(|e| (e[0] - a).perp_dot(e[1] - a)).sum::<f64>().abs() * 0.5
    }

    #[inline]
    fn clipped(&self, inside: impl Fn(DVec2) -> f64) -> Self {
        let c = self.corners();
        // Most are cut by few lines.
        if c.iter().all(|&c| inside(c) >= 0.0) {
            return *self;
        }
        let mut out = Polygon { corners: [DVec2::ZERO; 8], count: 0 };
        let Some(mut a) = c.last() else { return out };
        let mut da = inside(*a);
        for b in c {
            let db = inside(*b);
            if (da >= 0.0) != (db >= 0.0) {
                out.push(a + (b - a) * (da / (da - db)));
            }
            if db >= 0.0 {
                out.push(*b);
            }
            (a, da) = (b, db);
        }
        out
    }

    fn push(&mut self, corner: DVec2) {
        // Seven corners are the most a triangle and a square can make; rounding may add one without area.
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat2;

    #[test]
    fn cells_of_a_triangle_add_up_to_it() {
        let t = Polygon::triangle([DVec2::new(0.3, 0.2), DVec2::new(6.7, 1.9), DVec2::new(2.1, 5.6)]);
        let sum: f64 = (0..7)
            .flat_map(|x| (0..7).map(move |y| DVec2::new(f64::from(x), f64::from(y))))
            .map(|min| t.clipped_to_cell(min).area())
            .sum();
        assert!((sum - t.area()).abs() < 1e-12, "{sum} {}", t.area());
    }

    /// The same part of a triangle, by the cell's sides and, in barycentrics, by its own.
    #[test]
    fn a_cell_in_a_triangle_is_a_triangle_in_a_cell() {
        let (o, x, y) = (DVec2::new(0.3, 0.2), DVec2::new(3.4, 1.7), DVec2::new(1.8, 4.4));
        let to_bary = DMat2::from_cols(x, y).inverse();
        let mut cut = 0;
        for k in 0..49 {
            let min = DVec2::new(f64::from(k % 7), f64::from(k / 7));
            let cell = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|c| to_bary * (min + c - o));
            let area = Polygon::quadrangle(cell).clipped_to_triangle().area() * x.perp_dot(y);
            let other = Polygon::triangle([o, o + x, o + y]).clipped_to_cell(min).area();
            assert!((area - other).abs() < 1e-12, "{min}: {area} {other}");
            cut += usize::from(area > 1e-9 && area < 1.0 - 1e-9);
        }
        assert!(cut > 9, "{cut}");
    }

    #[test]
    fn outside_is_empty() {
        let t = Polygon::triangle([DVec2::ZERO, DVec2::X, DVec2::Y]);
        assert_eq!(t.clipped_to_cell(DVec2::new(3.0, 0.0)).area(), 0.0);
    }
}
