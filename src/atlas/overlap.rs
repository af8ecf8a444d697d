//! Where triangles of a layout lie on one another: found on a raster, measured exactly.
//!
//! Shared edges and corners do not count. What is narrower than a cell of the raster may be missed.

use glam::DVec2;

/// A triangle in uv, counter-clockwise or clockwise, and whom it belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Corners.
    pub uv: [DVec2; 3],
    /// Index of the owner.
    pub group: u32,
}

/// Two pieces, by index, whose overlap went beyond what is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Clash(pub u32, pub u32);

/// Which pairs count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Among {
    /// All of them.
    All,
    /// Pieces of different groups.
    Groups,
}

/// Overlapping area of each group; stops at the first pair that brings a group above its `limit`.
pub(super) fn overlap(pieces: &[Piece], among: Among, limit: &[f64]) -> Result<Vec<f64>, Clash> {
    let mut found = vec![0.0; limit.len()];
    let Some(grid) = Grid::around(pieces) else { return Ok(found) };
    let mut owner = vec![u32::MAX; grid.width * grid.height];
    // The piece that last met piece i: each pair is measured once.
    let mut met = vec![u32::MAX; pieces.len()];
    for (i, piece) in pieces.iter().enumerate() {
        let i = i as u32;
        for (row, span) in grid.rows(&piece.uv) {
            for cell in &mut owner[row * grid.width..][span] {
                if *cell == u32::MAX {
                    *cell = i;
                    continue;
                }
                let j = *cell as usize;
                let other = &pieces[j];
                if met[j] == i || (among == Among::Groups && other.group == piece.group) {
                    continue;
                }
                met[j] = i;
                let area = shared_area(&piece.uv, &other.uv);
                for g in [piece.group as usize, other.group as usize] {
                    found[g] += area;
                    if found[g] > limit[g] {
                        return Err(Clash(j as u32, i));
                    }
                    if piece.group == other.group {
                        break;
                    }
                }
            }
        }
    }
    Ok(found)
}

/// Twice the signed area.
pub(super) fn cross(t: &[DVec2; 3]) -> f64 {
    (t[1] - t[0]).perp_dot(t[2] - t[0])
}

/// Sample points over the box that holds all pieces.
struct Grid {
    min: DVec2,
    cell: f64,
    width: usize,
    height: usize,
}

impl Grid {
    fn around(pieces: &[Piece]) -> Option<Grid> {
        let corners = || pieces.iter().flat_map(|p| p.uv);
        let min = corners().reduce(DVec2::min)?;
        let size = corners().reduce(DVec2::max)? - min;
        // Sixteen samples a triangle in the mean and more, within reason.
        let edge = (16.0 * (pieces.len() as f64).sqrt()).clamp(256.0, 4096.0);
        let cell = size.max_element() / edge;
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let [width, height] = size.to_array().map(|s| (s / cell).ceil() as usize + 1);
        Some(Grid { min, cell, width, height })
    }

    /// Rows with the columns whose sample points lie inside `t`.
    fn rows(&self, t: &[DVec2; 3]) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
        let t = t.map(|p| (p - self.min) / self.cell - 0.5);
        let low = t.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = t.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
        let width = self.width;
        let rows = (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).clamp(0.0, self.height as f64) as usize);
        rows.map(move |row| {
            let y = row as f64;
            let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if (a.y <= y) != (b.y <= y) {
                    let x = a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
                    (from, to) = (from.min(x), to.max(x));
                }
            }
            let start = (from.ceil().max(0.0) as usize).min(width);
            let end = ((to.floor() + 1.0).clamp(0.0, width as f64)) as usize;
            (row, start..end.max(start))
        })
    }
}

/// Area that two triangles share.
fn shared_area(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
    let turned = |t: &[DVec2; 3]| if cross(t) < 0.0 { [t[0], t[2], t[1]] } else { *t };
    let (a, b) = (turned(a), turned(b));
    let mut polygon = a.to_vec();
    for k in 0..3 {
        let (p, edge) = (b[k], b[(k + 1) % 3] - b[k]);
        let side = |q: DVec2| edge.perp_dot(q - p);
        let mut cut = Vec::with_capacity(polygon.len() + 1);
        for (i, &q) in polygon.iter().enumerate() {
            let r = polygon[(i + 1) % polygon.len()];
            let (s, t) = (side(q), side(r));
            if s >= 0.0 {
                cut.push(q);
            }
            if (s > 0.0 && t < 0.0) || (s < 0.0 && t > 0.0) {
                cut.push(q + (r - q) * (s / (s - t)));
            }
        }
        polygon = cut;
    }
    let Some(&first) = polygon.first() else { return 0.0 };
    polygon.windows(2).map(|w| (w[0] - first).perp_dot(w[1] - first)).sum::<f64>().max(0.0) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(uv: [[f64; 2]; 3], group: u32) -> Piece {
        Piece { uv: uv.map(DVec2::from), group }
    }

    #[test]
    fn touching_is_no_overlap_and_overlap_is_measured() {
        let lower = piece([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0);
        let upper = piece([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 1);
        assert!(overlap(&[lower, upper], Among::All, &[1.0, 1.0]).unwrap()[0] < 1e-12);
        let across = piece([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 1);
        let found = overlap(&[lower, across], Among::Groups, &[1.0, 1.0]).unwrap();
        assert!((found[0] - 0.25).abs() < 1e-12 && (found[1] - 0.25).abs() < 1e-12, "{found:?}");
        assert_eq!(overlap(&[lower, across], Among::All, &[0.1, 0.1]), Err(Clash(0, 1)));
    }
}
