//! What a ray found.

/// The closest intersection of a ray with a triangle.
///
/// A ray that goes on from here, to be reflected or to look for a light, is not to hit the same surface again. Where it starts
/// is best worked out from `u` and `v`, which is more accurate than [`Ray::at`](super::Ray::at) far from its origin, and
/// moved off the surface, along the triangle's normal, by 10^-5 of the largest coordinate of the scene: rounding takes an
/// eightieth of that. A point to be looked at is moved likewise, for the ends of a [segment](super::Ray::segment) count.
///
/// ```
/// use wide_bvh::{Builder, Ray, TriangleMesh, glam::Vec3};
///
/// let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2_u32]])?;
/// let bvh = Builder::new().build(&mesh)?;
/// let ray = Ray::new([0.3, 0.3, 1.0], [0.0, 0.0, -1.0]);
/// let hit = bvh.closest_hit(&ray).unwrap();
///
/// let [a, b, c] = mesh.triangle(hit.primitive as usize).unwrap();
/// let normal = (b - a).cross(c - a).normalize();
/// let outwards = if normal.dot(ray.direction) < 0.0 { normal } else { -normal };
/// let largest = bvh.bounds().min.abs().max(bvh.bounds().max.abs()).max_element();
/// let point = a + hit.u * (b - a) + hit.v * (c - a) + 1e-5 * largest * outwards;
/// let light = [0.0, 0.0, 9.0];
/// assert!(!bvh.any_hit(&Ray::segment(point, light)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Where along the ray, in multiples of its direction. Within the ray's range.
    pub t: f32,
    /// Barycentric weight of the triangle's second corner, 0 to 1.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner, 0 to 1. The first has `1 - u - v`.
    pub v: f32,
    /// Which triangle, by its place in the mesh.
    pub primitive: u32,
}
