//! By Cramer's rule.

use super::{Hits, NO_HITS, TriangleTest, Vectors, WIDTH, lane, mask, vectors};
use glam::Vec3;
use wide_bvh::geometry::Ray;

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
