//! How far t, u and v are off, on triangles that `f32` alone has them far off on.

use fastrand::Rng;
use glam::{DMat3, DVec3, Vec3};
use wide_bvh::{Builder, Ray, TriangleMesh};

const SEED: u64 = 17;
const RAYS: usize = 20_000;

/// t, u and v of the floats given, in `f64`.
fn meet(ray: &Ray, corners: [Vec3; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let solution = DMat3::from_cols(ray.direction.as_dvec3(), a - b, a - c).inverse();
    (solution * (a - ray.origin.as_dvec3())).to_array()
}

/// A point in the cube from -1 to 1.
fn point(rng: &mut Rng) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| 2.0 * rng.f64() - 1.0))
}

/// Rays at points well inside of triangles that `triangle` makes, from as far as `distance` says: the error at the 99.9th
/// percentile and the worst, of t relative to it and of u and v.
fn errors(
    mut triangle: impl FnMut(&mut Rng) -> [DVec3; 3],
    distance: impl Fn(&mut Rng) -> f64,
) -> [[f64; 2]; 2] {
    let mut rng = Rng::with_seed(SEED);
    let mut errors = [vec![], vec![]];
    for _ in 0..RAYS {
        let corners = triangle(&mut rng).map(|corner| corner.as_vec3());
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let (u, v) = (0.1 + 0.4 * rng.f64(), 0.1 + 0.3 * rng.f64());
        let target = a + (b - a) * u + (c - a) * v;
        let from = (target + point(&mut rng).normalize() * distance(&mut rng)).as_vec3();
        let ray = Ray::new(from, (target - from.as_dvec3()).as_vec3());
        let exactly = meet(&ray, corners);
        // Where the ray is not nearly in the plane, and the triangle is not nearly a line.
        let normal = (b - a).cross(c - a).normalize();
        let facing = normal.dot(ray.direction.as_dvec3().normalize()).abs();
        if !(facing > 0.05 && exactly[1] > 0.05 && exactly[2] > 0.05) {
            continue;
        }
        let mesh = TriangleMesh::new(&corners, &[[0, 1, 2_u32]]).unwrap();
        let bvh = Builder::new().build(&mesh).unwrap();
        let hit = bvh.closest_hit(&ray).unwrap();
        let off = [hit.t, hit.u, hit.v].map(f64::from);
        errors[0].push((off[0] / exactly[0] - 1.0).abs());
        errors[1].push((off[1] - exactly[1]).abs().max((off[2] - exactly[2]).abs()));
    }
    errors.map(|mut errors| {
        assert!(errors.len() > RAYS / 4, "seed {SEED}");
        errors.sort_by(f64::total_cmp);
        [errors[errors.len() * 999 / 1000], errors[errors.len() - 1]]
    })
}

#[test]
fn large_walls_seen_from_near() {
    let wall = |rng: &mut Rng| [(); 3].map(|()| point(rng) * 100.0);
    let [[t, worst_t], [uv, _]] = errors(wall, |rng| 10.0_f64.powf(-2.0 + 2.0 * rng.f64()));
    // In `f32` alone it is 1e-3.
    assert!(t < 1e-6, "{t:e}");
    assert!(worst_t < 2.0_f64.powi(-15), "{worst_t:e}");
    assert!(uv < 1e-6, "{uv:e}");
}

#[test]
fn needles() {
    let needle = |rng: &mut Rng| {
        let (a, along) = (point(rng), point(rng));
        [a, a + along, a + along * 0.5 + point(rng) * 1e-4]
    };
    let [[t, worst_t], [uv, _]] = errors(needle, |rng| 1.0 + rng.f64());
    assert!(t < 2e-7, "{t:e}");
    assert!(worst_t < 1e-6, "{worst_t:e}");
    assert!(uv < 1e-3, "{uv:e}");
}
