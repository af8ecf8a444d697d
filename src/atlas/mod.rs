//! [`Atlas`]: where each surface lies in the lightmap. Charts in a mesh's own rectangle, rectangles on pages.
//!
//! A mesh is laid out once; each instance has a rectangle of its own on one page:
//! page uv = offset + scale * layout uv, (0, 0) the page's top left corner.

mod coverage;
mod keep;

pub use coverage::{Charted, Coverage, Fragment, NO_PAGE, NO_TEXEL, Texel};

use glam::{UVec2, Vec2};

/// Layouts of all meshes and rectangles of all instances.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// One for each of the scene's meshes; empty for a mesh that no mapped instance uses.
    pub layouts: Vec<Layout>,
    /// One for each of the scene's instances; `None`: nothing of it is lit (unlit material).
    pub placements: Vec<Option<Placement>>,
    /// Pages; hidden ones follow the visible ones.
    pub pages: Vec<Page>,
    /// True if the file's own lightmap coordinates are used, so that its vertices stay as they are.
    pub kept: bool,
}

/// A mesh's triangles in uv.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// For each layout vertex the mesh's vertex it is a copy of; a primitive's vertices stay together and in order of
    /// primitives. The identity if nothing was split.
    pub source: Vec<u32>,
    /// For each layout vertex its uv in [0, 1]^2, v down.
    pub uv: Vec<Vec2>,
    /// The mesh's triangles, in the mesh's order, by layout vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Chart of each triangle, [`NO_CHART`] for one without area.
    pub charts: Vec<u32>,
    /// Number of charts.
    pub chart_count: u32,
}

/// Chart of a triangle that has none.
pub const NO_CHART: u32 = u32::MAX;

/// An instance's rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index in [`Atlas::pages`].
    pub page: u32,
    /// Page uv of the layout's (0, 0).
    pub offset: Vec2,
    /// Page uv per layout uv.
    pub scale: Vec2,
}

/// Size of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Page {
    /// Width and height in texels.
    pub size: UVec2,
    /// Hidden pages carry light for instances without a map of their own; they are not written.
    pub hidden: bool,
}

/// Who makes the layouts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unwrap {
    /// The author's TEXCOORD_1.
    Keep,
    /// The crate uvunwrap.
    #[default]
    Uvunwrap,
    /// xatlas (cargo feature `xatlas`).
    Xatlas,
}

/// How large texels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Density {
    /// One page of this edge length, texel size chosen to fill it.
    Resolution(u32),
    /// Texels per metre, as many pages as needed.
    TexelsPerMeter(f64),
}

/// What an atlas is made by.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Who makes the layouts. Default: uvunwrap.
    pub unwrap: Unwrap,
    /// Texel size. Default: one page of 1024.
    pub density: Density,
    /// Largest edge of a page, texels. Default: 4096.
    pub page_size: u32,
}

/// Empty texels kept around every chart, at every instance.
pub const PADDING: u32 = 2;

impl Default for Options {
    fn default() -> Self {
        Options { unwrap: Unwrap::default(), density: Density::Resolution(1024), page_size: 4096 }
    }
}
