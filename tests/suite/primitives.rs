//! A caller's own primitives: spheres, boxes, and a primitive whose test is wrong on purpose.

use crate::common::{any_float, config, point};
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{
    build::Builder,
    geometry::{Aabb, Ray},
    layout::{Bvh, CompactNode4, CompactNode8, Node4, Node8},
    primitive::{Cuboids, Primitives, Sphere, Spheres},
    reference,
    simd::Backend,
};

/// Holds a hierarchy to the reference: a macro, for those of different leaves share no trait of their queries.
macro_rules! check_hierarchy {
    ($built:expr, $name:expr, $primitives:expr, $count:expr, $rays:expr) => {
        let mut bvh = $built.unwrap();
        for backend in Backend::available() {
            bvh.set_backend(backend);
            for ray in $rays {
                let expected = reference::closest_primitive($primitives, $count, ray);
                let found = bvh.closest_hit($primitives, ray);
                let bits = |hit: Option<(f32, u32)>| hit.map(|(t, id)| (t.to_bits(), id));
                prop_assert_eq!(
                    bits(found.map(|hit| (hit.t, hit.primitive))),
                    bits(expected.map(|hit| (hit.t, hit.primitive))),
                    "{}, {:?}, {:?}",
                    $name,
                    backend,
                    ray
                );
                prop_assert_eq!(bvh.any_hit($primitives, ray), expected.is_some());
            }
        }
    };
}

fn check<P: Primitives>(primitives: &P, count: usize, rays: &[Ray]) -> Result<(), TestCaseError> {
    let (builder, count) = (Builder::new(), count as u32);
    let aabbs: Vec<Aabb> = (0..count).map(|i| primitives.aabb(i)).collect();
    let eight = builder.build_primitives::<Node8>(&aabbs);
    check_hierarchy!(eight, "8 wide", primitives, count, rays);
    let four = builder.build_primitives::<Node4>(&aabbs);
    check_hierarchy!(four, "4 wide", primitives, count, rays);
    let eight = builder.build_compact_primitives::<CompactNode8>(&aabbs);
    check_hierarchy!(eight, "compact, 8 wide", primitives, count, rays);
    let four = builder.build_compact_primitives::<CompactNode4>(&aabbs);
    check_hierarchy!(four, "compact, 4 wide", primitives, count, rays);
    Ok(())
}

fn rays() -> impl Strategy<Value = Vec<Ray>> {
    let ordinary = (point(), point()).prop_map(|(o, d)| Ray::new(o, d));
    let any = || [any_float(), any_float(), any_float()];
    let raw = (any(), any(), any_float(), any_float())
        .prop_map(|(o, d, t_min, t_max)| Ray::new(o, d).with_range(t_min, t_max));
    prop::collection::vec(prop_oneof![4 => ordinary, 1 => raw], 30)
}

/// Says yes to any ray, at a `t` that has nothing to do with it. The contract holds all the same.
struct Liar(Vec<Aabb>);

impl Primitives for Liar {
    type Detail = u32;

    fn aabb(&self, primitive: u32) -> Aabb {
        self.0[primitive as usize]
    }

    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, u32)> {
        let noise = (ray.direction.x * 1e4 + primitive as f32).sin();
        Some((noise * 10.0, primitive))
    }
}

fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
    let aabb = (point(), point()).prop_map(|(a, b)| Aabb::from_points([a.into(), b.into()]));
    prop::collection::vec(aabb, 1..50)
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn spheres(
        spheres in prop::collection::vec(
            (point(), 0.0f32..1.5).prop_map(|(c, radius)| Sphere { center: c.into(), radius }),
            1..50,
        ),
        rays in rays(),
    ) {
        check(&Spheres(&spheres), spheres.len(), &rays)?;
    }

    #[test]
    fn cuboids(boxes in boxes(), rays in rays()) {
        check(&Cuboids(&boxes), boxes.len(), &rays)?;
    }

    #[test]
    fn a_wrong_test_is_wrong_alike(boxes in boxes(), rays in rays()) {
        let count = boxes.len();
        check(&Liar(boxes), count, &rays)?;
    }
}

/// Whatever its own test says.
#[test]
fn what_has_no_box_is_never_hit() {
    let place = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
    let endless = Aabb::new(Vec3::splat(-1.0), Vec3::INFINITY);
    let liar = Liar(vec![Aabb::EMPTY, place, endless, Aabb::EMPTY]);
    let builder = Builder::new().drop_non_finite(true);
    let bvh: Bvh<Node8, _, _> = builder.build_primitives(&liar.0).unwrap();
    let mut hits = 0;
    for i in 0..100 {
        let ray = Ray::new(
            [-9.0, 0.02 * i as f32, 0.0],
            [1.0 + 0.01 * i as f32, 0.0, 0.0],
        );
        let hit = bvh.closest_hit(&liar, &ray);
        assert_eq!(hit, reference::closest_primitive(&liar, 4, &ray));
        assert!(hit.is_none_or(|hit| hit.primitive == 1));
        hits += usize::from(hit.is_some());
    }
    assert!((5..95).contains(&hits), "{hits} hits");
}

#[test]
fn a_sphere_is_hit_where_it_is() {
    let spheres = [
        Sphere {
            center: Vec3::new(0.0, 0.0, 5.0),
            radius: 1.0,
        },
        Sphere {
            center: Vec3::new(0.0, 0.0, 9.0),
            radius: 2.0,
        },
    ];
    let primitives = Spheres(&spheres);
    let aabbs: Vec<Aabb> = (0..2).map(|i| primitives.aabb(i)).collect();
    let bvh: Bvh<Node8, _, _> = Builder::new().build_primitives(&aabbs).unwrap();
    let hit = |ray: Ray| {
        bvh.closest_hit(&primitives, &ray)
            .map(|hit| (hit.t, hit.primitive))
    };
    let ahead = Ray::new([0.0; 3], [0.0, 0.0, 2.0]);
    assert_eq!(hit(ahead), Some((2.0, 0)));
    // From inside the first sphere: its far side.
    assert_eq!(hit(ahead.with_range(2.5, 10.0)), Some((3.0, 0)));
    assert_eq!(hit(ahead.with_range(3.25, 10.0)), Some((3.5, 1)));
    assert_eq!(hit(Ray::new([0.0; 3], [0.0, 1.0, 0.0])), None);
}
