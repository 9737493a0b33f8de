//! Closest hit and any hit over triangles.

#[cfg(feature = "std")]
use super::compiled;
use super::{
    Counts,
    count::Counting,
    one_by_one,
    single::{Visitor, walk},
};
use crate::{
    geometry::{Hit, Ray},
    layout::{Bvh, Storage, TriangleLeaves, Triangles, WideNode, number_at},
    primitive::triangle::{RayShear, TriangleHits, Where, bits},
    simd::{Lanes, Operation, Simd},
    slab::{NarrowRay, PreparedRay},
};
use core::ops::ControlFlow;

impl<N: WideNode, L: TriangleLeaves, S: Storage> Bvh<N, L, S> {
    /// The closest triangle that the ray hits: of all within its range the one of least `t`, of equal
    /// ones the one of least number.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        #[cfg(feature = "std")]
        if Self::IS_BVH8 {
            return compiled::closest_hit(self.as_bvh8(), ray);
        }
        closest_hit(self, ray)
    }

    /// Whether the ray hits anything within its range: just when [`closest_hit`](Self::closest_hit)
    /// finds something, and sooner.
    #[inline]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        #[cfg(feature = "std")]
        if Self::IS_BVH8 {
            return compiled::any_hit(self.as_bvh8(), ray);
        }
        any_hit(self, ray)
    }

    /// [`closest_hit`](Self::closest_hit), and what it cost.
    pub fn closest_hit_counted(&self, ray: &Ray) -> (Option<Hit>, Counts) {
        self.backend().run(ClosestCounted { bvh: self, ray })
    }

    /// [`any_hit`](Self::any_hit), and what it cost.
    pub fn any_hit_counted(&self, ray: &Ray) -> (bool, Counts) {
        self.backend().run(AnyCounted { bvh: self, ray })
    }
}

#[inline(always)]
pub(super) fn closest_hit<N: WideNode, L: TriangleLeaves, S: Storage>(
    bvh: &Bvh<N, L, S>,
    ray: &Ray,
) -> Option<Hit> {
    bvh.backend().run(Closest { bvh, ray })
}

#[inline(always)]
pub(super) fn any_hit<N: WideNode, L: TriangleLeaves, S: Storage>(
    bvh: &Bvh<N, L, S>,
    ray: &Ray,
) -> bool {
    bvh.backend().run(Any { bvh, ray })
}

/// The best hit so far.
#[derive(Clone, Copy, Default)]
pub(super) struct Found {
    pub(super) t: f32,
    pub(super) u: f32,
    pub(super) v: f32,
    /// Its place in the list of primitive numbers, which is read when it is needed.
    pub(super) place: usize,
}

impl Found {
    /// Takes note of the triangles of `leaf` that are hit up to `t_max`, which becomes the best one's. Whether there is a
    /// new best one.
    #[inline(always)]
    pub(super) fn update<T: Simd>(
        token: T,
        best: &mut Option<Self>,
        t_max: &mut f32,
        leaf: impl Triangles,
        shear: &RayShear,
        primitives: &[u32],
    ) -> bool {
        let Some(hits) = leaf.test::<T, Where>(token, shear, *t_max) else {
            return false;
        };
        Self::choose(best, t_max, leaf, hits, primitives)
    }

    /// Takes note of hits in `leaf`, none farther than `t_max`, which becomes the best one's. Whether there is a new
    /// best one.
    #[inline(always)]
    pub(super) fn choose<V: Lanes>(
        best: &mut Option<Self>,
        t_max: &mut f32,
        leaf: impl Triangles,
        hits: TriangleHits<V>,
        primitives: &[u32],
    ) -> bool {
        let mut any_closer = false;
        let (t, u, v) = (hits.t.to_array(), hits.u.to_array(), hits.v.to_array());
        let (t, u, v) = (t.as_ref(), u.as_ref(), v.as_ref());
        for lane in bits(hits.mask) {
            let found = Self {
                t: t[lane],
                u: u[lane],
                v: v[lane],
                place: leaf.first() + lane,
            };
            any_closer |= found.compare(best, t_max, primitives);
        }
        any_closer
    }

    /// Becomes the best one if it is. Whether it did.
    #[inline(always)]
    pub(super) fn compare(
        self,
        best: &mut Option<Self>,
        t_max: &mut f32,
        primitives: &[u32],
    ) -> bool {
        let closer = best.is_none_or(|best| {
            self.t < best.t
                || self.t == best.t
                    && number_at(primitives, self.place) < number_at(primitives, best.place)
        });
        if closer {
            *t_max = self.t;
            *best = Some(self);
        }
        closer
    }

    /// In the caller's terms, of which `t` is.
    #[inline(always)]
    pub(super) fn hit(self, t: f32, primitives: &[u32]) -> Hit {
        Hit {
            t,
            u: self.u,
            v: self.v,
            primitive: number_at(primitives, self.place),
        }
    }
}

struct Closest<'a, N: WideNode, L: TriangleLeaves, S: Storage> {
    bvh: &'a Bvh<N, L, S>,
    ray: &'a Ray,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Operation for Closest<'_, N, L, S> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> Option<Hit> {
        if T::ONE_BY_ONE {
            return one_by_one::find(self.bvh, self.ray, false);
        }
        let mut scaled = PreparedRay::ROOM;
        let prepared = PreparedRay::new(self.ray, &mut scaled)?;
        let mut room = NarrowRay::ROOM;
        let narrow = NarrowRay::new(&prepared, self.bvh.bounds(), N::WIDTH, &mut room);
        let mut visitor = ClosestVisitor::new(token, &prepared, narrow, self.bvh.primitives());
        walk(token, self.bvh, narrow, prepared.ray.t_max, &mut visitor);
        visitor.hit(self.ray, &prepared)
    }
}

struct ClosestCounted<'a, N: WideNode, L: TriangleLeaves, S: Storage> {
    bvh: &'a Bvh<N, L, S>,
    ray: &'a Ray,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Operation for ClosestCounted<'_, N, L, S> {
    type Output = (Option<Hit>, Counts);

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> (Option<Hit>, Counts) {
        let mut scaled = PreparedRay::ROOM;
        let Some(prepared) = PreparedRay::new(self.ray, &mut scaled) else {
            return (None, Counts::default());
        };
        let mut room = NarrowRay::ROOM;
        let narrow = NarrowRay::new(&prepared, self.bvh.bounds(), N::WIDTH, &mut room);
        let primitives = self.bvh.primitives();
        let mut counting = Counting {
            visitor: ClosestVisitor::new(token, &prepared, narrow, primitives),
            counts: Counts::default(),
        };
        walk(token, self.bvh, narrow, prepared.ray.t_max, &mut counting);
        (counting.visitor.hit(self.ray, &prepared), counting.counts)
    }
}

struct Any<'a, N: WideNode, L: TriangleLeaves, S: Storage> {
    bvh: &'a Bvh<N, L, S>,
    ray: &'a Ray,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Operation for Any<'_, N, L, S> {
    type Output = bool;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> bool {
        if T::ONE_BY_ONE {
            return one_by_one::find(self.bvh, self.ray, true).is_some();
        }
        let mut scaled = PreparedRay::ROOM;
        let Some(prepared) = PreparedRay::new(self.ray, &mut scaled) else {
            return false;
        };
        let mut room = NarrowRay::ROOM;
        let narrow = NarrowRay::new(&prepared, self.bvh.bounds(), N::WIDTH, &mut room);
        let mut visitor = AnyVisitor::new(token, &prepared, narrow);
        walk(token, self.bvh, narrow, prepared.ray.t_max, &mut visitor);
        visitor.found
    }
}

struct AnyCounted<'a, N: WideNode, L: TriangleLeaves, S: Storage> {
    bvh: &'a Bvh<N, L, S>,
    ray: &'a Ray,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Operation for AnyCounted<'_, N, L, S> {
    type Output = (bool, Counts);

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> (bool, Counts) {
        let mut scaled = PreparedRay::ROOM;
        let Some(prepared) = PreparedRay::new(self.ray, &mut scaled) else {
            return (false, Counts::default());
        };
        let mut room = NarrowRay::ROOM;
        let narrow = NarrowRay::new(&prepared, self.bvh.bounds(), N::WIDTH, &mut room);
        let mut counting = Counting {
            visitor: AnyVisitor::new(token, &prepared, narrow),
            counts: Counts::default(),
        };
        walk(token, self.bvh, narrow, prepared.ray.t_max, &mut counting);
        (counting.visitor.found, counting.counts)
    }
}

struct ClosestVisitor<'a, T: Simd> {
    token: T,
    shear: RayShear<'a>,
    primitives: &'a [u32],
    t_max: f32,
    found: Option<Found>,
}

impl<'a, T: Simd> ClosestVisitor<'a, T> {
    #[inline(always)]
    fn new(
        token: T,
        prepared: &PreparedRay<'a>,
        narrow: &NarrowRay,
        primitives: &'a [u32],
    ) -> Self {
        Self {
            token,
            shear: RayShear::new(prepared, narrow.along()),
            primitives,
            t_max: prepared.ray.t_max,
            found: None,
        }
    }

    /// What was found, in the caller's terms.
    #[inline(always)]
    fn hit(&self, ray: &Ray, prepared: &PreparedRay) -> Option<Hit> {
        let found = self.found?;
        Some(found.hit(prepared.unscaled(found.t, ray), self.primitives))
    }
}

impl<L: TriangleLeaves, T: Simd> Visitor<L> for ClosestVisitor<'_, T> {
    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32> {
        let Self {
            token,
            shear,
            primitives,
            t_max,
            found,
        } = self;
        if T::IN_FOURS {
            for four in leaf.fours() {
                Found::update(*token, found, t_max, four, shear, primitives);
            }
        } else {
            Found::update(*token, found, t_max, leaf, shear, primitives);
        }
        ControlFlow::Continue(self.t_max)
    }
}

struct AnyVisitor<'a, T: Simd> {
    token: T,
    shear: RayShear<'a>,
    t_max: f32,
    found: bool,
}

impl<'a, T: Simd> AnyVisitor<'a, T> {
    #[inline(always)]
    fn new(token: T, prepared: &PreparedRay<'a>, narrow: &NarrowRay) -> Self {
        Self {
            token,
            shear: RayShear::new(prepared, narrow.along()),
            t_max: prepared.ray.t_max,
            found: false,
        }
    }
}

impl<L: TriangleLeaves, T: Simd> Visitor<L> for AnyVisitor<'_, T> {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32> {
        if leaf.is_hit(self.token, &self.shear, self.t_max) {
            self.found = true;
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(self.t_max)
    }
}
