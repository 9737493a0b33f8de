//! Queries: one generic walk, for every node, leaf and backend.

mod batch;
mod bundle;
mod count;
mod primitives;
mod query;
mod single;
pub mod sweep;
mod triangles;
mod wave;

pub use batch::Scratch;
pub use count::Counts;
