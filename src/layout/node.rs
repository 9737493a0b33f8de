//! Full-precision nodes, 4 and 8 wide.

use super::{Child, Link};
use crate::{
    geometry::{Aabb, Ray},
    simd::{Lanes, Simd, Vector},
    slab::{BundleSlabs, NarrowSlabs, Planes, RaySlabs},
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use sealed::Sealed;

/// A node of some width and precision: what the one traversal needs of it.
pub trait WideNode: Pod + Sealed {
    /// How many children it has at most.
    const WIDTH: usize;
    /// The ray in this node's terms, in a backend's vectors.
    #[doc(hidden)]
    type Slabs<S: Simd>: Copy;
    /// A float a child, in a backend's vector.
    #[doc(hidden)]
    type Lanes<S: Simd>: Lanes<Token = S>;

    /// A node of up to [`WIDTH`](Self::WIDTH) children with their bounds, in the lanes' order; more are
    /// left out.
    fn from_children(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self;

    /// What each lane leads to, as it is stored.
    fn links(&self) -> &[Link];

    /// What a lane leads to.
    fn child(&self, lane: usize) -> Child {
        self.links()
            .get(lane)
            .map_or(Child::EMPTY, |link| link.child::<Self>())
    }

    /// The bounds of the child in a lane, as they are tested. Empty past the last.
    fn child_aabb(&self, lane: usize) -> Aabb;

    #[doc(hidden)]
    fn slabs<S: Simd>(
        token: S,
        ray: &Ray,
        reciprocal: [S::F32x8; 3],
        bounds: &Aabb,
    ) -> Self::Slabs<S>;
    /// As [`test`](Self::test), for a bundle of rays.
    #[doc(hidden)]
    fn test_bundle<S: Simd>(
        &self,
        token: S,
        slabs: &BundleSlabs,
        t_max: Self::Lanes<S>,
    ) -> (Self::Lanes<S>, Self::Lanes<S>);
    /// The planes of a child's box that rays of this direction meet first, and those they meet last.
    #[doc(hidden)]
    fn child_planes(&self, lane: usize, direction: Vec3) -> [[f32; 3]; 2];
    /// The same from single numbers.
    #[doc(hidden)]
    fn widen<S: Simd>(token: S, slabs: &NarrowSlabs) -> Self::Slabs<S>;
    #[doc(hidden)]
    fn link_lanes<S: Simd>(&self, token: S) -> Self::Lanes<S>;
    /// By how much the greatest `t` is to be raised for [`test`](Self::test).
    #[doc(hidden)]
    fn margin<S: Simd>(slabs: &Self::Slabs<S>) -> f32;
    /// Which children the ray may meet up to `t_max`, as a comparison's outcome, and from which `t` on.
    #[doc(hidden)]
    fn test<S: Simd>(
        &self,
        token: S,
        slabs: &Self::Slabs<S>,
        t_max: Self::Lanes<S>,
    ) -> (Self::Lanes<S>, Self::Lanes<S>);
}

mod sealed {
    pub trait Sealed {}
}

/// `W` children: the planes of their boxes by axis, side and child, then where they lie. Empty lanes come
/// last, with a box that no ray passes.
///
/// `A` is a type of the alignment that a load of `W` floats wants.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Node<const W: usize, A> {
    align: [A; 0],
    planes: Planes<W>,
    links: [Link; W],
}

/// 16 bytes of alignment.
#[derive(Clone, Copy, Debug, Zeroable, Pod)]
#[repr(C, align(16))]
pub struct Align16([u8; 16]);

/// 32 bytes of alignment.
#[derive(Clone, Copy, Debug, Zeroable, Pod)]
#[repr(C, align(32))]
pub struct Align32([u8; 32]);

/// 4 children in 112 bytes.
pub type Node4 = Node<4, Align16>;
/// 8 children in 224 bytes.
pub type Node8 = Node<8, Align32>;

macro_rules! impl_wide_node {
    ($node:ty, $width:literal, $vector:ident, $bytes:literal, $narrow:expr) => {
        const _: () = assert!(size_of::<$node>() == $bytes);

        // SAFETY: floats and integers alone, `repr(C)`, and no padding: the size above is the sum
        // of the fields'.
        unsafe impl Zeroable for $node {}
        // SAFETY: as above.
        unsafe impl Pod for $node {}

        impl Sealed for $node {}

        impl WideNode for $node {
            const WIDTH: usize = $width;
            type Slabs<S: Simd> = RaySlabs<$width, S::$vector>;
            type Lanes<S: Simd> = S::$vector;

            fn from_children(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self {
                Self::new(children)
            }

            #[inline(always)]
            fn links(&self) -> &[Link] {
                &self.links
            }

            fn child_aabb(&self, lane: usize) -> Aabb {
                self.aabb(lane)
            }

            #[inline(always)]
            fn slabs<S: Simd>(
                token: S,
                ray: &Ray,
                [x, y, z]: [S::F32x8; 3],
                bounds: &Aabb,
            ) -> Self::Slabs<S> {
                RaySlabs::new(token, ray, [$narrow(x), $narrow(y), $narrow(z)], bounds)
            }

            #[inline(always)]
            fn test_bundle<S: Simd>(
                &self,
                token: S,
                slabs: &BundleSlabs,
                t_max: Self::Lanes<S>,
            ) -> (Self::Lanes<S>, Self::Lanes<S>) {
                slabs.test(token, &self.planes, t_max)
            }

            #[inline(always)]
            fn child_planes(&self, lane: usize, direction: Vec3) -> [[f32; 3]; 2] {
                let lane = lane % $width;
                let [[x0, x1], [y0, y1], [z0, z1]] = &self.planes;
                let planes = [x0[lane], x1[lane], y0[lane], y1[lane], z0[lane], z1[lane]];
                let [x, y, z] = [
                    (direction.x.to_bits() >> 31) as usize,
                    (direction.y.to_bits() >> 31) as usize,
                    (direction.z.to_bits() >> 31) as usize,
                ];
                [
                    [planes[x], planes[2 + y], planes[4 + z]],
                    [planes[x ^ 1], planes[2 + (y ^ 1)], planes[4 + (z ^ 1)]],
                ]
            }

            #[inline(always)]
            fn widen<S: Simd>(token: S, slabs: &NarrowSlabs) -> Self::Slabs<S> {
                slabs.widen(token)
            }

            #[inline(always)]
            fn link_lanes<S: Simd>(&self, token: S) -> Self::Lanes<S> {
                S::$vector::load(token, bytemuck::cast_ref(&self.links))
            }

            #[inline(always)]
            fn margin<S: Simd>(slabs: &Self::Slabs<S>) -> f32 {
                slabs.margin()
            }

            #[inline(always)]
            fn test<S: Simd>(
                &self,
                token: S,
                slabs: &Self::Slabs<S>,
                t_max: Self::Lanes<S>,
            ) -> (Self::Lanes<S>, Self::Lanes<S>) {
                slabs.test(token, &self.planes, t_max)
            }
        }
    };
}

impl_wide_node!(Node4, 4, F32x4, 112, S::low);
impl_wide_node!(Node8, 8, F32x8, 224, core::convert::identity);

impl<const W: usize, A> Node<W, A> {
    fn new(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self {
        let mut node = Self {
            align: [],
            planes: [[[f32::INFINITY; W], [f32::NEG_INFINITY; W]]; 3],
            links: [Link::new::<Self>(Child::EMPTY); W],
        };
        for (lane, (aabb, child)) in children.into_iter().take(W).enumerate() {
            for axis in 0..3 {
                node.planes[axis][0][lane] = aabb.min[axis];
                node.planes[axis][1][lane] = aabb.max[axis];
            }
            node.links[lane] = Link::new::<Self>(child);
        }
        node
    }

    #[inline]
    fn aabb(&self, lane: usize) -> Aabb {
        if lane >= W {
            return Aabb::EMPTY;
        }
        let [[min_x, max_x], [min_y, max_y], [min_z, max_z]] = &self.planes;
        Aabb::new(
            Vec3::new(min_x[lane], min_y[lane], min_z[lane]),
            Vec3::new(max_x[lane], max_y[lane], max_z[lane]),
        )
    }
}
