//! Queries of a [`Bvh8`], compiled with this crate.
//!
//! What is generic is compiled by whoever asks, as they are optimised: the debug build of a game would trace at its own speed,
//! however this crate is optimised. Of what builds make unless told otherwise it does not.

use super::{
    batch,
    query::{AnyHit, ClosestHit},
    triangles,
};
use crate::{
    geometry::{Hit, Ray},
    layout::{Bvh, Bvh8, Leaves, Node8, Storage, WideNode},
};
use core::ptr;

impl<N: WideNode, L: Leaves, S: Storage> Bvh<N, L, S> {
    /// Whether this is a [`Bvh8`].
    pub(super) const IS_BVH8: bool = N::KIND == Node8::KIND && L::ARE_TRIANGLES && S::IS_OWNED;

    /// This, which is a [`Bvh8`].
    #[inline(always)]
    pub(super) fn as_bvh8(&self) -> &Bvh8 {
        assert!(Self::IS_BVH8);
        // SAFETY: the same type, by the line above. No two kinds of nodes, of leaves or of storage have the same constant, and
        // nobody can add others.
        unsafe { &*ptr::from_ref(self).cast() }
    }
}

pub(super) fn closest_hit(bvh: &Bvh8, ray: &Ray) -> Option<Hit> {
    triangles::closest_hit(bvh, ray)
}

pub(super) fn any_hit(bvh: &Bvh8, ray: &Ray) -> bool {
    triangles::any_hit(bvh, ray)
}

pub(super) fn closest_hits(bvh: &Bvh8, rays: &[Ray], hits: &mut [Option<Hit>]) {
    batch::trace::<_, _, _, ClosestHit>(bvh, rays, hits);
}

pub(super) fn any_hits(bvh: &Bvh8, rays: &[Ray], occluded: &mut [bool]) {
    batch::trace::<_, _, _, AnyHit>(bvh, rays, occluded);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{
        Approximate, Borrowed, CompactNode4, CompactNode8, MeshLeaf, Node4, OrderedLeaf, Owned,
        PrimitiveLeaf, RunLeaf, TriangleLeaf,
    };

    #[test]
    fn nothing_else_is_a_bvh8() {
        assert_eq!([Bvh8::IS_BVH8], [true]);
        let others = [
            Bvh::<Node4, TriangleLeaf, Owned>::IS_BVH8,
            Bvh::<CompactNode8, TriangleLeaf, Owned>::IS_BVH8,
            Bvh::<CompactNode4, TriangleLeaf, Owned>::IS_BVH8,
            Bvh::<Node8, Approximate<TriangleLeaf>, Owned>::IS_BVH8,
            Bvh::<Node8, PrimitiveLeaf, Owned>::IS_BVH8,
            Bvh::<Node8, RunLeaf, Owned>::IS_BVH8,
            Bvh::<Node8, OrderedLeaf, Owned>::IS_BVH8,
            Bvh::<Node8, MeshLeaf, Owned>::IS_BVH8,
            Bvh::<Node8, TriangleLeaf, Borrowed>::IS_BVH8,
        ];
        assert_eq!(others, [false; 9]);
    }
}
