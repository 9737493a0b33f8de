//! Packets of 8 or 16 rays a call, in the caller's order. Each packet is copied onto the stack, as the call
//! overwrites it.

use super::{
    ffi::{self, Arguments4, Context3, PacketCalls, RayHitPacket, RayPacket},
    scene::Scene,
};
use crate::engines::Batch;
use std::{array, ffi::c_int};
use wide_bvh::geometry::{Hit, Ray};

/// Packets of `N` rays in Embree's format.
pub struct Packets<'a, const N: usize> {
    scene: &'a Scene,
    calls: PacketCalls<N>,
    coherent: bool,
    packets: Vec<RayPacket<N>>,
}

impl<'a, const N: usize> Packets<'a, N> {
    /// Tells Embree whether the rays of a packet are `coherent`.
    pub fn new(scene: &'a Scene, calls: PacketCalls<N>, coherent: bool, rays: &[Ray]) -> Self {
        Self {
            scene,
            calls,
            coherent,
            packets: rays.chunks(N).map(pack).collect(),
        }
    }

    fn intersect_all(
        &self,
        hits: &mut [Option<Hit>],
        intersect: impl Fn(*const c_int, &mut RayHitPacket<N>),
    ) {
        for (&ray, hits) in self.packets.iter().zip(hits.chunks_mut(N)) {
            let mut found = RayHitPacket {
                ray,
                geometry: [ffi::INVALID_GEOMETRY_ID; N],
                instance: [ffi::INVALID_GEOMETRY_ID; N],
                normal: [[0.0; N]; 3],
                u: [0.0; N],
                v: [0.0; N],
                primitive: [0; N],
                instance_primitive: [0; N],
            };
            intersect(lanes::<N>(hits.len()).0.as_ptr(), &mut found);
            for (lane, hit) in hits.iter_mut().enumerate() {
                *hit = (found.geometry[lane] != ffi::INVALID_GEOMETRY_ID).then_some(Hit {
                    t: found.ray.t_far[lane],
                    u: found.u[lane],
                    v: found.v[lane],
                    primitive: found.primitive[lane],
                });
            }
        }
    }

    fn occlude_all(&self, all: &mut [bool], occlude: impl Fn(*const c_int, &mut RayPacket<N>)) {
        for (&(mut rays), all) in self.packets.iter().zip(all.chunks_mut(N)) {
            occlude(lanes::<N>(all.len()).0.as_ptr(), &mut rays);
            for (occluded, t_far) in all.iter_mut().zip(rays.t_far) {
                *occluded = t_far < 0.0;
            }
        }
    }
}

impl<const N: usize> Batch for Packets<'_, N> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        let scene = self.scene.handle();
        match self.calls {
            PacketCalls::V3 { intersect, .. } => {
                let mut context = Context3::new(self.coherent);
                let context = &raw mut context;
                self.intersect_all(hits, |lanes, rays| {
                    // SAFETY: the scene is committed; the lanes, the context and the rays are as they
                    // should be, aligned as Embree asks, and live until the call returns.
                    unsafe { intersect(lanes, scene, context, rays) }
                });
            }
            PacketCalls::V4 { intersect, .. } => {
                let mut arguments = Arguments4::new(self.coherent);
                let arguments = &raw mut arguments;
                self.intersect_all(hits, |lanes, rays| {
                    // SAFETY: as above, with arguments for the context.
                    unsafe { intersect(lanes, scene, rays, arguments) }
                });
            }
        }
    }

    fn any(&self, all: &mut [bool]) {
        let scene = self.scene.handle();
        match self.calls {
            PacketCalls::V3 { occluded, .. } => {
                let mut context = Context3::new(self.coherent);
                let context = &raw mut context;
                self.occlude_all(all, |lanes, rays| {
                    // SAFETY: as in `closest`.
                    unsafe { occluded(lanes, scene, context, rays) }
                });
            }
            PacketCalls::V4 { occluded, .. } => {
                let mut arguments = Arguments4::new(self.coherent);
                let arguments = &raw mut arguments;
                self.occlude_all(all, |lanes, rays| {
                    // SAFETY: as in `closest`.
                    unsafe { occluded(lanes, scene, rays, arguments) }
                });
            }
        }
    }
}

/// Which lanes are to be traced, as Embree asks for it, aligned for 16 lanes.
#[repr(align(64))]
struct Lanes<const N: usize>([c_int; N]);

/// The first `count` lanes.
#[inline]
fn lanes<const N: usize>(count: usize) -> Lanes<N> {
    if count == N {
        Lanes([-1; N])
    } else {
        Lanes(array::from_fn(|lane| -c_int::from(lane < count)))
    }
}

/// At least one ray and `N` at most; the first stands in for those that are missing.
fn pack<const N: usize>(rays: &[Ray]) -> RayPacket<N> {
    let ray = |lane: usize| rays.get(lane).unwrap_or(&rays[0]);
    RayPacket {
        origin: array::from_fn(|axis| array::from_fn(|lane| ray(lane).origin[axis])),
        t_near: array::from_fn(|lane| ray(lane).t_min),
        direction: array::from_fn(|axis| array::from_fn(|lane| ray(lane).direction[axis])),
        time: [0.0; N],
        t_far: array::from_fn(|lane| ray(lane).t_max),
        mask: [!0; N],
        id: [0; N],
        flags: [0; N],
    }
}
