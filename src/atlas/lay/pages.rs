//! How many pages of which size, at which density.

use super::{
    super::{
        PADDING, pages_added,
        place::{self, Demand},
        uvunwrap::{self, Failure, Packed, Size},
    },
    LARGEST_RATIO, Room, Trial, lies_alone, whole, within,
};
use crate::error::Result;
use glam::UVec2;

/// Share of one page that charts should at least fill; below, pages are added.
const LEAST_USE: f64 = 0.1;

impl Room<'_> {
    /// One page of edge `wish`, at the density that fills it; more if one cannot hold all, larger ones if a node's charts
    /// do not fit one at all. The general density.
    pub(super) fn one_page(&mut self, wish: u32) -> Result<f64> {
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
            self.warnings.push(pages_added(packed.pages as usize, edge));
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
        if packed.pages > 1 && self.users.iter().any(lies_alone) {
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
    pub(super) fn pages(&mut self, density: f64) -> Result<f64> {
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
}

/// The edge of a page that may hold `edge` x `length` texels: twice `edge`, or as often as it takes.
fn doubled(edge: u32, length: u32) -> u32 {
    let mut side = u64::from(edge) * 2;
    while side * side < u64::from(edge) * u64::from(length) {
        side *= 2;
    }
    side.min(u32::MAX.into()) as u32
}

/// A page's size in multiples of four texels, if `most` allows.
fn rounded(size: UVec2, most: u32) -> UVec2 {
    UVec2::new(size.x.next_multiple_of(4), size.y.next_multiple_of(4)).min(UVec2::splat(most)).max(size)
}
