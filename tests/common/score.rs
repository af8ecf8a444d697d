//! The score: a bake against path-traced irradiance at some thousand texels of the author's layout.
//!
//! [`texels`] compares texel with texel (the bake kept the author's UVs, same resolution); [`probe`] reads any layout
//! bilinearly, as a viewer would, at 2 x 2 surface points of each truth texel. All errors are over three channels:
//! `rrmse = sqrt(mean((x - t)^2) - mean(se^2)) / mean(t)`, the truth's own known variance taken off.

use super::npz::Npz;
use glam::{DVec2, DVec3};
use luxel::{
    atlas::Atlas,
    lightmaps::{Lightmaps, Map},
    scene::{Scene, Sky, World},
};
use std::{error::Error, fmt, fs, path::Path};

/// Points on a texel's side in [`probe`].
const POINTS: usize = 2;

/// Texels nearer than this to the edge of their chart count as its border.
const BORDER: f64 = 2.0;

/// Known irradiance of a scene at some texels of its TEXCOORD_1.
pub struct Truth {
    /// Texels on a side of the square map.
    pub resolution: usize,
    /// The texels, in no order.
    pub texels: Vec<TruthTexel>,
}

/// Mean irradiance of one texel.
pub struct TruthTexel {
    /// Index in the map, row by row from the top.
    pub index: usize,
    /// Irradiance.
    pub irradiance: DVec3,
    /// Its standard error.
    pub error: DVec3,
    /// Distance to the edge of its chart in texels, 1 at the border.
    pub edge: f64,
    /// Partly inside other geometry: not counted.
    pub buried: bool,
}

impl Truth {
    /// Reads the arrays R, idx, E, se, edge and back of an .npz file.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let file = Npz::read(path)?;
        let (index, irradiance, error) = (file.array("idx")?, file.array("E")?, file.array("se")?);
        let (edge, back) = (file.array("edge")?, file.array("back")?);
        let texel = |i: usize| TruthTexel {
            index: index[i] as usize,
            irradiance: DVec3::from_slice(&irradiance[3 * i..]),
            error: DVec3::from_slice(&error[3 * i..]),
            edge: edge[i],
            buried: back[i] > f64::from(0.02f32),
        };
        Ok(Truth { resolution: file.array("R")?[0] as usize, texels: (0..index.len()).map(texel).collect() })
    }
}

/// A benchmark scene: its sky stands in the `extras.bench` of its first glTF scene.
pub fn read_scene(path: &Path) -> Result<Scene, Box<dyn Error>> {
    let mut scene = luxel::gltf::read(path, &luxel::gltf::ReadOptions::default())?.scene;
    let glb = fs::read(path)?;
    let length = glb.get(12..16).ok_or("not a GLB")?;
    let length = u32::from_le_bytes(length.try_into()?) as usize;
    let json: serde_json::Value = serde_json::from_slice(glb.get(20..20 + length).ok_or("not a GLB")?)?;
    let sky = &json["scenes"][0]["extras"]["bench"]["sky"];
    let [r, g, b] = [0, 1, 2].map(|c| sky[c].as_f64().unwrap_or(0.0) as f32);
    if r.max(g).max(b) > 0.0 {
        scene.sky = Sky::Uniform(glam::vec3(r, g, b));
    }
    Ok(scene)
}

/// What the map holds at the truth's texels. The map is one page of the truth's resolution.
pub fn texels(maps: &Lightmaps, truth: &Truth) -> Vec<Option<DVec3>> {
    let [page] = &maps.pages[..] else { panic!("{} pages, not one in the author's layout", maps.pages.len()) };
    let size = page.size.as_usizevec2();
    assert_eq!((size.x, size.y), (truth.resolution, truth.resolution), "the page's size is the truth's");
    truth.texels.iter().map(|t| Some(page.irradiance[t.index].as_dvec3())).collect()
}

/// What a viewer would see, on average, on the surface of the truth's texels; `None` where it has no lightmap.
pub fn probe(scene: &Scene, atlas: &Atlas, maps: &Lightmaps, truth: &Truth) -> Vec<Option<DVec3>> {
    let side = truth.resolution * POINTS;
    let cells = rasterized(scene, side);
    let world = World::new(scene);
    let seen = |cell: usize| {
        let triangle = cells[cell];
        if triangle == EMPTY {
            return None;
        }
        let (instance, t) = world.locate(triangle);
        let (mesh, t) = (scene.instances[instance].mesh as usize, t as usize);
        let placement = atlas.placements[instance]?;
        let layout = &atlas.layouts[mesh];
        let b = barycentrics(reference_uv(scene, mesh, t)?, center(cell, side))?;
        let [p, q, r] = layout.triangles[t].map(|v| layout.uv[v as usize].as_dvec2());
        let uv = placement.offset.as_dvec2() + placement.scale.as_dvec2() * (p + (q - p) * b.x + (r - p) * b.y);
        Some(bilinear(&maps.pages[placement.page as usize], uv))
    };
    let value = |t: &TruthTexel| {
        let (x, y) = (t.index % truth.resolution * POINTS, t.index / truth.resolution * POINTS);
        let points = (0..POINTS * POINTS).filter_map(|k| seen((y + k / POINTS) * side + x + k % POINTS));
        let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(sum, n), v| (sum + v, n + 1.0));
        (n > 0.0).then(|| sum / n)
    };
    truth.texels.iter().map(value).collect()
}

/// The figures of one comparison. Relative numbers.
#[derive(Clone, Copy, Debug)]
pub struct Metrics {
    /// Over all texels that count.
    pub rrmse: f64,
    /// Over the darker half, relative to that half's mean: indirect light shows here.
    pub dark: f64,
    /// Over the texels at the borders of charts, relative to the mean of all.
    pub border: f64,
    /// Mean over mean, less 1.
    pub bias: f64,
    /// Median of |x - t| / t, grey.
    pub median: f64,
    /// Its 95th percentile.
    pub p95: f64,
    /// Truth texels without a value.
    pub missing: usize,
}

impl Metrics {
    /// Compares `values` with the truth's texels, one by one.
    pub fn new(truth: &Truth, values: &[Option<DVec3>]) -> Self {
        let all: Vec<(&TruthTexel, DVec3)> = truth
            .texels
            .iter()
            .zip(values)
            .filter(|(t, _)| !t.buried)
            .filter_map(|(t, x)| Some((t, x.filter(|x| x.is_finite())?)))
            .collect();
        let missing = values.iter().filter(|x| !x.is_some_and(|x| x.is_finite())).count();
        let grey = |v: DVec3| v.element_sum() / 3.0;
        let mean = |of: &[(&TruthTexel, DVec3)]| average(of.iter().map(|(t, _)| grey(t.irradiance)));
        let middle = percentile(all.iter().map(|(t, _)| grey(t.irradiance)).collect(), 0.5);
        let part =
            |keep: &dyn Fn(&TruthTexel) -> bool| -> Vec<_> { all.iter().filter(|(t, _)| keep(t)).copied().collect() };
        let dark = part(&|t| grey(t.irradiance) <= middle);
        let border = part(&|t| t.edge <= BORDER);
        let whole = mean(&all);
        let relative: Vec<f64> = part(&|t| grey(t.irradiance) > 0.01 * whole)
            .iter()
            .map(|(t, x)| (grey(*x) - grey(t.irradiance)).abs() / grey(t.irradiance))
            .collect();
        Metrics {
            rrmse: rmse(&all) / whole,
            dark: rmse(&dark) / mean(&dark),
            border: rmse(&border) / whole,
            bias: average(all.iter().map(|(_, x)| grey(*x))) / whole - 1.0,
            median: percentile(relative.clone(), 0.5),
            p95: percentile(relative, 0.95),
            missing,
        }
    }
}

impl fmt::Display for Metrics {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Metrics { rrmse, dark, border, bias, median, p95, missing } = self;
        write!(f, "rrmse {rrmse:.4} dark {dark:.4} border {border:.4} bias {bias:+.4} ")?;
        write!(f, "median {median:.4} p95 {p95:.4} missing {missing}")
    }
}

/// Root mean square error, the truth's own variance taken off.
fn rmse(of: &[(&TruthTexel, DVec3)]) -> f64 {
    let squares = average(of.iter().map(|(t, x)| (*x - t.irradiance).length_squared() / 3.0));
    let known = average(of.iter().map(|(t, _)| t.error.length_squared() / 3.0));
    (squares - known).max(0.0).sqrt()
}

fn average(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

/// With linear interpolation between the values beside it.
fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = share * (values.len() as f64 - 1.0);
    let (low, high) = (values[at.floor() as usize], values[at.ceil() as usize]);
    low + (high - low) * at.fract()
}

const EMPTY: u32 = u32::MAX;

/// Global triangle whose TEXCOORD_1 covers the centre of each cell of a map of `side` x `side` cells.
fn rasterized(scene: &Scene, side: usize) -> Vec<u32> {
    let mut cells = vec![EMPTY; side * side];
    let mut triangle = 0;
    for instance in &scene.instances {
        let mesh = instance.mesh as usize;
        for t in 0..scene.meshes[mesh].triangles.len() {
            if let Some(uv) = reference_uv(scene, mesh, t) {
                let [p, q, r] = uv.map(|v| v * side as f64 - 0.5);
                let from = (p.min(q).min(r) - 1e-6).ceil().max(DVec2::ZERO);
                let to = (p.max(q).max(r) + 1e-6).floor().min(DVec2::splat(side as f64 - 1.0));
                let covered = |cell: &usize| barycentrics(uv, center(*cell, side)).is_some();
                let rows = from.y as usize..(to.y + 1.0).max(0.0) as usize;
                let columns = from.x as usize..(to.x + 1.0).max(0.0) as usize;
                let inside = rows.flat_map(|y| columns.clone().map(move |x| y * side + x));
                inside.filter(covered).for_each(|cell| cells[cell] = triangle);
            }
            triangle += 1;
        }
    }
    cells
}

/// The author's lightmap coordinates of a triangle.
fn reference_uv(scene: &Scene, mesh: usize, t: usize) -> Option<[DVec2; 3]> {
    let mesh = &scene.meshes[mesh];
    let set = mesh.uvs.get(1).filter(|set| !set.is_empty())?;
    let has = mesh.primitives[mesh.primitive_of(t as u32)].has_uv(1);
    has.then(|| mesh.triangles[t].map(|v| set[v as usize].as_dvec2()))
}

fn center(cell: usize, side: usize) -> DVec2 {
    (DVec2::new((cell % side) as f64, (cell / side) as f64) + 0.5) / side as f64
}

/// Weights of the second and third corner; `None` outside.
fn barycentrics([p, q, r]: [DVec2; 3], at: DVec2) -> Option<DVec2> {
    let (a, b, d) = (q - p, r - p, at - p);
    let det = a.perp_dot(b);
    let w = DVec2::new(d.perp_dot(b), a.perp_dot(d)) / det;
    (det.abs() > 1e-30 && w.min_element() > -1e-6 && w.element_sum() < 1.0 + 1e-6).then_some(w)
}

fn bilinear(map: &Map, uv: DVec2) -> DVec3 {
    let size = map.size.as_dvec2();
    let p = uv * size - 0.5;
    let (i, f) = (p.floor(), p - p.floor());
    let read = |x: f64, y: f64| {
        let (x, y) = (x.clamp(0.0, size.x - 1.0) as usize, y.clamp(0.0, size.y - 1.0) as usize);
        map.irradiance[y * map.size.x as usize + x].as_dvec3()
    };
    let row = |y: f64| read(i.x, y).lerp(read(i.x + 1.0, y), f.x);
    row(i.y).lerp(row(i.y + 1.0), f.y)
}
