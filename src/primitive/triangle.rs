//! Ray against `N` triangles: watertight, and exact in whether it hits.
//!
//! After Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): move the ray's origin
//! to 0, shear its direction onto the z axis, and ask on which side of each edge 0 lies. A vertex is sheared
//! by itself, so triangles that share it agree on where it is. What is added here:
//!
//! - The edge functions a·b - c·d, in `f32` without fused operations, never have the wrong sign: rounding is
//!   monotone, so the rounded products compare as the exact ones do or come out equal. A lane that comes out
//!   zero, or overflows, is worked out again in `f64`, where the products are exact. So the sign is exact,
//!   and the sheared mesh has no crack at an edge or a vertex.
//! - `t` is put into the interval where the ray meets the triangle's own box (see [`slab`](crate::slab)):
//!   on a needle seen edge-on the weights, and so `t`, are ill-conditioned, but never worse than the geometry.
//!
//! A triangle with two corners at one place has an edge function that is exactly zero and two that are
//! opposite, so it is never hit.

use crate::{
    geometry::{PreparedRay, pow2},
    simd::Vector,
    slab::primitive_interval,
};

/// What the triangle test needs of a ray, in every lane.
#[derive(Clone, Copy)]
pub struct RayShear<const N: usize, V> {
    origin: [V; 3],
    shear: [V; 2],
    axes: [usize; 3],
    reciprocal: [f32; 3],
    t_min: V,
}

/// Vertices (one a lane) as the ray sees them.
#[derive(Clone, Copy)]
pub struct Sheared<V> {
    /// Less the ray's origin, along the axes of the shear.
    relative: [V; 3],
    /// x and y after the shear.
    sheared: [V; 2],
}

/// What a ray found among `N` triangles.
pub struct TriangleHits<V> {
    /// Which triangles are hit, a bit each. The other fields are meaningful in these lanes alone.
    pub mask: u32,
    pub t: V,
    pub u: V,
    pub v: V,
}

/// Determinants outside are worked out in `f64`: products overflow, or lose bits to underflow.
const MIN_DETERMINANT: f32 = pow2(-100);
const MAX_DETERMINANT: f32 = pow2(126);

impl<const N: usize, V: Vector<N>> RayShear<N, V> {
    #[inline(always)]
    pub(crate) fn new(token: V::Token, ray: &PreparedRay) -> Self {
        Self {
            origin: ray.axes.map(|axis| V::splat(token, ray.origin[axis])),
            shear: ray.shear.map(|s| V::splat(token, s)),
            axes: ray.axes,
            reciprocal: ray.axes.map(|axis| ray.reciprocal[axis]),
            t_min: V::splat(token, ray.t_min),
        }
    }

    /// Moves and shears vertices, given as arrays of x, of y and of z.
    #[inline(always)]
    pub(crate) fn shear(&self, token: V::Token, vertices: &[[f32; N]; 3]) -> Sheared<V> {
        let [x, y, z] = [0, 1, 2].map(|i| {
            // The axes are 0 to 2; `min` tells the compiler.
            V::load(token, &vertices[self.axes[i].min(2)]) - self.origin[i]
        });
        Sheared {
            relative: [x, y, z],
            sheared: [x - self.shear[0] * z, y - self.shear[1] * z],
        }
    }

    /// The test: `corner(i)` picks corner `i` of each triangle out of a vector of vertices, `lanes`
    /// has a bit for each lane that holds a triangle, `t_max` is the greatest `t` that counts.
    #[inline(always)]
    pub(crate) fn test(
        &self,
        token: V::Token,
        vertices: &Sheared<V>,
        corner: impl Fn(V, usize) -> V,
        lanes: u32,
        t_max: V,
    ) -> Option<TriangleHits<V>> {
        let zero = V::splat(token, 0.0);
        let corners = |vector: V| [0, 1, 2].map(|i| corner(vector, i));
        let [ax, bx, cx] = corners(vertices.sheared[0]);
        let [ay, by, cy] = corners(vertices.sheared[1]);

        let wa = cx * by - cy * bx;
        let wb = ax * cy - ay * cx;
        let wc = bx * ay - by * ax;
        let determinant = wa + wb + wc;
        let (least, most) = (wa.min(wb).min(wc), wa.max(wb).max(wc));
        let finite = determinant.abs().lt(V::splat(token, MAX_DETERMINANT));
        let missed = least.lt(zero) & zero.lt(most) & finite;
        let candidates = lanes & !missed.bits();
        if candidates == 0 {
            return None;
        }

        let certain = (zero.lt(least) | most.lt(zero))
            & finite
            & V::splat(token, MIN_DETERMINANT).lt(determinant.abs());
        let mut mask = candidates & certain.bits();
        let (mut u, mut v) = (wb / determinant, wc / determinant);
        let doubtful = candidates & !mask;
        if doubtful != 0 {
            let corners = [ax, ay, bx, by, cx, cy].map(V::to_array);
            let (mut us, mut vs) = (u.to_array(), v.to_array());
            for lane in bits(doubtful) {
                if let Some(weights) = exact_weights(corners.map(|c| c[lane])) {
                    [us[lane], vs[lane]] = weights;
                    mask |= 1 << lane;
                }
            }
            (u, v) = (V::load(token, &us), V::load(token, &vs));
        }
        if mask == 0 {
            return None;
        }

        let relative = vertices.relative.map(corners);
        let [az, bz, cz] = relative[2];
        let z = az + u * (bz - az) + v * (cz - az);
        let (near, far) = primitive_interval(
            token,
            self.reciprocal,
            relative.map(|[a, b, c]| a.min(b).min(c)),
            relative.map(|[a, b, c]| a.max(b).max(c)),
        );
        let t = z * V::splat(token, self.reciprocal[2]);
        let is_finite = |t: V| t.abs().lt(V::splat(token, f32::INFINITY));
        // Before `t` is moved, too, for that would hide a NaN on some backends.
        let finite = is_finite(t);
        // Adding 0 turns -0 into 0, whose sign `min` and `max` leave open.
        let t = t.max(near).min(far) + zero;
        let in_range = self.t_min.le(t) & t.le(t_max) & finite & is_finite(t);
        mask &= in_range.bits();
        (mask != 0).then_some(TriangleHits {
            mask,
            t,
            u: u + zero,
            v: v + zero,
        })
    }
}

/// The weights of the second and the third corner by the exact signs of the edge functions, or `None` for
/// a miss. The arguments are x and y of the sheared corners.
#[cold]
#[inline(never)]
pub(crate) fn exact_weights(corners: [f32; 6]) -> Option<[f32; 2]> {
    let [ax, ay, bx, by, cx, cy] = corners.map(f64::from);
    let wa = cx * by - cy * bx;
    let wb = ax * cy - ay * cx;
    let wc = bx * ay - by * ax;
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    let determinant = wa + wb + wc;
    (inside && determinant != 0.0 && determinant.is_finite())
        .then(|| [(wb / determinant) as f32, (wc / determinant) as f32])
}

/// The places of the bits that are set, the lowest first.
#[inline(always)]
pub(crate) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lowest = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            lowest
        })
    })
}
