//! [`Report`]: what a bake says about itself. Its JSON is the program's `--report`; charts are drawn from it.

use serde::Serialize;

/// Version of the report's schema; grows when a field changes its meaning.
pub const SCHEMA: u32 = 1;

/// Everything measured in one bake. Seconds are wall time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Program and version.
    pub generator: String,
    /// What the scene holds.
    pub scene: SceneCounts,
    /// Lit nodes.
    pub nodes: Vec<NodeReport>,
    /// Lightmap pages.
    pub pages: Vec<PageReport>,
    /// Seconds by room, in the order in which they ran.
    pub seconds: Vec<(&'static str, f64)>,
    /// Texels that are covered by a surface.
    pub texels: usize,
    /// Patches: texels, and the backs of double-sided texels that rays met.
    pub patches: usize,
    /// Patches at which a row is measured.
    pub receivers: usize,
    /// Rays a row by which they were chosen, where they need not be all texels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive_rays: Option<u32>,
    /// How rows were measured.
    pub form_factors: FormFactorReport,
    /// Rays that measured rows, and their share of trouble.
    pub rays: RayReport,
    /// Stored matrix entries.
    pub matrix_entries: u64,
    /// Bytes of the stored matrix.
    pub matrix_bytes: u64,
    /// Where the light went.
    pub energy: EnergyReport,
    /// How the solver came to its answer.
    pub solver: SolverReport,
    /// Reflectance that was limited.
    pub reflectance: ReflectanceReport,
    /// Texels whose front lies inside other geometry.
    pub buried_texels: usize,
    /// Texels that show their back, because their front is buried and the back is lit.
    pub turned_texels: usize,
    /// Relative jump of irradiance across chart seams, 95th percentile.
    pub seam_jump_p95: Option<f64>,
    /// The error that was to be reached, and how that went.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetReport>,
    /// Under which light, where it was chosen by options.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<LightReport>,
    /// Peak resident memory of the process, in MB.
    pub peak_memory_mb: u64,
    /// Everything the user should know, one sentence each.
    pub warnings: Vec<String>,
    /// What was done on the way and is as it should be, one sentence each.
    pub notes: Vec<String>,
}

/// A bake to a target. Errors are root mean squares over the mean.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TargetReport {
    /// The error to be reached; none if only time was to be used.
    pub error: Option<f64>,
    /// True if the audit said so.
    pub reached: bool,
    /// What was tried, in order; the last is what the maps hold.
    pub looks: Vec<LookReport>,
}

/// What an audit said of one effort, by points that were drawn for it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LookReport {
    /// Rays a texel.
    pub rays: u32,
    /// Shadow rays a source, where shadows are mixed.
    pub shadow_rays: u32,
    /// The error and its confidence interval; none if too few points could be seen.
    pub error: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Confidence of this look.
    pub level: f64,
    /// Points.
    pub points: usize,
    /// Wall time of the audit.
    pub seconds: f64,
}

/// The options by which the light was chosen, as they are typed. They go into the lit file, for its audit.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LightReport {
    /// `--sky`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sky: Option<String>,
    /// `--sun`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun: Option<String>,
    /// `--light-scale`.
    #[serde(rename = "lightScale")]
    pub light_scale: f32,
    /// `--max-reflectance`.
    #[serde(rename = "maxReflectance")]
    pub max_reflectance: f32,
    /// `--exclude`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<String>,
}

/// Sizes of the scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SceneCounts {
    /// Meshes.
    pub meshes: usize,
    /// Placed meshes.
    pub instances: usize,
    /// Triangles in meshes.
    pub triangles: usize,
    /// Triangles after instancing.
    pub instanced_triangles: usize,
    /// Triangles without area.
    pub degenerate_triangles: usize,
    /// Materials.
    pub materials: usize,
    /// Punctual lights.
    pub lights: usize,
    /// Triangles with area whose material emits, after instancing.
    pub emitting_triangles: usize,
}

/// One lit node.
#[derive(Clone, Debug, Default, Serialize)]
pub struct NodeReport {
    /// Node index in the file.
    pub node: u32,
    /// Its name.
    pub name: String,
    /// Page, or none for a node without a map of its own.
    pub page: Option<u32>,
    /// Texels per metre, mean over its surface.
    pub texels_per_meter: f64,
    /// Charts.
    pub charts: u32,
    /// Charts narrower than two texels.
    pub small_charts: u32,
}

/// One lightmap page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PageReport {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Covered texels.
    pub texels: usize,
    /// Covered share of the page.
    pub utilization: f64,
}

/// The estimator of rows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FormFactorReport {
    /// Its name, with its parameters.
    pub name: String,
    /// Rows that summed to something else than they may, and were scaled.
    pub rescaled: u64,
    /// Furthest that such a sum was from 1.
    pub excess: f64,
    /// Root mean square of A_i F_ij - A_j F_ji over that of A_i F_ij; none for rays, of which noise alone sets it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reciprocity: Option<f64>,
}

/// Rays of the form-factor rows, and those that texels were given that share with too few.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RayReport {
    /// Rays traced; those of texels that share with too few by the last attempt at a target.
    pub traced: u64,
    /// Rays of rows per second.
    pub per_second: f64,
    /// Rays that left the scene.
    pub escaped: u64,
    /// Rays that met the back of a single-sided surface, or a surface without texels: unlit, or too thin for them.
    pub blocked: u64,
    /// Rays that hit a surface, but no covered texel.
    pub lost: u64,
    /// Shadow rays of direct light.
    pub shadow: u64,
}

/// Balance of power, sums over rgb, in watts.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EnergyReport {
    /// Light put in: emitted by surfaces, received directly from lights, from the sky.
    pub emitted: f64,
    /// Light absorbed by surfaces, buried ones left out.
    pub absorbed: f64,
    /// Light that left the scene or ended on backs.
    pub escaped: f64,
    /// (absorbed + escaped) / emitted - 1; light that a limit on bounces dropped is missing here.
    pub imbalance: f64,
}

/// The solver's way to its answer.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SolverReport {
    /// Name of the solver; `neumann` for a truncated sum.
    pub name: &'static str,
    /// Bounces after which light was dropped; none: all bounces.
    pub bounces: Option<u32>,
    /// Who went on where the solver could do no more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fallback: Option<&'static str>,
    /// Iterations: looks at the residual, one after each step of the solver.
    pub iterations: usize,
    /// Matrix entries touched, those of looks, of the bound and of preparations included.
    pub entries: u64,
    /// Wall time.
    pub seconds: f64,
    /// Largest true residual (irradiance) at each look; none for a truncated sum.
    pub residuals: Vec<f64>,
    /// Matrix entries touched until each look.
    pub touched: Vec<u64>,
    /// Bound on the largest truncation error (irradiance), of groups of patches where rays are shared; none for a truncated sum.
    pub bound: Option<f64>,
    /// The same, relative to the mean of the darker half.
    pub relative_bound: Option<f64>,
    /// True if the bound came below the tolerance; a truncated sum has no bound.
    pub converged: bool,
}

/// Reflectances that were limited.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ReflectanceReport {
    /// Largest reflectance used.
    pub max: f64,
    /// Area (m^2) whose reflectance was capped.
    pub capped_area: f64,
    /// Area (m^2) that is metallic (more than half).
    pub metallic_area: f64,
    /// All area (m^2).
    pub area: f64,
}
