//! Ray against axis-aligned boxes: the slab test, one multiply-add a plane, that never loses a hit.
//!
//! # Why it never loses a hit
//!
//! Let u = 2^-24, o the ray's origin, d its direction (largest component in 2^-23 to 2^24), r its reciprocals,
//! D the largest over the axes of |scene bound| + |o|. A box plane p is met at
//!
//! ```text
//! near = p·r + (-(o·r) - E),  far = p·r + (-(o·r) + E),  E = K_BOX·u·D·|r|
//! ```
//!
//! (for r < 0, the box's two planes change places, here and below) and the box is passed when
//!
//! ```text
//! max(near, t_min - S(t_min)) <= min(far, t_max + S(t_max)),  S(t) = u·D·|r.z| + K_RELATIVE·u·|t|
//! ```
//!
//! with z the axis of the largest direction component; but the left side is no less than 0, which is seen to in (7).
//! Let M be the largest |vertex - o| of a triangle on any axis: M <= D(1 + u).
//!
//! *(1) An accepted triangle has a point near the ray.* The edge functions have exact signs, so the triangle,
//! sheared *as computed*, holds 0: weights w >= 0 of sum 1 exist with Σ w·x' = 0 and Σ w·y' = 0 exactly. A
//! sheared x' = fl(X - fl(s·Z)), where X and Z are rounded differences and s a product with a rounded
//! reciprocal, is off from the exact shear by at most u·|X| (difference) + 4u·|Z| (difference, reciprocal,
//! quotient, product; |s| <= 1) + u·(|X| + |Z|) (last difference) <= 7u·M. So at t* = Σ w·Z / d.z the ray is
//! within 7u·M, on each axis, of the point P = Σ w·vertex of the triangle, and exactly there along z.
//!
//! *(2) Every box that holds P is open at t\*.* Let lo <= P <= hi on an axis. Then
//! lo - o - 7u·D <= d·t* <= hi - o + 7u·D, and, multiplied by |r|, exact near - 7u·D·|r| <= t* <=
//! exact far + 7u·D·|r|. Computing near, with or without a fused operation, adds at most u·D·|r| (reciprocal),
//! u·|p·r| + u·|o·r| <= u·D·|r| (products), u·(|o·r| + E) (constant) and u·(D·|r| + E) (sum): 4u·D·|r| + 2u·E.
//! 7 + 4 = 11, and D and E are themselves rounded: **K_BOX = 14** gives near <= t* <= far on every axis.
//!
//! *(3) The same where r was cut off* at R = 2^48, that is |d| < 1/R: (2) multiplied by R instead of by |r| has
//! |d·R| <= 1 times t* where it had t*. It is off from t* by less than 2·|t*|, for which there are the
//! 14 - 7 - 4 = 3 u·D·R = 3·2^24·D that are left of K_BOX: and |t*| <= M / |d.z| <= 2^23·D (1 + u), for d.z, the
//! largest component, is at least 2^-23. This is why R is not smaller.
//!
//! *(4) The computed t is within S(t) of t\*.* In `f32` it is Z.a + v·(Z.b - Z.a) + w·(Z.c - Z.a), times r.z, of computed
//! weights. With X and Y the largest |x'| and |y'| of the corners, an edge function is off by 2u·X·Y + u·itself, the
//! determinant by 6u·X·Y + 3u·itself, and a weight by 8u·X·Y/|det| + 5u of itself. With d the greater of |Z.b - Z.a| and
//! |Z.c - Z.a|, and Z the mean, that and the mean's own operations come to (16·X·Y/|det| + 10)·u·d + 2u·|Z|. It is used
//! where (X·Y/|det| + 1)·d <= C·|Z|: it is off by less than (16·C + 4)·u·|t|, the product and r.z included:
//! **K_RELATIVE = 272** has 12 to spare for C = [`CONDITION`] = 16, for terms of u² and for the sums of S and t.
//! Elsewhere numbers are `f64`, off by a few 2^-53, and then rounded:
//!
//! - The triangle is sheared once more. Corners are off by 2^-50·M; no weight is below 0, and as the area is at least u of
//!   the products that it is the difference of, each weight is off by less than 2^-27. So (1) holds with 2^-24·M for
//!   7u·M, for the P of these weights, whose z t has to 2^-50·M.
//! - Or the corners are those of (1), the edge functions are exact but for their last rounding, and so are the weights.
//!
//! In both t is off by u·|t| and 2^-50·M·|r.z|, a quarter of what S has of D: the rest is for results that are denormal.
//!
//! *The pass itself.* A hit that counts has t_min <= t <= t_max. By (4), and as t + S(t) and t - S(t) grow with t,
//! t_min - S(t_min) <= t* <= t_max + S(t_max); by (2), near <= t* <= far on each axis: t* is between the two sides of the
//! test. It is enough that *some* box of each level holds P: boxes may hold parts of triangles.
//!
//! *(5) A caller's primitive* has no such t*. Its t is put into the interval [n, f] that the ray spends in the
//! primitive's own box, by one fixed formula, n = (lo - o)·r - e and f = (hi - o)·r + e with
//! e = K_PRIMITIVE·u·M·|r|. A box around it is no tighter, and each formula is monotone in the plane, rounding
//! included, so it is enough to compare the two on one plane: near is off from p·r - o·r - E by 3u·D·|r| + 2u·E, n
//! from its own by 3u·M·|r| + u·e. So near <= n if K_BOX - K_PRIMITIVE >= 6 and some: **K_PRIMITIVE = 6**. No
//! more is needed: that n <= f, where it does not hold, is part of the definition of a miss.
//!
//! *(6) Nothing overflows or turns NaN.* For D < 2^77, |p·r| and |o·r| are below 2^125. Beyond, far from
//! any scene that floats can describe, the slabs are opened so wide that every box is passed: slow, and
//! right. Below, D and M are never taken as less than 2^-70, which covers the absolute error of
//! results that are denormal, or flushed to zero by a program that has asked for it.
//!
//! *(7) t begins at 0 or later.* The greater and the lesser of two numbers are found by their bits, as integers, where
//! that is sooner: as it should be, but for two negative ones, of which it may be either. So the left side of the test is
//! never negative, and the right side is just when it should be. (Boxes that are tested one by one are compared as floats:
//! there t begins where it does.)
//!
//! - If t_min >= 0, the left side is the greater of 0 and what it was. Then t* may be left of 0, by no more than
//!   S(0) = u·D·|r.z|, and far has to be 0 at least: |r.z| is the least of |r|, (3) needs 1 of the 3 u·D·|r| that are left
//!   of K_BOX, and this 1 more.
//! - Else t is moved: s is added to near, far and the range's end, with -s = t_min - S(t_min), or -1.01·D·|r.z|, before
//!   which nothing is hit by (1) or (5). Roundings are more: u·s of s itself as it is widened, u·(|o·r| + E + s) of what is
//!   added up, and u·s of the last sum: 4u·D·|r| and some. Near and far are moved apart by a fourth of far - near, which is
//!   2E less roundings of 2u·D·|r|: 6u·D·|r|. The end has s·(1 + 2^-20), for its own.
//!
//! An empty lane (lo = ∞, hi = -∞) has near = ∞ and is never passed.
//!
//! The known ways are Williams et al., "An Efficient and Robust Ray-Box Intersection Algorithm" (2005),
//! and Ize, "Robust BVH Ray Traversal" (2013), which widens far by two ULPs; they cover the rounding
//! of the box test, not that of the triangle test.

mod bundle;
mod narrow;
pub(crate) mod passing;
mod prepared;

pub use bundle::{BundlePasses, BundleSlabs};
pub(crate) use bundle::{Bundling, least, most};
pub use narrow::NarrowRay;
pub use passing::Passing;
pub(crate) use prepared::{PreparedRay, pow2, reciprocal, reciprocals};

use crate::{
    geometry::{Aabb, Ray},
    simd::{F32x1, Portable, Vector, splat3},
};
use glam::Vec3;

/// Half the distance from 1 to the next float: the relative error of one rounding.
pub(crate) const UNIT_ROUNDOFF: f32 = pow2(-24);
/// Margin of the box test: derived above.
const K_BOX: f32 = 14.0;
/// Margin of the computed `t` of a triangle: derived above.
const K_RELATIVE: f32 = 272.0;
/// Margin of a primitive's own interval: derived above.
const K_PRIMITIVE: f32 = 6.0;
/// How far off a triangle's `t` may be in `f32`: (4) above.
pub(crate) const CONDITION: f32 = 16.0;
/// No `t` of a hit is less than this times the negative of what S has of the scene: (7) above.
const EARLIEST: f32 = 1.01 / UNIT_ROUNDOFF;
/// No distance is taken to be smaller when errors are estimated: (6) above.
const MIN_EXTENT: f32 = pow2(-70);
/// Up to here nothing overflows: (6) above.
pub(crate) const MAX_EXTENT: f32 = pow2(77);

/// What the box test needs of a ray and a scene, in every lane: 9 vectors, kept in registers.
#[derive(Clone, Copy)]
pub struct RaySlabs<const N: usize, V> {
    reciprocal: [V; 3],
    near: [V; 3],
    far: [V; 3],
    /// The least `t`, less S of it, but no less than 0 where [`between`](Self::between) takes numbers by their bits.
    t_min: V,
    /// Of S, what is of the scene; and by how much `t` was moved.
    margin: V,
    /// How many bytes after the first of a node's planes those are that are met first, by axis.
    first: [usize; 3],
}

/// What is added to a plane times the reciprocal, for the plane that is met first and for the other. `error` is the
/// margin less the reciprocal's magnitude.
#[inline(always)]
fn plane_terms<const N: usize, V: Vector<N>>(
    token: V::Token,
    origin: V,
    reciprocal: V,
    error: V,
) -> (V, V) {
    let at_origin = V::splat(token, 0.0) - origin * reciprocal;
    let error = error * reciprocal.abs();
    (at_origin - error, at_origin + error)
}

impl<const N: usize, V: Vector<N>> RaySlabs<N, V> {
    /// For boxes within `bounds`. `reciprocal` is [`PreparedRay::reciprocals`], narrowed.
    #[inline(always)]
    pub(crate) fn new(token: V::Token, ray: &Ray, reciprocal: [V; 3], bounds: &Aabb) -> Self {
        let origin = splat3(token, ray.origin.to_array());
        let t_min = V::splat(token, ray.t_min);
        let (mut slabs, extent) =
            Self::of_lanes(token, origin, reciprocal, t_min, ray.direction, bounds);
        if extent.lt(V::splat(token, MAX_EXTENT)).bits() == 0 {
            slabs.open(token);
        }
        slabs
    }

    /// A ray a lane, all of whose directions have the signs of `direction`; and each one's D, which must be less than
    /// [`MAX_EXTENT`].
    #[inline(always)]
    pub(crate) fn of_lanes(
        token: V::Token,
        origin: [V; 3],
        reciprocal: [V; 3],
        t_min: V,
        direction: Vec3,
        bounds: &Aabb,
    ) -> (Self, V) {
        let (lo, hi): ([V; 3], [V; 3]) = (
            splat3(token, bounds.min.to_array()),
            splat3(token, bounds.max.to_array()),
        );
        let mut extent = V::splat(token, MIN_EXTENT);
        for axis in 0..3 {
            extent = extent.max(lo[axis].abs().max(hi[axis].abs()) + origin[axis].abs());
        }
        let error = extent * V::splat(token, K_BOX * UNIT_ROUNDOFF);
        let [rx, ry, rz] = [
            reciprocal[0].abs(),
            reciprocal[1].abs(),
            reciprocal[2].abs(),
        ];
        let margin = extent * V::splat(token, UNIT_ROUNDOFF) * rx.min(ry).min(rz);
        let zero = V::splat(token, 0.0);
        let mut slabs = Self {
            reciprocal,
            near: [zero; 3],
            far: [zero; 3],
            t_min: t_min - slack(token, t_min, margin),
            margin,
            first: [
                first_planes(0, direction.x, Self::SIDE),
                first_planes(1, direction.y, Self::SIDE),
                first_planes(2, direction.z, Self::SIDE),
            ],
        };
        for axis in 0..3 {
            let terms = plane_terms(token, origin[axis], reciprocal[axis], error);
            (slabs.near[axis], slabs.far[axis]) = terms;
        }
        (slabs, extent)
    }

    /// Has `t` begin at 0 or later, by moving it if it does not: (7) above. `t_min` is the rays'. Before which `t` nothing is
    /// hit, as it was.
    #[inline(always)]
    pub(crate) fn begin_at_zero(&mut self, token: V::Token, t_min: V) -> V {
        let zero = V::splat(token, 0.0);
        if t_min.lt(zero).bits() == 0 {
            let start = self.t_min;
            self.t_min = start.max(zero);
            return start;
        }
        let earliest = zero - self.margin * V::splat(token, EARLIEST);
        let start = self.t_min.max(earliest);
        let shift = zero - start.min(zero);
        self.t_min = start.max(zero);
        self.margin = self.margin + shift * V::splat(token, 1.0 + pow2(-20));
        for axis in 0..3 {
            let (near, far) = (&mut self.near[axis], &mut self.far[axis]);
            let wider = (*far - *near) * V::splat(token, 0.25);
            (*near, *far) = (*near + (shift - wider), *far + (shift + wider));
        }
        start
    }

    /// Those of the ray in a lane, in every lane of other vectors.
    #[inline(always)]
    pub(crate) fn of_lane<const M: usize, W: Vector<M, Token = V::Token>>(
        &self,
        token: V::Token,
        at: usize,
    ) -> RaySlabs<M, W> {
        let spread = |[x, y, z]: &[V; 3]| splat3(token, [lane(x, at), lane(y, at), lane(z, at)]);
        RaySlabs {
            reciprocal: spread(&self.reciprocal),
            near: spread(&self.near),
            far: spread(&self.far),
            t_min: W::splat(token, lane(&self.t_min, at)),
            margin: W::splat(token, lane(&self.margin, at)),
            first: self.first.map(|first| first / N * M),
        }
    }

    /// How far the computed `t` of a triangle may be off beside what [`reach`] has of `t` itself.
    #[inline(always)]
    pub(crate) fn margin(&self) -> f32 {
        self.margin.to_array()[0]
    }

    /// The same of each lane.
    #[inline(always)]
    pub(crate) fn margins(&self) -> V {
        self.margin
    }

    /// The reciprocals it was made with.
    #[inline(always)]
    pub(crate) fn reciprocals(&self) -> [V; 3] {
        self.reciprocal
    }

    /// Has every box passed but the empty one.
    #[cold]
    #[inline(never)]
    fn open(&mut self, token: V::Token) {
        for axis in 0..3 {
            let tiny = V::splat(token, pow2(-126));
            let negative = self.reciprocal[axis].lt(V::splat(token, 0.0));
            self.reciprocal[axis] = negative.select(V::splat(token, -pow2(-126)), tiny);
            self.near[axis] = V::splat(token, -f32::MAX);
            self.far[axis] = V::splat(token, f32::MAX);
        }
    }

    /// Which side's planes are met first.
    #[inline(always)]
    pub(crate) fn first(&self) -> FirstPlanes<N> {
        FirstPlanes(self.first)
    }

    /// Which of the boxes the ray may meet up to `t_max`, raised by the margin, and from which `t` on: of the planes that
    /// are met first and those that are met last.
    #[inline(always)]
    pub(crate) fn between(&self, near: [V; 3], far: [V; 3], t_max: V) -> (V, V) {
        let [rx, ry, rz] = self.reciprocal;
        let near_x = near[0].mul_add(rx, self.near[0]);
        let near_y = near[1].mul_add(ry, self.near[1]);
        let near_z = near[2].mul_add(rz, self.near[2]);
        let far_x = far[0].mul_add(rx, self.far[0]);
        let far_y = far[1].mul_add(ry, self.far[1]);
        let far_z = far[2].mul_add(rz, self.far[2]);
        let near = near_x
            .max_from_zero(near_y)
            .max_from_zero(near_z.max_from_zero(self.t_min));
        let far = far_x
            .min_from_zero(far_y)
            .min_from_zero(far_z.min_from_zero(t_max));
        (near.le(far), near)
    }

    /// Bytes of one side's planes.
    const SIDE: usize = size_of::<[f32; N]>();
}

/// A lane, modulo `N`, of a vector in memory: all of it would be loaded and stored again, to be read there.
#[inline(always)]
pub(crate) fn lane<const N: usize, V: Vector<N>>(vector: &V, at: usize) -> f32 {
    const { assert!(size_of::<V>() == size_of::<[f32; N]>()) };
    // SAFETY: every backend's vector is as many floats and nothing else, which the size bears out.
    unsafe { *core::ptr::from_ref(vector).cast::<f32>().add(at % N) }
}

/// Up to which `t` boxes are of interest, where hits are up to `t_max`.
#[inline(always)]
pub(crate) fn reach<const N: usize, V: Vector<N>>(token: V::Token, t_max: V, margin: V) -> V {
    t_max + slack(token, t_max, margin)
}

/// S(t), for `margin` the part of it that is of the scene.
#[inline(always)]
fn slack<const N: usize, V: Vector<N>>(token: V::Token, t: V, margin: V) -> V {
    t.abs() * V::splat(token, K_RELATIVE * UNIT_ROUNDOFF) + margin
}

/// The same of one number.
#[inline(always)]
pub(crate) fn reach_of(t_max: f32, margin: f32) -> f32 {
    reach(Portable, F32x1(t_max), F32x1(margin)).0
}

/// Which side's planes rays of some direction meet first, by axis, in a node of `N` children: how many bytes after the
/// first they are, were they floats.
#[derive(Clone, Copy)]
pub struct FirstPlanes<const N: usize>([usize; 3]);

impl<const N: usize> FirstPlanes<N> {
    #[inline(always)]
    pub(crate) fn new(direction: Vec3) -> Self {
        let side = size_of::<[f32; N]>();
        Self([
            first_planes(0, direction.x, side),
            first_planes(1, direction.y, side),
            first_planes(2, direction.z, side),
        ])
    }

    /// The planes that are met first, by axis, and those that are met last; whatever they are written as.
    #[inline(always)]
    pub(crate) fn pick<P>(self, planes: &[[[P; N]; 2]; 3]) -> [[&[P; N]; 3]; 2] {
        let Self([x, y, z]) = self;
        let other = size_of::<[f32; N]>();
        [
            [
                Self::at(planes, x),
                Self::at(planes, y),
                Self::at(planes, z),
            ],
            [
                Self::at(planes, x ^ other),
                Self::at(planes, y ^ other),
                Self::at(planes, z ^ other),
            ],
        ]
    }

    #[inline(always)]
    fn at<P>(planes: &[[[P; N]; 2]; 3], place: usize) -> &[P; N] {
        let planes: *const [P; N] = planes.as_ptr().cast();
        // SAFETY: `place` is from `first_planes`, or the other side's: one of six.
        unsafe { &*planes.byte_add(place * size_of::<P>() / size_of::<f32>()) }
    }
}

/// How many bytes after the first of a node's planes those are, `side` bytes a side, that a ray of this direction meets
/// first.
#[inline(always)]
fn first_planes(axis: usize, direction: f32, side: usize) -> usize {
    (2 * axis + (direction.to_bits() >> 31) as usize) * side
}

/// The interval of `t` within which a primitive's own bounds are met, for the hit to be put into: (5) above.
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
