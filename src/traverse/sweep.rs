//! The tests without a walk: what a ray meets of a plain list of nodes or leaves.
//!
//! For a handful of boxes or triangles that need no tree, and to measure how fast the tests are by themselves.

use super::bundle;
use crate::{
    geometry::{Aabb, Ray},
    layout::{TriangleLeaf, Triangles, WideNode},
    primitive::triangle::{RayShear, Where},
    simd::{Backend, Lanes, Operation, Simd},
    slab::{NarrowRay, PreparedRay, reach_of},
};

/// How many children of `nodes`, all within `bounds`, the ray passes the boxes of. 0 for a ray that can hit nothing.
pub fn count_boxes<N: WideNode>(backend: Backend, nodes: &[N], bounds: &Aabb, ray: &Ray) -> u32 {
    struct Boxes<'a, N>(&'a [N], &'a Aabb, &'a Ray);
    impl<N: WideNode> Operation for Boxes<'_, N> {
        type Output = u32;
        #[inline(always)]
        fn run<T: Simd>(self, token: T) -> u32 {
            let (mut scaled, mut room) = (PreparedRay::ROOM, NarrowRay::ROOM);
            let Some(prepared) = PreparedRay::new(self.2, &mut scaled) else {
                return 0;
            };
            let narrow = NarrowRay::new(&prepared, self.1, N::WIDTH, &mut room);
            let slabs = N::widen(token, narrow);
            let t_max =
                N::Lanes::<T>::splat(token, reach_of(prepared.ray.t_max, N::margin(&slabs)));
            let mut passed = 0;
            // No closure: it would not inherit the target's features.
            for node in self.0 {
                passed += node.test(token, &slabs, t_max).0.count_ones();
            }
            passed
        }
    }
    backend.run(Boxes(nodes, bounds, ray))
}

/// How many children of `nodes`, all within `bounds`, up to 64 rays pass the boxes of, tested all at once as a batch tests
/// rays that are alike: at least those that any of them passes the boxes of. `None` if they are not alike.
pub fn count_boxes_of_bundle<N: WideNode>(
    backend: Backend,
    nodes: &[N],
    bounds: &Aabb,
    rays: &[Ray],
) -> Option<u32> {
    struct Boxes<'a, N>(&'a [N], &'a Aabb, &'a [Ray]);
    impl<N: WideNode> Operation for Boxes<'_, N> {
        type Output = Option<u32>;
        #[inline(always)]
        fn run<T: Simd>(self, token: T) -> Option<u32> {
            bundle::count_boxes(token, self.0, self.1, self.2)
        }
    }
    backend.run(Boxes(nodes, bounds, rays))
}

/// How many triangles of `leaves` the ray hits within its range.
pub fn count_triangles(backend: Backend, leaves: &[TriangleLeaf], ray: &Ray) -> u32 {
    struct Triangles<'a>(&'a [TriangleLeaf], &'a Ray);
    impl Operation for Triangles<'_> {
        type Output = u32;
        #[inline(always)]
        fn run<T: Simd>(self, token: T) -> u32 {
            let mut room = PreparedRay::ROOM;
            let Some(prepared) = PreparedRay::new(self.1, &mut room) else {
                return 0;
            };
            let shear = RayShear::new(&prepared, prepared.along());
            let mut count = 0;
            for leaf in self.0 {
                if let Some(hits) = leaf.test::<T, Where>(token, &shear, prepared.ray.t_max) {
                    count += hits.mask.count_ones();
                }
            }
            count
        }
    }
    backend.run(Triangles(leaves, ray))
}
