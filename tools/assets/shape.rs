//! [`Shape`]: triangles with normals, built from quads, boxes, grids and profiles that turn about an axis.

use glam::{Vec2, Vec3, vec2, vec3};
use std::f32::consts::TAU;

/// Vertices and triangles; counter-clockwise is the front. `uvs` and `colors` are empty or one a vertex.
#[derive(Clone, Default)]
pub struct Shape {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub colors: Vec<Vec3>,
    pub indices: Vec<u16>,
}

/// Faces of a box, for [`Shape::block`].
pub mod side {
    pub const LEFT: u8 = 1;
    pub const RIGHT: u8 = 2;
    pub const BOTTOM: u8 = 4;
    pub const TOP: u8 = 8;
    pub const BACK: u8 = 16;
    pub const FRONT: u8 = 32;
}

impl Shape {
    /// A flat quad, counter-clockwise from its front.
    pub fn quad(mut self, corners: [Vec3; 4]) -> Self {
        let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize();
        let first = self.positions.len() as u16;
        self.positions.extend(corners);
        self.normals.extend([normal; 4]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        self
    }

    /// A box without the faces in `without`: those that touch something else and would lie in its plane.
    pub fn block(mut self, min: Vec3, max: Vec3, without: u8) -> Self {
        let p = |x: u8, y: u8, z: u8| {
            vec3(
                if x == 0 { min.x } else { max.x },
                if y == 0 { min.y } else { max.y },
                if z == 0 { min.z } else { max.z },
            )
        };
        let faces = [
            (side::LEFT, [p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0)]),
            (side::RIGHT, [p(1, 0, 1), p(1, 0, 0), p(1, 1, 0), p(1, 1, 1)]),
            (side::BOTTOM, [p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1)]),
            (side::TOP, [p(0, 1, 1), p(1, 1, 1), p(1, 1, 0), p(0, 1, 0)]),
            (side::BACK, [p(1, 0, 0), p(0, 0, 0), p(0, 1, 0), p(1, 1, 0)]),
            (side::FRONT, [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)]),
        ];
        for (_, corners) in faces.into_iter().filter(|(s, _)| s & without == 0) {
            self = self.quad(corners);
        }
        self
    }

    /// Quads between the grid lines `us` x `vs`; `place` puts (u, v) into space, the front is where u turns to v
    /// counter-clockwise.
    pub fn grid(self, us: &[f32], vs: &[f32], place: impl Fn(f32, f32) -> Vec3) -> Self {
        self.grid_with_holes(us, vs, |_, _| false, place)
    }

    /// A grid without the cells (column, row) that `hole` names.
    pub fn grid_with_holes(
        mut self,
        us: &[f32],
        vs: &[f32],
        hole: impl Fn(usize, usize) -> bool,
        place: impl Fn(f32, f32) -> Vec3,
    ) -> Self {
        for j in 0..vs.len() - 1 {
            for i in (0..us.len() - 1).filter(|i| !hole(*i, j)) {
                let ([u0, u1], [v0, v1]) = ([us[i], us[i + 1]], [vs[j], vs[j + 1]]);
                self = self.quad([place(u0, v0), place(u1, v0), place(u1, v1), place(u0, v1)]);
            }
        }
        self
    }

    /// A smooth sheet of `nu` x `nv` cells over (s, t) in [0, 1]^2 with texture coordinates (s, 1 - t).
    /// `place` gives position and normal. Rows that shrink to a point give one triangle a cell.
    pub fn sheet(nu: usize, nv: usize, place: impl Fn(f32, f32) -> (Vec3, Vec3)) -> Self {
        let mut out = Shape::default();
        for j in 0..=nv {
            for i in 0..=nu {
                let (s, t) = (i as f32 / nu as f32, j as f32 / nv as f32);
                let (position, normal) = place(s, t);
                out.positions.push(position);
                out.normals.push(normal.normalize());
                out.uvs.push(vec2(s, 1.0 - t));
            }
        }
        let at = |i: usize, j: usize| (j * (nu + 1) + i) as u16;
        for (j, i) in (0..nv).flat_map(|j| (0..nu).map(move |i| (j, i))) {
            for t in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]] {
                let [a, b, c] = t.map(|v| out.positions[v as usize]);
                if (b - a).cross(c - a).length() > 1e-9 {
                    out.indices.extend(t);
                }
            }
        }
        out.compact()
    }

    /// A profile of (radius, height) from the bottom up, turned about +Y; the front is outside. Smooth but at points
    /// that stand twice in the profile.
    pub fn turned(profile: &[Vec2], around: usize) -> Self {
        let mut out = Shape::default();
        let mut from = 0;
        for to in 1..profile.len() {
            let sharp = to + 1 == profile.len() || profile[to] == profile[to + 1];
            if sharp {
                out = out.append(&turned_piece(&profile[from..=to], around));
                from = to + 1;
            }
        }
        out
    }

    /// A ball.
    pub fn ball(radius: f32, around: usize) -> Self {
        let rows = around / 2;
        let point = |j| {
            let polar = TAU / 2.0 * j as f32 / rows as f32;
            let sin = if j == 0 || j == rows { 0.0 } else { libm::sinf(polar) };
            radius * vec2(sin, -libm::cosf(polar))
        };
        let mut out = turned_piece(&(0..=rows).map(point).collect::<Vec<_>>(), around);
        out.normals = out.positions.iter().map(|p| p.normalize()).collect();
        out
    }

    /// Adds another shape's triangles. Both have the same attributes, or this one is still empty.
    fn append(mut self, other: &Shape) -> Self {
        let first = self.positions.len() as u16;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uvs.extend(&other.uvs);
        self.colors.extend(&other.colors);
        self.indices.extend(other.indices.iter().map(|i| first + i));
        self
    }

    /// Texture coordinates from positions.
    pub fn mapped(mut self, uv: impl Fn(Vec3) -> Vec2) -> Self {
        self.uvs = self.positions.iter().map(|p| uv(*p)).collect();
        self
    }

    /// No texture coordinates.
    pub fn plain(mut self) -> Self {
        self.uvs.clear();
        self
    }

    /// Without the vertices that no triangle uses.
    fn compact(mut self) -> Self {
        let mut used = vec![false; self.positions.len()];
        self.indices.iter().for_each(|i| used[*i as usize] = true);
        let mut next = 0;
        let renumber = |used: &bool| {
            next += u16::from(*used);
            next.saturating_sub(1)
        };
        let new: Vec<u16> = used.iter().map(renumber).collect();
        self.indices.iter_mut().for_each(|i| *i = new[*i as usize]);
        let keep = |i: &usize| used[*i];
        let all = 0..used.len();
        self.positions = all.clone().filter(keep).map(|i| self.positions[i]).collect();
        self.normals = all.clone().filter(keep).map(|i| self.normals[i]).collect();
        self.uvs = all.filter(keep).map(|i| self.uvs[i]).collect();
        self
    }
}

fn turned_piece(profile: &[Vec2], around: usize) -> Shape {
    let rows = profile.len() - 1;
    let sheet = Shape::sheet(around, rows, |s, t| {
        let j = (t * rows as f32 + 0.5) as usize;
        let tangent = profile[(j + 1).min(rows)] - profile[j.saturating_sub(1)];
        // The seam's two columns are the same points exactly.
        let angle = if s == 1.0 { 0.0 } else { TAU * s };
        let out = vec3(libm::sinf(angle), 0.0, libm::cosf(angle));
        (profile[j].x * out + profile[j].y * Vec3::Y, tangent.y * out - tangent.x * Vec3::Y)
    });
    sheet.plain()
}
