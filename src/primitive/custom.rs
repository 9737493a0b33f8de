//! A caller's own primitives.

use crate::{
    geometry::{Aabb, Ray},
    simd::Portable,
    slab::{PreparedRay, primitive_interval},
};

/// Primitives that the caller keeps and intersects: spheres, curves, voxels, whole objects.
///
/// The contract (the same answer as brute force, bit for bit) holds for these too, whatever the
/// rounding of [`intersect`](Self::intersect): a hit counts if the ray passes the primitive's own
/// box, and its `t` is put into the interval in which it does so. The boxes must be those that the
/// hierarchy was built on; if they are not, hits may be lost, and nothing worse.
pub trait Primitives {
    /// What the caller wants to know of a hit beyond `t`: coordinates, a normal, a part's number.
    type Detail: Copy;

    /// The bounds of primitive number `primitive`. What has bounds that are empty or not finite is never hit.
    fn aabb(&self, primitive: u32) -> Aabb;

    /// The least `t` within the ray's range at which it meets primitive number `primitive`.
    ///
    /// The ray is the caller's own, whatever has been found already: the answer must depend on
    /// the arguments alone.
    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, Self::Detail)>;
}

/// The closest intersection of a ray with a caller's primitives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit<D> {
    /// Where along the ray, in multiples of its direction. Within the ray's range.
    pub t: f32,
    /// Which primitive.
    pub primitive: u32,
    /// What [`Primitives::intersect`] said of it.
    pub detail: D,
}

/// The scaled `t` at which a primitive is hit, if it counts: the one definition of a hit on a
/// caller's primitive.
#[inline]
pub(crate) fn intersect<P: Primitives + ?Sized>(
    primitives: &P,
    primitive: u32,
    ray: &Ray,
    prepared: &PreparedRay,
) -> Option<(f32, P::Detail)> {
    let aabb = primitives.aabb(primitive);
    if aabb.is_empty() || !aabb.is_finite() {
        return None;
    }
    let (lo, hi) = (aabb.min.to_array(), aabb.max.to_array());
    let relative = |bound: [f32; 3]| {
        [0, 1, 2].map(|axis| wide::f32x4::splat(bound[axis] - prepared.ray.origin[axis]))
    };
    let reciprocals = prepared.reciprocals(Portable);
    let interval = primitive_interval(Portable, reciprocals, relative(lo), relative(hi));
    let (near, far) = (interval.0.to_array()[0], interval.1.to_array()[0]);
    if !(near <= far && near <= prepared.ray.t_max && prepared.ray.t_min <= far) {
        return None;
    }
    let (t, detail) = primitives.intersect(primitive, ray)?;
    if !t.is_finite() {
        return None;
    }
    // Adding 0 turns -0 into 0, for ties to be ties.
    let t = prepared.scaled(t).max(near).min(far) + 0.0;
    (t.is_finite() && prepared.ray.t_min <= t && t <= prepared.ray.t_max).then_some((t, detail))
}
