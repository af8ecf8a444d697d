//! [`Atlas`]: where each surface lies in the lightmap. Charts in a mesh's own rectangle, rectangles on pages.
//!
//! A mesh is laid out once; each instance has a rectangle of its own on one page:
//! page uv = offset + scale * layout uv, (0, 0) the page's top left corner.

mod coverage;
mod keep;
mod lay;
mod overlap;
mod place;
mod shape;
mod uvunwrap;
mod validate;
#[cfg(feature = "xatlas")]
mod xatlas;

pub use coverage::{Charted, Coverage, Fragment, NO_PAGE, NO_TEXEL, Texel};

use crate::{
    error::{Error, Result},
    progress::{self, Observer},
    scene::Scene,
};
use glam::{UVec2, Vec2};
use place::{Demand, Packed};
use std::{ops::RangeInclusive, path::Path};

/// Layouts of all meshes and rectangles of all instances.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// One for each of the scene's meshes; empty for a mesh that no mapped instance uses.
    pub layouts: Vec<Layout>,
    /// One for each of the scene's instances; `None`: nothing of it is lit (unlit
    /// material, or no area).
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

impl Unwrap {
    /// Everything there is to choose from.
    pub const ALL: [Unwrap; 3] = [Unwrap::Keep, Unwrap::Uvunwrap, Unwrap::Xatlas];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Unwrap::Keep => "keep-uv",
            Unwrap::Uvunwrap => "uvunwrap",
            Unwrap::Xatlas => "xatlas",
        }
    }
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

/// Edges of the smallest and of the largest page that is made: 2^30 texels.
pub const PAGE_EDGES: RangeInclusive<u32> = 16..=32768;

/// Lays out every mesh and gives every instance its rectangle. `file` is for messages.
pub fn unwrap(
    scene: &Scene,
    options: &Options,
    file: &Path,
    observer: &dyn Observer,
    warnings: &mut Vec<String>,
) -> Result<Atlas> {
    options.check()?;
    progress::check(observer)?;
    let instances = place::Instances::of(scene);
    let atlas = match options.unwrap {
        Unwrap::Keep => keep::unwrap(scene, &instances, options, file, observer, warnings)?,
        #[cfg(feature = "xatlas")]
        Unwrap::Xatlas => lay::unwrap(scene, &instances, options, xatlas::cut, file, observer, warnings)?,
        _ => lay::unwrap(scene, &instances, options, uvunwrap::cut, file, observer, warnings)?,
    };
    debug_assert_eq!(atlas.validate(scene), Ok(()));
    Ok(atlas)
}

/// Texels that the nodes of `scene` will take at least, as far as its density tells before anything is laid out.
///
/// A node that a page does not hold is made coarser: until a chart as long as its box's diagonal fits, or until the page
/// is half full, whatever is less.
pub fn least_texels(scene: &Scene, options: &Options) -> u64 {
    let page = options.page_size;
    match (options.density, options.unwrap) {
        (Density::Resolution(n), _) => u64::from(n).pow(2),
        // The author's layout may be one page.
        (Density::TexelsPerMeter(t), Unwrap::Keep) => {
            place::least_texels(scene, t, page).min(f64::from(page).powi(2)) as u64
        }
        (Density::TexelsPerMeter(t), _) => place::least_texels(scene, t, page) as u64,
    }
}

impl Options {
    /// [`Error::Usage`] for sizes that make no page, and for an unwrapper that is not there.
    pub fn check(&self) -> Result<()> {
        if self.unwrap == Unwrap::Xatlas && !cfg!(feature = "xatlas") {
            let remedy = "build it with `cargo install --path . --features xatlas`, or use --unwrap uvunwrap";
            return Err(Error::Usage(format!("--unwrap xatlas: this luxel was built without xatlas\n  {remedy}")));
        }
        let (least, most) = PAGE_EDGES.into_inner();
        let edge = |name: &str, n: u32| match PAGE_EDGES.contains(&n) {
            true => Ok(()),
            false => Err(Error::Usage(format!("{name} {n}: a page has {least} to {most} texels an edge"))),
        };
        match self.density {
            Density::Resolution(n) => edge("--resolution", n),
            Density::TexelsPerMeter(t) if !(t > 0.0 && t.is_finite()) => {
                Err(Error::Usage(format!("--texels-per-meter {t}: a density is a positive number")))
            }
            Density::TexelsPerMeter(_) => edge("--page-size", self.page_size),
        }?;
        edge("--page-size", self.page_size)
    }
}

impl Atlas {
    /// Packs visible rectangles as `options` wish, with warnings; the general density.
    fn place(&mut self, scene: &Scene, demands: &[Demand], options: &Options, warnings: &mut Vec<String>) -> f64 {
        let (packed, edge) = match options.density {
            Density::Resolution(n) => (place::fill(demands, n), n),
            Density::TexelsPerMeter(t) => (place::spread(demands, t, options.page_size, false), options.page_size),
        };
        place::warn_lowered(scene, &packed.lowered, edge, warnings);
        if let (Density::Resolution(_), 2..) = (options.density, packed.pages.len()) {
            warnings.push(pages_added(packed.pages.len(), edge));
        }
        let density = packed.density;
        self.append(demands, packed);
        density
    }

    /// Takes over what another atlas of the same scene holds, its pages after those that are there.
    fn join(&mut self, other: Atlas) {
        let first = self.pages.len() as u32;
        for (own, new) in self.placements.iter_mut().zip(other.placements).filter(|(_, new)| new.is_some()) {
            *own = new.map(|p| Placement { page: first + p.page, ..p });
        }
        for (own, new) in self.layouts.iter_mut().zip(other.layouts).filter(|(_, new)| !new.triangles.is_empty()) {
            *own = new;
        }
        self.pages.extend(other.pages);
    }

    /// Takes packed rectangles over, after the pages that are there.
    fn append(&mut self, demands: &[Demand], packed: Packed) {
        let first = self.pages.len() as u32;
        for (demand, placement) in demands.iter().zip(packed.placements) {
            self.placements[demand.instance] = Some(Placement { page: first + placement.page, ..placement });
        }
        self.pages.extend(packed.pages);
    }
}

/// The warning for a scene that one page cannot hold.
fn pages_added(pages: usize, edge: u32) -> String {
    format!(
        "one page of {edge} x {edge} cannot hold every chart with its padding: {} added, {pages} in all",
        match pages - 1 {
            1 => "1 page was".to_string(),
            n => format!("{n} pages were"),
        }
    )
}
