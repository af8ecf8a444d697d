//! The author's own layout: TEXCOORD_1 as it is.
//!
//! Where the coordinates of all nodes are disjoint and each mesh is used once, they are one page's layout; otherwise
//! each instance has a rectangle that holds its mesh's unit square. Refuses what cannot be a lightmap, by mesh. Meshes
//! that are only reflected, never shown, are laid out by the default unwrapper.

use super::{
    Atlas, Density, Layout, NO_CHART, Options, Page, lay,
    overlap::{self, Among, Piece},
    place::{self, Demand, HIDDEN_DENSITY, Instances, Role},
    uvunwrap,
};
use crate::{
    error::{Error, Result},
    progress::{self, Observer},
    scene::{Mesh, Scene},
};
use glam::{UVec2, Vec2};
use rayon::prelude::*;
use std::{collections::HashMap, path::Path};

/// The texture coordinate set of lightmaps.
const SET: usize = 1;
/// How far outside the unit square a coordinate may lie: rounding.
const OUTSIDE: f32 = 1e-5;
/// Overlap that is only warned of, relative to the area in uv.
const OVERLAP: f64 = 1e-4;

/// Lays out `scene` as its author did.
pub(super) fn unwrap(
    scene: &Scene,
    instances: &Instances,
    options: &Options,
    file: &Path,
    observer: &dyn Observer,
    warnings: &mut Vec<String>,
) -> Result<Atlas> {
    let Instances { roles, areas } = instances;
    let mut users = vec![Vec::new(); scene.meshes.len()];
    for (i, instance) in scene.instances.iter().enumerate().filter(|(i, _)| roles[*i] != Role::Unlit) {
        users[instance.mesh as usize].push(i);
    }
    let shown: Vec<bool> = users.iter().map(|u| u.iter().any(|&i| roles[i] == Role::Mapped)).collect();
    let kept: Vec<Kept> = scene
        .meshes
        .par_iter()
        .zip(&shown)
        .map(|(mesh, shown)| {
            progress::check(observer)?;
            if *shown { keep(scene, mesh, file) } else { Ok(Kept::default()) }
        })
        .collect::<Result<_>>()?;
    warnings.extend(kept.iter().flat_map(|k| k.warnings.iter().cloned()));

    let scale = |i: usize| {
        let uv = kept[scene.instances[i].mesh as usize].uv_area;
        if uv > 0.0 { (areas[i] / uv).sqrt() } else { 0.0 }
    };
    let demand = |role: Role, i: usize| Demand {
        instance: i,
        extent: glam::DVec2::splat(scale(i)),
        least: (2.0 * f64::from(kept[scene.instances[i].mesh as usize].layout.chart_count).sqrt()).ceil() as u32,
        own: scene.instances[i].texels_per_meter.filter(|_| role == Role::Mapped),
    };
    let of = |role: Role| (0..roles.len()).filter(move |&i| roles[i] == role);

    let mut atlas = Atlas { kept: true, placements: vec![None; roles.len()], ..Atlas::default() };
    let mapped: Vec<usize> = of(Role::Mapped).collect();
    let density = if !mapped.is_empty() && users.iter().all(|u| u.len() <= 1) && disjoint(scene, &kept, &mapped) {
        let world: f64 = mapped.iter().map(|&i| areas[i]).sum();
        let uv: f64 = mapped.iter().map(|&i| kept[scene.instances[i].mesh as usize].uv_area).sum();
        let (edge, density) = one_page(options, if uv > 0.0 { (world / uv).sqrt() } else { 0.0 }, warnings);
        if mapped.iter().any(|&i| scene.instances[i].texels_per_meter.is_some()) {
            warnings.push("the file's lightmap coordinates are one page: densities of single nodes are ignored".into());
        }
        atlas.pages.push(Page { size: UVec2::splat(edge), hidden: false });
        mapped.iter().for_each(|&i| atlas.placements[i] = Some(place::whole_page(0)));
        density
    } else {
        let demands: Vec<Demand> = mapped.iter().map(|&i| demand(Role::Mapped, i)).collect();
        atlas.place(scene, &demands, options, warnings)
    };
    let has_layout = |i: &usize| shown[scene.instances[*i].mesh as usize];
    let hidden: Vec<Demand> = of(Role::Hidden).filter(has_layout).map(|i| demand(Role::Hidden, i)).collect();
    atlas.append(&hidden, place::spread(&hidden, density * HIDDEN_DENSITY, options.page_size, true));
    atlas.layouts = kept.into_iter().map(|k| k.layout).collect();
    // What only reflects is nobody's to look at: it needs no coordinates of its author's.
    let mut rest = Instances { roles: vec![Role::Unlit; roles.len()], areas: areas.clone() };
    of(Role::Hidden).filter(|i| !has_layout(i)).for_each(|i| rest.roles[i] = Role::Hidden);
    if rest.roles.contains(&Role::Hidden) {
        let options = Options { density: Density::TexelsPerMeter(density), ..*options };
        atlas.join(lay::unwrap(scene, &rest, &options, uvunwrap::cut, file, observer, warnings)?);
    }
    Ok(atlas)
}

/// Edge and density of the one page that is wanted; `metres`: what the page's edge stands for.
fn one_page(options: &Options, metres: f64, warnings: &mut Vec<String>) -> (u32, f64) {
    let edge = match options.density {
        Density::Resolution(n) => n,
        Density::TexelsPerMeter(t) => {
            let wish = (metres * t).clamp(4.0, f64::from(u32::MAX / 2)) as u32;
            if wish.next_multiple_of(4) > options.page_size {
                warnings.push(format!(
                    "the kept layout is one page, and {t} texels per metre would need {wish} texels: \
                     the density was lowered to fit --page-size {}",
                    options.page_size
                ));
            }
            wish.next_multiple_of(4).min(options.page_size)
        }
    };
    (edge, if metres > 0.0 { f64::from(edge) / metres } else { 1.0 })
}

/// A mesh's layout and what was found on the way.
#[derive(Clone, Debug, Default)]
struct Kept {
    layout: Layout,
    uv_area: f64,
    warnings: Vec<String>,
}

/// Checks and takes over one mesh's coordinates.
fn keep(scene: &Scene, mesh: &Mesh, file: &Path) -> Result<Kept> {
    let wrong = |problem: String, remedy: &str| {
        Err(Error::invalid(file, &mesh.name, problem, format!("bake without --keep-uv, or {remedy}")))
    };
    let lit = |p: &crate::scene::Primitive| !p.triangles.is_empty() && !place::is_unlit(scene, p.material);
    if let Some(p) = mesh.primitives.iter().find(|p| lit(p) && p.uv_sets >> SET & 1 == 0) {
        return wrong(format!("primitive {} has no TEXCOORD_{SET}", p.source), "give it a second UV set");
    }
    let set = mesh.uvs.get(SET).filter(|s| s.len() == mesh.positions.len());
    let mut uv = set.cloned().unwrap_or_else(|| vec![Vec2::ZERO; mesh.positions.len()]);
    let mut used = vec![false; uv.len()];
    for p in mesh.primitives.iter().filter(|p| lit(p)) {
        for t in &mesh.triangles[p.triangles.start as usize..p.triangles.end as usize] {
            t.iter().for_each(|&v| used[v as usize] = true);
        }
    }
    for (v, c) in uv.iter_mut().enumerate() {
        if !used[v] {
            *c = if c.is_finite() { c.clamp(Vec2::ZERO, Vec2::ONE) } else { Vec2::ZERO };
        } else if !c.is_finite() {
            return wrong(format!("TEXCOORD_{SET} of vertex {v} is not a finite number"), "repair its second UV set");
        } else if c.min_element() < -OUTSIDE || c.max_element() > 1.0 + OUTSIDE {
            let at = format!("TEXCOORD_{SET} of vertex {v} is ({}, {}), outside [0, 1]", c.x, c.y);
            return wrong(at, "fix the mesh: a lightmap does not repeat");
        } else {
            *c = c.clamp(Vec2::ZERO, Vec2::ONE);
        }
    }

    let corners = |t: &[u32; 3]| t.map(|v| uv[v as usize].as_dvec2());
    let mut shown = vec![false; mesh.triangles.len()];
    let (mut uv_area, mut area, mut lost) = (0.0, 0.0, 0.0);
    for p in mesh.primitives.iter().filter(|p| lit(p)) {
        for t in p.triangles.clone() {
            let triangle = &mesh.triangles[t as usize];
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
            let (flat, world) = (overlap::cross(&corners(triangle)).abs(), (b - a).cross(c - a).length());
            shown[t as usize] = flat > 0.0;
            (uv_area, area) = (uv_area + flat * 0.5, area + world);
            lost += if flat > 0.0 { 0.0 } else { world };
        }
    }
    if uv_area <= 0.0 && area > 0.0 {
        return wrong(format!("TEXCOORD_{SET} has no area"), "unwrap it into its second UV set");
    }
    let mut warnings = Vec::new();
    if lost > OVERLAP * area {
        let share = 100.0 * lost / area;
        warnings.push(format!("{}: {share:.2} % of its area has no area in TEXCOORD_{SET} and stays dark", mesh.name));
    }
    let charted: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&t| shown[t as usize]).collect();
    let pieces: Vec<Piece> =
        charted.iter().map(|&t| Piece { uv: corners(&mesh.triangles[t as usize]), group: 0 }).collect();
    match overlap::overlap(&pieces, Among::All, &[OVERLAP * uv_area]) {
        Ok(found) if found[0] > 1e-7 * uv_area => {
            let share = 100.0 * found[0] / uv_area;
            warnings.push(format!("{}: {share:.4} % of TEXCOORD_{SET} overlaps; those texels are shared", mesh.name));
        }
        Ok(_) => {}
        Err(clash) => {
            let [a, b] = [clash.0, clash.1].map(|i| charted[i as usize]);
            let problem = format!("TEXCOORD_{SET} overlaps itself, for example triangles {a} and {b}");
            return wrong(problem, "fix the mesh: each triangle needs texels of its own");
        }
    }
    let (charts, chart_count) = charts(mesh, &uv, &shown);
    let source = (0..mesh.positions.len() as u32).collect();
    let layout = Layout { source, uv, triangles: mesh.triangles.clone(), charts, chart_count };
    Ok(Kept { layout, uv_area, warnings })
}

/// Chart of each shown triangle: those that share a corner's position, its uv and its side.
fn charts(mesh: &Mesh, uv: &[Vec2], shown: &[bool]) -> (Vec<u32>, u32) {
    let mut parents: Vec<u32> = Vec::new();
    let mut keys = HashMap::new();
    let mut node_of = vec![u32::MAX; mesh.triangles.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate().filter(|(t, _)| shown[*t]) {
        let side = overlap::cross(&triangle.map(|v| uv[v as usize].as_dvec2())) > 0.0;
        for &v in triangle {
            let position = mesh.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
            let at = (uv[v as usize].as_dvec2() * 1e6).round().as_ivec2();
            let node = *keys.entry((position, at, side)).or_insert_with(|| {
                parents.push(parents.len() as u32);
                parents.len() as u32 - 1
            });
            match node_of[t] {
                u32::MAX => node_of[t] = node,
                other => {
                    let (a, b) = (root(&mut parents, other), root(&mut parents, node));
                    parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
    }
    let mut numbers = HashMap::new();
    let mut number = |node: u32| {
        if node == u32::MAX {
            return NO_CHART;
        }
        let next = numbers.len() as u32;
        *numbers.entry(root(&mut parents, node)).or_insert(next)
    };
    let charts: Vec<u32> = node_of.into_iter().map(&mut number).collect();
    (charts, numbers.len() as u32)
}

fn root(parents: &mut [u32], mut node: u32) -> u32 {
    while parents[node as usize] != node {
        parents[node as usize] = parents[parents[node as usize] as usize];
        node = parents[node as usize];
    }
    node
}

/// True if the layouts of the `mapped` instances' meshes lie beside one another.
fn disjoint(scene: &Scene, kept: &[Kept], mapped: &[usize]) -> bool {
    let mut pieces = Vec::new();
    let mut limits = Vec::new();
    for &i in mapped {
        let Kept { layout, uv_area, .. } = &kept[scene.instances[i].mesh as usize];
        let shown = layout.triangles.iter().zip(&layout.charts).filter(|(_, c)| **c != NO_CHART);
        let group = limits.len() as u32;
        pieces.extend(shown.map(|(t, _)| Piece { uv: t.map(|v| layout.uv[v as usize].as_dvec2()), group }));
        limits.push(OVERLAP * uv_area);
    }
    overlap::overlap(&pieces, Among::Groups, &limits).is_ok()
}
