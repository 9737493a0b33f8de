//! One ray a call. Each ray is copied onto the stack, as the call overwrites it.

use super::{
    ffi::{self, Context3, RayHit, SingleCalls},
    scene::Scene,
};
use crate::engines::Batch;
use std::ptr::null_mut;
use wide_bvh::geometry::{Hit, Ray};

/// Rays in Embree's format.
pub struct Rays<'a> {
    scene: &'a Scene,
    calls: SingleCalls,
    rays: Vec<ffi::Ray>,
}

impl<'a> Rays<'a> {
    pub fn new(scene: &'a Scene, rays: &[Ray]) -> Self {
        Self {
            scene,
            calls: scene.api().single,
            rays: rays.iter().map(ffi::Ray::new).collect(),
        }
    }

    fn intersect_all(&self, hits: &mut [Option<Hit>], intersect: impl Fn(&mut RayHit)) {
        for (&ray, hit) in self.rays.iter().zip(hits) {
            let mut found = RayHit {
                ray,
                hit: ffi::Hit::NONE,
            };
            intersect(&mut found);
            *hit = found.found();
        }
    }

    fn occlude_all(&self, all: &mut [bool], occlude: impl Fn(&mut ffi::Ray)) {
        for (&(mut ray), occluded) in self.rays.iter().zip(all) {
            occlude(&mut ray);
            *occluded = ray.is_occluded();
        }
    }
}

impl Batch for Rays<'_> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        let scene = self.scene.handle();
        match self.calls {
            SingleCalls::V3 { intersect, .. } => {
                let mut context = Context3::new(false);
                let context = &raw mut context;
                self.intersect_all(hits, |ray| {
                    // SAFETY: the scene is committed; the context and the ray are as they should
                    // be, and live until the call returns.
                    unsafe { intersect(scene, context, ray) }
                });
            }
            SingleCalls::V4 { intersect, .. } => self.intersect_all(hits, |ray| {
                // SAFETY: the scene is committed, the ray lives until the call returns, and no
                // arguments are the default ones.
                unsafe { intersect(scene, ray, null_mut()) }
            }),
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        let scene = self.scene.handle();
        match self.calls {
            SingleCalls::V3 { occluded: call, .. } => {
                let mut context = Context3::new(false);
                let context = &raw mut context;
                self.occlude_all(occluded, |ray| {
                    // SAFETY: as in `closest`.
                    unsafe { call(scene, context, ray) }
                });
            }
            SingleCalls::V4 { occluded: call, .. } => self.occlude_all(occluded, |ray| {
                // SAFETY: as in `closest`.
                unsafe { call(scene, ray, null_mut()) }
            }),
        }
    }
}
