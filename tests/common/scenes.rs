//! Shapes for a [`Stage`]: rectangles, boxes, cut faces, polygons, discs, spheres and spherical bowls.
//!
//! Curved shapes take their tessellation; their error is of the order of the squared angle of a facet.

use super::stage::{Chart, Stage, Surface};
use glam::{UVec2, Vec2, Vec3, uvec2, vec2, vec3};
use std::f64::consts::{PI, TAU};

/// Faces of a box. Charts: u = x (z on the sides), v = z (y on upright faces).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// x = low.
    Left,
    /// x = high.
    Right,
    /// y = low.
    Bottom,
    /// y = high.
    Top,
    /// z = low.
    Back,
    /// z = high.
    Front,
}

pub const FACES: [Face; 6] = [Face::Left, Face::Right, Face::Bottom, Face::Top, Face::Back, Face::Front];

impl Face {
    /// Axes of u, of v and of the normal; true if the face is the high one.
    fn axes(self) -> ([usize; 3], bool) {
        match self {
            Face::Left => ([2, 1, 0], false),
            Face::Right => ([2, 1, 0], true),
            Face::Bottom => ([0, 2, 1], false),
            Face::Top => ([0, 2, 1], true),
            Face::Back => ([0, 1, 2], false),
            Face::Front => ([0, 1, 2], true),
        }
    }
}

/// An axis-aligned box; its faces look inwards (a room) or outwards (a block).
#[derive(Clone, Copy, Debug)]
pub struct Cuboid {
    pub low: Vec3,
    pub high: Vec3,
    pub inwards: bool,
}

impl Cuboid {
    pub fn room(low: Vec3, high: Vec3) -> Self {
        Cuboid { low, high, inwards: true }
    }

    pub fn block(low: Vec3, high: Vec3) -> Self {
        Cuboid { low, high, inwards: false }
    }

    /// All six faces of one material with `texels` x `texels` charts, in the order of [`FACES`].
    pub fn all(&self, stage: &mut Stage, material: u32, texels: u32) -> Vec<Chart> {
        FACES.iter().map(|f| self.face(stage, *f, material, UVec2::ONE, UVec2::splat(texels))).collect()
    }

    /// One face as a grid of `cells` quads in a chart of `texels`.
    pub fn face(&self, stage: &mut Stage, face: Face, material: u32, cells: UVec2, texels: UVec2) -> Chart {
        let ([u, v, _], _) = face.axes();
        self.part(stage, face, material, [cells, texels], [[self.low[u], self.high[u]], [self.low[v], self.high[v]]])
    }

    /// One face cut along coordinates `us` and `vs`: a surface for each cell to which `of(i, j)` gives a material
    /// and texels; `charts[j][i]`.
    pub fn cut(
        &self,
        stage: &mut Stage,
        face: Face,
        us: &[f32],
        vs: &[f32],
        of: impl Fn(usize, usize) -> Option<(u32, UVec2)>,
    ) -> Vec<Vec<Option<Chart>>> {
        let rows = vs.windows(2).enumerate().map(|(j, v)| {
            let row = us.windows(2).enumerate().map(|(i, u)| {
                let (material, texels) = of(i, j)?;
                Some(self.part(stage, face, material, [UVec2::ONE, texels], [[u[0], u[1]], [v[0], v[1]]]))
            });
            row.collect()
        });
        rows.collect()
    }

    fn part(&self, stage: &mut Stage, face: Face, material: u32, sizes: [UVec2; 2], range: [[f32; 2]; 2]) -> Chart {
        let ([u, v, n], high) = face.axes();
        // u x v is -n for the horizontal and the x faces, +n for the z faces.
        let along = n == 2;
        let flip = (along == high) == self.inwards;
        let cells = sizes[0];
        let on = |[a, b]: [f32; 2], i: u32, n: u32| if i == n { b } else { a + (b - a) * i as f32 / n as f32 };
        let position = |i: u32, j: u32| {
            let mut p = Vec3::ZERO;
            p[u] = on(range[0], i, cells.x);
            p[v] = on(range[1], j, cells.y);
            p[n] = if high { self.high[n] } else { self.low[n] };
            p
        };
        stage.grid(&format!("{face:?}"), material, sizes, flip, position, None)
    }
}

/// Coordinates `low..high` with cuts at `+-half` about each of `points`.
pub fn cuts_about(low: f32, high: f32, points: &[f32], half: f32) -> Vec<f32> {
    let mut cuts = vec![low, high];
    cuts.extend(points.iter().flat_map(|p| [p - half, p + half]).filter(|c| *c > low && *c < high));
    cuts.sort_by(f32::total_cmp);
    cuts.dedup();
    cuts
}

/// A parallelogram: corner `o`, edges `s` (to the right in its chart) and `t` (down); its front is s x t.
pub fn rectangle(stage: &mut Stage, material: u32, [o, s, t]: [Vec3; 3], texels: UVec2) -> Chart {
    stage.grid("rectangle", material, [UVec2::ONE, texels], false, |i, j| o + s * i as f32 + t * j as f32, None)
}

/// A convex polygon, counter-clockwise seen from its front, in a chart whose longer edge is `texels`.
pub fn polygon(stage: &mut Stage, material: u32, points: &[Vec3], texels: u32) -> Chart {
    let s = (points[1] - points[0]).normalize();
    let fan = (1..points.len() - 1).map(|i| (points[i] - points[0]).cross(points[i + 1] - points[0]));
    let t = fan.sum::<Vec3>().normalize().cross(s);
    let flat: Vec<Vec2> = points.iter().map(|p| vec2((*p - points[0]).dot(s), (*p - points[0]).dot(t))).collect();
    let low = flat.iter().copied().reduce(Vec2::min).expect("a polygon has points");
    let extent = flat.iter().copied().reduce(Vec2::max).expect("a polygon has points") - low;
    let density = texels as f32 / extent.max_element();
    let surface = Surface {
        positions: points.to_vec(),
        uv: flat.iter().map(|p| (*p - low) * density).collect(),
        triangles: (1..points.len() as u32 - 1).map(|i| [0, i, i + 1]).collect(),
        size: (extent * density).round().as_uvec2().max(UVec2::ONE),
        ..Surface::default()
    };
    stage.surface("polygon", material, surface)
}

/// A disc with `n` edges and the area of the circle: centre `o`, unit axes `s`, `t`; its front is s x t.
pub fn disc(stage: &mut Stage, material: u32, [o, s, t]: [Vec3; 3], r: f64, n: u32, texels: u32) -> Chart {
    let r = r * libm::sqrt(TAU / (f64::from(n) * libm::sin(TAU / f64::from(n))));
    let at = |i: u32| {
        let a = TAU * f64::from(i) / f64::from(n);
        o + s * (r * libm::cos(a)) as f32 + t * (r * libm::sin(a)) as f32
    };
    polygon(stage, material, &(0..n).map(at).collect::<Vec<_>>(), texels)
}

/// A sphere, or the part of one between two polar angles from +y.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub center: Vec3,
    pub radius: f64,
    /// Polar angles from +y; (0, pi) is the whole sphere.
    pub polar: [f64; 2],
    /// Facets around and from end to end.
    pub facets: UVec2,
    /// Texels along each edge of a facet.
    pub texels: u32,
    pub inwards: bool,
    /// Vertex normals of the sphere instead of face normals.
    pub smooth: bool,
}

impl Ball {
    /// A whole sphere with face normals and one texel a facet.
    pub fn whole(center: Vec3, radius: f64, facets: UVec2, inwards: bool) -> Self {
        Ball { center, radius, polar: [0.0, PI], facets, texels: 1, inwards, smooth: false }
    }

    /// A bowl: share `f` of a sphere of radius 1, open at the top, seen from inside.
    pub fn bowl(f: f64, facets: UVec2, texels: u32) -> Self {
        let polar = [libm::acos(1.0 - 2.0 * (1.0 - f)), PI];
        Ball { center: Vec3::ZERO, radius: 1.0, polar, facets, texels, inwards: true, smooth: false }
    }

    pub fn build(&self, stage: &mut Stage, material: u32) -> Chart {
        let unit = |i: u32, j: u32| self.unit(i, j).as_vec3();
        let position = |i: u32, j: u32| self.center + (self.unit(i, j) * self.radius).as_vec3();
        let normal = |i: u32, j: u32| if self.inwards { -unit(i, j) } else { unit(i, j) };
        let normal: Option<&dyn Fn(u32, u32) -> Vec3> = if self.smooth { Some(&normal) } else { None };
        stage.grid("ball", material, [self.facets, self.facets * self.texels], self.inwards, position, normal)
    }

    /// Area of the flat opening that a bowl's first ring bounds.
    pub fn opening(&self) -> f64 {
        let n = f64::from(self.facets.x);
        let r = self.radius * libm::sin(self.polar[0]);
        0.5 * n * r * r * libm::sin(TAU / n)
    }

    /// Angle of a facet in radians, the larger one.
    pub fn facet(&self) -> f64 {
        (TAU / f64::from(self.facets.x)).max((self.polar[1] - self.polar[0]) / f64::from(self.facets.y))
    }

    fn unit(&self, i: u32, j: u32) -> glam::DVec3 {
        let t = f64::from(j) / f64::from(self.facets.y);
        let polar = self.polar[0] + (self.polar[1] - self.polar[0]) * t;
        let around = TAU * f64::from(i % self.facets.x) / f64::from(self.facets.x);
        let pole = polar == 0.0 || polar == PI;
        let sin = if pole { 0.0 } else { libm::sin(polar) };
        glam::dvec3(sin * libm::cos(around), libm::cos(polar), sin * libm::sin(around))
    }
}

/// The unit cube from inside.
pub fn unit_room() -> Cuboid {
    Cuboid::room(Vec3::ZERO, Vec3::ONE)
}

/// A closed room without symmetry: a block stands on the floor, another floats. Charts: the room's, then the blocks'.
pub fn furnished(stage: &mut Stage, room: u32, block: u32, texels: u32) -> Vec<Chart> {
    let mut charts = Cuboid::room(Vec3::ZERO, vec3(2.0, 1.0, 1.5)).all(stage, room, texels);
    let floating = Cuboid::block(vec3(1.3, 0.55, 0.2), vec3(1.7, 0.75, 0.7));
    charts.extend(floating.all(stage, block, texels / 2));
    let standing = Cuboid::block(vec3(0.25, 0.125, 0.5), vec3(0.75, 0.5, 1.0));
    charts.extend(standing.all(stage, block, texels / 2));
    charts
}

/// Texels of a cell of `size` metres at `density` texels per metre, at least `least` each way.
pub fn texels(size: Vec2, density: f32, least: u32) -> UVec2 {
    let n = (size * density).round().as_uvec2();
    uvec2(n.x.max(least), n.y.max(least))
}
