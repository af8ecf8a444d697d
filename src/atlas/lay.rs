//! Charts to pages: chooses the density, which meshes lie on the page directly and which have rectangles.
//!
//! A mesh used once may be laid out in page coordinates, as long as there is one page; all others, and all of them
//! on several pages, have one rectangle an instance, so that a node lies on one page.

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

/// Share of one page that charts should at least fill; below, pages are added.
const LEAST_USE: f64 = 0.1;

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
    let units = vec![Unit::default(); users.len()];
    let (users, shapes, cuts) = (&users[..], &shapes[..], &cuts[..]);
    let mut room = Room { scene, instances, options, users, shapes, cuts, file, observer, warnings, atlas, units };
    let density = match options.density {
        Density::Resolution(edge) => room.one_page(edge)?,
        Density::TexelsPerMeter(t) => room.pages(t)?,
    };
    room.hidden(density * HIDDEN_DENSITY)?;
    Ok(room.atlas)
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
    /// One page of edge `wish`, at the density that fills it; more if one cannot hold all, larger ones if a node's charts
    /// do not fit one at all. The general density.
    fn one_page(&mut self, wish: u32) -> Result<f64> {
        let mapped = self.mapped();
        let area_of = |list: &[usize]| list.iter().map(|&i| self.instances.areas[i]).sum::<f64>();
        if mapped.is_empty() {
            let area = area_of(&self.users.iter().flat_map(|u| u.hidden.clone()).collect::<Vec<_>>());
            return Ok(if area > 0.0 { f64::from(wish) / area.sqrt() } else { 1.0 });
        }
        let mut edge = wish;
        let (packed, general) = loop {
            match self.fill(edge, &mapped) {
                Err(Failure::TooLarge(n)) if edge < self.options.page_size => {
                    edge = doubled(edge, n).min(self.options.page_size);
                }
                Err(failure) => return Err(self.error(failure, edge)),
                Ok(filled) => break filled,
            }
        };
        if edge > wish {
            let (node, problem) = self.crowded(wish);
            self.warnings.push(format!("{node}: {problem}: the page has {edge} x {edge} (raise --resolution)"));
        }
        let density = packed.density;
        if general.is_some_and(|d| density < d * 0.9) {
            self.warnings.push("one page is too small for the nodes' own densities: they were lowered".into());
        }
        if packed.pages > 1 {
            self.warnings.push(super::pages_added(packed.pages as usize, edge));
        }
        self.take(packed, UVec2::splat(edge));
        Ok(density)
    }

    /// Packs the `mapped` instances on one page of edge `edge`, or on more; the general density if nodes have their own.
    fn fill(&self, edge: u32, mapped: &[usize]) -> std::result::Result<(Packed, Option<f64>), Failure> {
        let size = Size::Page(edge);
        let mut packed = self.pack(&Trial { size, general: None, lower: &[], direct: true })?;
        let mut general = None;
        let own = |i: usize| self.scene.instances[i].texels_per_meter;
        let area = |i: usize| self.instances.areas[i];
        if mapped.iter().any(|&i| own(i).is_some()) {
            // What is left by the nodes that have a density of their own is for the others; the page's use is measured.
            let free: f64 = mapped.iter().filter(|&&i| own(i).is_none()).map(|&i| area(i)).sum();
            let fixed: f64 = mapped.iter().filter_map(|&i| Some(area(i) * own(i)?.powi(2))).sum();
            let mut used = packed.density.powi(2) * mapped.iter().map(|&i| area(i)).sum::<f64>();
            let least = packed.density * 0.05;
            for _ in 0..5 {
                let d = if free > 0.0 { ((used - fixed).max(0.0) / free).sqrt().max(least) } else { packed.density };
                packed = self.pack(&Trial { size, general: Some(d), lower: &[], direct: true })?;
                general = Some(d);
                used = packed.density.powi(2) * (free + fixed / (d * d));
                if (packed.density / d - 1.0).abs() < 0.02 {
                    break;
                }
            }
        }
        if packed.pages > 1 {
            packed = self.pack(&Trial { size, general, lower: &[], direct: false })?;
        }
        let full = f64::from(edge).powi(2) / mapped.iter().map(|&i| area(i)).sum::<f64>();
        if packed.pages == 1 && mapped.len() > 1 && packed.density.powi(2) < LEAST_USE * full {
            // Padding ate the page: charts are far below a texel.
            let size = Size::Pages((0.25 * full).sqrt(), edge);
            if let Ok(more) = self.pack(&Trial { size, general, lower: &[], direct: false }) {
                packed = more;
            }
        }
        Ok((packed, general))
    }

    /// Pages at `density`, as many as needed. The general density.
    fn pages(&mut self, density: f64) -> Result<f64> {
        let mapped = self.mapped();
        if mapped.is_empty() {
            return Ok(density);
        }
        let edge = self.options.page_size;
        let most = f64::from(edge.saturating_sub(2 * PADDING).max(1));
        let texels = |i: usize| {
            let d = self.scene.instances[i].texels_per_meter.unwrap_or(density);
            d * d * self.instances.areas[i]
        };
        let mut lower = vec![1.0; self.scene.instances.len()];
        let (size, general) = (Size::Density(density), Some(density));
        if mapped.iter().map(|&i| texels(i)).sum::<f64>() <= most * most {
            let packed = self.pack(&Trial { size, general, lower: &lower, direct: true });
            let packed = packed.map_err(|failure| self.error(failure, edge))?;
            if packed.size.max_element() <= edge {
                let page = rounded(packed.size, edge);
                self.take(packed, page);
                return Ok(density);
            }
        }
        // A page that is full to the last texel does not exist.
        mapped.iter().for_each(|&i| lower[i] = (0.95 * most / texels(i).sqrt()).min(1.0));
        let size = Size::Pages(density, edge);
        let mut trial = Trial { size, general, lower: &lower, direct: false };
        let mut packed = self.pack(&trial);
        if matches!(packed, Err(Failure::TooLarge(_))) {
            for j in self.with_mapped() {
                self.lower_to_fit(j, size, density, most, &mut lower)?;
            }
            trial = Trial { size, general, lower: &lower, direct: false };
            packed = self.pack(&trial);
        }
        let packed = packed.map_err(|failure| self.error(failure, edge))?;
        let demands: Vec<Demand> = self
            .with_mapped()
            .into_iter()
            .zip(&packed.meshes)
            .flat_map(|(j, mesh)| self.users[j].mapped.iter().zip(&mesh.rectangles))
            .map(|(&instance, r)| Demand { instance, extent: whole(r.size) / density, least: 0, own: None })
            .collect();
        let placed = place::spread(&demands, density, edge, false);
        let lowered: Vec<usize> = mapped.into_iter().filter(|&i| lower[i] < 1.0).collect();
        place::warn_lowered(self.scene, &lowered, edge, self.warnings);
        self.take(packed, UVec2::splat(edge));
        self.atlas.pages.clear();
        self.atlas.append(&demands, placed);
        Ok(density)
    }

    /// Lowers the density of user `j`'s largest instances until a page holds each of them.
    fn lower_to_fit(&self, j: usize, size: Size, general: f64, most: f64, lower: &mut [f64]) -> Result<()> {
        let mapped = &self.users[j].mapped;
        loop {
            let trial = Trial { size, general: Some(general), lower, direct: false };
            let factors: Vec<f64> = mapped.iter().map(|&i| self.factor(&trial, i, j)).collect();
            let longest =
                match uvunwrap::pack(&[self.item(j, 1.0, within(&factors, LARGEST_RATIO))], size, self.observer) {
                    Err(Failure::TooLarge(n)) => f64::from(n),
                    Err(failure) => return Err(self.error(failure, self.options.page_size)),
                    Ok(_) => return Ok(()),
                };
            let largest = factors.iter().copied().fold(0.0, f64::max);
            let goal = largest * (most / longest).min(1.0) * 0.97;
            for (&i, factor) in mapped.iter().zip(factors) {
                lower[i] *= (goal / factor).min(1.0);
            }
            if largest < 1e-9 {
                return Ok(());
            }
        }
    }

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
                if trial.direct && u.mapped.len() + u.hidden.len() == 1 {
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

/// The edge of a page that may hold `edge` x `length` texels: twice `edge`, or as often as it takes.
fn doubled(edge: u32, length: u32) -> u32 {
    let mut side = u64::from(edge) * 2;
    while side * side < u64::from(edge) * u64::from(length) {
        side *= 2;
    }
    side.min(u32::MAX.into()) as u32
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

/// A page's size in multiples of four texels, if `most` allows.
fn rounded(size: UVec2, most: u32) -> UVec2 {
    UVec2::new(size.x.next_multiple_of(4), size.y.next_multiple_of(4)).min(UVec2::splat(most)).max(size)
}
