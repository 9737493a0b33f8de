//! Closest hit and any hit over a caller's primitives.

use super::single::{Visitor, walk};
use crate::{
    geometry::Ray,
    layout::{Bvh, Leaves, Listed, PrimitiveLeaf, RunLeaf, Storage, WideNode},
    primitive::{PrimitiveHit, Primitives, custom::intersect},
    simd::{Operation, Simd},
    slab::{NarrowRay, PreparedRay},
};
use core::ops::ControlFlow;

/// Queries over a caller's primitives, which are those that the hierarchy was built on.
macro_rules! impl_queries {
    ($leaf:ty) => {
        impl<N: WideNode, S: Storage> Bvh<N, $leaf, S> {
            /// The closest primitive that the ray hits: the hit of least `t` within the ray's range, and of those of equal `t`
            /// the primitive of least number. `primitives` are those that the hierarchy was built on.
            #[inline]
            pub fn closest_hit<P: Primitives + ?Sized>(
                &self,
                primitives: &P,
                ray: &Ray,
            ) -> Option<PrimitiveHit<P::Detail>> {
                let mut room = PreparedRay::ROOM;
                let prepared = PreparedRay::new(ray, &mut room)?;
                let hit = self.backend().run(Query::<_, $leaf, _, _, true> {
                    bvh: self,
                    primitives,
                    ray,
                    prepared: &prepared,
                })?;
                Some(PrimitiveHit {
                    t: prepared.unscaled(hit.t, ray),
                    ..hit
                })
            }

            /// Whether the ray hits anything within its range: just when [`closest_hit`](Self::closest_hit)
            /// finds something, and sooner.
            #[inline]
            pub fn any_hit<P: Primitives + ?Sized>(&self, primitives: &P, ray: &Ray) -> bool {
                let mut room = PreparedRay::ROOM;
                PreparedRay::new(ray, &mut room).is_some_and(|prepared| {
                    let query = Query::<_, $leaf, _, _, false> {
                        bvh: self,
                        primitives,
                        ray,
                        prepared: &prepared,
                    };
                    self.backend().run(query).is_some()
                })
            }
        }
    };
}

impl_queries!(PrimitiveLeaf);
impl_queries!(RunLeaf);

/// The closest hit if `CLOSEST`, else the first that is met.
struct Query<'a, N: WideNode, L: Leaves, S: Storage, P: ?Sized, const CLOSEST: bool> {
    bvh: &'a Bvh<N, L, S>,
    primitives: &'a P,
    ray: &'a Ray,
    prepared: &'a PreparedRay<'a>,
}

impl<N: WideNode, L, S: Storage, P: Primitives + ?Sized, const CLOSEST: bool> Operation
    for Query<'_, N, L, S, P, CLOSEST>
where
    L: for<'a> Leaves<Ref<'a>: Listed>,
{
    /// `t` is scaled.
    type Output = Option<PrimitiveHit<P::Detail>>;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> Self::Output {
        let (bvh, prepared) = (self.bvh, self.prepared);
        let mut visitor = PrimitiveVisitor {
            query: self,
            found: None,
        };
        let mut room = NarrowRay::ROOM;
        let narrow = NarrowRay::new(prepared, bvh.bounds(), N::WIDTH, &mut room);
        walk(token, bvh, narrow, prepared.ray.t_max, &mut visitor);
        visitor.found
    }
}

struct PrimitiveVisitor<
    'a,
    N: WideNode,
    L: Leaves,
    S: Storage,
    P: Primitives + ?Sized,
    const CLOSEST: bool,
> {
    query: Query<'a, N, L, S, P, CLOSEST>,
    found: Option<PrimitiveHit<P::Detail>>,
}

impl<N: WideNode, L, S: Storage, P: Primitives + ?Sized, const CLOSEST: bool> Visitor<L>
    for PrimitiveVisitor<'_, N, L, S, P, CLOSEST>
where
    L: for<'a> Leaves<Ref<'a>: Listed>,
{
    const NEAREST_FIRST: bool = CLOSEST;

    #[inline(always)]
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32> {
        let Query {
            bvh,
            primitives,
            ray,
            prepared,
        } = self.query;
        for &primitive in &bvh.primitives()[leaf.places()] {
            let Some((t, detail)) = intersect(primitives, primitive, ray, prepared) else {
                continue;
            };
            let closer = self
                .found
                .is_none_or(|best| t < best.t || t == best.t && primitive < best.primitive);
            if closer {
                self.found = Some(PrimitiveHit {
                    t,
                    primitive,
                    detail,
                });
                if !CLOSEST {
                    return ControlFlow::Break(());
                }
            }
        }
        ControlFlow::Continue(self.found.map_or(prepared.ray.t_max, |best| best.t))
    }
}
