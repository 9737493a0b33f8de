//! The triangle test in `f32` alone: what it gives up, and what it does not.

use crate::common::{SEED, part};
use glam::Vec3;
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    simd::Backend,
};
use wide_bvh_scenes::{Mesh, shapes};

fn vector(random: &mut fastrand::Rng) -> Vec3 {
    Vec3::from([(); 3].map(|()| random.f32() - 0.5))
}

fn view(mesh: &Mesh) -> TriangleMesh<'_> {
    TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap()
}

/// Closed meshes hold rays in: at vertices, at edges, at faces, along axes.
#[test]
fn no_ray_gets_out() {
    println!("seed {SEED}");
    let mut random = fastrand::Rng::with_seed(SEED);
    for mesh in [
        shapes::icosphere(4),
        shapes::quantised(shapes::icosphere(4), 64),
        shapes::icosphere(3).moved(|p| p * Vec3::new(1.0e3, 1.0, 1.0e-3)),
        shapes::cuboid([-1.0; 3], [1.0; 3]),
    ] {
        let (min, max) = mesh.bounds();
        let (min, max) = (Vec3::from(min), Vec3::from(max));
        let centre = ((min + max) * 0.5).round();
        let mut bvh = Builder::new().build(&view(&mesh)).unwrap();
        for backend in Backend::available() {
            bvh.set_backend(backend);
            let approximate = bvh.approximate();
            for i in 0..part(40_000) {
                let [a, b, _] = mesh.indices[random.usize(..mesh.indices.len())]
                    .map(|corner| Vec3::from(mesh.positions[corner as usize]));
                let direction = match i % 5 {
                    0 => a - centre,
                    1 => (a + b) * 0.5 - centre,
                    2 => a + random.f32() * (b - a) - centre,
                    3 => Vec3::AXES[random.usize(..3)],
                    _ => vector(&mut random),
                };
                if direction == Vec3::ZERO {
                    continue;
                }
                let ray = Ray::new(centre, direction);
                let hit = approximate.closest_hit(&ray);
                assert!(hit.is_some(), "{} leaks at {ray:?}", mesh.name);
                assert!(approximate.any_hit(&ray));
            }
        }
    }
}

/// In a scene without needles answers are those of the exact test, but for rounding; by every call.
#[test]
fn ordinary_answers_are_alike() {
    let mut random = fastrand::Rng::with_seed(SEED);
    let mesh = shapes::torus_knot(2, 3, 0.3, 120, 16);
    let bvh = Builder::new().build(&view(&mesh)).unwrap();
    let approximate = bvh.approximate();
    let rays: Vec<Ray> = (0..part(20_000))
        .map(|_| {
            let origin = 8.0 * vector(&mut random);
            Ray::new(origin, 2.0 * vector(&mut random) - origin)
        })
        .collect();
    let mut hits = vec![None; rays.len()];
    approximate.closest_hits(&rays, &mut hits);
    let (mut hit, mut other) = (0, 0);
    for (ray, batched) in rays.iter().zip(&hits) {
        let (exact, one) = (bvh.closest_hit(ray), approximate.closest_hit(ray));
        assert_eq!(one.is_some(), approximate.any_hit(ray));
        for found in [one, *batched] {
            let alike = match (exact, found) {
                (None, None) => true,
                (Some(a), Some(b)) => (a.t - b.t).abs() < 1e-4 * a.t.abs(),
                _ => false,
            };
            other += usize::from(!alike);
        }
        hit += usize::from(exact.is_some());
    }
    assert!(hit > rays.len() / 10, "{hit}");
    // Where an outline is met within rounding.
    assert!(other <= rays.len() / 1000, "{other}");
}

/// No bits of a mesh or a ray make it panic or find what is no triangle, out of range or not a number.
#[test]
fn any_bits() {
    let mut random = fastrand::Rng::with_seed(SEED);
    for _ in 0..part(300) {
        let wild = random.bool();
        let number = |random: &mut fastrand::Rng| match wild {
            true => f32::from_bits(random.u32(..)),
            false => random.i8(-3..=3).into(),
        };
        let positions: Vec<[f32; 3]> = (0..30)
            .map(|_| [(); 3].map(|()| number(&mut random)))
            .collect();
        let indices: Vec<[u32; 3]> = (0..40)
            .map(|_| [(); 3].map(|()| random.u32(..30)))
            .collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let mut bvh = Builder::new().drop_non_finite(true).build(&mesh).unwrap();
        for backend in Backend::available() {
            bvh.set_backend(backend);
            for _ in 0..20 {
                let mut point = || [(); 3].map(|()| number(&mut random));
                let (origin, direction) = (point(), point());
                let range = point();
                let ray = Ray::new(origin, direction).with_range(range[0], range[1]);
                let approximate = bvh.approximate();
                let found: Option<Hit> = approximate.closest_hit(&ray);
                assert_eq!(found.is_some(), approximate.any_hit(&ray), "{ray:?}");
                if let Some(Hit { t, primitive, .. }) = found {
                    assert!(ray.t_min <= t && t <= ray.t_max && t.is_finite());
                    assert!((primitive as usize) < indices.len());
                }
            }
        }
    }
}
