//! What may be asked of a ray.

use super::triangles::Found;
use crate::geometry::{Hit, Ray};

/// The closest hit, or whether there is any.
pub(super) trait Query {
    type Answer: Copy + Send;
    const MISS: Self::Answer;
    /// Whether the closest hit is wanted: else the first that is met will do.
    const CLOSEST: bool;

    /// Of what was found for a ray that was not scaled.
    fn answer(found: Found, ray: &Ray, primitives: &[u32]) -> Self::Answer;
}

/// The closest hit.
pub(super) struct ClosestHit;

/// Whether there is any hit.
pub(super) struct AnyHit;

impl Query for ClosestHit {
    type Answer = Option<Hit>;
    const MISS: Option<Hit> = None;
    const CLOSEST: bool = true;

    #[inline(always)]
    fn answer(found: Found, ray: &Ray, primitives: &[u32]) -> Option<Hit> {
        Some(found.hit(ray, 1.0, primitives))
    }
}

impl Query for AnyHit {
    type Answer = bool;
    const MISS: bool = false;
    const CLOSEST: bool = false;

    #[inline(always)]
    fn answer(_: Found, _: &Ray, _: &[u32]) -> bool {
        true
    }
}
