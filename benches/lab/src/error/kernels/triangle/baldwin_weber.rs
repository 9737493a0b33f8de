//! By a change of coordinates.

use super::{Hits, Lanes, NO_HITS, TriangleTest, WIDTH, mask};
use glam::{DVec3, Vec3};
use wide_bvh::geometry::Ray;

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
