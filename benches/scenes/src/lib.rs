//! Meshes to trace: loaded from files, or made by code, each with the cameras it is looked at from.
//!
//! It knows nothing of hierarchies or rays: a mesh is two plain buffers, a camera gives an origin and a
//! direction, so that any library's kernel can be handed the same input.

mod camera;
mod default_scene;
mod load;
mod mesh;
pub mod shapes;

pub use camera::{Camera, cameras_for, cameras_of};
pub use default_scene::default_scene;
pub use load::{LoadError, Reason, load};
pub use mesh::{Mesh, bounds};
