//! Ray against primitives: triangles, and whatever a caller brings.

mod cuboid;
pub(crate) mod custom;
pub(crate) mod exact;
mod sphere;
pub(crate) mod triangle;

pub use cuboid::Cuboids;
pub use custom::{PrimitiveHit, Primitives};
pub use sphere::{Sphere, Spheres};
