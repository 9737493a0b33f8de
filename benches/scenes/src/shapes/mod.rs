//! Meshes made by code, the same every time: for tests that need to know their input, and for scenes.

mod crowd;
mod patch;
mod polyhedra;
mod quantised;
mod revolved;
mod soup;
mod terrain;
mod torus_knot;

pub use crowd::crowd;
pub use patch::{Wrap, patch};
pub use polyhedra::{cuboid, icosphere};
pub use quantised::quantised;
pub use revolved::revolved;
pub use soup::soup;
pub use terrain::{hills_at, plane, terrain};
pub use torus_knot::torus_knot;
