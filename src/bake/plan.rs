//! What a bake says before and after: the pre-flight line, the report, warnings.

use super::{Ground, Lit, Options};
use crate::{
    atlas::{self, Atlas, Coverage, Density, NO_CHART},
    error::{Error, Result},
    lightmaps::jump_across_seams,
    memory::{self, REMEDY},
    progress::Observer,
    radiosity::{self, Solver},
    report::{FormFactorReport, NodeReport, PageReport, RayReport, ReflectanceReport, Report, SCHEMA, SceneCounts},
    scene::{Primitive, Scene, Texture, World},
    trace::{self, Tracer},
    transport::{self, FormFactors, Receivers},
};
use std::collections::HashSet;

/// Bytes that a bake needs beside its rows, by texel, by placed triangle and, while trees are built, by stored triangle
/// (measured).
const BYTES_A_TEXEL: u64 = 340;
const BYTES_A_TRIANGLE: u64 = 50;
const BYTES_A_STORED_TRIANGLE: u64 = 300;
const BYTES_A_PIXEL: u64 = 40;
/// Texels of a group of up to 16, at least, on average.
const LEAST_OF_GROUP: u64 = 4;
/// For a texel that reads receivers.
const BYTES_OF_WEIGHTS: u64 = 40;
/// While the lit file is written.
const BYTES_A_NODE: u64 = 6500;
/// Of the program itself.
const BYTES_OF_PROGRAM: u64 = 24 << 20;

/// Refuses a scene or an atlas, to be or made, that would not fit before anything large is made of it.
pub(super) fn refuse(scene: &Scene, options: &Options, atlas: Option<&Atlas>) -> Result<()> {
    let pixels = atlas.map_or_else(|| atlas::least_texels(scene, &options.atlas), pixels);
    // Where a density is wished for, pages are cropped to what is covered.
    let texels =
        if matches!(options.atlas.density, Density::TexelsPerMeter(_)) && atlas.is_none() { pixels } else { 0 };
    if pixels > u64::from(u32::MAX) {
        return Err(Error::Usage(format!("{pixels} texels are more than an atlas can hold\n  {REMEDY}")));
    }
    let need = bytes_of_triangles(scene) + pixels * BYTES_A_PIXEL + texels * bytes_a_texel(options, texels);
    memory::fits(need >> 20, memory::free_mb(), REMEDY)
}

/// Refuses a scene of which no triangle has an area.
pub(super) fn refuse_flat(world: &World) -> Result<()> {
    let mut instances = 0..world.scene.instances.len();
    if instances.any(|i| degenerate(world, i) < world.triangles_of(i).len()) || world.is_empty() {
        return Ok(());
    }
    let problem = "no triangle has an area: there is nothing to light";
    let remedy = "export the meshes again; a scale of 0 flattens them, too";
    Err(Error::invalid(&world.scene.file, &world.mesh(0).name, problem, remedy))
}

/// With the row of its front, or with the weights by which it reads those of others: how many these are is not known
/// before they are chosen.
fn bytes_a_texel(options: &Options, texels: u64) -> u64 {
    BYTES_A_TEXEL
        + match options.transport.receivers {
            Receivers::All => options.transport.bytes_of_rows(texels as usize) / texels.max(1),
            Receivers::Auto => BYTES_OF_WEIGHTS,
        }
}

/// Of the rays that neighbours share, on every thread. Of adaptive receivers nobody knows yet how many there are.
fn bytes_of_pools(options: &Options, atlas: &Atlas, texels: u64) -> u64 {
    let shares = match options.transport.receivers {
        Receivers::All => options.transport.shares(texels as usize),
        Receivers::Auto => options.transport.shares(1),
    };
    let pools: u64 = atlas.pages.iter().map(|p| radiosity::pools(p.size.y)).sum();
    let at_once = pools.min(rayon::current_num_threads() as u64);
    if shares { at_once * radiosity::bytes_of_pool(options.transport.rays_of_row()) } else { 0 }
}

fn bytes_of_triangles(scene: &Scene) -> u64 {
    let placed: usize = scene.instances.iter().map(|i| scene.meshes[i.mesh as usize].triangles.len()).sum();
    placed as u64 * BYTES_A_TRIANGLE + trace::stored(scene) as u64 * BYTES_A_STORED_TRIANGLE
}

fn pixels(atlas: &Atlas) -> u64 {
    atlas.pages.iter().map(|p| u64::from(p.size.x) * u64::from(p.size.y)).sum()
}

/// Says what is to come, and refuses what does not fit beside the `taken_mb` of before.
pub(super) fn announce(
    scene: &Scene,
    atlas: &Atlas,
    coverage: &Coverage,
    options: &Options,
    taken_mb: u64,
    observer: &dyn Observer,
) -> Result<()> {
    let texels = coverage.texels.len() as u64;
    let rays = texels * options.transport.rays_of_row();
    let all = options.transport.receivers == Receivers::All;
    let of_scene = bytes_of_triangles(scene) + pixels(atlas) * BYTES_A_PIXEL + BYTES_OF_PROGRAM;
    let rest = of_scene + texels * bytes_a_texel(options, texels);
    let entries = |rows: u64| options.transport.bytes_of_entries(rows as usize, texels as usize);
    // A sum of bounces is a plain iteration.
    let solver = options.radiosity.bounces.map_or(options.radiosity.solver, |_| Solver::Jacobi);
    let grouped = all && options.radiosity.bounces.is_none() && options.transport.shares(texels as usize);
    let need = |backs: u64| {
        let of_all = entries(texels + backs);
        // Rows between groups are there beside those of texels while the solver runs.
        let (unknowns, of_groups) =
            if grouped { (texels / LEAST_OF_GROUP + backs, of_all) } else { (texels + backs, 0) };
        // Pools take what the solver has given back.
        let solving = (of_groups + solver.bytes(unknowns, of_all)).max(bytes_of_pools(options, atlas, texels));
        rest + backs * BYTES_A_TEXEL + entries(backs) + solving
    };
    let pages = atlas.pages.iter().filter(|p| !p.hidden).count();
    let free_mb = free_beside(taken_mb);
    let textures: u64 = scene.textures.iter().map(|t| Texture::bytes(t.picture().0)).sum();
    options.transport.form_factors.check(texels as usize)?;
    // The solver runs when all rows are there.
    options.radiosity.check(if all { texels as usize } else { 0 }, all)?;
    // Every texel has a back at worst: rays will tell. Nodes are written when the rows are gone.
    let sheets = scene.materials.iter().any(|m| m.double_sided);
    let most = need(if sheets && all { texels } else { 0 }).max(scene.instances.len() as u64 * BYTES_A_NODE);
    let most_mb = (taken_mb + (most >> 20)).max(memory::peak_mb());
    let taken = if textures > 0 { format!(" ({} MB of textures)", textures >> 20) } else { String::new() };
    let memory = format!("{taken_mb} MB of them taken{taken}, {free_mb} MB free");
    let size = format!("{texels} texels on {pages} page(s)");
    let effort = match options.transport.receivers {
        Receivers::All => {
            format!("{rays} rays{}, up to {most_mb} MB", unshared(&options.transport, coverage.texels.len()))
        }
        Receivers::Auto => format!("up to {rays} rays, {most_mb} MB and the receivers' rows"),
    };
    observer.plan(&format!("{size}, {effort}, {memory}"));
    memory::fits(need(0) >> 20, free_mb, REMEDY)
}

/// Memory (MB) that is free beside the `taken_mb` of before: what an earlier attempt holds is given back.
pub(super) fn free_beside(taken_mb: u64) -> u64 {
    memory::free_mb().saturating_add(memory::resident_mb().saturating_sub(taken_mb))
}

/// What to know of rays that neighbours were to share, if they are too many for it: fewer would err less.
fn unshared(options: &transport::Options, texels: usize) -> String {
    if !options.reuse || options.form_factors != FormFactors::Rays || options.shares(texels) {
        return String::new();
    }
    format!(" (too many for neighbours to share, as up to {} a texel are)", transport::Options::most_shared(texels))
}

/// Fills the report from the rooms.
pub(super) fn describe(r: &mut Report, ground: &Ground, lit: &Lit, options: &Options) {
    let Ground { tracer, atlas, coverage, .. } = ground;
    let Lit { patches, transport, direct, radiosity, lightmaps, .. } = lit;
    let scene = tracer.world.scene;
    r.schema = SCHEMA;
    r.generator = concat!("luxel ", env!("CARGO_PKG_VERSION")).into();
    r.scene = counts(tracer);
    r.texels = coverage.texels.len();
    r.patches = patches.len();
    r.receivers = transport.receivers.len();
    let adaptive = options.transport.receivers == Receivers::Auto;
    r.adaptive_rays = adaptive.then_some(options.transport.rays);
    let seconds = r.seconds.iter().find(|s| s.0 == "transport").map_or(0.0, |s| s.1);
    let mut rays = transport.stats;
    rays += lit.added;
    r.rays = RayReport {
        traced: rays.traced,
        per_second: transport.stats.traced as f64 / seconds.max(1e-9),
        escaped: rays.escaped,
        blocked: rays.dark,
        lost: rays.lost,
        shadow: direct.shadow_rays,
    };
    let form_factors = options.transport.form_factors;
    r.form_factors = FormFactorReport {
        name: form_factors.to_string(),
        rescaled: transport.stats.rescaled,
        excess: transport.stats.excess,
        reciprocity: (form_factors != FormFactors::Rays).then(|| transport.reciprocity(patches)),
    };
    r.matrix_entries = transport.rows.entries();
    r.matrix_bytes = transport.rows.bytes();
    let area: f64 = patches.area[..patches.fronts].iter().map(|&a| f64::from(a)).sum();
    r.reflectance = ReflectanceReport {
        max: patches.reflectance.iter().map(|c| f64::from(c.max_element())).fold(0.0, f64::max),
        capped_area: patches.capped_area,
        metallic_area: patches.metallic_area,
        area,
    };
    r.buried_texels = lightmaps.buried;
    r.turned_texels = lightmaps.turned;
    r.seam_jump_p95 = jump_across_seams(&tracer.world, atlas, coverage, lightmaps);
    r.energy = lit.energy.clone();
    r.solver = radiosity.report.clone();
    r.peak_memory_mb = memory::peak_mb();
    let mut covered = vec![0; atlas.pages.len()];
    coverage.texels.iter().for_each(|t| covered[t.page as usize] += 1);
    for (page, texels) in atlas.pages.iter().zip(covered).filter(|(p, _)| !p.hidden) {
        let pixels = f64::from(page.size.x) * f64::from(page.size.y);
        let (width, height) = (page.size.x, page.size.y);
        r.pages.push(PageReport { width, height, texels, utilization: texels as f64 / pixels });
    }
    r.nodes = (0..scene.instances.len()).map(|i| node(tracer, atlas, coverage, i)).collect();
    warn_of_uncovered(r, tracer, coverage);
    if lightmaps.broken > 0 {
        r.warnings.push(format!(
            "{} texels came out infinite and were set to 0: is a light absurdly bright?",
            lightmaps.broken
        ));
    }
}

/// Names nodes that have a place on a page, but no texel there.
fn warn_of_uncovered(r: &mut Report, tracer: &Tracer, coverage: &Coverage) {
    let mut covered = vec![false; r.nodes.len()];
    coverage.fragments.iter().for_each(|f| covered[tracer.world.locate(f.triangle).0] = true);
    let bare: Vec<&NodeReport> =
        r.nodes.iter().zip(covered).filter(|(n, c)| n.page.is_some() && !c).map(|n| n.0).collect();
    let Some(first) = bare.first() else { return };
    let others = if bare.len() > 1 { format!(" and {} more", bare.len() - 1) } else { String::new() };
    r.warnings
        .push(format!("{}{others}: too small for a texel, so it is not lit (see --texels-per-meter)", first.name));
}

/// Adds what the user should know.
pub(super) fn warn(r: &mut Report, tracer: &Tracer, options: &Options) {
    let share = |a: f64| 100.0 * a / r.reflectance.area.max(1e-30);
    if r.reflectance.capped_area > 0.0 {
        r.warnings.push(format!(
            "reflectance was capped at {} on {:.1} % of the surface (--max-reflectance)",
            options.max_reflectance,
            share(r.reflectance.capped_area)
        ));
    }
    if r.reflectance.metallic_area > 1e-3 * r.reflectance.area {
        r.warnings.push(format!(
            "{:.1} % of the surface is metallic and reflects no diffuse light",
            share(r.reflectance.metallic_area)
        ));
    }
    if let Some(i) = (0..tracer.world.scene.instances.len()).find(|&i| degenerate(&tracer.world, i) > 0) {
        let (count, mesh) = (r.scene.degenerate_triangles, &tracer.world.mesh(i).name);
        r.warnings.push(format!("triangles without area were left out: {count}, the first in {mesh}"));
    }
    if r.turned_texels > 0 {
        r.warnings.push(format!("{} texels show their back: their front is inside geometry", r.turned_texels));
    }
    if r.rays.lost as f64 > 1e-5 * r.rays.traced as f64 {
        r.warnings.push(format!("{} of {} rays met no texel: light is lost", r.rays.lost, r.rays.traced));
    }
    if r.form_factors.rescaled > 0 {
        let (rows, percent) = (r.form_factors.rescaled, 100.0 * r.form_factors.excess);
        let name = &r.form_factors.name;
        r.warnings.push(format!(
            "{rows} of {} rows of form factors ({name}) were scaled, as they summed to up to {percent:.1} % more or less than \
             they may",
            r.receivers
        ));
    }
    if let Some(other) = r.solver.fallback {
        let name = r.solver.name;
        r.warnings.push(format!("the solver {name} could do no more and {other} went on; --solver chooses another"));
    }
    if let Some(bound) = r.solver.relative_bound.filter(|_| !r.solver.converged) {
        r.warnings.push(format!("the solver stopped at a relative error bound of {bound:.1e}"));
    }
}

fn counts(tracer: &Tracer) -> SceneCounts {
    let (scene, world) = (tracer.world.scene, &tracer.world);
    let instances = || 0..scene.instances.len();
    let emitting = |i: usize| {
        let emits = |p: &&Primitive| scene.materials[p.material as usize].emits();
        let triangles = world.mesh(i).primitives.iter().filter(emits).flat_map(|p| p.triangles.clone());
        triangles.filter(|&t| !is_degenerate(world, i, t)).count()
    };
    SceneCounts {
        meshes: scene.meshes.len(),
        instances: scene.instances.len(),
        triangles: scene.meshes.iter().map(|m| m.triangles.len()).sum(),
        instanced_triangles: world.len() as usize,
        degenerate_triangles: instances().map(|i| degenerate(world, i)).sum(),
        materials: scene.materials.len(),
        lights: scene.lights.len(),
        emitting_triangles: instances().map(emitting).sum(),
    }
}

/// Triangles of instance `i` without area.
fn degenerate(world: &World, i: usize) -> usize {
    (0..world.triangles_of(i).len() as u32).filter(|&t| is_degenerate(world, i, t)).count()
}

fn is_degenerate(world: &World, i: usize, t: u32) -> bool {
    world.cross(i, &world.corners(i, t)) == glam::Vec3::ZERO
}

fn node(tracer: &Tracer, atlas: &Atlas, coverage: &Coverage, i: usize) -> NodeReport {
    let (world, instance) = (&tracer.world, &tracer.world.scene.instances[i]);
    let layout = &atlas.layouts[instance.mesh as usize];
    let (mut area, mut texels) = (0f64, 0f64);
    let mut widths = vec![(glam::Vec2::INFINITY, glam::Vec2::NEG_INFINITY); layout.chart_count as usize];
    for (local, triangle) in world.triangles_of(i).enumerate() {
        let [a, b, c] = coverage.charted[triangle as usize].corners;
        area += f64::from(world.cross(i, &world.corners(i, local as u32)).length()) * 0.5;
        texels += f64::from((b - a).perp_dot(c - a).abs()) * 0.5;
        let chart = layout.charts.get(local).copied().unwrap_or(NO_CHART);
        if let Some((low, high)) = widths.get_mut(chart as usize) {
            *low = low.min(a).min(b).min(c);
            *high = high.max(a).max(b).max(c);
        }
    }
    let used: HashSet<u32> = layout.charts.iter().copied().filter(|&c| c != NO_CHART).collect();
    NodeReport {
        node: instance.node,
        name: instance.name.clone(),
        page: atlas.placements[i].filter(|p| !atlas.pages[p.page as usize].hidden).map(|p| p.page),
        texels_per_meter: if area > 0.0 { (texels / area).sqrt() } else { 0.0 },
        charts: used.len() as u32,
        small_charts: widths.iter().filter(|(low, high)| low.x <= high.x && (*high - *low).min_element() < 2.0).count()
            as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_beyond_memory_is_refused_before_it_is_packed() {
        let atlas = |n| atlas::Options { density: Density::Resolution(n), ..atlas::Options::default() };
        let resolution = |n| Options { atlas: atlas(n), ..Options::default() };
        assert!(refuse(&Scene::default(), &resolution(64), None).is_ok());
        // 40 GB for the pixels alone.
        let refused = refuse(&Scene::default(), &resolution(32768), None).is_err();
        assert!(refused || memory::free_mb() > 40_000);
    }

    #[test]
    fn rays_that_neighbours_cannot_share_are_told() {
        let told =
            |rays, reuse, texels| unshared(&transport::Options { reuse, ..transport::Options::of(rays) }, texels);
        assert_eq!(told(64, true, 1 << 26), "");
        assert_eq!(told(368, true, 727_508), "");
        assert!(told(369, true, 727_508).contains("up to 368 a texel"));
        assert_eq!(told(369, false, 727_508), "");
    }
}
