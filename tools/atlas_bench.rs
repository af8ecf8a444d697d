//! Compares unwrappers on glTF files: seconds, charts, small charts, page used, stretch.
//!
//! `cargo run --release --example atlas_bench -- [--resolution N | --texels-per-meter T] [--keep] FILE...`
//! (`--features xatlas` for the other unwrapper).

use glam::DVec2;
use luxel::{
    atlas::{self, Atlas, Density, NO_CHART, Options, Unwrap},
    gltf::{ReadOptions, read},
    progress::Silent,
    scene::Scene,
};
use std::{path::Path, time::Instant};

fn main() {
    let mut density = Density::Resolution(1024);
    let mut unwrappers = vec![("uvunwrap", Unwrap::Uvunwrap)];
    if cfg!(feature = "xatlas") {
        unwrappers.push(("xatlas", Unwrap::Xatlas));
    }
    let mut args = std::env::args().skip(1);
    println!(
        "| scene | unwrapper | seconds | charts | below 6 texels | pages | page used | area stretch p95 | lost area |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    while let Some(arg) = args.next() {
        let mut number = || args.next().and_then(|n| n.parse::<f64>().ok()).expect("a number follows");
        match arg.as_str() {
            "--resolution" => density = Density::Resolution(number() as u32),
            "--texels-per-meter" => density = Density::TexelsPerMeter(number()),
            "--keep" => unwrappers = vec![("kept", Unwrap::Keep)],
            file => {
                let scene = match read(Path::new(file), &ReadOptions::default()) {
                    Ok(input) => input.scene,
                    Err(e) => {
                        eprintln!("{e}");
                        continue;
                    }
                };
                for &(name, unwrap) in &unwrappers {
                    row(file, name, &scene, &Options { unwrap, density, ..Options::default() });
                }
            }
        }
    }
}

fn row(file: &str, name: &str, scene: &Scene, options: &Options) {
    let mut warnings = Vec::new();
    let start = Instant::now();
    let result = atlas::unwrap(scene, options, Path::new(file), &Silent, &mut warnings);
    let seconds = start.elapsed().as_secs_f64();
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    let atlas = match result {
        Ok(atlas) => atlas,
        Err(e) => return println!("| {stem} | {name} | {seconds:.2} | {e} |"),
    };
    let m = Measured::of(&atlas, scene);
    println!(
        "| {stem} | {name} | {seconds:.2} | {} | {} | {} | {:.2} | {:.2} | {:.1e} |",
        m.charts, m.small, m.pages, m.used, m.stretch, m.lost
    );
    warnings.iter().take(5).for_each(|w| eprintln!("{stem}: {w}"));
    if let Err(e) = atlas.validate(scene) {
        eprintln!("{stem}: INVALID: {e}");
    }
}

#[derive(Default)]
struct Measured {
    charts: u32,
    /// Charts of less than six texels.
    small: usize,
    pages: String,
    /// Share of the visible pages under charts.
    used: f64,
    /// 95th percentile, by area, of a triangle's density squared over the median (either way).
    stretch: f64,
    /// Share of the area without chart.
    lost: f64,
}

impl Measured {
    fn of(atlas: &Atlas, scene: &Scene) -> Measured {
        let mut m = Measured { charts: atlas.layouts.iter().map(|l| l.chart_count).sum(), ..Measured::default() };
        let (mut densities, mut area, mut lost, mut texels) = (Vec::new(), 0.0, 0.0, 0.0);
        for (p, instance) in atlas.placements.iter().zip(&scene.instances) {
            let Some(p) = p else { continue };
            let page = atlas.pages[p.page as usize];
            let (mesh, layout) = (&scene.meshes[instance.mesh as usize], &atlas.layouts[instance.mesh as usize]);
            let mut charts = vec![0.0; layout.chart_count as usize];
            for (t, (own, &chart)) in mesh.triangles.iter().zip(layout.triangles.iter().zip(&layout.charts)) {
                let [a, b, c] = t.map(|v| instance.transform.transform_point3(mesh.positions[v as usize].as_dvec3()));
                let world = (b - a).cross(c - a).length() * 0.5;
                area += world;
                if chart == NO_CHART {
                    lost += world;
                    continue;
                }
                let [a, b, c] =
                    own.map(|v| layout.uv[v as usize].as_dvec2() * p.scale.as_dvec2() * page.size.as_dvec2());
                let flat = DVec2::perp_dot(b - a, c - a).abs() * 0.5;
                charts[chart as usize] += flat;
                densities.push((flat / world.max(1e-30), world));
            }
            m.small += charts.iter().filter(|&&c| c < 6.0).count();
            texels += if page.hidden { 0.0 } else { charts.iter().sum() };
        }
        let visible: Vec<_> = atlas.pages.iter().filter(|p| !p.hidden).collect();
        let all: f64 = visible.iter().map(|p| p.size.as_dvec2().element_product()).sum();
        m.pages = match visible.first() {
            Some(p) => format!("{} of {} x {}", visible.len(), p.size.x, p.size.y),
            None => "0".into(),
        };
        m.used = texels / all;
        m.lost = lost / area;
        densities.sort_by(|a, b| a.0.total_cmp(&b.0));
        let median = percentile(&densities, 0.5);
        let mut off: Vec<_> = densities.iter().map(|(d, a)| ((d / median).max(median / d), *a)).collect();
        off.sort_by(|a, b| a.0.total_cmp(&b.0));
        m.stretch = percentile(&off, 0.95);
        m
    }
}

/// The value below which `share` of the weight lies.
fn percentile(sorted: &[(f64, f64)], share: f64) -> f64 {
    let mut left = share * sorted.iter().map(|v| v.1).sum::<f64>();
    let at = sorted.iter().find(|v| {
        left -= v.1;
        left <= 0.0
    });
    at.or(sorted.last()).map_or(1.0, |v| v.0)
}
