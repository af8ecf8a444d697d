//! Embree 4, loaded at run time. Only what the benchmark needs of its interface, after the headers of 4.4.
#![allow(unsafe_code)]

use super::{
    batch::{Caster, Hit, Ray},
    build::timed,
};
use glam::Vec3;
use libloading::Library;
use luxel::scene::World;
use std::{
    error::Error,
    ffi::{c_char, c_void},
    mem::ManuallyDrop,
    ptr::{null, null_mut},
    sync::atomic::{AtomicIsize, Ordering::Relaxed},
};

type Handle = *mut c_void;
type Monitor = extern "C" fn(*mut c_void, isize, bool) -> bool;

macro_rules! functions {
    ($($name:ident($($argument:ty),*) $(-> $result:ty)?;)*) => {
        #[allow(non_snake_case)]
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            /// Never unloaded: its threads outlive the device.
            _library: ManuallyDrop<Library>,
        }

        impl Functions {
            /// SAFETY: the library must be Embree 4.
            unsafe fn load(path: &str) -> Result<Self, libloading::Error> {
                unsafe {
                    let library = Library::new(path)?;
                    Ok(Functions { $($name: *library.get(stringify!($name))?,)* _library: ManuallyDrop::new(library) })
                }
            }
        }
    };
}

functions! {
    rtcNewDevice(*const c_char) -> Handle;
    rtcReleaseDevice(Handle);
    rtcGetDeviceProperty(Handle, i32) -> isize;
    rtcGetDeviceError(Handle) -> i32;
    rtcSetDeviceMemoryMonitorFunction(Handle, Monitor, *const c_void);
    rtcNewScene(Handle) -> Handle;
    rtcReleaseScene(Handle);
    rtcSetSceneFlags(Handle, i32);
    rtcSetSceneBuildQuality(Handle, i32);
    rtcCommitScene(Handle);
    rtcNewGeometry(Handle, i32) -> Handle;
    rtcReleaseGeometry(Handle);
    rtcSetSharedGeometryBuffer(Handle, i32, u32, i32, *const c_void, usize, usize, usize);
    rtcSetGeometryInstancedScene(Handle, Handle);
    rtcSetGeometryTransform(Handle, u32, i32, *const f32);
    rtcCommitGeometry(Handle);
    rtcAttachGeometryByID(Handle, Handle, u32);
    rtcIntersect1(Handle, *mut RtcRayHit, *mut c_void);
    rtcOccluded1(Handle, *mut RtcRay, *mut c_void);
}

/// RTCDeviceProperty: VERSION_MAJOR, VERSION_MINOR, VERSION_PATCH.
const VERSION: [i32; 3] = [1, 2, 3];
/// RTC_SCENE_FLAG_ROBUST.
const ROBUST: i32 = 4;
/// RTC_BUILD_QUALITY_MEDIUM.
const MEDIUM: i32 = 1;
/// RTC_GEOMETRY_TYPE_TRIANGLE and RTC_GEOMETRY_TYPE_INSTANCE.
const TRIANGLES: i32 = 0;
const INSTANCE: i32 = 121;
/// Type and format of a buffer: RTC_BUFFER_TYPE_INDEX of RTC_FORMAT_UINT3, RTC_BUFFER_TYPE_VERTEX of RTC_FORMAT_FLOAT3.
const INDICES: (i32, i32) = (0, 0x5003);
const VERTICES: (i32, i32) = (1, 0x9003);
/// RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR.
const MATRIX: i32 = 0x9234;
/// RTC_INVALID_GEOMETRY_ID.
const NONE: u32 = u32::MAX;

/// RTCRay.
#[repr(C, align(16))]
struct RtcRay {
    origin: [f32; 3],
    tnear: f32,
    direction: [f32; 3],
    time: f32,
    tfar: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

/// RTCRayHit; as large as it gets with instance arrays.
#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instance: u32,
    instance_primitive: u32,
}

const _: () = assert!(size_of::<RtcRay>() == 48 && size_of::<RtcRayHit>() == 96);

/// How a scene is handed to Embree.
#[derive(Clone, Copy, PartialEq)]
pub enum Flavour {
    /// All triangles placed, no scene flag.
    Plain,
    /// All triangles placed, watertight.
    Robust,
    /// One scene a mesh, placed by instances, watertight.
    Instances,
}

impl Flavour {
    /// Every one.
    pub const ALL: [Flavour; 3] = [Flavour::Plain, Flavour::Robust, Flavour::Instances];

    /// For the reader.
    pub fn name(self) -> &'static str {
        match self {
            Flavour::Plain => "Embree",
            Flavour::Robust => "Embree robust",
            Flavour::Instances => "Embree instances",
        }
    }
}

/// The library and a device that uses all cores.
pub struct Embree {
    functions: Functions,
    device: Handle,
    /// Live bytes, as the device reports them.
    bytes: Box<AtomicIsize>,
}

/// A committed scene.
pub struct Scene<'e> {
    embree: &'e Embree,
    handle: Handle,
    /// First global triangle of each instance, where there are instances.
    starts: Vec<u32>,
    parts: Vec<Handle>,
    /// What Embree allocated for it and kept; not the buffers that are shared with it.
    pub bytes: usize,
    _buffers: Vec<Buffers>,
}

/// Shared with Embree, which reads 16 bytes at the last vertex.
struct Buffers {
    vertices: Vec<f32>,
    indices: Vec<[u32; 3]>,
}

// SAFETY: queries to a committed scene may come from any thread.
unsafe impl Sync for Scene<'_> {}

extern "C" fn count(sum: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: the pointer is to Embree::bytes, which outlives the device.
    unsafe { &*sum.cast::<AtomicIsize>() }.fetch_add(bytes, Relaxed);
    true
}

impl Embree {
    /// From the library named, or from where the loader finds it.
    pub fn load(path: Option<&str>) -> Result<Self, Box<dyn Error>> {
        // SAFETY: whoever names a library trusts it; the version is checked below.
        let functions = unsafe { Functions::load(path.unwrap_or("libembree4.so.4"))? };
        // SAFETY: no configuration is the default one.
        let device = unsafe { (functions.rtcNewDevice)(null()) };
        if device.is_null() {
            return Err("Embree makes no device on this machine".into());
        }
        let embree = Embree { functions, device, bytes: Box::default() };
        // SAFETY: the counter outlives the device.
        unsafe {
            (embree.functions.rtcSetDeviceMemoryMonitorFunction)(device, count, (&raw const *embree.bytes).cast())
        };
        match embree.version() {
            v if v.starts_with("4.") => Ok(embree),
            v => Err(format!("Embree {v} is not Embree 4").into()),
        }
    }

    /// Major.minor.patch.
    pub fn version(&self) -> String {
        // SAFETY: the device lives as long as this.
        VERSION.map(|p| unsafe { (self.functions.rtcGetDeviceProperty)(self.device, p) }.to_string()).join(".")
    }

    /// The scene, and the seconds of its commits.
    pub fn build(&self, world: &World, corners: &[[Vec3; 3]], flavour: Flavour) -> (Scene<'_>, f64) {
        let before = self.bytes.load(Relaxed);
        let buffers = if flavour == Flavour::Instances {
            world.scene.meshes.iter().map(|m| Buffers::new(&m.positions, m.triangles.clone())).collect()
        } else {
            let indices = (0..corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            vec![Buffers::new(corners.as_flattened(), indices)]
        };
        let flags = if flavour == Flavour::Plain { 0 } else { ROBUST };
        let (mut parts, seconds) = timed(|| buffers.iter().map(|b| self.part(b, flags)).collect::<Vec<_>>());
        let (mut starts, mut handle, mut more) = (Vec::new(), null_mut(), 0.0);
        if flavour == Flavour::Instances {
            (handle, more) = timed(|| self.top(world, &parts, flags));
            starts = (0..world.scene.instances.len()).map(|i| world.triangles_of(i).start).collect();
        } else if let Some(only) = parts.pop() {
            handle = only;
        }
        // SAFETY: the device lives as long as this.
        let error = unsafe { (self.functions.rtcGetDeviceError)(self.device) };
        assert_eq!(error, 0, "Embree builds the scene");
        let bytes = (self.bytes.load(Relaxed) - before) as usize;
        (Scene { embree: self, handle, starts, parts, bytes, _buffers: buffers }, seconds + more)
    }

    /// A committed scene of triangles. The buffers must outlive it.
    fn part(&self, b: &Buffers, flags: i32) -> Handle {
        let f = &self.functions;
        // SAFETY: handles are valid, and the buffers are as large as is said.
        unsafe {
            let scene = self.scene(flags);
            let g = (f.rtcNewGeometry)(self.device, TRIANGLES);
            let share = |(kind, format): (i32, i32), data: *const c_void, count: usize| {
                (f.rtcSetSharedGeometryBuffer)(g, kind, 0, format, data, 0, 12, count);
            };
            share(VERTICES, b.vertices.as_ptr().cast(), b.vertices.len() / 3);
            share(INDICES, b.indices.as_ptr().cast(), b.indices.len());
            self.attach(scene, g, 0);
            (f.rtcCommitScene)(scene);
            scene
        }
    }

    /// A committed scene of instances.
    fn top(&self, world: &World, parts: &[Handle], flags: i32) -> Handle {
        let f = &self.functions;
        // SAFETY: handles are valid; the matrix is copied.
        unsafe {
            let scene = self.scene(flags);
            for (i, instance) in world.scene.instances.iter().enumerate() {
                let g = (f.rtcNewGeometry)(self.device, INSTANCE);
                (f.rtcSetGeometryInstancedScene)(g, parts[instance.mesh as usize]);
                let matrix = instance.transform.to_cols_array().map(|x| x as f32);
                (f.rtcSetGeometryTransform)(g, 0, MATRIX, matrix.as_ptr());
                self.attach(scene, g, i as u32);
            }
            (f.rtcCommitScene)(scene);
            scene
        }
    }

    /// SAFETY: the device is valid.
    unsafe fn scene(&self, flags: i32) -> Handle {
        unsafe {
            let scene = (self.functions.rtcNewScene)(self.device);
            (self.functions.rtcSetSceneFlags)(scene, flags);
            (self.functions.rtcSetSceneBuildQuality)(scene, MEDIUM);
            scene
        }
    }

    /// Commits the geometry and leaves it to the scene. SAFETY: both handles are valid.
    unsafe fn attach(&self, scene: Handle, geometry: Handle, id: u32) {
        unsafe {
            (self.functions.rtcCommitGeometry)(geometry);
            (self.functions.rtcAttachGeometryByID)(scene, geometry, id);
            (self.functions.rtcReleaseGeometry)(geometry);
        }
    }
}

impl Buffers {
    fn new(positions: &[Vec3], indices: Vec<[u32; 3]>) -> Self {
        let mut vertices = Vec::with_capacity(3 * positions.len() + 1);
        vertices.extend(positions.iter().flat_map(|p| p.to_array()));
        Buffers { vertices, indices }
    }
}

fn ray(r: &Ray, tfar: f32) -> RtcRay {
    let (origin, direction) = (r.origin.to_array(), r.direction.to_array());
    RtcRay { origin, tnear: 0.0, direction, time: 0.0, tfar, mask: u32::MAX, id: 0, flags: 0 }
}

impl Caster for Scene<'_> {
    #[inline]
    fn closest(&self, r: &Ray) -> Hit {
        let mut hit = RtcRayHit {
            ray: ray(r, f32::INFINITY),
            normal: [0.0; 3],
            uv: [0.0; 2],
            primitive: NONE,
            geometry: NONE,
            instance: NONE,
            instance_primitive: NONE,
        };
        // SAFETY: the scene is committed, the structure aligned and as the headers have it; no arguments are the default.
        unsafe { (self.embree.functions.rtcIntersect1)(self.handle, &mut hit, null_mut()) };
        let start = if self.starts.is_empty() || hit.geometry == NONE { 0 } else { self.starts[hit.instance as usize] };
        (hit.geometry != NONE).then_some((hit.ray.tfar, start + hit.primitive))
    }

    #[inline]
    fn occluded(&self, r: &Ray) -> bool {
        let mut ray = ray(r, r.t);
        // SAFETY: as in `closest`.
        unsafe { (self.embree.functions.rtcOccluded1)(self.handle, &mut ray, null_mut()) };
        ray.tfar < 0.0
    }
}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        for scene in [self.handle].iter().chain(&self.parts) {
            // SAFETY: nothing else holds the handle.
            unsafe { (self.embree.functions.rtcReleaseScene)(*scene) };
        }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: scenes borrow this and are gone.
        unsafe { (self.functions.rtcReleaseDevice)(self.device) };
    }
}
