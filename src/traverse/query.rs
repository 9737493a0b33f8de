//! What may be asked of a ray.

use super::triangles::Found;
use crate::{
    geometry::{Hit, Ray},
    layout::{Bvh, Storage, TriangleLeaves, WideNode},
};

/// The closest hit, or whether there is any.
pub(super) trait Query {
    type Answer: Copy + Send;
    const MISS: Self::Answer;
    /// Whether the closest hit is wanted: else the first that is met will do.
    const CLOSEST: bool;

    /// The answer to one ray by itself. A call: in the midst of a batch's code it is slower, on WebAssembly by a fifth.
    fn one<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        ray: &Ray,
    ) -> Self::Answer;

    /// Of what was found for a ray that was not scaled.
    fn answer(found: Found, primitives: &[u32]) -> Self::Answer;
}

/// The closest hit.
pub(super) struct ClosestHit;

/// Whether there is any hit.
pub(super) struct AnyHit;

impl Query for ClosestHit {
    type Answer = Option<Hit>;
    const MISS: Option<Hit> = None;
    const CLOSEST: bool = true;

    #[inline(never)]
    fn one<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        ray: &Ray,
    ) -> Option<Hit> {
        bvh.closest_hit(ray)
    }

    #[inline(always)]
    fn answer(found: Found, primitives: &[u32]) -> Option<Hit> {
        // `t` is within the ray's range as it is.
        Some(found.hit(found.t, primitives))
    }
}

impl Query for AnyHit {
    type Answer = bool;
    const MISS: bool = false;
    const CLOSEST: bool = false;

    #[inline(never)]
    fn one<N: WideNode, L: TriangleLeaves, S: Storage>(bvh: &Bvh<N, L, S>, ray: &Ray) -> bool {
        bvh.any_hit(ray)
    }

    #[inline(always)]
    fn answer(_: Found, _: &[u32]) -> bool {
        true
    }
}
