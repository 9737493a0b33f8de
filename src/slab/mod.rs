//! Ray against axis-aligned boxes: the slab test, one multiply-add a plane, that never loses a hit.
//!
//! # Why it never loses a hit
//!
//! Let u = 2^-24, o the ray's origin, d its direction (largest component in 2^-23 to 2^24), r its reciprocals, D the largest over the axes of |scene bound| + |o|. A box plane p is met at
//!
//! ```text
//! near = p·r + (-(o·r) - E),  far = p·r + (-(o·r) + E),  E = K_BOX·u·D·|r|
//! ```
//!
//! and the box is passed when max(near, t_min) <= min(far, t_max). The triangle test ends by putting t
//! into the interval [n, f] of the triangle's own box by one fixed formula:
//!
//! ```text
//! n = max over axes of ((lo - o)·r - e),  f = min over axes of ((hi - o)·r + e),
//! e = K_PRIMITIVE·u·M·|r|
//! ```
//!
//! with M the largest |vertex - o| of any axis (for r < 0, lo and hi change places, here as above).
//!
//! *(1) n and f are in order, and a point of the ray that meets the triangle lies between.* The edge
//! functions have exact signs, so an accepted triangle, sheared *as computed*, holds 0: weights w >= 0
//! of sum 1 exist with Σ w·x' = 0 and Σ w·y' = 0 exactly. A sheared x' = fl(X - fl(s·Z)), where X and Z
//! are rounded differences and s a product with a rounded reciprocal, is off from the exact shear by at most
//! u·|X| (difference) + 4u·|Z| (difference, reciprocal, quotient, product; |s| <= 1) + u·(|X| + |Z|) (last
//! difference) <= 7u·M. So at t* = Σ w·Z / d.z the ray is within 7u·M, on each axis, of the point
//! Σ w·vertex of the triangle, and exactly there along z. Hence (lo - o) - 7u·M <= d·t* <= (hi - o) + 7u·M,
//! and, multiplied by |r|: exact n - 7u·M·|r| <= t* <= exact f + 7u·M·|r| on each axis. Computing
//! (lo - o)·r - e adds at most u·M·|r| each for the difference, the reciprocal, the product and the last
//! difference. 7 + 4 = 11, and second-order terms are far below 1: **K_PRIMITIVE = 12** gives
//! n <= t* <= f on every pair of axes.
//!
//! *(2) The same where r was cut off* at R = 2^48, that is |d| < 1/R: multiplied by R, the inequality reads
//! (lo - o)·R <= d·R·t* + 7u·M·R with |d·R| <= 1, so |t*| has to fit in what is left of K_PRIMITIVE,
//! 12 - 7 - 3 > 1 u·M·R = 2^24·M. And |t*| <= M / |d.z| <= 2^23·M, for d.z, the
//! largest component, is at least 2^-23. This is why R is not smaller.
//!
//! *(3) near(box) <= n <= t and t <= f <= far(box) for each box above.* Bounds of a box are no tighter
//! than the triangle's, and each formula is monotone in the plane, rounding included, so it is enough
//! to compare the two formulas on one plane. near, with or without a fused operation, is off by at most
//! u·|p·r| + u·|o·r| (products), u·(|o·r| + E) (constant), u·(D·|r| + E) (sum) <= 3u·D·|r| + 2u·E from
//! p·r - o·r - E; n by 3u·M·|r| + u·e from its own value with e, as counted in (1) without the
//! reciprocal, which both share. M <= D(1 + u). So E - e >= 6u·D·|r| is enough: 12 + 6, and 2 more for
//! the rounding of D, M, E and e themselves: **K_BOX = 20**.
//!
//! *(4) Nothing overflows or turns NaN.* For D < 2^77, |p·r| and |o·r| are below 2^125. Beyond, far from
//! any scene that floats can describe, the slabs are opened so wide that every box is passed: slow, and
//! right. Below, D and M are never taken as less than 2^-70, which covers the absolute error of
//! results that are denormal, or flushed to zero by a program that has asked for it.
//!
//! The pass itself follows: t_min <= t <= t_max for a hit that counts, near <= t on each axis and
//! t <= far on each, so max(near, t_min) <= t <= min(far, t_max). An empty lane (lo = ∞, hi = -∞) has
//! near = ∞ and is never passed.
//!
//! The known ways are Williams et al., "An Efficient and Robust Ray-Box Intersection Algorithm" (2005),
//! and Ize, "Robust BVH Ray Traversal" (2013), which widens far by two ULPs; they cover the rounding
//! of the box test, not that of the triangle test.

mod prepared;

pub(crate) use prepared::{PreparedRay, pow2, reciprocal};

use crate::{
    geometry::{Aabb, Ray},
    simd::{Vector, splat3},
};

/// Half the distance from 1 to the next float: the relative error of one rounding.
const UNIT_ROUNDOFF: f32 = pow2(-24);
/// Margin of the box test: derived above.
const K_BOX: f32 = 20.0;
/// Margin of a primitive's own interval: derived above.
const K_PRIMITIVE: f32 = 12.0;
/// No distance is taken to be smaller when errors are estimated: (4) above.
const MIN_EXTENT: f32 = pow2(-70);
/// Up to here nothing overflows: (4) above.
const MAX_EXTENT: f32 = pow2(77);

/// What the box test needs of a ray and a scene, in every lane: 9 vectors, kept in registers.
#[derive(Clone, Copy)]
pub struct RaySlabs<const N: usize, V> {
    reciprocal: [V; 3],
    near: [V; 3],
    far: [V; 3],
    t_min: V,
    /// 1 where the direction is negative: which of a box's two planes is met first.
    negative: [usize; 3],
}

/// The planes of `N` boxes: by axis, then `min` and `max`, then box.
pub type Planes<const N: usize> = [[[f32; N]; 2]; 3];

impl<const N: usize, V: Vector<N>> RaySlabs<N, V> {
    /// For boxes within `bounds`. `reciprocal` is [`PreparedRay::reciprocals`], narrowed.
    #[inline(always)]
    pub(crate) fn new(token: V::Token, ray: &Ray, reciprocal: [V; 3], bounds: &Aabb) -> Self {
        let origin: [V; 3] = splat3(token, ray.origin.to_array());
        let (lo, hi): ([V; 3], [V; 3]) = (
            splat3(token, bounds.min.to_array()),
            splat3(token, bounds.max.to_array()),
        );
        let mut extent = V::splat(token, MIN_EXTENT);
        for axis in 0..3 {
            extent = extent.max(lo[axis].abs().max(hi[axis].abs()) + origin[axis].abs());
        }
        let error = extent * V::splat(token, K_BOX * UNIT_ROUNDOFF);
        let zero = V::splat(token, 0.0);
        let mut slabs = Self {
            reciprocal,
            near: [zero; 3],
            far: [zero; 3],
            t_min: V::splat(token, ray.t_min),
            negative: [
                (ray.direction.x.to_bits() >> 31) as usize,
                (ray.direction.y.to_bits() >> 31) as usize,
                (ray.direction.z.to_bits() >> 31) as usize,
            ],
        };
        for axis in 0..3 {
            let at_origin = zero - origin[axis] * reciprocal[axis];
            let error = error * reciprocal[axis].abs();
            slabs.near[axis] = at_origin - error;
            slabs.far[axis] = at_origin + error;
        }
        if extent.lt(V::splat(token, MAX_EXTENT)).bits() == 0 {
            slabs.open(token);
        }
        slabs
    }

    /// Has every box passed but the empty one.
    #[cold]
    #[inline(never)]
    fn open(&mut self, token: V::Token) {
        for axis in 0..3 {
            let sign = [1.0, -1.0][self.negative[axis]];
            self.reciprocal[axis] = V::splat(token, sign * pow2(-126));
            self.near[axis] = V::splat(token, -f32::MAX);
            self.far[axis] = V::splat(token, f32::MAX);
        }
    }

    /// Which of the boxes the ray may meet up to `t_max`, a bit each, and from which `t` on.
    #[inline(always)]
    pub(crate) fn test(&self, token: V::Token, planes: &Planes<N>, t_max: V) -> (u32, V) {
        let (near_x, far_x) = self.axis(token, planes, 0);
        let (near_y, far_y) = self.axis(token, planes, 1);
        let (near_z, far_z) = self.axis(token, planes, 2);
        let near = near_x.max(near_y).max(near_z.max(self.t_min));
        let far = far_x.min(far_y).min(far_z.min(t_max));
        (near.le(far).bits(), near)
    }

    /// From where to where the ray is between the two planes of an axis.
    #[inline(always)]
    fn axis(&self, token: V::Token, planes: &Planes<N>, axis: usize) -> (V, V) {
        let first = self.negative[axis] & 1;
        let r = self.reciprocal[axis];
        let near = V::load(token, &planes[axis][first]).mul_add(r, self.near[axis]);
        let far = V::load(token, &planes[axis][first ^ 1]).mul_add(r, self.far[axis]);
        (near, far)
    }
}

/// The interval of `t` within which a primitive's own bounds are met, for the hit to be put into: (1) above.
/// `reciprocal` is the ray's; `lo` and `hi` are the bounds less the ray's origin, axis by axis in the same order.
///
/// One fixed formula, so that every backend finds the same bits.
#[inline(always)]
pub(crate) fn primitive_interval<const N: usize, V: Vector<N>>(
    token: V::Token,
    reciprocal: [V; 3],
    lo: [V; 3],
    hi: [V; 3],
) -> (V, V) {
    let mut extent = V::splat(token, MIN_EXTENT);
    for axis in 0..3 {
        extent = extent.max(lo[axis].abs()).max(hi[axis].abs());
    }
    let error = V::splat(token, K_PRIMITIVE * UNIT_ROUNDOFF) * extent;
    let mut near = V::splat(token, f32::NEG_INFINITY);
    let mut far = V::splat(token, f32::INFINITY);
    for axis in 0..3 {
        let r = reciprocal[axis];
        let (a, b) = (lo[axis] * r, hi[axis] * r);
        let e = error * r.abs();
        let (enter, leave) = (a.min(b) - e, a.max(b) + e);
        // Not `max` and `min`: where both terms have overflowed their difference is NaN, which is to
        // be passed over on every backend alike.
        near = near.lt(enter).select(enter, near);
        far = leave.lt(far).select(leave, far);
    }
    (near, far)
}
