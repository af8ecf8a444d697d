//! Charts to pages: chooses the density, which meshes lie on the page directly and which have rectangles.
//!
//! A mesh used once may be laid out in page coordinates, as long as there is one page; all others, and all of them
//! on several pages, have one rectangle an instance, so that a node lies on one page.

mod pages;

use super::{
    Atlas, Density, Layout, Options, PADDING, PAGE_EDGES, Page, Placement,
    place::{self, Demand, HIDDEN_DENSITY, Instances, Role},
    shape::{self, Cut, Shape},
    uvunwrap::{self, Failure, Item, Packed, Rectangle, Size},
};
use crate::{
    error::{Error, Result},
    progress::Observer,
    scene::Scene,
};
use glam::{DVec2, UVec2};
use rayon::prelude::*;
use std::path::Path;

/// Cuts shapes into charts.
pub(super) type Cutter = fn(&[Shape], &Path, &dyn Observer) -> Result<Vec<Cut>>;

/// Largest ratio between the sizes of one mesh's instances: smaller ones get more texels than wished, since all share
/// one layout, whose padding the smallest decides.
const LARGEST_RATIO: f64 = 16.0;

/// Lays out `scene` in charts that `cutter` makes.
pub(super) fn unwrap(
    scene: &Scene,
    instances: &Instances,
    options: &Options,
    cutter: Cutter,
    file: &Path,
    observer: &dyn Observer,
    warnings: &mut Vec<String>,
) -> Result<Atlas> {
    let mut users: Vec<Users> = Vec::new();
    let mut user_of = vec![usize::MAX; scene.meshes.len()];
    for (i, instance) in scene.instances.iter().enumerate().filter(|(i, _)| instances.roles[*i] != Role::Unlit) {
        let mesh = instance.mesh as usize;
        if user_of[mesh] == usize::MAX {
            user_of[mesh] = users.len();
            users.push(Users { mesh, reference: i, ..Users::default() });
        }
        let u = &mut users[user_of[mesh]];
        let role = if instances.roles[i] == Role::Hidden { &mut u.hidden } else { &mut u.mapped };
        role.push(i);
    }
    let shapes: Vec<Shape> =
        users.par_iter().map(|u| Shape::new(scene, u.mesh, &scene.instances[u.reference])).collect();
    observer.begin("atlas: charts", 0);
    let cuts = cutter(&shapes, file, observer)?;
    for (u, _) in users.iter_mut().zip(&cuts).filter(|(_, cut)| cut.charts == 0) {
        // The packer expects that a rectangle has something in it.
        warnings.push(format!("{}: its triangles are too thin for texels; it is not lit", scene.meshes[u.mesh].name));
        *u = Users { mesh: u.mesh, reference: u.reference, ..Users::default() };
    }
    let atlas = Atlas {
        layouts: vec![Layout::default(); scene.meshes.len()],
        placements: vec![None; scene.instances.len()],
        ..Atlas::default()
    };
    refuse_many(users.iter().map(|u| u.mapped.len()).sum(), options)?;
    let units = vec![Unit::default(); users.len()];
    let (users, shapes, cuts) = (&users[..], &shapes[..], &cuts[..]);
    let mut room = Room { scene, instances, options, users, shapes, cuts, file, observer, warnings, atlas, units };
    observer.begin("atlas: packing", 0);
    let density = match options.density {
        Density::Resolution(edge) => room.one_page(edge)?,
        Density::TexelsPerMeter(t) => room.pages(t)?,
    };
    room.hidden(density * HIDDEN_DENSITY)?;
    Ok(room.atlas)
}

/// Pages that the least rectangles may take: the time to pack them grows with their number times the pages'.
const MOST_PAGES: u64 = 256;

/// Refuses so many mapped `nodes` that their least rectangles, one texel and its padding each, need too many pages.
fn refuse_many(nodes: usize, options: &Options) -> Result<()> {
    const LEAST: u32 = 1 + 2 * PADDING;
    let (edge, option) = match options.density {
        Density::Resolution(edge) if edge < options.page_size => (edge, "--resolution"),
        _ => (options.page_size, "--page-size"),
    };
    let nodes = nodes as u64;
    let pages = |edge: u32| nodes.div_ceil(u64::from(edge / LEAST).pow(2));
    if pages(edge) <= MOST_PAGES {
        return Ok(());
    }
    let mut enough = edge;
    while pages(enough) > MOST_PAGES {
        enough *= 2;
    }
    Err(Error::Usage(format!(
        "{option} {edge}: {nodes} nodes, {LEAST} x {LEAST} texels each at least, need {} pages, more than {MOST_PAGES}\n  \
         raise {option} to {enough}, leave nodes out (--exclude), or join them into fewer",
        pages(edge)
    )))
}

/// A mesh's instances.
#[derive(Clone, Debug, Default)]
struct Users {
    mesh: usize,
    /// The instance whose size its shape has.
    reference: usize,
    mapped: Vec<usize>,
    hidden: Vec<usize>,
}

/// What is laid out, and the atlas that grows.
struct Room<'a> {
    scene: &'a Scene,
    instances: &'a Instances,
    options: &'a Options,
    users: &'a [Users],
    shapes: &'a [Shape],
    cuts: &'a [Cut],
    file: &'a Path,
    observer: &'a dyn Observer,
    warnings: &'a mut Vec<String>,
    atlas: Atlas,
    /// Of each user's layout, once it is made.
    units: Vec<Unit>,
}

/// What a layout's unit square stands for.
#[derive(Clone, Copy, Debug, Default)]
struct Unit {
    /// Metres of the reference instance.
    metres: DVec2,
    /// Texels along the longer edge that keep the padding.
    least: u32,
}

/// One way to size the mapped instances.
struct Trial<'a> {
    size: Size,
    /// The general density, to which nodes' own densities relate; unknown: they are ignored.
    general: Option<f64>,
    /// Factor of each instance's density; empty: 1.
    lower: &'a [f64],
    /// Meshes used once lie on the page.
    direct: bool,
}

impl Room<'_> {
    /// Which node's charts do not fit on a page of edge `edge`, however coarse they are, and how many they are.
    fn crowded(&self, edge: u32) -> (String, String) {
        let most = self.with_mapped().into_iter().max_by_key(|&j| (self.cuts[j].charts, std::cmp::Reverse(j)));
        let Some(j) = most else { return ("geometry".into(), "its charts do not fit on a page".into()) };
        let (name, charts) = (&self.scene.instances[self.users[j].mapped[0]].name, self.cuts[j].charts);
        (name.clone(), format!("its {charts} charts and their padding do not fit on a page of {edge} x {edge}"))
    }

    /// The error to report for `failure` on pages of edge `edge`.
    fn error(&self, failure: Failure, edge: u32) -> Error {
        match failure {
            Failure::TooLarge(_) => {
                let more = if edge < *PAGE_EDGES.end() { "raise --page-size, or " } else { "" };
                let (node, problem) = self.crowded(edge);
                Error::invalid(self.file, node, problem, format!("{more}split its mesh into several nodes"))
            }
            Failure::Charts(problem) => Error::invalid(self.file, "geometry", problem, uvunwrap::REMEDY),
            Failure::Other(e) => e,
        }
    }

    /// Coarse rectangles of the hidden instances; layouts for the meshes that only they use.
    fn hidden(&mut self, density: f64) -> Result<()> {
        let alone: Vec<usize> = (0..self.users.len())
            .filter(|&j| self.users[j].mapped.is_empty() && !self.users[j].hidden.is_empty())
            .collect();
        let items: Vec<Item> = alone.iter().map(|&j| self.item(j, 1.0, self.hidden_scales(j))).collect();
        let size = Size::Density(density);
        let pack = || uvunwrap::pack(&items, size, self.observer).map_err(|f| self.error(f, self.options.page_size));
        let packed = if items.is_empty() { None } else { Some(pack()?) };
        for (&j, mesh) in alone.iter().zip(packed.iter().flat_map(|p| &p.meshes)) {
            self.set_layout(j, mesh, DVec2::ONE);
        }
        let mut demands = Vec::new();
        for (j, u) in self.users.iter().enumerate() {
            let Unit { metres, least } = self.units[j];
            demands.extend(u.hidden.iter().map(|&instance| Demand {
                instance,
                extent: metres * self.relative(instance, j),
                least,
                own: None,
            }));
        }
        let placed = place::spread(&demands, density, self.options.page_size, true);
        self.atlas.append(&demands, placed);
        Ok(())
    }

    /// The users with mapped instances, in the order of [`Packed::meshes`].
    fn with_mapped(&self) -> Vec<usize> {
        (0..self.users.len()).filter(|&j| !self.users[j].mapped.is_empty()).collect()
    }

    /// All mapped instances.
    fn mapped(&self) -> Vec<usize> {
        self.users.iter().flat_map(|u| u.mapped.iter().copied()).collect()
    }

    /// Size of instance `i` relative to the shape of its user `j`.
    fn relative(&self, i: usize, j: usize) -> f64 {
        (self.instances.areas[i] / self.instances.areas[self.users[j].reference]).sqrt()
    }

    fn item(&self, j: usize, factor: f64, scales: Vec<f32>) -> Item<'_> {
        Item { shape: &self.shapes[j], cut: &self.cuts[j], factor, scales }
    }

    fn hidden_scales(&self, j: usize) -> Vec<f32> {
        let factors: Vec<f64> = self.users[j].hidden.iter().map(|&i| self.relative(i, j)).collect();
        within(&factors, LARGEST_RATIO)
    }

    /// Size of instance `i` of user `j` in `trial`, density included, relative to the shape's.
    fn factor(&self, trial: &Trial, i: usize, j: usize) -> f64 {
        let own = self.scene.instances[i].texels_per_meter;
        let wish = own.zip(trial.general).map_or(1.0, |(t, d)| t / d);
        self.relative(i, j) * wish * trial.lower.get(i).copied().unwrap_or(1.0)
    }

    /// Packs the mapped instances.
    fn pack(&self, trial: &Trial) -> std::result::Result<Packed, Failure> {
        let mut ratio = LARGEST_RATIO;
        loop {
            let item = |j: usize| {
                let u = &self.users[j];
                let factors: Vec<f64> = u.mapped.iter().map(|&i| self.factor(trial, i, j)).collect();
                if trial.direct && lies_alone(u) {
                    return self.item(j, factors[0], vec![]);
                }
                self.item(j, 1.0, within(&factors, ratio))
            };
            let items: Vec<Item> = self.with_mapped().into_iter().map(item).collect();
            match uvunwrap::pack(&items, trial.size, self.observer) {
                // Padding grows with the ratio; it may be more than a small page holds.
                Err(Failure::TooLarge(_)) if uneven(&items) && matches!(trial.size, Size::Page(_)) => ratio /= 4.0,
                result => return result,
            }
        }
    }

    /// Makes the mapped meshes' layouts and puts them on pages of size `page`.
    fn take(&mut self, packed: Packed, page: UVec2) {
        let of_page = packed.size.as_dvec2() / page.as_dvec2();
        self.atlas.pages = vec![Page { size: page, hidden: false }; packed.pages as usize];
        for (j, mesh) in self.with_mapped().into_iter().zip(&packed.meshes) {
            if mesh.rectangles.is_empty() {
                self.set_layout(j, mesh, of_page);
                self.atlas.placements[self.users[j].mapped[0]] = Some(place::whole_page(0));
                continue;
            }
            self.set_layout(j, mesh, DVec2::ONE);
            for (&i, r) in self.users[j].mapped.iter().zip(&mesh.rectangles) {
                let page = page.as_dvec2();
                let (offset, scale) = ((r.min / page).as_vec2(), (whole(r.size) / page).as_vec2());
                self.atlas.placements[i] = Some(Placement { page: r.page, offset, scale });
            }
        }
    }

    fn set_layout(&mut self, j: usize, mesh: &uvunwrap::Mesh, scale: DVec2) {
        let longest = |r: &Rectangle| whole(r.size).max_element() as u32;
        self.units[j] =
            Unit { metres: mesh.metres, least: mesh.rectangles.iter().map(longest).min().unwrap_or_default() };
        let m = self.users[j].mesh;
        self.atlas.layouts[m] = shape::layout(&self.scene.meshes[m], &mesh.flat, &mesh.indices, scale);
    }
}

/// True for a mesh used once, which may lie on the page directly.
fn lies_alone(users: &Users) -> bool {
    users.mapped.len() == 1 && users.hidden.is_empty()
}

/// True if instances of a mesh differ in size.
fn uneven(items: &[Item]) -> bool {
    items.iter().any(|i| i.scales.windows(2).any(|w| w[0] != w[1]))
}

/// `factors`, the smallest raised to the largest over `ratio`.
fn within(factors: &[f64], ratio: f64) -> Vec<f32> {
    let most = factors.iter().copied().fold(0.0, f64::max);
    factors.iter().map(|f| f.max(most / ratio.max(1.0)).clamp(1e-12, 1e12) as f32).collect()
}

/// A rectangle's size on whole texels; it was given that much room.
fn whole(size: DVec2) -> DVec2 {
    (size - 0.01).ceil().max(DVec2::ONE)
}
