//! [`Coverage`]: which texels each surface touches, exactly, and with how much area.
//!
//! A triangle is clipped against every texel of its bounds, in double precision: a texel is covered if any area of any
//! triangle lies in it, however little, and a point taken from a fragment lies on the surface inside the texel.

use super::Atlas;
use crate::{math::Polygon, scene::World};
use glam::{DVec2, IVec2, UVec2, Vec2};
use rayon::prelude::*;

/// Every covered texel with the pieces of surface inside it.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// Covered texels, by page, then tile by tile: neighbours in the list are neighbours on the surface.
    pub texels: Vec<Texel>,
    /// Pieces of surface; `starts[i]..starts[i + 1]` are texel i's.
    pub fragments: Vec<Fragment>,
    /// Where each texel's fragments begin, and their number.
    pub starts: Vec<u32>,
    /// For each page, row by row, the index in `texels`, or [`NO_TEXEL`].
    pub grids: Vec<Vec<u32>>,
    /// Size of each page.
    pub sizes: Vec<UVec2>,
    /// Texel coordinates of each global triangle on its page.
    pub charted: Vec<Charted>,
}

/// An uncovered place of a page.
pub const NO_TEXEL: u32 = u32::MAX;

/// Page of a triangle without a place in the atlas.
pub const NO_PAGE: u32 = u32::MAX;

/// A covered place of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texel {
    /// Index of the page.
    pub page: u32,
    /// Column and row.
    pub at: UVec2,
}

/// The part of one triangle inside one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Global triangle ([`World`]).
    pub triangle: u32,
    /// World area, m^2.
    pub area: f32,
}

/// Where a global triangle lies on its page, and what else a ray that meets it asks: found in one place.
#[derive(Clone, Copy, Debug)]
pub struct Charted {
    /// Corners in texels, v down.
    pub corners: [Vec2; 3],
    /// Index of the page, or [`NO_PAGE`].
    pub page: u32,
    /// True if its back is a surface, too.
    pub double_sided: bool,
    /// True if it shines.
    pub emits: bool,
}

impl Charted {
    /// Texel coordinates at barycentrics (1 - x - y, x, y).
    #[inline]
    pub fn at(&self, bary: Vec2) -> Vec2 {
        let [a, b, c] = self.corners;
        a + (b - a) * bary.x + (c - a) * bary.y
    }

    /// The corners in double precision, for clipping.
    pub fn exact(&self) -> [DVec2; 3] {
        self.corners.map(|c| c.as_dvec2())
    }
}

impl Coverage {
    /// Finds every fragment of every placed triangle.
    pub fn new(world: &World, atlas: &Atlas) -> Self {
        let charted = charted(world, atlas);
        let mut bases = vec![0u64];
        for p in &atlas.pages {
            bases.push(bases[bases.len() - 1] + u64::from(p.size.x) * u64::from(p.size.y));
        }
        let found: Vec<Vec<(u32, Fragment)>> = (0..world.scene.instances.len())
            .flat_map(|i| chunks(world.triangles_of(i), 256).map(move |range| (i, range)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(i, range)| {
                let mut out = Vec::new();
                for triangle in range {
                    let c = &charted[triangle as usize];
                    if c.page != NO_PAGE {
                        let size = atlas.pages[c.page as usize].size;
                        fragments(world, i, triangle, c, size, |pixel, fragment| {
                            out.push(((bases[c.page as usize] + u64::from(pixel)) as u32, fragment));
                        });
                    }
                }
                out
            })
            .collect();
        let sizes: Vec<UVec2> = atlas.pages.iter().map(|p| p.size).collect();
        Coverage { charted, ..sorted(&found, sizes, &bases) }
    }

    /// The fragments of a texel.
    pub fn fragments_of(&self, texel: usize) -> &[Fragment] {
        &self.fragments[self.starts[texel] as usize..self.starts[texel + 1] as usize]
    }

    /// The covered texel at texel coordinates `at` of a page.
    #[inline]
    pub fn texel_at(&self, page: u32, at: Vec2) -> Option<u32> {
        // Truncation is the floor of what is not negative; a hair below 0 belongs to the first texel, and a coordinate of
        // exactly 1 to the last.
        let (at, size) = (at.as_ivec2(), self.sizes[page as usize].as_ivec2());
        self.texel(page, at - IVec2::new(i32::from(at.x == size.x), i32::from(at.y == size.y)))
    }

    /// The covered texel at `at` on a triangle, or the one beside it where rounding put a hit just outside.
    #[inline]
    pub fn texel_near(&self, charted: &Charted, at: Vec2) -> Option<u32> {
        self.texel_at(charted.page, at).or_else(|| self.texel_beside(charted, at))
    }

    #[cold]
    fn texel_beside(&self, charted: &Charted, at: Vec2) -> Option<u32> {
        let [a, b, c] = charted.corners;
        let home = at.floor().as_ivec2();
        let inward = ((a + b + c) / 3.0 - at).clamp(Vec2::NEG_ONE, Vec2::ONE) * 1e-2;
        let around = [-1, 0, 1].map(|y| [-1, 0, 1].map(|x| home + IVec2::new(x, y)));
        self.texel_at(charted.page, at + inward)
            .or_else(|| around.as_flattened().iter().find_map(|p| self.texel(charted.page, *p)))
    }

    /// The covered texel at a column and row of a page.
    #[inline]
    pub fn texel(&self, page: u32, at: IVec2) -> Option<u32> {
        let size = self.sizes[page as usize];
        let (x, y) = (at.x as u32, at.y as u32);
        if x >= size.x || y >= size.y {
            return None;
        }
        let t = self.grids[page as usize][(y * size.x + x) as usize];
        (t != NO_TEXEL).then_some(t)
    }
}

fn charted(world: &World, atlas: &Atlas) -> Vec<Charted> {
    let mut charted = Vec::with_capacity(world.len() as usize);
    for (i, placement) in atlas.placements.iter().enumerate() {
        let mesh = world.mesh(i);
        for primitive in &mesh.primitives {
            let material = &world.scene.materials[primitive.material as usize];
            // Unlit primitives have no light to map: a ray that meets them ends there.
            let place = placement.as_ref().filter(|_| !material.unlit);
            let page = place.map_or(NO_PAGE, |p| p.page);
            let layout = &atlas.layouts[world.scene.instances[i].mesh as usize];
            let corners = |t: u32| {
                let Some(p) = place else { return [Vec2::ZERO; 3] };
                let size = atlas.pages[p.page as usize].size.as_vec2();
                layout.triangles[t as usize].map(|v| (p.offset + p.scale * layout.uv[v as usize]) * size)
            };
            let (double_sided, emits) = (material.double_sided, material.emits());
            charted.extend(primitive.triangles.clone().map(|t| Charted {
                corners: corners(t),
                page,
                double_sided,
                emits,
            }));
        }
    }
    charted
}

/// Calls `found` with the pixel and the fragment for each texel that the triangle covers.
fn fragments(world: &World, i: usize, triangle: u32, c: &Charted, size: UVec2, mut found: impl FnMut(u32, Fragment)) {
    let corners = world.corners(i, triangle - world.triangles_of(i).start);
    let world_area = f64::from(world.cross(i, &corners).length()) * 0.5;
    let polygon = Polygon::triangle(c.exact());
    let uv_area = polygon.area();
    if uv_area <= 0.0 || world_area <= 0.0 {
        return;
    }
    let [p, q, r] = c.exact();
    let last = size.as_dvec2() - 1.0;
    let rows = [p.y.min(q.y).min(r.y), p.y.max(q.y).max(r.y)].map(|y| y.floor().clamp(0.0, last.y) as u32);
    for y in rows[0]..=rows[1] {
        let strip = polygon.clipped_to_strip(1, f64::from(y));
        let x = |pick: fn(f64, f64) -> f64, start: f64| strip.corners().iter().map(|c| c.x).fold(start, pick);
        let columns = [x(f64::min, f64::INFINITY), x(f64::max, f64::NEG_INFINITY)];
        if columns[0] > columns[1] {
            continue;
        }
        let columns = columns.map(|x| x.floor().clamp(0.0, last.x) as u32);
        for x in columns[0]..=columns[1] {
            let area = strip.clipped_to_strip(0, f64::from(x)).area() / uv_area * world_area;
            if area as f32 > 0.0 {
                found(y * size.x + x, Fragment { triangle, area: area as f32 });
            }
        }
    }
}

/// Counting sort by texel; `found` names pixels, counted through the pages from their `bases`, row by row.
fn sorted(found: &[Vec<(u32, Fragment)>], sizes: Vec<UVec2>, bases: &[u64]) -> Coverage {
    let mut count = vec![0u32; bases[sizes.len()] as usize];
    for (pixel, _) in found.iter().flatten() {
        count[*pixel as usize] += 1;
    }
    let (mut starts, mut texels, mut grids) = (vec![0u32], Vec::new(), Vec::new());
    for (page, &size) in sizes.iter().enumerate() {
        let mut grid = vec![NO_TEXEL; (size.x * size.y) as usize];
        for at in tiled(size) {
            let pixel = at.y * size.x + at.x;
            let n = &mut count[(bases[page] + u64::from(pixel)) as usize];
            if *n > 0 {
                let begin = starts[texels.len()];
                grid[pixel as usize] = texels.len() as u32;
                texels.push(Texel { page: page as u32, at });
                starts.push(begin + *n);
                *n = begin;
            }
        }
        grids.push(grid);
    }
    let mut fragments = vec![Fragment { triangle: 0, area: 0.0 }; starts[texels.len()] as usize];
    for (pixel, fragment) in found.iter().flatten() {
        let next = &mut count[*pixel as usize];
        fragments[*next as usize] = *fragment;
        *next += 1;
    }
    Coverage { texels, fragments, starts, grids, sizes, charted: Vec::new() }
}

/// Edge of the squares by which texels are numbered.
const TILE: u32 = 8;

/// The places of a page, tile by tile.
fn tiled(size: UVec2) -> impl Iterator<Item = UVec2> {
    let tiles = (0..size.y.div_ceil(TILE)).flat_map(move |y| (0..size.x.div_ceil(TILE)).map(move |x| UVec2::new(x, y)));
    tiles.flat_map(move |tile| {
        let (first, end) = (tile * TILE, ((tile + 1) * TILE).min(size));
        (first.y..end.y).flat_map(move |y| (first.x..end.x).map(move |x| UVec2::new(x, y)))
    })
}

fn chunks(range: std::ops::Range<u32>, size: u32) -> impl Iterator<Item = std::ops::Range<u32>> {
    let end = range.end;
    range.step_by(size as usize).map(move |start| start..(start + size).min(end))
}
