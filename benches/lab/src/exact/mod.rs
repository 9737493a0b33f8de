//! The exact reference: rays against triangles and boxes without rounding, and what the crate's documents claim
//! held to it.
//!
//! `number`, `triangle` and `cuboid` are the definitions, in rationals: slow, and obviously right. The crate does
//! not promise their answers: it rounds where a vertex is seen from the ray, and is exact from there on. `sheared` has
//! the vertices as they are after that rounding, bit for bit, and `claims` the promises in a form that can be
//! checked, each in rationals. `margins` says in `f64` how much of each bound is used.

pub mod claims;
mod cuboid;
mod margins;
mod number;
mod sheared;
mod triangle;

pub use margins::{Margins, margins};
pub use sheared::Sheared;
