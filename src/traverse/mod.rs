//! Queries: one generic walk, for every node, leaf and backend.

mod count;
mod primitives;
mod single;
pub mod sweep;
mod triangles;

pub use count::Counts;
