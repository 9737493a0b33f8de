//! Ways to test a ray against eight triangles.

use glam::{DVec3, Vec3};
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

/// Bits of the lanes that are hit.
#[inline(always)]
fn mask(hit: [bool; WIDTH]) -> u32 {
    let mut mask = 0;
    for (lane, hit) in hit.into_iter().enumerate() {
        mask |= u32::from(hit) << lane;
    }
    mask
}

/// Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997), with the edges worked out beforehand.
pub struct MollerTrumbore;

pub struct CornerAndEdges {
    corner: Vectors,
    edge1: Vectors,
    edge2: Vectors,
}

macro_rules! moller_trumbore {
    ($float:ty, $origin:ident, $direction:ident, $corner:ident, $edge1:ident, $edge2:ident) => {{
        let [dx, dy, dz] = $direction;
        let ([e1x, e1y, e1z], [e2x, e2y, e2z]) = ($edge1, $edge2);
        let (px, py, pz) = (
            dy * e2z - dz * e2y,
            dz * e2x - dx * e2z,
            dx * e2y - dy * e2x,
        );
        let determinant = e1x * px + e1y * py + e1z * pz;
        let inverse = 1.0 / determinant;
        let (sx, sy, sz) = (
            $origin[0] - $corner[0],
            $origin[1] - $corner[1],
            $origin[2] - $corner[2],
        );
        let u: $float = (sx * px + sy * py + sz * pz) * inverse;
        let (qx, qy, qz) = (
            sy * e1z - sz * e1y,
            sz * e1x - sx * e1z,
            sx * e1y - sy * e1x,
        );
        let v: $float = (dx * qx + dy * qy + dz * qz) * inverse;
        let t: $float = (e2x * qx + e2y * qy + e2z * qz) * inverse;
        // Not `&&`: without branches it is vectorised.
        let inside = (determinant != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0);
        (inside, t as f32, u as f32, v as f32)
    }};
}

#[inline(always)]
fn lane(vectors: &Vectors, lane: usize) -> [f32; 3] {
    [vectors[0][lane], vectors[1][lane], vectors[2][lane]]
}

impl TriangleTest for MollerTrumbore {
    type Triangles = CornerAndEdges;
    type Ray = [[f32; 3]; 2];

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> CornerAndEdges {
        CornerAndEdges {
            corner: vectors(corners, |[a, ..]| *a),
            edge1: vectors(corners, |[a, b, _]| b - a),
            edge2: vectors(corners, |[a, _, c]| c - a),
        }
    }

    #[inline(always)]
    fn ray(ray: &Ray) -> [[f32; 3]; 2] {
        [ray.origin.to_array(), ray.direction.to_array()]
    }

    #[inline(always)]
    fn test(triangles: &CornerAndEdges, ray: &[[f32; 3]; 2], range: [f32; 2]) -> (u32, Hits) {
        let [origin, direction] = *ray;
        let mut hits = NO_HITS;
        let mut hit = [false; WIDTH];
        for (i, hit) in hit.iter_mut().enumerate() {
            let corner = lane(&triangles.corner, i);
            let (edge1, edge2) = (lane(&triangles.edge1, i), lane(&triangles.edge2, i));
            let (inside, t, u, v) = moller_trumbore!(f32, origin, direction, corner, edge1, edge2);
            (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
            *hit = inside & (t >= range[0]) & (t <= range[1]);
        }
        (mask(hit), hits)
    }
}

/// The same in `f64`, from the corners on, with `t`, `u` and `v` rounded in the end.
pub struct MollerTrumbore64;

impl TriangleTest for MollerTrumbore64 {
    type Triangles = [Vectors; 3];
    type Ray = [[f64; 3]; 2];

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> [Vectors; 3] {
        [0, 1, 2].map(|corner| vectors(corners, |corners| corners[corner]))
    }

    #[inline(always)]
    fn ray(ray: &Ray) -> [[f64; 3]; 2] {
        [
            ray.origin.as_dvec3().to_array(),
            ray.direction.as_dvec3().to_array(),
        ]
    }

    #[inline(always)]
    fn test(triangles: &[Vectors; 3], ray: &[[f64; 3]; 2], range: [f32; 2]) -> (u32, Hits) {
        let [origin, direction] = *ray;
        let mut hits = NO_HITS;
        let mut hit = [false; WIDTH];
        for (i, hit) in hit.iter_mut().enumerate() {
            let [corner, b, c] = [0, 1, 2].map(|c| lane(&triangles[c], i).map(f64::from));
            let edge1 = [b[0] - corner[0], b[1] - corner[1], b[2] - corner[2]];
            let edge2 = [c[0] - corner[0], c[1] - corner[1], c[2] - corner[2]];
            let (inside, t, u, v) = moller_trumbore!(f64, origin, direction, corner, edge1, edge2);
            (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
            *hit = inside & (t >= range[0]) & (t <= range[1]);
        }
        (mask(hit), hits)
    }
}

/// Baldwin and Weber, "Fast Ray-Triangle Intersections by Coordinate Transformation" (JCGT 2016): a matrix a triangle that
/// takes it to the unit triangle, worked out in `f64` and then rounded. Stored whole, its 0s and 1s included, so that eight
/// triangles of any orientation go together; that changes no result.
pub struct BaldwinWeber;

/// Three rows of four numbers.
pub type Matrices = [[Lanes; 4]; 3];

/// The matrix of one triangle. One without area is never hit: its numbers are NaN.
fn matrix(corners: &[Vec3; 3]) -> [[f32; 4]; 3] {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let (edge1, edge2) = (b - a, c - a);
    let normal = edge1.cross(edge2);
    let fixed = {
        let size = normal.abs();
        let largest = size.max_element();
        (0..3).position(|axis| size[axis] == largest).unwrap_or(0)
    };
    // The triangle is moved along this axis, so the weights do not depend on it.
    let free = DVec3::AXES[fixed];
    let scale = 1.0 / normal[fixed];
    // Rows that are 1 at one corner and 0 at the two others, wherever along `free`.
    let u = edge2.cross(free) * scale;
    let v = free.cross(edge1) * scale;
    let plane = normal * scale;
    [(u, -u.dot(a)), (v, -v.dot(a)), (plane, -plane.dot(a))]
        .map(|(row, last)| [row.x, row.y, row.z, last].map(|x| x as f32))
}

impl TriangleTest for BaldwinWeber {
    type Triangles = Matrices;
    type Ray = [[f32; 3]; 2];

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> Matrices {
        let matrices = corners.each_ref().map(matrix);
        [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| matrices.map(|matrix| matrix[row][column])))
    }

    #[inline(always)]
    fn ray(ray: &Ray) -> [[f32; 3]; 2] {
        [ray.origin.to_array(), ray.direction.to_array()]
    }

    #[inline(always)]
    fn test(matrices: &Matrices, ray: &[[f32; 3]; 2], range: [f32; 2]) -> (u32, Hits) {
        let [[ox, oy, oz], [dx, dy, dz]] = *ray;
        let mut hits = NO_HITS;
        let mut hit = [false; WIDTH];
        for (i, hit) in hit.iter_mut().enumerate() {
            let at = |row: usize, column: usize| matrices[row][column][i];
            let height = at(2, 0) * ox + at(2, 1) * oy + at(2, 2) * oz + at(2, 3);
            let speed = at(2, 0) * dx + at(2, 1) * dy + at(2, 2) * dz;
            let t = -height / speed;
            let (x, y, z) = (ox + t * dx, oy + t * dy, oz + t * dz);
            let u = at(0, 0) * x + at(0, 1) * y + at(0, 2) * z + at(0, 3);
            let v = at(1, 0) * x + at(1, 1) * y + at(1, 2) * z + at(1, 3);
            (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
            let inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0);
            *hit = inside & (t >= range[0]) & (t <= range[1]);
        }
        (mask(hit), hits)
    }
}

/// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013). With `F64` an edge function that comes out
/// zero is worked out again in `f64`, as published; without, it counts as zero.
pub struct Woop<const F64: bool>;

/// What Woop's test needs of a ray.
#[derive(Clone, Copy)]
pub struct ShearedRay {
    origin: [f32; 3],
    axes: [usize; 3],
    shear: [f32; 3],
}

impl<const F64: bool> TriangleTest for Woop<F64> {
    type Triangles = [Vectors; 3];
    type Ray = ShearedRay;

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> [Vectors; 3] {
        MollerTrumbore64::triangles(corners)
    }

    #[inline(always)]
    fn ray(ray: &Ray) -> ShearedRay {
        let size = ray.direction.abs();
        let kz = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if ray.direction[kz] < 0.0 {
            (kx, ky) = (ky, kx);
        }
        let d = ray.direction;
        ShearedRay {
            origin: ray.origin.to_array(),
            axes: [kx, ky, kz],
            shear: [d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]],
        }
    }

    #[inline(always)]
    fn test(corners: &[Vectors; 3], ray: &ShearedRay, range: [f32; 2]) -> (u32, Hits) {
        let [kx, ky, kz] = ray.axes.map(|axis| axis % 3);
        let [sx, sy, sz] = ray.shear;
        let [ox, oy, oz] = [ray.origin[kx], ray.origin[ky], ray.origin[kz]];
        let mut hits = NO_HITS;
        let mut hit = [false; WIDTH];
        let mut zero = [false; WIDTH];
        let mut sheared = [[[0.0; WIDTH]; 3]; 3];
        for (corner, sheared) in corners.iter().zip(&mut sheared) {
            let (xs, ys, zs) = (&corner[kx], &corner[ky], &corner[kz]);
            for i in 0..WIDTH {
                let z = zs[i] - oz;
                sheared[0][i] = xs[i] - ox - sx * z;
                sheared[1][i] = ys[i] - oy - sy * z;
                sheared[2][i] = sz * z;
            }
        }
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = &sheared;
        for i in 0..WIDTH {
            let wa = cx[i] * by[i] - cy[i] * bx[i];
            let wb = ax[i] * cy[i] - ay[i] * cx[i];
            let wc = bx[i] * ay[i] - by[i] * ax[i];
            let (inside, t, u, v) = weigh([wa, wb, wc], [az[i], bz[i], cz[i]]);
            (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
            hit[i] = inside & (t >= range[0]) & (t <= range[1]);
            zero[i] = (wa == 0.0) | (wb == 0.0) | (wc == 0.0);
        }
        let mut hit = mask(hit);
        if F64 {
            let mut again = mask(zero);
            while again != 0 {
                let i = again.trailing_zeros() as usize % WIDTH;
                again &= again - 1;
                let edge = |px: f32, qy: f32, py: f32, qx: f32| {
                    (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
                };
                let weights = [
                    edge(cx[i], by[i], cy[i], bx[i]),
                    edge(ax[i], cy[i], ay[i], cx[i]),
                    edge(bx[i], ay[i], by[i], ax[i]),
                ];
                let (inside, t, u, v) = weigh(weights, [az[i], bz[i], cz[i]]);
                (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
                let in_range = (t >= range[0]) & (t <= range[1]);
                hit = hit & !(1 << i) | u32::from(inside & in_range) << i;
            }
        }
        (hit, hits)
    }
}

/// Whether the weights have one sign, and `t`, `u` and `v` by them.
#[inline(always)]
fn weigh([wa, wb, wc]: [f32; 3], [az, bz, cz]: [f32; 3]) -> (bool, f32, f32, f32) {
    let outside = ((wa < 0.0) | (wb < 0.0) | (wc < 0.0)) & ((wa > 0.0) | (wb > 0.0) | (wc > 0.0));
    let determinant = wa + wb + wc;
    let inverse = 1.0 / determinant;
    let t = (wa * az + wb * bz + wc * cz) * inverse;
    (
        !outside & (determinant != 0.0),
        t,
        wb * inverse,
        wc * inverse,
    )
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
