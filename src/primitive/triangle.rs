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
//! - `t`, `u` and `v` come from `f64`, and from the triangle as given, where those of `f32` would be off by more than a few
//!   roundings of `t`: on needles, on triangles seen nearly edge-on, and on large ones seen from near. So the error of `t`
//!   is bounded whatever the triangle (see [`slab`](crate::slab)), and small.

use core::ops::{Mul, Sub};

use super::exact::{Open, Pair, Pairs, exact_hit};
use crate::{
    geometry::Ray,
    simd::{F32x1, Portable, Simd, Vector, splat3},
    slab::{CONDITION, PreparedRay, UNIT_ROUNDOFF, pow2},
};

/// How much of the triangle test is done.
#[doc(hidden)]
pub trait Precision {
    /// Whether what `f32` leaves open, or has too roughly, is worked out in `f64`. If not, a triangle that the ray passes
    /// through an edge of, as rounded, is hit, and its weights and `t` are those of `f32`.
    const EXACT: bool;
}

/// All of it.
#[derive(Clone, Copy, Debug)]
pub enum Exact {}

/// What there is to do in `f32`.
#[derive(Clone, Copy, Debug)]
pub enum InFloats {}

impl Precision for Exact {
    const EXACT: bool = true;
}

impl Precision for InFloats {
    const EXACT: bool = false;
}

/// What the triangle test needs of a ray. Numbers are spread over the lanes when they are needed: that costs
/// no more than to load a vector, and many rays never get to a leaf.
#[derive(Clone, Copy)]
pub struct RayShear<'a> {
    ray: &'a Ray,
    /// Of the shear.
    axes: &'static [usize; 3],
    /// Of the direction's component along z.
    reciprocal: f32,
}

/// What the test needs to know along a ray, or along as many rays as there are lanes.
#[derive(Clone, Copy)]
pub struct Along<V> {
    /// Of the direction's component along the axis of the shear.
    pub(crate) reciprocal: V,
    /// Least `t` at which a hit counts.
    pub(crate) t_min: V,
}

/// Vertices, one a lane, as the ray sees them: less its origin, along the axes of the shear, and sheared.
#[derive(Clone, Copy)]
pub struct Sheared<V> {
    pub x: V,
    pub y: V,
    /// Not scaled: the distance along the axis of the shear.
    pub z: V,
}

/// x, y and z of the first, second and third corners.
pub type Corners<V> = [[V; 3]; 3];

/// On which sides of triangles' edges a ray passes.
#[derive(Clone, Copy)]
pub struct Edges<V> {
    wa: V,
    wb: V,
    wc: V,
    least: V,
    most: V,
    /// The triangles that may be hit, a bit each.
    pub candidates: u32,
}

impl<V> Edges<V> {
    /// The edge functions of triangles, and which of them, of those that `lanes` has a bit for, may be hit.
    ///
    /// Nothing here is of `z`: most leaves end here, and theirs is never put in order.
    #[inline(always)]
    pub(crate) fn new<const N: usize>(
        token: V::Token,
        [[ax, bx, cx], [ay, by, cy], _]: Corners<V>,
        lanes: u32,
    ) -> Self
    where
        V: Vector<N>,
    {
        let zero = V::splat(token, 0.0);
        let wa = cx * by - cy * bx;
        let wb = ax * cy - ay * cx;
        let wc = bx * ay - by * ax;
        let (least, most) = (wa.min(wb).min(wc), wa.max(wb).max(wc));
        // Signs are right where products overflow, too. Where both do there is none, a NaN, which `min` and `max` pass on, or
        // pass over. Where a corner has overflowed itself they say nothing, but the rest of the test finds a miss there, too.
        let missed = least.lt(zero) & zero.lt(most);
        Self {
            wa,
            wb,
            wc,
            least,
            most,
            candidates: lanes & !missed.bits(),
        }
    }
}

/// What a first look at triangles has brought: their corners as the ray sees them, and which of them it may hit.
#[derive(Clone, Copy)]
pub struct Look<V> {
    corners: Corners<V>,
    edges: Edges<V>,
}

impl<V> Look<V> {
    /// Of triangles with these first, second and third corners, those that `lanes` has a bit for.
    #[inline(always)]
    pub(crate) fn new<const N: usize>(
        token: V::Token,
        [a, b, c]: [Sheared<V>; 3],
        lanes: u32,
    ) -> Self
    where
        V: Vector<N>,
    {
        let corners = [[a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z]];
        let edges = Edges::new(token, corners, lanes);
        Self { corners, edges }
    }

    /// Whether any may be hit.
    #[inline(always)]
    pub(crate) fn may_hit(&self) -> bool {
        self.edges.candidates != 0
    }

    /// The rest of the test, of the same ray: [`Along::test`].
    #[inline(always)]
    pub(crate) fn finish<const N: usize, A: Aim, P: Precision, O: Pairs>(
        self,
        token: V::Token,
        ray: &RayShear,
        t_max: f32,
        pairs: O,
    ) -> TriangleHits<V>
    where
        V: Vector<N>,
    {
        let Self { corners, edges } = self;
        let t_max = V::splat(token, t_max);
        (ray.along(token)).test::<N, A, P, O>(token, corners, edges, t_max, pairs)
    }
}

impl<V> Sheared<V> {
    /// Four of eight: in lane `i` is the one of lane `lanes[i]`.
    #[inline(always)]
    pub(crate) fn pick<S: Simd<F32x8 = V>>(self, token: S, lanes: &[u8; 4]) -> Sheared<S::F32x4> {
        Sheared {
            x: token.pick(self.x, lanes),
            y: token.pick(self.y, lanes),
            z: token.pick(self.z, lanes),
        }
    }

    /// Those in other lanes: in lane `i` is the one of lane `lanes[i]`.
    #[inline(always)]
    pub(crate) fn permute<const N: usize>(self, lanes: &[u8; N]) -> Self
    where
        V: Vector<N>,
    {
        Self {
            x: self.x.permute(lanes),
            y: self.y.permute(lanes),
            z: self.z.permute(lanes),
        }
    }
}

impl<V: Copy + Sub<Output = V> + Mul<Output = V>> Sheared<V> {
    /// Vertices along the axes of the shear, for rays from `origin` with `slope`: how far they go along x and y for one
    /// unit along z.
    #[inline(always)]
    pub(crate) fn new([x, y, z]: [V; 3], origin: [V; 3], slope: [V; 2]) -> Self {
        let (x, y, z) = (x - origin[0], y - origin[1], z - origin[2]);
        Self {
            x: x - slope[0] * z,
            y: y - slope[1] * z,
            z,
        }
    }
}

/// What is to be found out about triangles.
pub trait Aim {
    /// Whether `t` is needed. Else it is enough to know whether any is hit.
    const NEED_T: bool;
    /// Whether it is worth a branch that `f32` leaves nothing open.
    const BRANCHES: bool;
}

/// Whether any is hit.
pub enum Whether {}
impl Aim for Whether {
    const NEED_T: bool = false;
    const BRANCHES: bool = false;
}

/// Where they are hit.
pub enum Where {}
impl Aim for Where {
    const NEED_T: bool = true;
    const BRANCHES: bool = true;
}

/// The same where a branch is guessed badly, since each ray goes its own way, or where code is to be short.
pub enum WhereUnbranched {}
impl Aim for WhereUnbranched {
    const NEED_T: bool = true;
    const BRANCHES: bool = false;
}

/// What a ray found among `N` triangles.
pub struct TriangleHits<V> {
    /// Which triangles are hit, a bit each, if any. The other fields are meaningful in these lanes alone.
    pub mask: u32,
    pub t: V,
    pub u: V,
    pub v: V,
}

/// Determinants outside are worked out in `f64`: products overflow, or lose bits to underflow.
const MIN_DETERMINANT: f32 = pow2(-100);
const MAX_DETERMINANT: f32 = pow2(126);

impl<'a> RayShear<'a> {
    /// `along` is [`PreparedRay::along`].
    #[inline(always)]
    pub(crate) fn new(prepared: &PreparedRay<'a>, along: f32) -> Self {
        Self::of(prepared.ray, prepared.axes, along)
    }

    /// Of a prepared ray, its axes and the reciprocal along the last of them.
    #[inline(always)]
    pub(crate) fn of(ray: &'a Ray, axes: &'static [usize; 3], reciprocal: f32) -> Self {
        Self {
            ray,
            axes,
            reciprocal,
        }
    }

    /// Moves and shears vertices, given as arrays of x, of y and of z.
    #[inline(always)]
    pub(crate) fn shear_arrays<const N: usize, V>(
        &self,
        token: V::Token,
        vertices: &[[f32; N]; 3],
    ) -> Sheared<V>
    where
        V: Vector<N>,
    {
        let [kx, ky, kz] = *self.axes;
        // SAFETY: the axes are those of a prepared ray, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        let vertices = [
            V::load(token, &vertices[kx]),
            V::load(token, &vertices[ky]),
            V::load(token, &vertices[kz]),
        ];
        self.shear_along(token, vertices)
    }

    /// The same of vectors.
    #[inline(always)]
    pub(crate) fn shear<const N: usize, V>(&self, token: V::Token, vertices: [V; 3]) -> Sheared<V>
    where
        V: Vector<N>,
    {
        let [kx, ky, kz] = *self.axes;
        // SAFETY: as above.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        self.shear_along(token, [vertices[kx], vertices[ky], vertices[kz]])
    }

    /// The same of vectors along the axes of the shear.
    #[inline(always)]
    fn shear_along<const N: usize, V>(&self, token: V::Token, vertices: [V; 3]) -> Sheared<V>
    where
        V: Vector<N>,
    {
        let [kx, ky, kz] = *self.axes;
        // SAFETY: the axes are those of a prepared ray, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        // As arrays: glam's index branches.
        let (origin, direction): (&[f32; 3], &[f32; 3]) =
            (self.ray.origin.as_ref(), self.ray.direction.as_ref());
        let origin = splat3(token, [origin[kx], origin[ky], origin[kz]]);
        let slope = [
            V::splat(token, direction[kx] * self.reciprocal),
            V::splat(token, direction[ky] * self.reciprocal),
        ];
        Sheared::new(vertices, origin, slope)
    }

    /// The ray with a triangle.
    #[inline(always)]
    pub(crate) fn pair(&self, corners: &[[f32; 3]; 3]) -> Pair {
        Pair::new(corners, self.ray, self.axes)
    }

    /// What the rest of the test needs of the ray.
    #[inline(always)]
    pub(crate) fn along<const N: usize, V>(&self, token: V::Token) -> Along<V>
    where
        V: Vector<N>,
    {
        Along {
            reciprocal: V::splat(token, self.reciprocal),
            t_min: V::splat(token, self.ray.t_min),
        }
    }
}

impl RayShear<'_> {
    /// One triangle: `t`, `u` and `v` if it is hit within the ray's range up to `t_max`.
    ///
    /// A call, for there to be one of it.
    #[inline(never)]
    pub(crate) fn test_triangle<P: Precision>(
        &self,
        triangle: &[[f32; 3]; 3],
        t_max: f32,
    ) -> Option<[f32; 3]> {
        let token = Portable;
        let [a, b, c] = triangle;
        let (a, b, c): (Sheared<F32x1>, _, _) = (
            self.shear(token, splat3(token, *a)),
            self.shear(token, splat3(token, *b)),
            self.shear(token, splat3(token, *c)),
        );
        let look = Look::new(token, [a, b, c], 1);
        if !look.may_hit() {
            return None;
        }
        let hit = look.finish::<1, WhereUnbranched, P, _>(token, self, t_max, self.pair(triangle));
        (hit.mask != 0).then_some([hit.t.0, hit.u.0, hit.v.0])
    }
}

impl<V> Along<V> {
    /// The triangles, of those that may be hit, that are hit within the ray's range up to `t_max`.
    #[inline(always)]
    pub(crate) fn test<const N: usize, A: Aim, P: Precision, O: Pairs>(
        &self,
        token: V::Token,
        corners: Corners<V>,
        edges: Edges<V>,
        t_max: V,
        pairs: O,
    ) -> TriangleHits<V>
    where
        V: Vector<N>,
    {
        let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = corners;
        let Edges {
            wa,
            wb,
            wc,
            least,
            most,
            candidates,
        } = edges;
        let reciprocal = self.reciprocal;
        let last = (az * reciprocal).max(bz * reciprocal).max(cz * reciprocal);
        let candidates = candidates & self.t_min.le(last).bits();
        let determinant = wa + wb + wc;
        let size = determinant.abs();
        let finite = size.lt(V::splat(token, MAX_DETERMINANT));
        let zero = V::splat(token, 0.0);
        let (ab, ac) = (bz - az, cz - az);
        let (mut u, mut v) = (wb / determinant, wc / determinant);
        let z = az + u * ab + v * ac;
        // Adding 0 turns -0 into 0, for ties to be ties and answers to be the same everywhere.
        let mut t = z * reciprocal + zero;
        if !P::EXACT {
            let inside = (zero.le(least) | most.le(zero)) & finite & zero.lt(size);
            return self.within_range(token, candidates & inside.bits(), [t, u, v], t_max);
        }
        let extent_x = ax.abs().max(bx.abs()).max(cx.abs());
        let extent_y = ay.abs().max(by.abs()).max(cy.abs());
        let depth = ab.abs().max(ac.abs());
        // How far z may be off, twice over, in 2^-19 and beside its own roundings: by those of the edge functions, and,
        // about, of the shear.
        let spread =
            extent_x * extent_y + extent_x.max(extent_y) * (az.abs() * V::splat(token, 0.5));
        let doubt = (spread / size + V::splat(token, 1.0)) * depth;
        // Where nothing overflows or vanishes; the signs are certain, too; and `t` is good enough.
        let ordinary = finite & V::splat(token, MIN_DETERMINANT).lt(size);
        let sound = (zero.lt(least) | most.lt(zero)) & ordinary;
        let precise = ordinary & doubt.le(z.abs() * V::splat(token, CONDITION));
        let certain = sound & precise;

        if A::BRANCHES && candidates & !certain.bits() == 0 {
            return self.within_range(token, candidates, [t, u, v], t_max);
        }

        // How far `t` may be off, twice over: where it cannot matter, no better one is worked out.
        let error = (doubt + az.abs()) * (reciprocal.abs() * V::splat(token, 32.0 * UNIT_ROUNDOFF));
        let (least_t, most_t) = (t - error, t + error);
        let (t_min, infinity) = (self.t_min, V::splat(token, f32::INFINITY));
        // Where `t` has overflowed, it is not known how far it is off.
        let outside = sound & t.abs().lt(infinity) & (most_t.lt(t_min) | t_max.lt(least_t));
        let candidates = candidates & !outside.bits();
        let mut mask = candidates & certain.bits();
        if !A::NEED_T {
            let inside = sound & t_min.le(least_t) & most_t.le(t_max) & most_t.abs().lt(infinity);
            let mask = candidates & inside.bits();
            if mask != 0 {
                return TriangleHits { mask, t, u, v };
            }
        }
        if mask != candidates {
            let (estimates, errors) = (t.to_array(), error.to_array());
            let (sound, precise) = (sound.bits(), precise.bits());
            let sheared = [
                [ax.to_array(), ay.to_array(), az.to_array()],
                [bx.to_array(), by.to_array(), bz.to_array()],
                [cx.to_array(), cy.to_array(), cz.to_array()],
            ];
            for lane in bits(candidates & !mask) {
                let at = lane % N;
                let open = match (sound >> lane & 1, precise >> lane & 1) {
                    (1, _) => Open::Place {
                        about: estimates[at],
                        error: errors[at],
                    },
                    (_, 1) => Open::Signs,
                    _ => Open::Both,
                };
                let mut hit = [0.0; 3];
                if exact_hit(&pairs.pair(lane), &sheared, lane, open, &mut hit) {
                    t = t.replace(token, lane, hit[0]);
                    u = u.replace(token, lane, hit[1]);
                    v = v.replace(token, lane, hit[2]);
                    mask |= 1 << lane;
                }
            }
        }

        self.within_range(token, mask, [t, u, v], t_max)
    }

    /// The hits, of those that `mask` has a bit for, with a `t` in the ray's range up to `t_max`.
    #[inline(always)]
    fn within_range<const N: usize>(
        &self,
        token: V::Token,
        mask: u32,
        [t, u, v]: [V; 3],
        t_max: V,
    ) -> TriangleHits<V>
    where
        V: Vector<N>,
    {
        let (zero, infinity) = (V::splat(token, 0.0), V::splat(token, f32::INFINITY));
        let in_range = self.t_min.le(t) & t.le(t_max) & t.abs().lt(infinity);
        TriangleHits {
            mask: mask & in_range.bits(),
            t,
            u: u + zero,
            v: v + zero,
        }
    }
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
