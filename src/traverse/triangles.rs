//! Closest hit and any hit over triangles.

use super::{
    Counts,
    count::Counting,
    single::{Visitor, walk},
};
use crate::{
    geometry::{Hit, PreparedRay, Ray},
    layout::{Bvh, Storage, TriangleLeaf, WideNode},
    primitive::triangle::{RayShear, bits},
    simd::{Operation, Simd, Vector},
};
use core::ops::ControlFlow;

impl<N: WideNode, S: Storage> Bvh<N, TriangleLeaf, S> {
    /// The closest triangle that the ray hits: of all within its range the one of least `t`, of equal
    /// ones the one of least number.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let prepared = PreparedRay::new(ray)?;
        let found = self.backend().run(Closest {
            bvh: self,
            ray: &prepared,
        })?;
        Some(found.hit(self.primitives(), ray, &prepared))
    }

    /// Whether the ray hits anything within its range: just when [`closest_hit`](Self::closest_hit)
    /// finds something, and sooner.
    #[inline]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        PreparedRay::new(ray).is_some_and(|prepared| {
            self.backend().run(Any {
                bvh: self,
                ray: &prepared,
            })
        })
    }

    /// [`closest_hit`](Self::closest_hit), and what it cost.
    pub fn closest_hit_counted(&self, ray: &Ray) -> (Option<Hit>, Counts) {
        let Some(prepared) = PreparedRay::new(ray) else {
            return (None, Counts::default());
        };
        let (found, counts) = self.backend().run(ClosestCounted {
            bvh: self,
            ray: &prepared,
        });
        let hit = found.map(|found| found.hit(self.primitives(), ray, &prepared));
        (hit, counts)
    }
}

/// The best hit so far.
#[derive(Clone, Copy)]
struct Found {
    t: f32,
    u: f32,
    v: f32,
    /// Its place in the list of primitive numbers, which is read when it is needed.
    place: usize,
}

impl Found {
    #[inline(always)]
    fn hit(self, primitives: &[u32], ray: &Ray, prepared: &PreparedRay) -> Hit {
        Hit {
            t: prepared.unscaled(self.t, ray),
            u: self.u,
            v: self.v,
            primitive: primitives[self.place],
        }
    }
}

struct Closest<'a, N: WideNode, S: Storage> {
    bvh: &'a Bvh<N, TriangleLeaf, S>,
    ray: &'a PreparedRay,
}

impl<N: WideNode, S: Storage> Operation for Closest<'_, N, S> {
    type Output = Option<Found>;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> Option<Found> {
        let mut visitor = ClosestVisitor::new(token, self.ray, self.bvh.primitives());
        walk(token, self.bvh, self.ray, &mut visitor);
        visitor.found
    }
}

struct ClosestCounted<'a, N: WideNode, S: Storage> {
    bvh: &'a Bvh<N, TriangleLeaf, S>,
    ray: &'a PreparedRay,
}

impl<N: WideNode, S: Storage> Operation for ClosestCounted<'_, N, S> {
    type Output = (Option<Found>, Counts);

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> (Option<Found>, Counts) {
        let mut counting = Counting {
            visitor: ClosestVisitor::new(token, self.ray, self.bvh.primitives()),
            counts: Counts::default(),
        };
        walk(token, self.bvh, self.ray, &mut counting);
        (counting.visitor.found, counting.counts)
    }
}

struct Any<'a, N: WideNode, S: Storage> {
    bvh: &'a Bvh<N, TriangleLeaf, S>,
    ray: &'a PreparedRay,
}

impl<N: WideNode, S: Storage> Operation for Any<'_, N, S> {
    type Output = bool;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> bool {
        let mut visitor = AnyVisitor {
            token,
            shear: RayShear::new(token, self.ray),
            t_max: self.ray.t_max,
            found: false,
        };
        walk(token, self.bvh, self.ray, &mut visitor);
        visitor.found
    }
}

struct ClosestVisitor<'a, T: Simd> {
    token: T,
    shear: RayShear<8, T::F32x8>,
    primitives: &'a [u32],
    t_max: f32,
    found: Option<Found>,
}

impl<'a, T: Simd> ClosestVisitor<'a, T> {
    #[inline(always)]
    fn new(token: T, ray: &PreparedRay, primitives: &'a [u32]) -> Self {
        Self {
            token,
            shear: RayShear::new(token, ray),
            primitives,
            t_max: ray.t_max,
            found: None,
        }
    }
}

impl<T: Simd> Visitor<TriangleLeaf> for ClosestVisitor<'_, T> {
    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn leaf(&mut self, leaf: &TriangleLeaf) -> ControlFlow<(), f32> {
        if let Some(hits) = leaf.test(self.token, &self.shear, self.t_max) {
            let (t, u, v) = (hits.t.to_array(), hits.u.to_array(), hits.v.to_array());
            for lane in bits(hits.mask) {
                let found = Found {
                    t: t[lane],
                    u: u[lane],
                    v: v[lane],
                    place: leaf.first() + lane,
                };
                let closer = self.found.is_none_or(|best| {
                    found.t < best.t
                        || found.t == best.t
                            && self.primitives[found.place] < self.primitives[best.place]
                });
                if closer {
                    self.t_max = found.t;
                    self.found = Some(found);
                }
            }
        }
        ControlFlow::Continue(self.t_max)
    }
}

struct AnyVisitor<T: Simd> {
    token: T,
    shear: RayShear<8, T::F32x8>,
    t_max: f32,
    found: bool,
}

impl<T: Simd> Visitor<TriangleLeaf> for AnyVisitor<T> {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn leaf(&mut self, leaf: &TriangleLeaf) -> ControlFlow<(), f32> {
        if leaf.test(self.token, &self.shear, self.t_max).is_some() {
            self.found = true;
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(self.t_max)
    }
}
