//! What a scene is made of and what is asked of it: boxes, rays, hits, triangle meshes.

mod aabb;
mod degenerate;
mod hit;
mod mesh;
mod ray;

pub use aabb::Aabb;
#[cfg(feature = "std")]
pub(crate) use degenerate::has_area;
pub(crate) use degenerate::is_degenerate;
pub use hit::Hit;
pub use mesh::{MeshError, Position, TriangleIndices, TriangleMesh};
pub use ray::Ray;
