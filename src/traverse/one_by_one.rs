//! A ray's closest hit, or any, where there are no vectors: boxes and triangles one by one, which is faster there than
//! several at a time, and one piece of code for both questions, for it to be small.

use super::{
    boxes::OneByOne,
    single::{Room, Visitor, walk_boxes},
    triangles::Found,
};
use crate::{
    geometry::{Hit, Ray},
    layout::{Bvh, Child, STACK, Storage, TriangleLeaves, Triangles, WideNode},
    primitive::triangle::RayShear,
    simd::Portable,
    slab::PreparedRay,
};
use core::ops::ControlFlow;

/// The closest hit; or, if `any` is set, one that is not farther than others need be.
#[inline(never)]
pub(super) fn find<N: WideNode, L: TriangleLeaves, S: Storage>(
    bvh: &Bvh<N, L, S>,
    ray: &Ray,
    any: bool,
) -> Option<Hit> {
    // Any ray is room for one. To clear it would be a call.
    let mut scaled = *ray;
    let prepared = PreparedRay::new(ray, &mut scaled)?;
    if bvh.root() == Child::EMPTY {
        return None;
    }
    let reciprocal = prepared.reciprocals(Portable);
    let mut boxes = OneByOne::new(prepared.ray, reciprocal, bvh.bounds());
    let mut finder = Finder {
        shear: RayShear::new(&prepared, prepared.along()),
        primitives: bvh.primitives(),
        t_max: prepared.ray.t_max,
        found: None,
        any,
    };
    let (t_max, room) = (prepared.ray.t_max, Room::<STACK>);
    walk_boxes(Portable, bvh, &mut boxes, t_max, &mut finder, room);
    let found = finder.found?;
    Some(found.hit(prepared.unscaled(found.t, ray), bvh.primitives()))
}

struct Finder<'a> {
    shear: RayShear<'a>,
    primitives: &'a [u32],
    t_max: f32,
    found: Option<Found>,
    any: bool,
}

impl<L: TriangleLeaves> Visitor<L> for Finder<'_> {
    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32> {
        for lane in 0..leaf.count() {
            let triangle = leaf.triangle(lane);
            let hit = (self.shear)
                .test_triangle::<<L::Ref<'_> as Triangles>::Precision>(&triangle, self.t_max);
            if let Some([t, u, v]) = hit {
                let place = leaf.first() + lane;
                let found = Found { t, u, v, place };
                found.compare(&mut self.found, &mut self.t_max, self.primitives);
                if self.any {
                    return ControlFlow::Break(());
                }
            }
        }
        ControlFlow::Continue(self.t_max)
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::{
        build::Builder,
        geometry::TriangleMesh,
        layout::{CompactBvh4, CompactBvh8, Node4, Node8},
        reference,
    };
    use fastrand::Rng;
    use glam::Vec3;
    use wide_bvh_scenes::shapes;

    type Ask<'a> = &'a dyn Fn(&Ray, bool) -> Option<Hit>;

    /// Targets that have vectors never come here but in this test.
    #[test]
    fn gives_the_references_answers() {
        let mut rng = Rng::with_seed(7);
        for mesh in [
            shapes::soup(150, 3),
            shapes::quantised(shapes::icosphere(2), 6),
        ] {
            let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
            let builder = Builder::new();
            let four = builder.build_as::<Node4>(&view).unwrap();
            let eight = builder.build_as::<Node8>(&view).unwrap();
            let compact_four: CompactBvh4 = builder.build_compact(&view).unwrap();
            let compact_eight: CompactBvh8 = builder.build_compact(&view).unwrap();
            let over_four = compact_four.over(&view).unwrap();
            let over_eight = compact_eight.over(&view).unwrap();
            let layouts: [Ask; 4] = [
                &|ray, any| find(&four, ray, any),
                &|ray, any| find(&eight, ray, any),
                &|ray, any| find(&over_four, ray, any),
                &|ray, any| find(&over_eight, ray, any),
            ];
            for number in 0..4000 {
                let mut point = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 12.0 - 3.0;
                let (from, to) = (point(), point());
                let vertex = mesh.positions[rng.usize(..mesh.positions.len())];
                let ray = match number % 4 {
                    0 => Ray::new(from, to - from),
                    1 => Ray::new(from, Vec3::from(vertex) - from),
                    2 => Ray::segment(vertex, to),
                    _ => {
                        let mut any = || f32::from_bits(rng.u32(..));
                        let ray = Ray::new([any(), any(), any()], [any(), any(), any()]);
                        ray.with_range(any(), any())
                    }
                };
                let expected = reference::closest_hit(&view, &ray);
                let bits = |hit: Option<Hit>| {
                    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive])
                };
                for layout in layouts {
                    assert_eq!(bits(layout(&ray, false)), bits(expected), "{ray:?}");
                    assert_eq!(layout(&ray, true).is_some(), expected.is_some(), "{ray:?}");
                }
            }
        }
    }
}
