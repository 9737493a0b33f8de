//! How a walk tests the boxes of a node: all at once, or one by one where there are no vectors.

use crate::{
    geometry::{Aabb, Ray},
    layout::WideNode,
    simd::{F32x1, Lanes, Portable, Simd},
    slab::{NarrowRay, RaySlabs},
};
use core::{hint::black_box, mem::MaybeUninit};
use glam::Vec3;

/// A ray in terms of nodes `N`.
pub(super) trait Boxes<N: WideNode> {
    /// From which `t` on the ray is in the boxes, to be taken from.
    type Nears;

    /// To be called after a leaf, which needs the registers: what nodes need is loaded again.
    #[inline(always)]
    fn renew(&mut self) {}
    /// By how much the greatest `t` is to be raised.
    fn margin(&self) -> f32;
    /// Which children the ray may meet up to `t_max`, a bit each, and from which `t` on.
    fn test(&self, node: &N, t_max: f32) -> (u32, Self::Nears);
    /// From which `t` on the ray is in a child's box.
    ///
    /// # Safety
    /// The child has a bit in the mask.
    unsafe fn near(nears: &Self::Nears, lane: usize) -> f32;
}

/// All at once.
pub(super) struct AtOnce<'a, T: Simd, N: WideNode> {
    token: T,
    ray: &'a NarrowRay,
    slabs: N::Slabs<T>,
}

impl<'a, T: Simd, N: WideNode> AtOnce<'a, T, N> {
    #[inline(always)]
    pub(super) fn new(token: T, ray: &'a NarrowRay) -> Self {
        let slabs = Self::widen(token, ray);
        Self { token, ray, slabs }
    }

    /// Opaque to the compiler: it would load numbers several at a time, which waits for what was written one by one; and
    /// keep vectors on the stack.
    #[inline(always)]
    fn widen(token: T, ray: &NarrowRay) -> N::Slabs<T> {
        N::widen(token, black_box(ray))
    }
}

impl<T: Simd, N: WideNode> Boxes<N> for AtOnce<'_, T, N> {
    type Nears = <N::Lanes<T> as Lanes>::Array;

    #[inline(always)]
    fn renew(&mut self) {
        self.slabs = Self::widen(self.token, self.ray);
    }

    #[inline(always)]
    fn margin(&self) -> f32 {
        N::margin(&self.slabs)
    }

    /// Numbers are written before it is known whether several children are met, which is often guessed wrong: they are to be
    /// read at once then.
    #[inline(always)]
    fn test(&self, node: &N, t_max: f32) -> (u32, Self::Nears) {
        let t_max = N::Lanes::<T>::splat(self.token, t_max);
        let (mask, near) = node.test(self.token, &self.slabs, t_max);
        (mask, near.to_array())
    }

    #[inline(always)]
    unsafe fn near(nears: &Self::Nears, lane: usize) -> f32 {
        // SAFETY: the mask has bits for the node's lanes alone, `nears` is of as many.
        unsafe { *nears.as_ref().get_unchecked(lane) }
    }
}

/// One by one.
pub(super) struct OneByOne {
    slabs: RaySlabs<1, F32x1>,
    direction: Vec3,
}

impl OneByOne {
    /// The most children of a node.
    const MOST: usize = 8;

    #[inline(always)]
    pub(super) fn new(ray: &Ray, reciprocal: [F32x1; 3], bounds: &Aabb) -> Self {
        Self {
            slabs: RaySlabs::new(Portable, ray, reciprocal, bounds),
            direction: ray.direction,
        }
    }
}

impl<N: WideNode> Boxes<N> for OneByOne {
    // Nothing is cleared, which would be a call.
    type Nears = [MaybeUninit<f32>; Self::MOST];

    #[inline(always)]
    fn margin(&self) -> f32 {
        self.slabs.margin()
    }

    #[inline(always)]
    fn test(&self, node: &N, t_max: f32) -> (u32, Self::Nears) {
        const { assert!(N::WIDTH <= Self::MOST) };
        let (mut mask, mut nears) = (0, [MaybeUninit::uninit(); Self::MOST]);
        for lane in 0..node.lanes() {
            let planes = node.child_planes(lane, self.direction);
            let [near, far] = planes.map(|sides| sides.map(F32x1));
            let (hit, near) = self.slabs.between(near, far, F32x1(t_max));
            mask |= hit.bits() << lane;
            nears[lane % Self::MOST] = MaybeUninit::new(near.0);
        }
        (mask, nears)
    }

    #[inline(always)]
    unsafe fn near(nears: &Self::Nears, lane: usize) -> f32 {
        // SAFETY: where the mask has a bit, the number was written.
        unsafe { nears.get_unchecked(lane).assume_init() }
    }
}
