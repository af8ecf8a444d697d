//! The crate uvunwrap: cuts shapes into charts, and packs charts, whoever cut them, onto pages.
//!
//! Its output depends on IEEE arithmetic alone, as long as its feature `direct-solver` is off.

use super::{
    PADDING,
    shape::{Cut, Flat, Shape, power_of_two},
};
use crate::{
    error::{Error, Result},
    progress::Observer,
};
use glam::{DVec2, UVec2, Vec2};
use std::path::Path;
use uvunwrap::{Density, MeshInput, Options, Packing};

/// Above this many charts packing by shape takes too long.
const MANY_CHARTS: usize = 2500;

/// Cuts each shape into charts.
pub(super) fn cut(shapes: &[Shape], file: &Path, observer: &dyn Observer) -> Result<Vec<Cut>> {
    // Charts are placed again later: here any place will do, found fast.
    let texels_per_unit = if shapes.len() < 4096 { 128.0 } else { 16.0 };
    let options = Options {
        density: Density::Fixed { texels_per_unit, page_size: None },
        padding: 1,
        packing: Packing::Fast,
        ..Options::default()
    };
    let inputs: Vec<MeshInput> = shapes
        .iter()
        .map(|s| MeshInput {
            ignored_faces: Some(&s.ignored),
            scale: positive(power_of_two(1.0 / s.area().sqrt())),
            ..MeshInput::new(&s.positions, &s.indices)
        })
        .collect();
    let atlas =
        uvunwrap::generate_with_progress(&inputs, &options, |_| goes_on(observer)).map_err(|e| uncut(e, file))?;
    let cut = |(shape, mesh): (&Shape, uvunwrap::OutputMesh)| {
        let mut charts: Vec<u32> = mesh.vertices.iter().filter_map(|v| v.chart).collect();
        charts.sort_unstable();
        charts.dedup();
        Cut {
            positions: mesh.vertices.iter().map(|v| shape.positions[v.xref as usize]).collect(),
            uvs: mesh.vertices.iter().map(|v| v.uv).collect(),
            indices: mesh.indices,
            charts: charts.len(),
        }
    };
    Ok(shapes.iter().zip(atlas.meshes).map(cut).collect())
}

/// A cut shape that is to be packed.
pub(super) struct Item<'a> {
    /// The shape.
    pub shape: &'a Shape,
    /// Its charts.
    pub cut: &'a Cut,
    /// Multiplies the shape's size.
    pub factor: f64,
    /// Size of each instance relative to the shape's own; empty: its charts lie on the page directly.
    pub scales: Vec<f32>,
}

/// How large texels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Size {
    /// As small as fill one page of this edge, if one can hold all.
    Page(u32),
    /// This many texels a metre, on one page as large as it takes.
    Density(f64),
    /// This many texels a metre, on pages of this edge.
    Pages(f64, u32),
}

/// Why charts could not be packed.
pub(super) enum Failure {
    /// A rectangle, padding included, has this longer edge, which no page holds.
    TooLarge(u32),
    /// The packer cannot take the charts, and says why.
    Charts(String),
    /// Another reason.
    Other(Error),
}

/// Packed charts.
pub(super) struct Packed {
    /// Size of each page.
    pub size: UVec2,
    /// Number of pages.
    pub pages: u32,
    /// Texels per metre at scale 1.
    pub density: f64,
    /// In the items' order.
    pub meshes: Vec<Mesh>,
}

/// Where an item's charts and instances came to lie.
pub(super) struct Mesh {
    /// Vertices: uv of the page, or of each instance's rectangle.
    pub flat: Vec<Flat>,
    /// Three a triangle.
    pub indices: Vec<u32>,
    /// Metres of the shape that the rectangles' width and height stand for.
    pub metres: DVec2,
    /// Rectangle of each instance.
    pub rectangles: Vec<Rectangle>,
}

/// An instance's place, texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    /// Index of the page.
    pub page: u32,
    /// Top left corner.
    pub min: DVec2,
    /// Width and height.
    pub size: DVec2,
}

/// Packs all items with [`PADDING`] at every instance.
pub(super) fn pack(items: &[Item], size: Size, observer: &dyn Observer) -> std::result::Result<Packed, Failure> {
    let charts: usize = items.iter().map(|i| i.cut.charts).sum();
    let options = Options {
        density: match size {
            Size::Page(page_size) => Density::Auto { page_size },
            Size::Density(d) => Density::Fixed { texels_per_unit: positive(d), page_size: None },
            Size::Pages(d, edge) => Density::Fixed { texels_per_unit: positive(d), page_size: Some(edge) },
        },
        padding: PADDING,
        packing: if charts > MANY_CHARTS { Packing::Fast } else { Packing::Shape },
        ..Options::default()
    };
    let inputs: Vec<MeshInput> = items
        .iter()
        .map(|i| MeshInput {
            ignored_faces: Some(&i.shape.ignored),
            scale: positive(i.shape.metres * i.factor),
            instance_scales: &i.scales,
            existing_uvs: Some(&i.cut.uvs),
            ..MeshInput::new(&i.cut.positions, &i.cut.indices)
        })
        .collect();
    let atlas = uvunwrap::generate_with_progress(&inputs, &options, |_| goes_on(observer)).map_err(failure)?;
    let page = DVec2::new(atlas.width.into(), atlas.height.into());
    let rectangle = |r: uvunwrap::InstanceRect| {
        let [min, max] = [r.min, r.max].map(|c| DVec2::from(c.map(f64::from)) * page);
        Rectangle { page: r.page, min: min.round(), size: max - min }
    };
    let density = f64::from(atlas.texels_per_unit);
    let mesh = |(item, m): (&Item, uvunwrap::OutputMesh)| {
        let rectangles: Vec<Rectangle> = m.instances.into_iter().map(rectangle).collect();
        let metres = |(r, &k): (&Rectangle, &f32)| r.size / (f64::from(k) * density);
        Mesh {
            flat: m.vertices.iter().map(|v| (Vec2::from(v.uv), v.chart)).collect(),
            indices: m.indices,
            metres: rectangles.iter().zip(&item.scales).map(metres).next().unwrap_or_default(),
            rectangles,
        }
    };
    Ok(Packed {
        size: UVec2::new(atlas.width, atlas.height),
        pages: atlas.page_count,
        density,
        meshes: items.iter().zip(atlas.meshes).map(mesh).collect(),
    })
}

/// Tells that some work is done, and whether more is wanted.
fn goes_on(observer: &dyn Observer) -> bool {
    observer.advance(1);
    !observer.cancelled()
}

/// A positive, finite single.
fn positive(x: f64) -> f32 {
    const MOST: f64 = (1u64 << 60) as f64;
    if x.is_nan() { 1.0 } else { x.clamp(1.0 / MOST, MOST) as f32 }
}

fn failure(e: uvunwrap::Error) -> Failure {
    Failure::Other(match e {
        uvunwrap::Error::ChartTooLarge { width, height, .. } => return Failure::TooLarge(width.max(height)),
        uvunwrap::Error::Cancelled => Error::Interrupted,
        uvunwrap::Error::AtlasTooLarge { texels } => Error::Usage(format!(
            "this density needs {:.1} thousand million texels, more than can be baked\n  \
             lower --texels-per-meter, or luxel.texels_per_meter of the nodes",
            texels as f64 * 1e-9
        )),
        // Charts are those that `cut` made.
        e => return Failure::Charts(format!("its charts cannot be packed: {e}")),
    })
}

/// Why the meshes of `file` could not be cut: whatever it is, it is about them.
fn uncut(e: uvunwrap::Error, file: &Path) -> Error {
    match e {
        uvunwrap::Error::Cancelled => Error::Interrupted,
        uvunwrap::Error::AtlasTooLarge { .. } => {
            let remedy = "merge what lies together, remove needles, or leave nodes out (--exclude)";
            Error::invalid(file, "geometry", "there are too many charts, or triangles too long and thin", remedy)
        }
        e => Error::invalid(file, "geometry", format!("it cannot be unwrapped: {e}"), REMEDY),
    }
}

/// What to do if the unwrapper is at fault.
pub(super) const REMEDY: &str = "unwrap the meshes in a modelling program and bake with --keep-uv";
