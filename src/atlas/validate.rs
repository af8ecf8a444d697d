//! What every [`Atlas`] keeps, checked: used by tests and debug builds.

use super::{
    Atlas, Layout, NO_CHART, PADDING, Placement,
    overlap::{self, Among, Piece},
    place,
};
use crate::scene::{Mesh, Scene};
use glam::{DVec2, Vec2};

/// Room for rounding, texels.
const SLACK: f64 = 0.02;

impl Atlas {
    /// Checks all that the other rooms rely on; names the first thing that does not hold.
    pub fn validate(&self, scene: &Scene) -> Result<(), String> {
        let lengths = [(self.layouts.len(), scene.meshes.len()), (self.placements.len(), scene.instances.len())];
        if lengths.iter().any(|(a, b)| a != b) {
            return Err("not one layout a mesh and one placement an instance".into());
        }
        if self.pages.windows(2).any(|p| p[0].hidden && !p[1].hidden) {
            return Err("a visible page follows a hidden one".into());
        }
        for (i, (placement, instance)) in self.placements.iter().zip(&scene.instances).enumerate() {
            let Some(p) = placement else { continue };
            let Some(page) = self.pages.get(p.page as usize) else { return Err(format!("instance {i}: no such page")) };
            let empty = scene.meshes[instance.mesh as usize].triangles.is_empty();
            if self.layouts[instance.mesh as usize].triangles.is_empty() && !empty {
                return Err(format!("instance {i}: its mesh has no layout"));
            }
            if page.hidden != instance.texels_per_meter.is_some_and(|t| t <= 0.0) {
                return Err(format!("instance {i}: on the wrong kind of page"));
            }
            let texel = (1.0 / page.size.as_dvec2()) * SLACK;
            let (min, max) = corners(p);
            if min.cmplt(-texel).any() || max.cmpgt(1.0 + texel).any() || !min.is_finite() || !max.is_finite() {
                return Err(format!("instance {i}: its rectangle {min} .. {max} leaves the page"));
            }
        }
        for (layout, mesh) in self.layouts.iter().zip(&scene.meshes) {
            layout.validate(mesh, self.kept).map_err(|e| format!("{}: {e}", mesh.name))?;
        }
        self.disjoint_rectangles()
    }

    /// Rectangles of one page keep twice the padding between them; whole pages hold layouts in page coordinates.
    fn disjoint_rectangles(&self) -> Result<(), String> {
        for (p, page) in self.pages.iter().enumerate() {
            let size = page.size.as_dvec2();
            let on_page = |q: &&Placement| q.page == p as u32 && **q != place::whole_page(p as u32);
            let mut rectangles: Vec<(DVec2, DVec2)> = self
                .placements
                .iter()
                .flatten()
                .filter(on_page)
                .map(corners)
                .map(|(a, b)| (a * size, b * size))
                .collect();
            rectangles.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
            let gap = f64::from(2 * PADDING) - SLACK;
            for (i, a) in rectangles.iter().enumerate() {
                let near = rectangles[i + 1..].iter().take_while(|b| b.0.x < a.1.x + gap);
                for b in near {
                    if a.0.y < b.1.y + gap && b.0.y < a.1.y + gap {
                        return Err(format!("page {p}: rectangles {a:?} and {b:?} are too close"));
                    }
                }
            }
        }
        Ok(())
    }
}

fn corners(p: &Placement) -> (DVec2, DVec2) {
    (p.offset.as_dvec2(), p.offset.as_dvec2() + p.scale.as_dvec2())
}

impl Layout {
    /// Checks the layout of `mesh`; overlaps within a `kept` one are its author's.
    fn validate(&self, mesh: &Mesh, kept: bool) -> Result<(), String> {
        if self.triangles.is_empty() {
            return Ok(());
        }
        if self.triangles.len() != mesh.triangles.len() || self.charts.len() != mesh.triangles.len() {
            return Err("not one triangle a triangle of the mesh".into());
        }
        if self.source.len() != self.uv.len() || self.source.iter().any(|&s| s as usize >= mesh.positions.len()) {
            return Err("source refers to no vertex".into());
        }
        let inside = |c: &Vec2| c.is_finite() && c.min_element() >= 0.0 && c.max_element() <= 1.0;
        if !self.uv.iter().all(inside) {
            return Err("uv outside [0, 1]".into());
        }
        for (t, (own, original)) in self.triangles.iter().zip(&mesh.triangles).enumerate() {
            if own.iter().zip(original).any(|(&o, &v)| self.source.get(o as usize) != Some(&v)) {
                return Err(format!("triangle {t} is another one in the layout"));
            }
            if self.charts[t] != NO_CHART && self.charts[t] >= self.chart_count {
                return Err(format!("triangle {t} has no such chart"));
            }
        }
        let primitive = |&s: &u32| mesh.primitives.iter().position(|p| p.vertices.contains(&s));
        if !self.source.iter().map(primitive).is_sorted() {
            return Err("a primitive's vertices are scattered".into());
        }
        if kept {
            return Ok(());
        }
        let shown = self.triangles.iter().zip(&self.charts).filter(|(_, c)| **c != NO_CHART);
        let pieces: Vec<Piece> =
            shown.map(|(t, _)| Piece { uv: t.map(|v| self.uv[v as usize].as_dvec2()), group: 0 }).collect();
        let area: f64 = pieces.iter().map(|p| overlap::cross(&p.uv).abs() * 0.5).sum();
        match overlap::overlap(&pieces, Among::All, &[1e-4 * area]) {
            Ok(_) => Ok(()),
            Err(clash) => Err(format!("charted triangles overlap: {clash:?}")),
        }
    }
}
