//! Queries, each written once for every node, leaf and backend.
//!
//! `single` is the walk of one ray; `wave` interleaves many, that `feed` gives it; a `bundle` goes side by side. `batch` chooses between the
//! last two, by the `classes` of the rays. What a leaf's triangles answer is the same code in all of them, so the answers
//! are the same bits.

mod batch;
mod boxes;
mod bundle;
mod classes;
mod count;
mod feed;
mod one_by_one;
mod primitives;
mod query;
mod single;
pub mod sweep;
mod triangles;
mod wave;

pub use batch::Scratch;
pub use count::Counts;
