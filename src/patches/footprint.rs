//! [`Footprint`]: points spread evenly over the surface inside a texel.

use crate::{
    atlas::Coverage,
    math::{Frame, Polygon},
    scene::{World, shading_normal},
    trace::{Ray, Segment, rounding},
};
use glam::{DMat2, DVec2, Mat2, Vec2, Vec3};

/// The surface inside one texel, cut into cells that are affine images of the unit square or its lower half.
///
/// Reused from texel to texel: [`Footprint::set`] keeps the allocations.
#[derive(Default)]
pub struct Footprint {
    cells: Vec<Cell>,
    faces: Vec<Face>,
}

/// Triangles of a world, made ready when they are first asked for: texels beside each other share most of them.
pub struct Faces<'w> {
    world: &'w World<'w>,
    coverage: &'w Coverage,
    /// By the last digits of their numbers, the last that was asked for.
    slots: Vec<Option<Face>>,
}

const SLOTS: usize = 64;

/// Cells among which one is found by comparing with all.
const FEW: usize = 8;

/// A part of a face: the affine image of the unit square or of its lower half.
pub struct Cell {
    /// Index of the face.
    pub face: u32,
    square: bool,
    /// Sum of the areas before this cell, and with it.
    before: f32,
    after: f32,
    origin: [Vec3; 3],
    bary: [Vec2; 3],
}

/// A triangle of which a part is inside the texel.
#[derive(Clone)]
pub struct Face {
    /// Global triangle.
    pub triangle: u32,
    normal: Vec3,
    frame: Frame,
    /// At its corners, where it is shaded smoothly.
    smooth: Option<[Vec3; 3]>,
    offset: f32,
    corners: [Vec3; 3],
    /// Its corners on the page, texels.
    uv: [Vec2; 3],
    /// From there to barycentrics.
    inverse: DMat2,
}

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// World position, on the face.
    pub position: Vec3,
    /// Unit face normal of the front.
    pub face: Vec3,
    /// Unit shading normal: the interpolated vertex normal where there is one.
    pub normal: Vec3,
    /// Axes around `normal`.
    pub frame: Frame,
    /// Global triangle.
    pub triangle: u32,
    /// Barycentrics (1 - x - y, x, y).
    pub bary: Vec2,
    /// How far from the face a ray starts so as not to meet it, metres.
    pub offset: f32,
}

impl SurfacePoint {
    /// The same point on the back of the surface.
    pub fn reversed(self) -> Self {
        SurfacePoint { face: -self.face, normal: -self.normal, frame: self.frame.reversed(), ..self }
    }

    /// Where rays from here start: just above the face.
    pub fn lifted(&self) -> Vec3 {
        self.position + self.face * self.offset
    }

    /// A ray from here.
    #[inline(always)]
    pub fn ray(&self, direction: Vec3, key: u32) -> Ray {
        Ray { origin: self.lifted(), direction, key, from: self.triangle }
    }

    /// The way from here as far as `t` lengths of the direction.
    #[inline(always)]
    pub fn segment(&self, direction: Vec3, t: f32) -> Segment {
        Segment { origin: self.lifted(), direction, t, from: self.triangle }
    }

    /// Share of the cosine-weighted hemisphere about `normal` that lies above the face: (1 + cos a) / 2.
    pub fn kept(&self) -> f32 {
        0.5 * (1.0 + self.normal.dot(self.face))
    }
}

impl Cell {
    /// World position of a place in the cell.
    #[inline(always)]
    pub fn position(&self, at: Vec2) -> Vec3 {
        self.origin[0] + self.origin[1] * at.x + self.origin[2] * at.y
    }

    /// The place in the cell that is nearest to a position, about: moved inside side by side.
    fn nearest(&self, position: Vec3) -> Vec2 {
        let [origin, x, y] = self.origin;
        let way = position - origin;
        let inverse = Mat2::from_cols(Vec2::new(x.dot(x), x.dot(y)), Vec2::new(x.dot(y), y.dot(y))).inverse();
        let at = inverse * Vec2::new(way.dot(x), way.dot(y));
        if !at.is_finite() {
            return Vec2::ZERO;
        }
        let inside = at.clamp(Vec2::ZERO, Vec2::ONE);
        let beyond = if self.square { 0.0 } else { (inside.element_sum() - 1.0).max(0.0) };
        inside - 0.5 * beyond
    }
}

impl Face {
    fn new(world: &World, coverage: &Coverage, triangle: u32) -> Self {
        let (instance, local) = world.locate(triangle);
        let corners = world.corners(instance, local);
        let normal = world.cross(instance, &corners).normalize_or_zero();
        let smooth = world.smooth_normals(instance, local, normal);
        let charted = &coverage.charted[triangle as usize];
        let [a, b, c] = charted.exact();
        Face {
            triangle,
            normal,
            frame: Frame::around(normal),
            smooth,
            offset: rounding(&corners),
            corners,
            uv: charted.corners,
            inverse: DMat2::from_cols(b - a, c - a).inverse(),
        }
    }

    /// Barycentrics of a place on the page.
    fn bary(&self, at: DVec2) -> DVec2 {
        self.inverse * (at - self.uv[0].as_dvec2())
    }

    /// True if the texel whose first corner is at `bary` lies in the triangle.
    fn holds_texel(&self, bary: DVec2) -> bool {
        const ROUNDING: f64 = 1e-9;
        let [x, y] = [self.inverse.x_axis, self.inverse.y_axis];
        let least = bary + x.min(DVec2::ZERO) + y.min(DVec2::ZERO);
        let most = bary.element_sum() + x.element_sum().max(0.0) + y.element_sum().max(0.0);
        least.min_element() >= -ROUNDING && most <= 1.0 + ROUNDING
    }

    /// From a point on the front to where rays start, and the axes of their directions; `None` where those differ from
    /// point to point.
    pub fn flat(&self) -> Option<(Vec3, Frame)> {
        self.smooth.is_none().then_some((self.normal * self.offset, self.frame))
    }
}

impl<'w> Faces<'w> {
    /// None yet.
    pub fn new(world: &'w World<'w>, coverage: &'w Coverage) -> Self {
        Faces { world, coverage, slots: vec![None; SLOTS] }
    }

    fn get(&mut self, triangle: u32) -> &Face {
        let slot = &mut self.slots[triangle as usize % SLOTS];
        if slot.as_ref().is_some_and(|face| face.triangle != triangle) {
            *slot = None;
        }
        slot.get_or_insert_with(|| Face::new(self.world, self.coverage, triangle))
    }
}

impl Footprint {
    /// That of one texel.
    pub fn of(texel: usize, faces: &mut Faces) -> Self {
        let mut footprint = Footprint::default();
        footprint.set(texel, faces);
        footprint
    }

    /// Takes on the surface inside `texel`.
    pub fn set(&mut self, texel: usize, faces: &mut Faces) {
        let coverage = faces.coverage;
        self.cells.clear();
        self.faces.clear();
        let at = coverage.texels[texel].at.as_dvec2();
        let mut sum = 0.0;
        for fragment in coverage.fragments_of(texel) {
            let face = faces.get(fragment.triangle);
            sum = cut(face, self.faces.len() as u32, at, fragment.area, sum, &mut self.cells);
            self.faces.push(face.clone());
        }
    }

    /// Its pieces, wound as the front is.
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        self.cells.iter().flat_map(|c| {
            let [o, x, y] = self.wound(c);
            let other = c.square.then_some([o + x, o + x + y, o + y]);
            std::iter::once([o, o + x, o + y]).chain(other)
        })
    }

    /// The same as convex polygons, one a face, without the diagonals that part them.
    pub fn polygons(&self) -> impl Iterator<Item = Vec<Vec3>> {
        self.cells.chunk_by(|a, b| a.face == b.face).map(|cells| {
            let [o, x, y] = cells[0].origin;
            let mut corners = vec![o, o + x];
            corners.extend(cells[0].square.then_some(o + x + y));
            // Cells of a face are a fan about its first corner.
            corners.extend(cells.iter().map(|c| c.origin[0] + c.origin[2]));
            if self.wound(&cells[0]) != [o, x, y] {
                corners.reverse();
            }
            corners
        })
    }

    /// Corner and edges of a cell, so that they turn as the front does.
    fn wound(&self, c: &Cell) -> [Vec3; 3] {
        let [o, x, y] = c.origin;
        // Clipping keeps the order of uv, which a mirrored chart turns around.
        if x.cross(y).dot(self.faces[c.face as usize].normal) < 0.0 { [o, y, x] } else { [o, x, y] }
    }

    /// Unit face normal of every piece of a triangle in it.
    pub fn normals(&self) -> impl Iterator<Item = Vec3> {
        self.faces.iter().map(|f| f.normal)
    }

    /// World area, m^2.
    pub fn area(&self) -> f32 {
        self.cells.last().map_or(0.0, |c| c.after)
    }

    /// Face normal of the largest piece.
    pub fn normal(&self) -> Vec3 {
        let largest = self.cells.iter().max_by(|a, b| (a.after - a.before).total_cmp(&(b.after - b.before)));
        largest.map_or(Vec3::Y, |c| self.faces[c.face as usize].normal)
    }

    /// The pieces of triangles in it.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// The same with the share of its area that each has.
    pub fn shares(&self) -> impl Iterator<Item = (&Face, f32)> {
        let of_face = |cells: &[Cell]| (cells[0].face, cells[cells.len() - 1].after - cells[0].before);
        let areas = self.cells.chunk_by(|a, b| a.face == b.face).map(of_face);
        areas.map(|(face, area)| (&self.faces[face as usize], area / self.area()))
    }

    /// The cell for `u` of the unit square, and the place in the cell; equal areas of the square are equal areas of surface.
    #[inline(always)]
    pub fn cell(&self, u: Vec2) -> (&Cell, Vec2) {
        let (cell, u) = match &self.cells[..] {
            [one] => (one, u),
            cells => {
                let at = u.x * self.area();
                // Counted where they are few: their loads do not wait for each other.
                let k = if cells.len() <= FEW {
                    cells.iter().map(|c| usize::from(c.after <= at)).sum::<usize>()
                } else {
                    cells.partition_point(|c| c.after <= at)
                };
                let k = k.min(cells.len() - 1);
                let c = &cells[k];
                (c, Vec2::new(((at - c.before) / (c.after - c.before)).clamp(0.0, 1.0), u.y))
            }
        };
        (cell, if cell.square { u } else { square_to_triangle(u) })
    }

    /// The point for `u` of the unit square.
    pub fn point(&self, u: Vec2) -> SurfacePoint {
        let (cell, f) = self.cell(u);
        self.at(cell, f)
    }

    /// The middle of the surface, which may lie beside it.
    pub fn centroid(&self) -> Vec3 {
        let middle = |c: &Cell| c.position(if c.square { Vec2::splat(0.5) } else { Vec2::splat(1.0 / 3.0) });
        self.cells.iter().map(|c| middle(c) * (c.after - c.before)).sum::<Vec3>() / self.area()
    }

    /// The point of the surface that is nearest to there, about.
    pub fn middle(&self) -> SurfacePoint {
        let centroid = self.centroid();
        let mut nearest = (f32::INFINITY, &self.cells[0], Vec2::ZERO);
        for cell in &self.cells {
            let f = cell.nearest(centroid);
            let distance = cell.position(f).distance_squared(centroid);
            if distance < nearest.0 {
                nearest = (distance, cell, f);
            }
        }
        self.at(nearest.1, nearest.2)
    }

    /// The point at a place of a cell.
    fn at(&self, cell: &Cell, f: Vec2) -> SurfacePoint {
        let face = &self.faces[cell.face as usize];
        let bary = (cell.bary[0] + cell.bary[1] * f.x + cell.bary[2] * f.y).max(Vec2::ZERO);
        let (normal, frame) = match &face.smooth {
            Some(corners) => {
                let normal = shading_normal(corners, bary, face.normal);
                (normal, Frame::around(normal))
            }
            None => (face.normal, face.frame),
        };
        SurfacePoint {
            position: cell.position(f),
            face: face.normal,
            normal,
            frame,
            triangle: face.triangle,
            bary,
            offset: face.offset,
        }
    }
}

/// Adds the cells of the part of a face, the `index`-th, inside the texel at `at`; `area` is that of the part, `sum` that of
/// the cells before. Returns the new sum.
fn cut(face: &Face, index: u32, at: DVec2, area: f32, mut sum: f32, cells: &mut Vec<Cell>) -> f32 {
    let [p, q, r] = face.corners.map(|c| c.as_dvec3());
    let position = |b: DVec2| (p + (q - p) * b.x + (r - p) * b.y).as_vec3();
    let mut add = |square: bool, [a, b, c]: [DVec2; 3], share: f64| {
        let after = sum + area * share as f32;
        if after > sum {
            let (pa, pb, pc) = (position(a), position(b), position(c));
            cells.push(Cell {
                face: index,
                square,
                before: sum,
                after,
                origin: [pa, pb - pa, pc - pa],
                bary: [a.as_vec2(), (b - a).as_vec2(), (c - a).as_vec2()],
            });
            sum = after;
        }
    };
    let (first, [x, y]) = (face.bary(at), [face.inverse.x_axis, face.inverse.y_axis]);
    if face.holds_texel(first) {
        add(true, [first, first + x, first + y], 1.0);
        return sum;
    }
    let mut clipped = Polygon::quadrangle([first, first + x, first + x + y, first + y]).clipped_to_triangle();
    let mut place = clipped;
    if clipped.area() == 0.0 {
        // Rounding ate it: as the coverage was cut, that found some.
        clipped = Polygon::triangle(face.uv.map(|c| c.as_dvec2())).clipped_to_cell(at);
        place = clipped.map(|c| face.bary(c));
    }
    let (total, c, b) = (clipped.area(), clipped.corners(), place.corners());
    for k in 1..c.len().saturating_sub(1) {
        let share = (c[k] - c[0]).perp_dot(c[k + 1] - c[0]).abs() * 0.5 / total;
        add(false, [b[0], b[k], b[k + 1]], share);
    }
    sum
}

/// Area-preserving fold of the unit square onto the triangle (0,0), (1,0), (0,1) (Heitz, "A Low-Distortion Map Between
/// Triangle and Square", 2019).
fn square_to_triangle(u: Vec2) -> Vec2 {
    u - 0.5 * u.min_element()
}
