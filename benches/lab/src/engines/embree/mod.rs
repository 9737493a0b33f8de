//! Embree, opened when running: single-ray calls over its tree of HIGH quality, in its ordinary mode
//! and in its robust one, built and traced by one thread (`threads=1`).
//!
//! Rays are Embree's own struct beforehand; tracing copies each onto the stack, as the call overwrites
//! it. Making a device is not timed: that readies the library. Bytes are what its memory monitor
//! counts. The vertex and index buffers are shared, so they are not in it.

mod ffi;

use super::{Batch, Built, Engine, timed};
use ffi::{Api, Context3, Handle, Queries, RayHit};
use libloading::Library;
use std::{
    error::Error,
    ffi::{CStr, c_int, c_void},
    fmt,
    ptr::null_mut,
    sync::{
        LazyLock,
        atomic::{AtomicIsize, Ordering},
    },
};
use wide_bvh::geometry::{Hit, Ray, TriangleMesh};

/// The newest Embree of version 4 or 3 where the system looks for libraries. It is never closed: the
/// threads that its scheduler keeps would lose their code.
static API: LazyLock<Option<Api>> = LazyLock::new(|| {
    [4, 3].into_iter().find_map(|major| {
        let name = format!("embree{major}");
        let plain = libloading::library_filename(&name);
        // What a system without the development package has.
        let versioned = format!("lib{name}.so.{major}").into();
        [plain, versioned].into_iter().find_map(|file| {
            // SAFETY: a library of this name is Embree, whose initialisation asks nothing of the
            // program that loads it.
            let library = unsafe { Library::new(&file) }.ok()?;
            // SAFETY: the name tells the version.
            unsafe { Api::new(library, major) }.ok()
        })
    })
});

/// Which Embree races, or how to install one.
///
/// # Errors
/// Embree cannot make a device.
pub fn about() -> Result<String, EmbreeError> {
    match &*API {
        Some(api) => Ok(Device::new(api, c"threads=1")?.describe()),
        None => Ok(HOW_TO_INSTALL.to_owned()),
    }
}

const HOW_TO_INSTALL: &str = "Embree is not installed, so the race goes on without it: it takes \
    libembree4 or libembree3 (Debian and Ubuntu: apt-get install libembree-dev)";

/// Its modes: ordinary and robust, and where it would use AVX-512 the ordinary one on AVX2 as well. None without
/// Embree.
///
/// # Errors
/// Embree cannot make a device or a scene.
pub fn engines(mesh: &TriangleMesh<'_>) -> Result<Vec<Box<dyn Engine>>, EmbreeError> {
    let Some(api) = &*API else {
        return Ok(Vec::new());
    };
    let mut modes = vec![
        ("embree HIGH", c"threads=1", ffi::SCENE_FLAG_NONE),
        ("embree HIGH robust", c"threads=1", ffi::SCENE_FLAG_ROBUST),
    ];
    if Device::new(api, c"threads=1")?.has_avx512() {
        let config = c"threads=1,isa=avx2";
        modes.push(("embree HIGH avx2", config, ffi::SCENE_FLAG_NONE));
    }
    modes
        .into_iter()
        .map(|(name, config, flags)| {
            let device = Device::new(api, config)?;
            let (scene, time) = timed(|| Scene::new(device, mesh, flags));
            let scene = scene?;
            let built = Built {
                time,
                bytes: scene.device.bytes(),
            };
            Ok(Box::new(Embree { name, built, scene }) as Box<dyn Engine>)
        })
        .collect()
}

/// What Embree said went wrong: an `RTCError`.
#[derive(Debug)]
pub struct EmbreeError(c_int);

impl fmt::Display for EmbreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree failed with RTCError {}", self.0)
    }
}

impl Error for EmbreeError {}

/// One mode.
struct Embree {
    name: &'static str,
    built: Built,
    scene: Scene,
}

impl Engine for Embree {
    fn name(&self) -> &str {
        self.name
    }

    fn built(&self) -> Built {
        self.built
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let rays = rays
            .iter()
            .map(|ray| ffi::Ray {
                origin: ray.origin.to_array(),
                t_near: ray.t_min,
                direction: ray.direction.to_array(),
                time: 0.0,
                t_far: ray.t_max,
                mask: !0,
                id: 0,
                flags: 0,
            })
            .collect();
        Box::new(Rays {
            scene: &self.scene,
            rays,
        })
    }
}

struct Rays<'a> {
    scene: &'a Scene,
    rays: Vec<ffi::Ray>,
}

impl Rays<'_> {
    fn intersect_all(&self, hits: &mut [Option<Hit>], intersect1: impl Fn(&mut RayHit)) {
        for (&ray, hit) in self.rays.iter().zip(hits) {
            let mut found = RayHit {
                ray,
                hit: ffi::Hit::NONE,
            };
            intersect1(&mut found);
            *hit = (found.hit.geometry != ffi::INVALID_GEOMETRY_ID).then_some(Hit {
                t: found.ray.t_far,
                u: found.hit.u,
                v: found.hit.v,
                primitive: found.hit.primitive,
            });
        }
    }

    fn occlude_all(&self, occluded: &mut [bool], occluded1: impl Fn(&mut ffi::Ray)) {
        for (&(mut ray), occluded) in self.rays.iter().zip(occluded) {
            occluded1(&mut ray);
            *occluded = ray.t_far < 0.0;
        }
    }
}

impl Batch for Rays<'_> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        let scene = self.scene.handle;
        match self.scene.device.api.queries {
            Queries::V3 { intersect1, .. } => {
                let mut context = Context3::INCOHERENT;
                let context = &raw mut context;
                self.intersect_all(hits, |ray| {
                    // SAFETY: the scene is committed; the context and the ray are as they should
                    // be, and live until the call returns.
                    unsafe { intersect1(scene, context, ray) }
                });
            }
            Queries::V4 { intersect1, .. } => self.intersect_all(hits, |ray| {
                // SAFETY: the scene is committed, the ray lives until the call returns, and no
                // arguments are the default ones.
                unsafe { intersect1(scene, ray, null_mut()) }
            }),
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        let scene = self.scene.handle;
        match self.scene.device.api.queries {
            Queries::V3 { occluded1, .. } => {
                let mut context = Context3::INCOHERENT;
                let context = &raw mut context;
                self.occlude_all(occluded, |ray| {
                    // SAFETY: as in `closest`.
                    unsafe { occluded1(scene, context, ray) }
                });
            }
            Queries::V4 { occluded1, .. } => self.occlude_all(occluded, |ray| {
                // SAFETY: as in `closest`.
                unsafe { occluded1(scene, ray, null_mut()) }
            }),
        }
    }
}

/// A device of one thread, and the memory it has taken.
struct Device {
    handle: Handle,
    api: &'static Api,
    /// What the monitor has counted. Boxed, as Embree points to it.
    allocated: Box<AtomicIsize>,
}

impl Device {
    fn new(api: &'static Api, config: &CStr) -> Result<Self, EmbreeError> {
        // SAFETY: the configuration is a C string.
        let handle = unsafe { (api.new_device)(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: without a device, the error is the thread's.
            return Err(EmbreeError(unsafe { (api.get_device_error)(null_mut()) }));
        }
        let allocated = Box::new(AtomicIsize::new(0));
        let user = (&raw const *allocated).cast_mut().cast();
        // SAFETY: the device is there, and the counter outlives it.
        unsafe { (api.set_device_memory_monitor_function)(handle, count_memory, user) };
        Ok(Self {
            handle,
            api,
            allocated,
        })
    }

    fn bytes(&self) -> usize {
        usize::try_from(self.allocated.load(Ordering::Relaxed)).unwrap_or(0)
    }

    fn property(&self, property: c_int) -> isize {
        // SAFETY: the device is there.
        unsafe { (self.api.get_device_property)(self.handle, property) }
    }

    fn has_avx512(&self) -> bool {
        let [_, sixteen] = ffi::PROPERTY_NATIVE_RAY;
        self.property(sixteen) > 0
    }

    /// The version, and the widest vectors it uses here.
    fn describe(&self) -> String {
        let [major, minor, patch] = ffi::PROPERTY_VERSION.map(|part| self.property(part));
        let vectors = match ffi::PROPERTY_NATIVE_RAY.map(|width| self.property(width) > 0) {
            [_, true] => "AVX-512",
            [true, false] => "AVX or AVX2",
            [false, false] => "4-wide vectors",
        };
        format!("Embree {major}.{minor}.{patch} with {vectors}")
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: released once, and after its scene, which holds it.
        unsafe { (self.api.release_device)(self.handle) };
    }
}

/// A committed scene of one mesh, on a device of its own, so that its memory is counted alone.
struct Scene {
    handle: Handle,
    /// The buffers that Embree shares.
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
    device: Device,
}

impl Scene {
    fn new(device: Device, mesh: &TriangleMesh<'_>, flags: c_int) -> Result<Self, EmbreeError> {
        let api = device.api;
        let mut positions = mesh.positions().to_vec();
        // Embree reads vertices 16 bytes at a time, past the end of the last.
        positions.push([0.0; 3]);
        let scene = Self {
            // SAFETY: the device is there.
            handle: unsafe { (api.new_scene)(device.handle) },
            positions,
            indices: mesh.indices().to_vec(),
            device,
        };
        // SAFETY: all handles are of this device; Embree takes a null one, as of a scene that it
        // could not make, for an error. The buffers hold as many elements as is said, the vertices
        // with the padding that Embree asks for, and live as long as the scene.
        unsafe {
            (api.set_scene_build_quality)(scene.handle, ffi::BUILD_QUALITY_HIGH);
            (api.set_scene_flags)(scene.handle, flags);
            let geometry = (api.new_geometry)(scene.device.handle, ffi::GEOMETRY_TYPE_TRIANGLE);
            let share = |buffer, format, data: *const c_void, items| {
                let stride = 3 * size_of::<f32>();
                (api.set_shared_geometry_buffer)(
                    geometry, buffer, 0, format, data, 0, stride, items,
                );
            };
            share(
                ffi::BUFFER_TYPE_VERTEX,
                ffi::FORMAT_FLOAT3,
                scene.positions.as_ptr().cast(),
                mesh.positions().len(),
            );
            share(
                ffi::BUFFER_TYPE_INDEX,
                ffi::FORMAT_UINT3,
                scene.indices.as_ptr().cast(),
                mesh.len(),
            );
            (api.commit_geometry)(geometry);
            (api.attach_geometry)(scene.handle, geometry);
            (api.release_geometry)(geometry);
            (api.commit_scene)(scene.handle);
            match (api.get_device_error)(scene.device.handle) {
                ffi::ERROR_NONE => Ok(scene),
                error => Err(EmbreeError(error)),
            }
        }
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: released once, before the buffers and the device go.
            unsafe { (self.device.api.release_scene)(self.handle) };
        }
    }
}

/// Adds up what Embree allocates (positive) and frees (negative).
///
/// # Safety
/// `user` points to an [`AtomicIsize`].
unsafe extern "C" fn count_memory(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the caller promises it.
    let allocated = unsafe { &*user.cast_const().cast::<AtomicIsize>() };
    allocated.fetch_add(bytes, Ordering::Relaxed);
    true
}
