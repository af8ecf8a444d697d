//! xatlas (of 2019, in the crate xatlas-rs): cuts shapes into charts. Packing is left to the common packer.
//!
//! The crate's own bindings carry names that only link with Microsoft's linker, so the functions of the C++ library it
//! builds are declared here, by their Itanium names. What xatlas cannot take is kept from it: degenerate triangles and
//! ones below its area threshold. They, and those whose charts failed, are cut by the packer's own unwrapper.
#![allow(unsafe_code)]

use super::{
    shape::{Cut, Shape},
    uvunwrap,
};
use crate::{
    error::{Error, Result},
    progress::{self, Observer},
};
use glam::Vec3;
use std::{
    ffi::{c_char, c_int, c_void},
    path::Path,
    ptr,
    sync::Mutex,
};
use xatlas_rs as _;

#[cfg(target_env = "msvc")]
compile_error!("the feature `xatlas` needs a compiler with the Itanium C++ ABI; build without it");

/// Edge of the box that shapes are scaled to: the area threshold is absolute.
const BOX: f32 = 1000.0;
/// Least area of a triangle in that box; xatlas ignores up to 1.2e-7.
const LEAST_AREA: f32 = 1e-6;
/// Least height of a triangle in that box: more than the packer asks for.
const LEAST_HEIGHT: f32 = 1e-5 * BOX;
/// A shape's square root of area in texels, for its rounding of charts to whole texels to be small.
const TEXELS: f32 = 1024.0;

/// xatlas keeps global state.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Cuts each shape into charts.
pub(super) fn cut(shapes: &[Shape], file: &Path, observer: &dyn Observer) -> Result<Vec<Cut>> {
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(|e| e.into_inner());
    shapes
        .iter()
        .map(|shape| {
            progress::check(observer)?;
            cut_one(shape, file, observer)
        })
        .collect()
}

fn cut_one(shape: &Shape, file: &Path, observer: &dyn Observer) -> Result<Cut> {
    let positions: Vec<[f32; 3]> = shape.positions.iter().map(|p| p.map(|x| x * BOX)).collect();
    let size = |t: &[u32]| {
        let [a, b, c] = [t[0], t[1], t[2]].map(|v| Vec3::from(positions[v as usize]));
        let area = (b - a).cross(c - a).length() * 0.5;
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        (area, 2.0 * area / longest)
    };
    let triangles: Vec<&[u32]> = shape.indices.chunks_exact(3).collect();
    let sound = |&t: &usize| {
        let (area, height) = size(triangles[t]);
        !shape.ignored[t] && area > LEAST_AREA && height > LEAST_HEIGHT && area.is_finite()
    };
    let good: Vec<usize> = (0..triangles.len()).filter(sound).collect();
    if good.is_empty() {
        return Ok(uvunwrap::cut(std::slice::from_ref(shape), file, observer)?.pop().unwrap_or_default());
    }
    let indices: Vec<u32> = good.iter().flat_map(|&t| triangles[t].iter().copied()).collect();
    let total: f32 = good.iter().map(|&t| size(triangles[t]).0).sum();
    let made = Handle::new(file)?.charts(&positions, &indices, total)?;

    // The triangles that were kept back have vertices of their own, all at one uv.
    let mut cut = Cut { charts: made.charts.max(1), ..Cut::default() };
    for (xref, uv) in made.vertices {
        cut.positions.push(shape.positions[xref as usize]);
        cut.uvs.push(uv);
    }
    let first = cut.positions.len() as u32;
    cut.positions.extend(&shape.positions);
    cut.uvs.resize(cut.positions.len(), [0.0; 2]);
    cut.indices = shape.indices.iter().map(|v| v + first).collect();
    for (&t, made) in good.iter().zip(made.indices.chunks_exact(3)) {
        cut.indices[3 * t..3 * t + 3].copy_from_slice(made);
    }
    Ok(cut)
}

/// Charts as xatlas made them.
struct Made {
    /// Original vertex and uv of each.
    vertices: Vec<(u32, [f32; 2])>,
    indices: Vec<u32>,
    charts: usize,
}

/// An atlas of xatlas, destroyed with this.
struct Handle<'a> {
    atlas: *mut Atlas,
    /// For messages.
    file: &'a Path,
}

impl Drop for Handle<'_> {
    fn drop(&mut self) {
        // SAFETY: made by Create, used nowhere else, destroyed once.
        unsafe { destroy(self.atlas) }
    }
}

impl<'a> Handle<'a> {
    fn new(file: &'a Path) -> Result<Self> {
        // SAFETY: no preconditions; without a print function xatlas is silent.
        let atlas = unsafe {
            set_print(None, false);
            create()
        };
        if atlas.is_null() { Err(failed(file)) } else { Ok(Handle { atlas, file }) }
    }

    fn charts(self, positions: &[[f32; 3]], indices: &[u32], area: f32) -> Result<Made> {
        let mesh = MeshDecl {
            vertex_count: positions.len() as u32,
            vertex_position_data: positions.as_ptr().cast(),
            vertex_position_stride: size_of::<[f32; 3]>() as u32,
            vertex_normal_data: ptr::null(),
            vertex_normal_stride: 0,
            vertex_uv_data: ptr::null(),
            vertex_uv_stride: 0,
            index_count: indices.len() as u32,
            index_data: indices.as_ptr().cast(),
            index_offset: 0,
            index_format: 1,
            face_ignore_data: ptr::null(),
        };
        let charts = ChartOptions {
            max_chart_area: 0.0,
            max_boundary_length: 0.0,
            proxy_fit_metric_weight: 2.0,
            roundness_metric_weight: 0.01,
            straightness_metric_weight: 6.0,
            normal_seam_metric_weight: 4.0,
            texture_seam_metric_weight: 0.5,
            max_threshold: 2.0,
            grow_face_count: 32,
            max_iterations: 1,
        };
        let pack = PackOptions {
            attempts: 1,
            texels_per_unit: TEXELS / area.sqrt().max(f32::MIN_POSITIVE),
            resolution: 0,
            max_chart_size: 1 << 15,
            block_align: false,
            conservative: false,
            padding: 0,
        };
        // SAFETY: the atlas is alive; AddMesh copies what `mesh` points to, whose counts are those of the slices, and
        // whose indices it checks. Structures have C++'s layout and are passed by value as the C ABI does; callbacks
        // may be null.
        unsafe {
            if add_mesh(self.atlas, &mesh) != 0 {
                return Err(failed(self.file));
            }
            compute_charts(self.atlas, charts, None, ptr::null_mut());
            parameterize_charts(self.atlas, None, None, ptr::null_mut());
            pack_charts(self.atlas, pack, None, ptr::null_mut());
        }
        // SAFETY: after PackCharts `meshes` holds one entry a mesh added, or none; it lives as long as the atlas.
        let mesh = unsafe {
            let atlas = &*self.atlas;
            if atlas.mesh_count != 1 || atlas.meshes.is_null() { None } else { Some(&*atlas.meshes) }
        };
        let Some(mesh) = mesh.filter(|m| m.index_count as usize == indices.len() && !m.index_array.is_null()) else {
            return Err(failed(self.file));
        };
        // SAFETY: the arrays have as many entries as their counts say, and are initialised by PackCharts.
        let (vertices, made) = unsafe {
            (
                std::slice::from_raw_parts(mesh.vertex_array, mesh.vertex_count as usize),
                std::slice::from_raw_parts(mesh.index_array, mesh.index_count as usize),
            )
        };
        let sound = |v: &Vertex| (v.xref as usize) < positions.len();
        if !vertices.iter().all(sound) || made.iter().any(|&i| i as usize >= vertices.len()) {
            return Err(failed(self.file));
        }
        let finite = |uv: [f32; 2]| if uv[0].is_finite() && uv[1].is_finite() { uv } else { [0.0; 2] };
        Ok(Made {
            vertices: vertices.iter().map(|v| (v.xref, finite(v.uv))).collect(),
            indices: made.to_vec(),
            charts: mesh.chart_count as usize,
        })
    }
}

fn failed(file: &Path) -> Error {
    Error::invalid(file, "geometry", "xatlas cannot unwrap it", "bake with --unwrap uvunwrap")
}

#[repr(C)]
struct Vertex {
    atlas_index: i32,
    uv: [f32; 2],
    xref: u32,
}

#[repr(C)]
struct Mesh {
    chart_array: *mut c_void,
    chart_count: u32,
    index_array: *const u32,
    index_count: u32,
    vertex_array: *const Vertex,
    vertex_count: u32,
}

#[repr(C)]
struct Atlas {
    width: u32,
    height: u32,
    atlas_count: u32,
    chart_count: u32,
    mesh_count: u32,
    meshes: *const Mesh,
    utilization: *const f32,
    texels_per_unit: f32,
}

#[repr(C)]
struct MeshDecl {
    vertex_count: u32,
    vertex_position_data: *const c_void,
    vertex_position_stride: u32,
    vertex_normal_data: *const c_void,
    vertex_normal_stride: u32,
    vertex_uv_data: *const c_void,
    vertex_uv_stride: u32,
    index_count: u32,
    index_data: *const c_void,
    index_offset: i32,
    index_format: c_int,
    face_ignore_data: *const bool,
}

#[repr(C)]
struct ChartOptions {
    max_chart_area: f32,
    max_boundary_length: f32,
    proxy_fit_metric_weight: f32,
    roundness_metric_weight: f32,
    straightness_metric_weight: f32,
    normal_seam_metric_weight: f32,
    texture_seam_metric_weight: f32,
    max_threshold: f32,
    grow_face_count: u32,
    max_iterations: u32,
}

#[repr(C)]
struct PackOptions {
    attempts: c_int,
    texels_per_unit: f32,
    resolution: u32,
    max_chart_size: u32,
    block_align: bool,
    conservative: bool,
    padding: u32,
}

type Progress = Option<unsafe extern "C" fn(c_int, c_int, *mut c_void)>;
type Parameterize = Option<unsafe extern "C" fn(*const f32, *mut f32, u32, *const u32, u32, bool)>;
type Print = Option<unsafe extern "C" fn(*const c_char, ...) -> c_int>;

unsafe extern "C" {
    #[link_name = "_ZN6xatlas6CreateEv"]
    fn create() -> *mut Atlas;
    #[link_name = "_ZN6xatlas7DestroyEPNS_5AtlasE"]
    fn destroy(atlas: *mut Atlas);
    #[link_name = "_ZN6xatlas7AddMeshEPNS_5AtlasERKNS_8MeshDeclE"]
    fn add_mesh(atlas: *mut Atlas, mesh: &MeshDecl) -> c_int;
    #[link_name = "_ZN6xatlas13ComputeChartsEPNS_5AtlasENS_12ChartOptionsEPFvNS_16ProgressCategory4EnumEiPvES5_"]
    fn compute_charts(atlas: *mut Atlas, options: ChartOptions, progress: Progress, data: *mut c_void);
    #[link_name = "_ZN6xatlas18ParameterizeChartsEPNS_5AtlasEPFvPKfPfjPKjjbEPFvNS_16ProgressCategory4EnumEiPvESB_"]
    fn parameterize_charts(atlas: *mut Atlas, function: Parameterize, progress: Progress, data: *mut c_void);
    #[link_name = "_ZN6xatlas10PackChartsEPNS_5AtlasENS_11PackOptionsEPFvNS_16ProgressCategory4EnumEiPvES5_"]
    fn pack_charts(atlas: *mut Atlas, options: PackOptions, progress: Progress, data: *mut c_void);
    #[link_name = "_ZN6xatlas8SetPrintEPFiPKczEb"]
    fn set_print(print: Print, verbose: bool);
}
