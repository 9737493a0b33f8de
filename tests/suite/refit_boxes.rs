//! A hierarchy that has followed a caller's primitives answers as the reference does on them where they are.

use crate::common::SEED;
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{
    build::{BuildError, Builder, Preset, RefitError},
    geometry::{Aabb, Ray},
    layout::{CompactBvh8, PrimitiveBvh8},
    primitive::{PrimitiveHit, Primitives},
    reference,
};

/// Boxes that are hit in the middle.
struct Solid(Vec<Aabb>);

impl Primitives for Solid {
    type Detail = ();

    fn aabb(&self, primitive: u32) -> Aabb {
        self.0[primitive as usize]
    }

    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, ())> {
        let center = self.aabb(primitive).center() - ray.origin;
        let t = center.dot(ray.direction) / ray.direction.length_squared();
        (t >= ray.t_min && t <= ray.t_max).then_some((t, ()))
    }
}

/// A hierarchy of either kind.
trait Follows: Sized {
    fn build(builder: &Builder, aabbs: &[Aabb]) -> Self;
    fn follow(&mut self, aabbs: &[Aabb]) -> Result<(), RefitError>;
    fn hit(&self, solid: &Solid, ray: &Ray) -> Option<PrimitiveHit<()>>;
}

impl Follows for PrimitiveBvh8 {
    fn build(builder: &Builder, aabbs: &[Aabb]) -> Self {
        builder.build_primitives(aabbs).unwrap()
    }

    fn follow(&mut self, aabbs: &[Aabb]) -> Result<(), RefitError> {
        self.refit(aabbs)
    }

    fn hit(&self, solid: &Solid, ray: &Ray) -> Option<PrimitiveHit<()>> {
        self.closest_hit(solid, ray)
    }
}

impl Follows for CompactBvh8 {
    fn build(builder: &Builder, aabbs: &[Aabb]) -> Self {
        builder.build_compact_primitives(aabbs).unwrap()
    }

    fn follow(&mut self, aabbs: &[Aabb]) -> Result<(), RefitError> {
        self.refit_primitives(aabbs)
    }

    fn hit(&self, solid: &Solid, ray: &Ray) -> Option<PrimitiveHit<()>> {
        self.closest_hit(solid, ray)
    }
}

fn check<B: Follows>() {
    let mut rng = Rng::with_seed(SEED);
    let random = |rng: &mut Rng| {
        let min = Vec3::new(rng.f32(), rng.f32(), rng.f32());
        Aabb::new(min, min + 0.2 * Vec3::new(rng.f32(), rng.f32(), rng.f32()))
    };
    let mut solid = Solid((0..500).map(|_| random(&mut rng)).collect());
    solid.0[3] = Aabb::EMPTY;
    for preset in [Preset::Fast, Preset::Balanced, Preset::Best] {
        let mut bvh = B::build(&Builder::new().preset(preset), &solid.0);
        for share in [1.0, 0.3, 0.0] {
            let mut moved = Solid(solid.0.clone());
            for (_, aabb) in moved.0.iter_mut().enumerate().filter(|(id, _)| *id != 3) {
                *aabb = match rng.f32() < share {
                    true => random(&mut rng),
                    false => Aabb::EMPTY,
                };
            }
            bvh.follow(&moved.0).unwrap();
            let mut hits = 0;
            for _ in 0..100 {
                let origin = 3.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 1.0;
                let ray = Ray::new(origin, Vec3::splat(0.5) - origin);
                let expected = reference::closest_primitive(&moved, 500, &ray);
                assert_eq!(bvh.hit(&moved, &ray), expected);
                hits += usize::from(expected.is_some());
            }
            assert!(hits > 0 || share == 0.0);
        }
        let mut wrong = solid.0.clone();
        assert_eq!(
            bvh.follow(&wrong[..400]),
            Err(RefitError::PrimitiveGone { primitive: 400 })
        );
        wrong[3] = wrong[4];
        assert_eq!(
            bvh.follow(&wrong),
            Err(RefitError::PrimitiveLeftOut { primitive: 3 })
        );
        wrong[100].min.x = f32::NAN;
        let error = BuildError::NonFiniteBox { primitive: 100 };
        let error = RefitError::Primitive {
            primitive: 100,
            error,
        };
        assert_eq!(bvh.follow(&wrong), Err(error));
    }
}

#[test]
fn full() {
    check::<PrimitiveBvh8>();
}

#[test]
fn compact() {
    check::<CompactBvh8>();
}
