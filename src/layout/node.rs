//! What the one traversal needs of a node.

use super::{Child, Link};
use crate::{
    geometry::Aabb,
    simd::{Lanes, PREFETCHED, Simd, Vector},
    slab::{BundlePasses, BundleSlabs, NarrowRay, Passing, RaySlabs},
};
use bytemuck::Pod;
use glam::Vec3;

/// A node of some width and precision: what the one traversal needs of it.
pub trait WideNode: Pod + Send + Sync + sealed::Sealed {
    /// How many children it has at most.
    const WIDTH: usize;
    /// In the header of [bytes](super::bytes).
    #[doc(hidden)]
    const KIND: u32;
    /// Whether its children have to be nodes first and then leaves, and their boxes may grow: the builder sees to the
    /// first, and to bounds that hold the second.
    #[doc(hidden)]
    const NODES_FIRST: bool;
    /// How many nodes, or leaves or what is counted of them, its links tell apart.
    #[doc(hidden)]
    const PLACES: usize;
    /// How many bytes after a node's first its links are, or what they follow from.
    #[doc(hidden)]
    const LINKS: usize;
    /// The ray in this node's terms, in a backend's vectors.
    #[doc(hidden)]
    type Slabs<S: Simd>: Copy;
    /// A float a child, in a backend's vector.
    #[doc(hidden)]
    type Lanes<S: Simd>: Lanes<Token = S>;

    /// Has the links of the node at `address` fetched, if [`prefetch`](Simd::prefetch) leaves them out. Any address will do.
    #[doc(hidden)]
    #[inline(always)]
    fn prefetch_links<S: Simd>(token: S, address: *const u8) {
        if Self::LINKS >= PREFETCHED {
            token.prefetch_line(address.wrapping_add(Self::LINKS));
        }
    }

    /// A node of up to [`WIDTH`](Self::WIDTH) children with their bounds, in the lanes' order; more are
    /// left out.
    fn from_children(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self;

    /// The same after so many other nodes and leaves.
    #[doc(hidden)]
    fn after(&self, nodes: u32, leaves: u32) -> Self;

    /// The place of the first leaf that it leads to, if that is quickly found; the others follow. Compact nodes always tell, of any
    /// place if they lead to none; other nodes if what they have there, masked, still leads to a leaf.
    #[doc(hidden)]
    fn first_leaf(&self, mask: u32) -> Option<usize>;

    /// About where the vertices begin that its leaves read of a mesh, if it was told
    /// ([`with_first_vertex`](Self::with_first_vertex)); else 0.
    #[doc(hidden)]
    fn first_vertex(&self) -> usize;

    /// The same node, told about where the vertices begin that its leaves read, if it has room for that.
    #[doc(hidden)]
    fn with_first_vertex(self, vertex: u32) -> Self;

    /// How many lanes may have a child.
    #[doc(hidden)]
    fn lanes(&self) -> usize;

    /// What a lane leads to. Nothing past the last.
    fn child(&self, lane: usize) -> Child;

    /// The bounds of the child in a lane, as they are tested. Empty past the last.
    fn child_aabb(&self, lane: usize) -> Aabb;

    /// As [`test`](Self::test), for a bundle of rays.
    #[doc(hidden)]
    fn test_bundle<S: Simd>(
        &self,
        token: S,
        slabs: &BundleSlabs,
        t_max: Self::Lanes<S>,
    ) -> BundlePasses<Self::Lanes<S>>;
    /// The planes of all children's boxes that a bundle's rays meet first, by axis, and those that they meet last.
    #[doc(hidden)]
    fn planes<S: Simd>(&self, token: S, slabs: &BundleSlabs) -> [[Self::Lanes<S>; 3]; 2];
    /// Of children, a bit each, those that there are.
    #[doc(hidden)]
    fn present(&self, children: u32) -> u32;
    /// As [`test`](Self::test), of [planes](Self::planes) and the ray in lane `ray` modulo `RAYS` of as many, which is number
    /// `ray` in `passing`. Children that there are not are left in.
    #[doc(hidden)]
    fn test_one_of<const RAYS: usize, V: Vector<RAYS>>(
        planes: &[[Self::Lanes<V::Token>; 3]; 2],
        token: V::Token,
        slabs: &RaySlabs<RAYS, V>,
        t_max: &V,
        ray: usize,
        passing: &mut Passing<Self::Lanes<V::Token>>,
    );
    /// The planes of a child's box that rays of this direction meet first, and those they meet last.
    #[doc(hidden)]
    fn child_planes(&self, lane: usize, direction: Vec3) -> [[f32; 3]; 2];
    /// The same from single numbers.
    #[doc(hidden)]
    fn widen<S: Simd>(token: S, ray: &NarrowRay) -> Self::Slabs<S>;
    /// Where a lane leads to.
    ///
    /// # Safety
    /// There is such a lane.
    #[doc(hidden)]
    unsafe fn link(&self, lane: usize) -> Link;
    #[doc(hidden)]
    fn link_lanes<S: Simd>(&self, token: S) -> Self::Lanes<S>;
    /// Where it is written where a lane leads to, `links` being where all do.
    ///
    /// # Safety
    /// There is such a lane.
    #[doc(hidden)]
    unsafe fn link_among<'a, S: Simd>(
        &'a self,
        links: &'a <Self::Lanes<S> as Lanes>::Array,
        lane: usize,
    ) -> &'a Link;
    /// By how much the greatest `t` is to be raised for [`test`](Self::test).
    #[doc(hidden)]
    fn margin<S: Simd>(slabs: &Self::Slabs<S>) -> f32;
    /// Which children the ray may meet up to `t_max`, a bit each, and from which `t` on.
    #[doc(hidden)]
    fn test<S: Simd>(
        &self,
        token: S,
        slabs: &Self::Slabs<S>,
        t_max: Self::Lanes<S>,
    ) -> (u32, Self::Lanes<S>);
    /// The same, which children as a comparison's outcome.
    #[doc(hidden)]
    fn test_lanes<S: Simd>(
        &self,
        token: S,
        slabs: &Self::Slabs<S>,
        t_max: Self::Lanes<S>,
    ) -> (Self::Lanes<S>, Self::Lanes<S>);
}

pub(super) mod sealed {
    #[cfg(feature = "std")]
    pub trait Sealed: crate::build::Buildable {}
    #[cfg(not(feature = "std"))]
    pub trait Sealed {}
}

/// The one implementation of [`WideNode`], for nodes of `$width` children in `$bytes` bytes, `$kind` in headers, that can
/// - be made of children, say whether only of ordered ones, and of how many in all: `new`, `ORDERED`, `PLACES`; and be put after
///   others: `after`;
/// - say where its links begin: `LINKS`;
/// - give a child's box: `aabb`;
/// - give the planes that are met first and last, a lane's or all: `lane_planes`, `planes`;
/// - say where its leaves begin, if that is quickly found, and keep where their vertices do, if it can: `first_leaf`,
///   `first_vertex`, `with_first_vertex`;
/// - say how many lanes may have a child, and unset the others of a comparison's outcome or its bits: `lanes`, `present`,
///   `present_bits`;
/// - say where a lane, or every one, leads: `link`, `link_lanes`, and the first by the second: `link_among`.
macro_rules! impl_wide_node {
    ($node:ty, $kind:literal, $width:literal, $vector:ident, $bytes:literal) => {
        const _: () = assert!(size_of::<$node>() == $bytes);

        // SAFETY: floats and integers alone, `repr(C)`, and no padding: the size above is the sum
        // of the fields'.
        unsafe impl bytemuck::Zeroable for $node {}
        // SAFETY: as above.
        unsafe impl bytemuck::Pod for $node {}

        impl $crate::layout::node::sealed::Sealed for $node {}

        impl $crate::layout::WideNode for $node {
            const WIDTH: usize = $width;
            const KIND: u32 = $kind;
            const NODES_FIRST: bool = Self::ORDERED;
            const PLACES: usize = Self::PLACES;
            const LINKS: usize = Self::LINKS;
            type Slabs<S: Simd> = RaySlabs<$width, S::$vector>;
            type Lanes<S: Simd> = S::$vector;

            fn from_children(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self {
                Self::new(children)
            }

            #[inline(always)]
            fn after(&self, nodes: u32, leaves: u32) -> Self {
                self.after(nodes, leaves)
            }

            #[inline(always)]
            fn first_leaf(&self, mask: u32) -> Option<usize> {
                self.first_leaf(mask)
            }

            #[inline(always)]
            fn first_vertex(&self) -> usize {
                self.first_vertex()
            }

            fn with_first_vertex(self, vertex: u32) -> Self {
                self.with_first_vertex(vertex)
            }

            #[inline(always)]
            fn lanes(&self) -> usize {
                self.lanes()
            }

            #[inline]
            fn child(&self, lane: usize) -> Child {
                if lane < self.lanes() {
                    // SAFETY: there is such a lane.
                    unsafe { self.link(lane) }.child::<Self>()
                } else {
                    Child::EMPTY
                }
            }

            #[inline]
            fn child_aabb(&self, lane: usize) -> Aabb {
                self.aabb(lane)
            }

            #[inline(always)]
            fn test_bundle<S: Simd>(
                &self,
                token: S,
                slabs: &BundleSlabs,
                t_max: Self::Lanes<S>,
            ) -> BundlePasses<Self::Lanes<S>> {
                let planes = self.planes::<S::$vector>(token, slabs.first());
                let passes = slabs.test(token, planes, t_max);
                BundlePasses {
                    any: self.present_bits(passes.any),
                    ..passes
                }
            }

            #[inline(always)]
            fn planes<S: Simd>(&self, token: S, slabs: &BundleSlabs) -> [[S::$vector; 3]; 2] {
                self.planes::<S::$vector>(token, slabs.first())
            }

            #[inline(always)]
            fn present(&self, children: u32) -> u32 {
                self.present_bits(children)
            }

            #[inline(always)]
            fn test_one_of<const RAYS: usize, V: Vector<RAYS>>(
                &[near, far]: &[[Self::Lanes<V::Token>; 3]; 2],
                token: V::Token,
                slabs: &RaySlabs<RAYS, V>,
                t_max: &V,
                ray: usize,
                passing: &mut Passing<Self::Lanes<V::Token>>,
            ) {
                let t_max = Self::Lanes::<V::Token>::splat(token, lane(t_max, ray));
                let slabs: RaySlabs<$width, Self::Lanes<V::Token>> = slabs.of_lane(token, ray);
                let (hit, near) = slabs.between(near, far, t_max);
                passing.add(token, ray, hit, near);
            }

            #[inline(always)]
            fn child_planes(&self, lane: usize, direction: Vec3) -> [[f32; 3]; 2] {
                self.lane_planes(lane, FirstPlanes::new(direction))
            }

            #[inline(always)]
            fn widen<S: Simd>(token: S, ray: &NarrowRay) -> Self::Slabs<S> {
                ray.widen(token)
            }

            #[inline(always)]
            unsafe fn link(&self, lane: usize) -> Link {
                // SAFETY: the caller's promise.
                unsafe { self.link(lane) }
            }

            #[inline(always)]
            fn link_lanes<S: Simd>(&self, token: S) -> Self::Lanes<S> {
                self.link_lanes::<S::$vector>(token)
            }

            #[inline(always)]
            unsafe fn link_among<'a, S: Simd>(
                &'a self,
                links: &'a [f32; $width],
                lane: usize,
            ) -> &'a Link {
                // SAFETY: the caller's promise.
                unsafe { self.link_among(links, lane) }
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
            ) -> (u32, Self::Lanes<S>) {
                let [near, far] = self.planes::<S::$vector>(token, slabs.first());
                let (hit, near) = slabs.between(near, far, t_max);
                (self.present_bits(hit.bits()), near)
            }

            #[inline(always)]
            fn test_lanes<S: Simd>(
                &self,
                token: S,
                slabs: &Self::Slabs<S>,
                t_max: Self::Lanes<S>,
            ) -> (Self::Lanes<S>, Self::Lanes<S>) {
                let [near, far] = self.planes::<S::$vector>(token, slabs.first());
                let (hit, near) = slabs.between(near, far, t_max);
                (self.present(token, hit), near)
            }
        }
    };
}
pub(super) use impl_wide_node;
