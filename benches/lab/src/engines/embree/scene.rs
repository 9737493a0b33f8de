//! Embree's trees.

use super::{
    EmbreeError,
    device::Device,
    ffi::{self, Api, Handle},
};
use crate::engines::{Built, timed};
use std::{
    ffi::{CString, c_int, c_void},
    rc::Rc,
};
use wide_bvh::geometry::TriangleMesh;

/// How a tree is built.
#[derive(Clone, Copy)]
pub struct Recipe {
    /// How many threads build.
    pub threads: usize,
    /// Whether to go without AVX-512.
    pub avx2: bool,
    /// An `RTCBuildQuality`.
    pub quality: c_int,
    /// `RTCSceneFlags`.
    pub flags: c_int,
}

impl Recipe {
    /// One thread, HIGH quality, the ordinary mode.
    pub const HIGH: Self = Self {
        threads: 1,
        avx2: false,
        quality: ffi::BUILD_QUALITY_HIGH,
        flags: ffi::SCENE_FLAG_NONE,
    };

    /// A device for it.
    ///
    /// # Errors
    /// Embree cannot make it.
    pub fn device(&self, api: &'static Api) -> Result<Device, EmbreeError> {
        let isa = if self.avx2 { ",isa=avx2" } else { "" };
        let config = format!("threads={}{isa}", self.threads);
        Device::new(api, &CString::new(config).expect("no zero in it"))
    }
}

/// A mesh in memory that scenes share.
pub struct Buffers {
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
}

impl Buffers {
    pub fn new(mesh: &TriangleMesh<'_>) -> Rc<Self> {
        let mut positions = mesh.positions().to_vec();
        // Embree reads vertices 16 bytes at a time, past the end of the last.
        positions.push([0.0; 3]);
        Rc::new(Self {
            positions,
            indices: mesh.indices().to_vec(),
        })
    }
}

/// A committed scene of one mesh, on a device of its own, so that its memory is counted alone.
pub struct Scene {
    handle: Handle,
    buffers: Rc<Buffers>,
    device: Device,
}

impl Scene {
    /// Builds a tree, and tells what it cost.
    ///
    /// # Errors
    /// Embree cannot make a device or a scene.
    pub fn build(
        api: &'static Api,
        buffers: &Rc<Buffers>,
        recipe: Recipe,
    ) -> Result<(Self, Built), EmbreeError> {
        let device = recipe.device(api)?;
        let buffers = Rc::clone(buffers);
        let (scene, time) = timed(|| Self::commit(device, buffers, recipe));
        let scene = scene?;
        let bytes = scene.device.bytes();
        Ok((scene, Built { time, bytes }))
    }

    /// For calls.
    pub fn handle(&self) -> Handle {
        self.handle
    }

    /// For calls.
    pub fn api(&self) -> &'static Api {
        self.device.api
    }

    fn commit(device: Device, buffers: Rc<Buffers>, recipe: Recipe) -> Result<Self, EmbreeError> {
        let api = device.api;
        let scene = Self {
            // SAFETY: the device is there.
            handle: unsafe { (api.new_scene)(device.handle) },
            buffers,
            device,
        };
        // SAFETY: all handles are of this device; Embree takes a null one, as of a scene that it
        // could not make, for an error. The buffers hold as many elements as is said, the vertices
        // with the padding that Embree asks for, and live as long as the scene.
        unsafe {
            (api.set_scene_build_quality)(scene.handle, recipe.quality);
            (api.set_scene_flags)(scene.handle, recipe.flags);
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
                scene.buffers.positions.as_ptr().cast(),
                scene.buffers.positions.len() - 1,
            );
            share(
                ffi::BUFFER_TYPE_INDEX,
                ffi::FORMAT_UINT3,
                scene.buffers.indices.as_ptr().cast(),
                scene.buffers.indices.len(),
            );
            // A scene of LOW quality asks each geometry for its own.
            (api.set_geometry_build_quality)(geometry, recipe.quality);
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
