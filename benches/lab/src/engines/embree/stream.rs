//! Arrays of rays, [`CHUNK`] a call, in the caller's order. Each is copied first, as the call overwrites it.

use super::{
    ffi::{self, Context3, RayHit, StreamCalls},
    scene::Scene,
};
use crate::engines::Batch;
use std::ffi::c_uint;
use wide_bvh::geometry::{Hit, Ray};

/// Rays a call. 256, 4096 and all at once are within 3 % of it; with 64 Embree loses a tenth on shadow rays.
const CHUNK: usize = 1024;

/// Rays in Embree's format.
pub struct Stream<'a> {
    scene: &'a Scene,
    calls: StreamCalls,
    coherent: bool,
    rays: Vec<ffi::Ray>,
}

impl<'a> Stream<'a> {
    /// Tells Embree whether the rays of an array are `coherent`.
    pub fn new(scene: &'a Scene, calls: StreamCalls, coherent: bool, rays: &[Ray]) -> Self {
        Self {
            scene,
            calls,
            coherent,
            rays: rays.iter().map(ffi::Ray::new).collect(),
        }
    }
}

impl Batch for Stream<'_> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        let mut context = Context3::new(self.coherent);
        let mut found = Vec::with_capacity(CHUNK);
        for (rays, hits) in self.rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            found.clear();
            found.extend(rays.iter().map(|&ray| RayHit {
                ray,
                hit: ffi::Hit::NONE,
            }));
            let count = found.len() as c_uint;
            // SAFETY: the scene is committed; the context and the rays, so many and so far apart, are as
            // they should be, and live until the call returns.
            unsafe {
                (self.calls.intersect)(
                    self.scene.handle(),
                    &raw mut context,
                    found.as_mut_ptr(),
                    count,
                    size_of::<RayHit>(),
                );
            }
            for (found, hit) in found.iter().zip(hits) {
                *hit = found.found();
            }
        }
    }

    fn any(&self, all: &mut [bool]) {
        let mut context = Context3::new(self.coherent);
        let mut traced = Vec::with_capacity(CHUNK);
        for (rays, all) in self.rays.chunks(CHUNK).zip(all.chunks_mut(CHUNK)) {
            traced.clear();
            traced.extend_from_slice(rays);
            let count = traced.len() as c_uint;
            // SAFETY: as in `closest`.
            unsafe {
                (self.calls.occluded)(
                    self.scene.handle(),
                    &raw mut context,
                    traced.as_mut_ptr(),
                    count,
                    size_of::<ffi::Ray>(),
                );
            }
            for (ray, occluded) in traced.iter().zip(all) {
                *occluded = ray.is_occluded();
            }
        }
    }
}
