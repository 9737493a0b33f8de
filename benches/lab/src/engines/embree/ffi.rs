//! The little of Embree's C interface that is needed, of versions 3 and 4: types, constants and the
//! functions, looked up when running. Nothing here is safe to use wrongly; `super` uses it rightly.

use libloading::Library;
use std::{
    ffi::{c_char, c_int, c_uint, c_void},
    ptr::null,
};
use wide_bvh::geometry;

/// An opaque handle. Each kind of handle is a pointer of its own in C.
pub type Handle = *mut c_void;

/// `RTC_BUILD_QUALITY_LOW`: a tree in Morton order.
pub const BUILD_QUALITY_LOW: c_int = 0;
/// `RTC_BUILD_QUALITY_MEDIUM`: a binned SAH tree.
pub const BUILD_QUALITY_MEDIUM: c_int = 1;
/// `RTC_BUILD_QUALITY_HIGH`: a binned SAH tree with spatial splits.
pub const BUILD_QUALITY_HIGH: c_int = 2;
/// `RTC_SCENE_FLAG_NONE`.
pub const SCENE_FLAG_NONE: c_int = 0;
/// `RTC_SCENE_FLAG_COMPACT`.
pub const SCENE_FLAG_COMPACT: c_int = 1 << 1;
/// `RTC_SCENE_FLAG_ROBUST`.
pub const SCENE_FLAG_ROBUST: c_int = 1 << 2;
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
/// `RTC_BUFFER_TYPE_INDEX`.
pub const BUFFER_TYPE_INDEX: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`.
pub const BUFFER_TYPE_VERTEX: c_int = 1;
/// `RTC_FORMAT_UINT3`.
pub const FORMAT_UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`.
pub const FORMAT_FLOAT3: c_int = 0x9003;
/// `RTC_INVALID_GEOMETRY_ID`.
pub const INVALID_GEOMETRY_ID: c_uint = c_uint::MAX;
/// `RTC_ERROR_NONE`.
pub const ERROR_NONE: c_int = 0;
/// `RTC_DEVICE_PROPERTY_VERSION_MAJOR`, then minor and patch.
pub const PROPERTY_VERSION: [c_int; 3] = [1, 2, 3];
/// `RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED`, then 16.
pub const PROPERTY_NATIVE_RAY: [c_int; 2] = [33, 34];
/// `RTC_DEVICE_PROPERTY_RAY_STREAM_SUPPORTED`.
pub const PROPERTY_RAY_STREAM: c_int = 35;

/// `RTCRay`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct Ray {
    pub origin: [f32; 3],
    pub t_near: f32,
    pub direction: [f32; 3],
    pub time: f32,
    /// The hit's distance after `rtcIntersect1`; negative after `rtcOccluded1` found something.
    pub t_far: f32,
    pub mask: c_uint,
    pub id: c_uint,
    pub flags: c_uint,
}

impl Ray {
    pub fn new(ray: &geometry::Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_near: ray.t_min,
            direction: ray.direction.to_array(),
            time: 0.0,
            t_far: ray.t_max,
            mask: !0,
            id: 0,
            flags: 0,
        }
    }

    /// Whether `rtcOccluded1` found something.
    pub fn is_occluded(&self) -> bool {
        self.t_far < 0.0
    }
}

/// `RTCHit` of one level of instances. Later versions of Embree 4 have one more number at the end,
/// which falls into the padding.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct Hit {
    pub normal: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub primitive: c_uint,
    pub geometry: c_uint,
    pub instance: c_uint,
    pub instance_primitive: c_uint,
}

impl Hit {
    /// What a ray has before it is traced.
    pub const NONE: Self = Self {
        normal: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: INVALID_GEOMETRY_ID,
        geometry: INVALID_GEOMETRY_ID,
        instance: INVALID_GEOMETRY_ID,
        instance_primitive: INVALID_GEOMETRY_ID,
    };
}

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct RayHit {
    pub ray: Ray,
    pub hit: Hit,
}

impl RayHit {
    /// What `rtcIntersect1` found.
    pub fn found(&self) -> Option<geometry::Hit> {
        (self.hit.geometry != INVALID_GEOMETRY_ID).then_some(geometry::Hit {
            t: self.ray.t_far,
            u: self.hit.u,
            v: self.hit.v,
            primitive: self.hit.primitive,
        })
    }
}

/// `RTCRay8` or `RTCRay16`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct RayPacket<const N: usize> {
    pub origin: [[f32; N]; 3],
    pub t_near: [f32; N],
    pub direction: [[f32; N]; 3],
    pub time: [f32; N],
    /// As a single ray's.
    pub t_far: [f32; N],
    pub mask: [c_uint; N],
    pub id: [c_uint; N],
    pub flags: [c_uint; N],
}

/// `RTCRayHit8` or `RTCRayHit16`. The last part is not there in all versions.
#[repr(C, align(64))]
pub struct RayHitPacket<const N: usize> {
    pub ray: RayPacket<N>,
    pub normal: [[f32; N]; 3],
    pub u: [f32; N],
    pub v: [f32; N],
    pub primitive: [c_uint; N],
    pub geometry: [c_uint; N],
    pub instance: [c_uint; N],
    pub instance_primitive: [c_uint; N],
}

/// `RTCIntersectContext` of Embree 3 with one level of instances, as it is built by default.
#[repr(C)]
pub struct Context3 {
    flags: c_int,
    filter: *const c_void,
    instance: c_uint,
    /// There only where Embree is built with `EMBREE_MIN_WIDTH`.
    min_width_distance_factor: f32,
}

impl Context3 {
    /// What `rtcInitIntersectContext` makes, for rays that are coherent or not: no filter.
    pub fn new(coherent: bool) -> Self {
        Self {
            flags: c_int::from(coherent),
            filter: null(),
            instance: INVALID_GEOMETRY_ID,
            min_width_distance_factor: 0.0,
        }
    }
}

/// `RTCIntersectArguments` and `RTCOccludedArguments` of Embree 4, which are laid out alike.
#[repr(C)]
pub struct Arguments4 {
    flags: c_int,
    features: c_uint,
    context: *const c_void,
    filter: *const c_void,
    callback: *const c_void,
    /// There only where Embree is built with `EMBREE_MIN_WIDTH`.
    min_width_distance_factor: f32,
}

impl Arguments4 {
    /// What `rtcInitIntersectArguments` makes, for rays that are coherent or not: all features, no
    /// callbacks.
    pub fn new(coherent: bool) -> Self {
        Self {
            flags: c_int::from(coherent) << 16,
            features: c_uint::MAX,
            context: null(),
            filter: null(),
            callback: null(),
            min_width_distance_factor: 0.0,
        }
    }
}

/// `RTCMemoryMonitorFunction`.
pub type MemoryMonitor = unsafe extern "C" fn(user: *mut c_void, bytes: isize, post: bool) -> bool;

/// The calls for one ray, whose parameters differ from one version to the next.
#[derive(Clone, Copy)]
pub enum SingleCalls {
    /// Embree 3: scene, context, ray.
    V3 {
        intersect: unsafe extern "C" fn(Handle, *mut Context3, *mut RayHit),
        occluded: unsafe extern "C" fn(Handle, *mut Context3, *mut Ray),
    },
    /// Embree 4: scene, ray, arguments; those may be null.
    V4 {
        intersect: unsafe extern "C" fn(Handle, *mut RayHit, *mut Arguments4),
        occluded: unsafe extern "C" fn(Handle, *mut Ray, *mut Arguments4),
    },
}

/// The calls for a packet of `N` rays. First comes -1 for every lane that is to be traced, 0 for others.
#[derive(Clone, Copy)]
pub enum PacketCalls<const N: usize> {
    /// Embree 3: lanes, scene, context, rays.
    V3 {
        intersect: unsafe extern "C" fn(*const c_int, Handle, *mut Context3, *mut RayHitPacket<N>),
        occluded: unsafe extern "C" fn(*const c_int, Handle, *mut Context3, *mut RayPacket<N>),
    },
    /// Embree 4: lanes, scene, rays, arguments; those may be null.
    V4 {
        intersect:
            unsafe extern "C" fn(*const c_int, Handle, *mut RayHitPacket<N>, *mut Arguments4),
        occluded: unsafe extern "C" fn(*const c_int, Handle, *mut RayPacket<N>, *mut Arguments4),
    },
}

/// The calls for an array of rays: scene, context, rays, how many, and the bytes from one to the next.
#[derive(Clone, Copy)]
pub struct StreamCalls {
    pub intersect: unsafe extern "C" fn(Handle, *mut Context3, *mut RayHit, c_uint, usize),
    pub occluded: unsafe extern "C" fn(Handle, *mut Context3, *mut Ray, c_uint, usize),
}

/// Looks up the two calls of one kind, for the version of Embree.
macro_rules! calls {
    ($library:ident, $major:ident, $calls:ident, $intersect:literal, $occluded:literal) => {
        if $major >= 4 {
            $calls::V4 {
                intersect: *$library.get($intersect)?,
                occluded: *$library.get($occluded)?,
            }
        } else {
            $calls::V3 {
                intersect: *$library.get($intersect)?,
                occluded: *$library.get($occluded)?,
            }
        }
    };
}

macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($parameter:ty),*) $(-> $result:ty)?;)*) => {
        /// The library and its functions, named as in C but for the prefix.
        pub struct Api {
            $(pub $field: unsafe extern "C" fn($($parameter),*) $(-> $result)?,)*
            pub single: SingleCalls,
            pub packet8: PacketCalls<8>,
            pub packet16: PacketCalls<16>,
            /// Embree 4 has none.
            pub stream: Option<StreamCalls>,
            /// Keeps the code that the pointers above lead to.
            _library: Library,
        }

        impl Api {
            /// Looks the functions up in `library`, which is Embree of version `major`, 3 or 4.
            ///
            /// # Safety
            /// It is that.
            pub unsafe fn new(library: Library, major: u32) -> Result<Self, libloading::Error> {
                // SAFETY: the caller promises that this is Embree of that version, whose headers
                // declare each function with the parameters and the result given here; the pointers
                // live in one struct with the library.
                unsafe {
                    let stream = if major >= 4 {
                        None
                    } else {
                        Some(StreamCalls {
                            intersect: *library.get("rtcIntersect1M")?,
                            occluded: *library.get("rtcOccluded1M")?,
                        })
                    };
                    Ok(Self {
                        $($field: *library.get($symbol)?,)*
                        single: calls!(library, major, SingleCalls, "rtcIntersect1", "rtcOccluded1"),
                        packet8: calls!(library, major, PacketCalls, "rtcIntersect8", "rtcOccluded8"),
                        packet16:
                            calls!(library, major, PacketCalls, "rtcIntersect16", "rtcOccluded16"),
                        stream,
                        _library: library,
                    })
                }
            }
        }
    };
}

functions! {
    new_device = "rtcNewDevice": fn(*const c_char) -> Handle;
    release_device = "rtcReleaseDevice": fn(Handle);
    get_device_error = "rtcGetDeviceError": fn(Handle) -> c_int;
    get_device_property = "rtcGetDeviceProperty": fn(Handle, c_int) -> isize;
    set_device_memory_monitor_function = "rtcSetDeviceMemoryMonitorFunction":
        fn(Handle, MemoryMonitor, *mut c_void);
    new_scene = "rtcNewScene": fn(Handle) -> Handle;
    release_scene = "rtcReleaseScene": fn(Handle);
    set_scene_build_quality = "rtcSetSceneBuildQuality": fn(Handle, c_int);
    set_geometry_build_quality = "rtcSetGeometryBuildQuality": fn(Handle, c_int);
    set_scene_flags = "rtcSetSceneFlags": fn(Handle, c_int);
    attach_geometry = "rtcAttachGeometry": fn(Handle, Handle) -> c_uint;
    commit_scene = "rtcCommitScene": fn(Handle);
    new_geometry = "rtcNewGeometry": fn(Handle, c_int) -> Handle;
    release_geometry = "rtcReleaseGeometry": fn(Handle);
    set_shared_geometry_buffer = "rtcSetSharedGeometryBuffer":
        fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    commit_geometry = "rtcCommitGeometry": fn(Handle);
}
