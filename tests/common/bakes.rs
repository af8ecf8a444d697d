//! [`Shot`]: a baked [`Stage`], read back chart by chart, with the noise that is in it.

use super::stage::{Chart, Stage};
use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use luxel::{
    atlas::{self, Atlas, Coverage, Density, NO_TEXEL, Unwrap},
    bake::{Baked, Options, bake},
    error::Result,
    lightmaps::Lightmaps,
    patches::Patches,
    progress::Silent,
    report::Report,
    scene::Scene,
    transport,
};

/// A finished bake of a stage's own charts.
pub struct Shot {
    pub baked: Parts,
    pub scene: Scene,
    corners: Vec<UVec2>,
    sizes: Vec<UVec2>,
}

/// What is left of a bake without its borrow of the scene.
pub struct Parts {
    pub atlas: Atlas,
    pub coverage: Coverage,
    pub patches: Patches,
    pub irradiance: Vec<Vec3>,
    pub lightmaps: Lightmaps,
    pub report: Report,
}

/// Bakes a scene.
pub fn parts(scene: &Scene, options: &Options) -> Parts {
    try_parts(scene, options).expect("the scene bakes")
}

/// The same, or why it is refused.
pub fn try_parts(scene: &Scene, options: &Options) -> Result<Parts> {
    let Baked { atlas, coverage, patches, irradiance, lightmaps, report, .. } = bake(scene, options, &Silent)?;
    Ok(Parts { atlas, coverage, patches, irradiance, lightmaps, report })
}

/// Options for tests, every texel by its own rays: what neighbours share is correlated, and how texels differ would not
/// tell their error. `rays` a row and a shadow, reflectance up to .9999.
pub fn options(rays: u32) -> Options {
    Options {
        transport: transport::Options { reuse: false, ..transport::Options::of(rays) },
        shadow_rays: rays,
        max_reflectance: 0.9999,
        ..Options::default()
    }
}

/// Bakes a stage on its own charts.
pub fn shoot(stage: Stage, rays: u32) -> Shot {
    shoot_with(stage, options(rays))
}

/// The same with other options; layout and resolution are the stage's.
pub fn shoot_with(stage: Stage, options: Options) -> Shot {
    try_shoot(stage, options).expect("the stage bakes")
}

/// The same, or why it is refused.
pub fn try_shoot(stage: Stage, options: Options) -> Result<Shot> {
    Shot::of(stage, options, try_parts)
}

/// Bakes a scene with the default unwrapper on one page of `edge` texels.
pub fn unwrapped(mut stage: Stage, edge: u32, rays: u32) -> Parts {
    stage.lay_out();
    let mut options = options(rays);
    options.atlas.density = Density::Resolution(edge);
    parts(&stage.scene, &options)
}

/// First channel of a colour; grey scenes have three equal ones.
pub fn grey(e: Vec3) -> f64 {
    f64::from(e.x)
}

impl Shot {
    /// A stage on its own charts, by whatever makes parts of a scene.
    pub fn of(
        mut stage: Stage,
        mut options: Options,
        make: impl Fn(&Scene, &Options) -> Result<Parts>,
    ) -> Result<Self> {
        let (edge, corners) = stage.lay_out();
        options.atlas = atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), page_size: 8192 };
        let Stage { scene, sizes, .. } = stage;
        let baked = make(&scene, &options)?;
        assert_eq!(baked.lightmaps.pages.len(), 1, "disjoint charts are one page's layout");
        assert_eq!(baked.atlas.pages[0].size, UVec2::splat(edge), "the page is exactly the resolution");
        Ok(Shot { baked, scene, corners, sizes })
    }

    /// Patches of a chart, row by row; `None` where nothing covers the texel.
    pub fn rows(&self, chart: Chart) -> Vec<Vec<Option<usize>>> {
        let (grid, width) = (&self.baked.coverage.grids[0], self.baked.atlas.pages[0].size.x);
        let (corner, size) = (self.corners[chart], self.sizes[chart]);
        let at = |x: u32, y: u32| grid[((corner.y + y) * width + corner.x + x) as usize];
        let row = |y: u32| (0..size.x).map(|x| Some(at(x, y)).filter(|t| *t != NO_TEXEL).map(|t| t as usize)).collect();
        (0..size.y).map(row).collect()
    }

    /// Covered patches of a chart.
    pub fn texels(&self, chart: Chart) -> Vec<usize> {
        self.rows(chart).into_iter().flatten().flatten().collect()
    }

    /// Irradiance of the chart's covered texels.
    pub fn values(&self, chart: Chart) -> Vec<Vec3> {
        self.texels(chart).iter().map(|i| self.baked.irradiance[*i]).collect()
    }

    /// Irradiance as the lightmap holds it (with its content option).
    pub fn mapped(&self, chart: Chart) -> Vec<Vec3> {
        let map = &self.baked.lightmaps.pages[0];
        let at = |i: &usize| self.baked.coverage.texels[*i].at;
        self.texels(chart).iter().map(at).map(|p| map.irradiance[(p.y * map.size.x + p.x) as usize]).collect()
    }

    /// Patches of a chart with their place in it: the middle in [0, 1]^2 of the chart, exact for texels of any shape.
    pub fn placed(&self, chart: Chart) -> Vec<(usize, DVec2)> {
        let rows = self.rows(chart);
        let size = self.sizes[chart].as_dvec2();
        let at = |x: usize, y: usize| (DVec2::new(x as f64, y as f64) + 0.5) / size;
        let row = |(y, row): (usize, &Vec<Option<usize>>)| {
            row.iter().enumerate().filter_map(|(x, i)| Some(((*i)?, at(x, y)))).collect::<Vec<_>>()
        };
        rows.iter().enumerate().flat_map(row).collect()
    }

    /// Page uv of the chart's corner and of the corner opposite.
    pub fn bounds(&self, chart: Chart) -> [Vec2; 2] {
        let edge = self.baked.atlas.pages[0].size.as_vec2();
        [self.corners[chart], self.corners[chart] + self.sizes[chart]].map(|p| p.as_vec2() / edge)
    }

    /// Bilinear lookup in the page, as an engine does it.
    pub fn lookup(&self, uv: Vec2) -> Vec3 {
        let map = &self.baked.lightmaps.pages[0];
        let p = uv * map.size.as_vec2() - 0.5;
        let (i, f) = (p.floor(), p - p.floor());
        let at = |x: f32, y: f32| {
            let [x, y] = [x, y].map(|c| (c.max(0.0) as u32).min(map.size.x - 1));
            map.irradiance[(y * map.size.x + x) as usize]
        };
        let row = |y: f32| at(i.x, y).lerp(at(i.x + 1.0, y), f.x);
        row(i.y).lerp(row(i.y + 1.0), f.y)
    }

    /// Lookups at a lattice of places over the whole chart, its border included.
    pub fn lookups(&self, chart: Chart) -> Vec<Vec3> {
        let [a, b] = self.bounds(chart);
        let n = (self.sizes[chart] * 3).as_vec2();
        let places = (0..=n.y as u32).flat_map(|j| (0..=n.x as u32).map(move |i| UVec2::new(i, j).as_vec2()));
        places.map(|p| self.lookup(a + (b - a) * p / n)).collect()
    }

    /// Area in m^2 of charts, and their area mean of irradiance: a texel's E is that of its open part, the rest is dark.
    pub fn mean(&self, charts: &[Chart]) -> (f64, DVec3) {
        let (mut area, mut sum) = (0.0, DVec3::ZERO);
        for i in charts.iter().flat_map(|c| self.texels(*c)) {
            let a = f64::from(self.baked.patches.area[i]);
            area += a;
            sum += self.baked.irradiance[i].as_dvec3() * a * f64::from(self.baked.patches.validity[i]);
        }
        (area, sum / area)
    }

    /// Standard error of one texel of a chart, per channel, from second differences of neighbours:
    /// Var(a - 2b + c) = 6 sigma^2. Curvature of the light adds to it: never too small for independent texels.
    pub fn noise(&self, chart: Chart) -> DVec3 {
        let rows = self.rows(chart);
        let e = |x: usize, y: usize| rows[y][x].map(|i| self.baked.irradiance[i].as_dvec3());
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for y in 0..rows.len() {
            for x in 0..rows[y].len() {
                let across = || Some([e(x.checked_sub(1)?, y)?, (x + 1 < rows[y].len()).then(|| e(x + 1, y))??]);
                let down = || Some([e(x, y.checked_sub(1)?)?, (y + 1 < rows.len()).then(|| e(x, y + 1))??]);
                for [a, c] in [across(), down()].into_iter().flatten() {
                    let Some(b) = e(x, y) else { continue };
                    let d = a - 2.0 * b + c;
                    sum += d * d;
                    n += 6.0;
                }
            }
        }
        assert!(n > 0.0, "a chart needs three texels in a row to show its noise");
        (sum / n).map(libm::sqrt)
    }

    /// Standard error of the mean of one chart, independent texels.
    pub fn error_of_mean(&self, chart: Chart) -> f64 {
        self.noise(chart).x / libm::sqrt(self.texels(chart).len() as f64)
    }

    /// Sum over all texels of (1 - rho) A E and of A M, first channel.
    pub fn power(&self) -> [f64; 2] {
        let p = &self.baked.patches;
        let mut sums = [0.0; 2];
        for i in 0..self.baked.coverage.texels.len() {
            let area = f64::from(p.area[i]);
            sums[0] += (1.0 - grey(p.reflectance[i])) * area * grey(self.baked.irradiance[i]);
            sums[1] += area * grey(p.exitance[i]);
        }
        sums
    }
}

/// Mean and standard deviation.
pub fn spread(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, libm::sqrt(values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n))
}

/// Largest |value / expected - 1|; NaN counts as infinite.
pub fn worst(values: impl IntoIterator<Item = f64>, expected: f64) -> f64 {
    let off = values.into_iter().map(|v| (v / expected - 1.0).abs());
    off.fold(0.0, |a, b| if b.is_nan() { f64::INFINITY } else { a.max(b) })
}

/// Root of the mean square, and largest, of relative errors in units of their sigma: within 3 and 6.
pub fn within_sigma(errors: &[f64]) -> std::result::Result<(f64, f64), String> {
    let rms = libm::sqrt(errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64);
    let largest = errors.iter().fold(0.0, |a: f64, e| a.max(e.abs()));
    if rms <= 3.0 && largest <= 6.0 {
        Ok((rms, largest))
    } else {
        Err(format!("RMS {rms:.2} sigma, largest {largest:.2}"))
    }
}
