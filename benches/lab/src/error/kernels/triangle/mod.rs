//! Ways to test a ray against eight triangles.

mod baldwin_weber;
mod moller_trumbore;
mod woop;

pub use baldwin_weber::BaldwinWeber;
pub use moller_trumbore::{MollerTrumbore, MollerTrumbore64};
pub use woop::Woop;

use glam::Vec3;
use wide_bvh::geometry::Ray;

/// How many boxes and triangles are tested at once.
pub const WIDTH: usize = 8;

/// One number of each of eight triangles.
type Lanes = [f32; WIDTH];

/// A vector of each of eight triangles.
type Vectors = [Lanes; 3];

/// A triangle test.
pub trait TriangleTest: 'static {
    /// Eight triangles in its own form.
    type Triangles: 'static;
    /// What it needs of a ray.
    type Ray: Copy;

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> Self::Triangles;

    fn ray(ray: &Ray) -> Self::Ray;

    /// Which are hit within `range`, a bit each.
    fn test(triangles: &Self::Triangles, ray: &Self::Ray, range: [f32; 2]) -> (u32, Hits);
}

/// Where eight triangles are hit: meaningful for those that are.
pub struct Hits {
    pub t: Lanes,
    pub u: Lanes,
    pub v: Lanes,
}

const NO_HITS: Hits = Hits {
    t: [0.0; WIDTH],
    u: [0.0; WIDTH],
    v: [0.0; WIDTH],
};

/// A vector for each triangle.
fn vectors(corners: &[[Vec3; 3]; WIDTH], of: impl Fn(&[Vec3; 3]) -> Vec3) -> Vectors {
    [0, 1, 2].map(|axis| corners.each_ref().map(|corners| of(corners)[axis]))
}

/// The vector of one triangle.
#[inline(always)]
fn lane(vectors: &Vectors, lane: usize) -> [f32; 3] {
    [vectors[0][lane], vectors[1][lane], vectors[2][lane]]
}

/// Bits of the lanes that are hit.
#[inline(always)]
fn mask(hit: [bool; WIDTH]) -> u32 {
    let mut mask = 0;
    for (lane, hit) in hit.into_iter().enumerate() {
        mask |= u32::from(hit) << lane;
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::truth::{ExactRay, intersect};
    use fastrand::Rng;

    /// Away from edges, every test says what the exact one says, nearly.
    fn agrees_with_the_exact_test<T: TriangleTest>() {
        let mut rng = Rng::with_seed(5);
        let mut point = || Vec3::from([(); 3].map(|()| rng.f32() * 2.0 - 1.0));
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..4000 {
            let corners = [(); WIDTH].map(|()| [point(), point(), point()]);
            let ray = Ray::new(point() * 2.0, point());
            let range = [ray.t_min, ray.t_max];
            let (mask, found) = T::test(&T::triangles(&corners), &T::ray(&ray), range);
            for (lane, corners) in corners.iter().enumerate() {
                let exact = intersect(&ExactRay::from(&ray), *corners);
                let hit = mask >> lane & 1 == 1;
                let Some(exact) = exact else {
                    misses += u32::from(!hit);
                    continue;
                };
                let inner = [exact.u, exact.v, 1.0 - exact.u - exact.v];
                let grazing = exact.t < 1e-2 || exact.t > 20.0;
                if inner.iter().any(|&weight| weight < 1e-2) || grazing {
                    continue;
                }
                let [a, b, c] = *corners;
                let normal = (b - a).cross(c - a).normalize();
                if normal.dot(ray.direction.normalize()).abs() < 1e-2 {
                    continue;
                }
                assert!(hit, "{ray:?} {corners:?}");
                hits += 1;
                let off = |float: f32, exact: f64| (f64::from(float) - exact).abs();
                assert!(off(found.t[lane], exact.t) < 1e-3 * exact.t);
                assert!(off(found.u[lane], exact.u) < 1e-3);
                assert!(off(found.v[lane], exact.v) < 1e-3);
            }
        }
        assert!(hits > 200, "{hits} hits");
        assert!(misses > 26_000, "{misses} misses");
    }

    #[test]
    fn every_test_agrees_with_the_exact_one_away_from_edges() {
        agrees_with_the_exact_test::<MollerTrumbore>();
        agrees_with_the_exact_test::<MollerTrumbore64>();
        agrees_with_the_exact_test::<BaldwinWeber>();
        agrees_with_the_exact_test::<Woop<true>>();
        agrees_with_the_exact_test::<Woop<false>>();
    }
}
