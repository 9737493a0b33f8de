//! How a walk tests the boxes of a node: all at once, or one by one where there are no vectors.

use crate::{
    geometry::{Aabb, Ray},
    layout::WideNode,
    simd::{F32x1, Lanes, Portable, Simd},
    slab::RaySlabs,
};
use glam::Vec3;

/// A ray in terms of nodes `N`.
pub(super) trait Boxes<N: WideNode> {
    /// From which `t` on the ray is in the boxes, as it comes.
    type Near: Copy;
    /// The same, a number a child.
    type Nears: AsRef<[f32]>;

    /// By how much the greatest `t` is to be raised.
    fn margin(&self) -> f32;
    /// Which children the ray may meet up to `t_max`, a bit each, and from which `t` on.
    fn test(&self, node: &N, t_max: f32) -> (u32, Self::Near);
    fn nears(near: Self::Near) -> Self::Nears;
}

/// All at once.
pub(super) struct AtOnce<T: Simd, N: WideNode> {
    token: T,
    slabs: N::Slabs<T>,
}

impl<T: Simd, N: WideNode> AtOnce<T, N> {
    #[inline(always)]
    pub(super) fn new(token: T, ray: &Ray, reciprocal: [T::F32x8; 3], bounds: &Aabb) -> Self {
        let slabs = N::slabs(token, ray, reciprocal, bounds);
        Self { token, slabs }
    }
}

impl<T: Simd, N: WideNode> Boxes<N> for AtOnce<T, N> {
    type Near = N::Lanes<T>;
    type Nears = <N::Lanes<T> as Lanes>::Array;

    #[inline(always)]
    fn margin(&self) -> f32 {
        N::margin(&self.slabs)
    }

    #[inline(always)]
    fn test(&self, node: &N, t_max: f32) -> (u32, N::Lanes<T>) {
        let t_max = N::Lanes::<T>::splat(self.token, t_max);
        let (hit, near) = node.test(self.token, &self.slabs, t_max);
        (hit.bits(), near)
    }

    #[inline(always)]
    fn nears(near: N::Lanes<T>) -> Self::Nears {
        near.to_array()
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
    type Near = [f32; Self::MOST];
    type Nears = [f32; Self::MOST];

    #[inline(always)]
    fn margin(&self) -> f32 {
        self.slabs.margin()
    }

    #[inline(always)]
    fn test(&self, node: &N, t_max: f32) -> (u32, Self::Near) {
        const { assert!(N::WIDTH <= Self::MOST) };
        let (mut mask, mut nears) = (0, [0.0; Self::MOST]);
        for lane in 0..node.lanes() {
            let planes = node.child_planes(lane, self.direction);
            let [near, far] = planes.map(|sides| sides.map(F32x1));
            let (hit, near) = self.slabs.between(near, far, F32x1(t_max));
            mask |= hit.bits() << lane;
            nears[lane % Self::MOST] = near.0;
        }
        (mask, nears)
    }

    #[inline(always)]
    fn nears(near: Self::Near) -> Self::Nears {
        near
    }
}
