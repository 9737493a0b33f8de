//! What a ray found.

/// The closest intersection of a ray with a triangle.
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
