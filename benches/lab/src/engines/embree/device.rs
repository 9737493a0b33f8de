//! Embree's devices: what Embree may use, and how much memory it takes.

use super::{
    EmbreeError,
    ffi::{self, Api, Handle, StreamCalls},
};
use std::{
    ffi::{CStr, c_int, c_void},
    ptr::null_mut,
    sync::atomic::{AtomicIsize, Ordering},
};

/// A device, and the memory it has taken.
pub struct Device {
    pub handle: Handle,
    pub api: &'static Api,
    /// What the monitor has counted. Boxed, as Embree points to it.
    allocated: Box<AtomicIsize>,
}

impl Device {
    /// A device of the given configuration, such as `threads=1`.
    ///
    /// # Errors
    /// Embree cannot make it.
    pub fn new(api: &'static Api, config: &CStr) -> Result<Self, EmbreeError> {
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

    /// How much memory it has now.
    pub fn bytes(&self) -> usize {
        usize::try_from(self.allocated.load(Ordering::Relaxed)).unwrap_or(0)
    }

    fn property(&self, property: c_int) -> isize {
        // SAFETY: the device is there.
        unsafe { (self.api.get_device_property)(self.handle, property) }
    }

    /// Whether it uses AVX-512.
    pub fn has_avx512(&self) -> bool {
        let [_, sixteen] = ffi::PROPERTY_NATIVE_RAY;
        self.property(sixteen) > 0
    }

    /// Its calls for arrays of rays, if it has them.
    pub fn stream(&self) -> Option<StreamCalls> {
        let supported = self.property(ffi::PROPERTY_RAY_STREAM) > 0;
        self.api.stream.filter(|_| supported)
    }

    /// The version, and the widest vectors it uses here.
    pub fn describe(&self) -> String {
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
