//! What the fuzz targets share: inputs made of a fuzzer's bytes, and the contract that answers are held to.
//!
//! - `open`: the hierarchy that bytes are, whichever of all there are, asked in every way.
//! - `float`, `mesh`, `boxes`, `rays`, `settings`: the inputs.
//! - `width`: builds and queries, for nodes of each width; `ask`: every query there is, on every backend; `compact`: both, of leaves
//!   that read a mesh.
//! - `words`: bytes spoilt.
//! - `truth`: what the reference says.

mod ask;
mod boxes;
mod compact;
mod float;
mod mesh;
mod open;
mod rays;
mod settings;
mod truth;
mod width;
mod words;

pub use ask::{Answers, Found, found};
pub use boxes::{BoxBytes, Liar, boxes, corners};
pub use compact::assert_compact;
pub use float::{Float, floats};
pub use mesh::{Mesh, MeshBytes, Move, moved};
pub use open::{Opened, open};
pub use rays::{RayBytes, rays};
pub use settings::{Cancel, Settings};
pub use truth::{assert_all, first_not_finite, of_boxes, of_mesh};
pub use width::{Boxes, Triangles, Width};
pub use words::{change, copy};
