//! Building hierarchies: from primitives to a binary tree, from there to wide nodes.
//!
//! 1. `refs`: every primitive is looked at; its box and its number.
//! 2. `binned`, by `split` and `sweep`: the binary tree, from the top down. Or `adopt`: a caller's.
//! 3. `collapse`: which subtrees are leaves and which nodes become one, at the least `cost`.
//! 4. `emit`: the parts, in the layout's order; `rebalance`, should they need more than a walk's stack.

mod adopt;
mod binary;
mod binned;
mod builder;
mod collapse;
mod cost;
mod emit;
mod error;
mod group;
mod input;
mod lay_out;
mod parallel;
mod rebalance;
mod refs;
mod reinsertion;
mod report;
mod split;
mod sweep;
#[cfg(test)]
mod tests;

pub use binary::{BinaryNode, BinaryTree, TreeError};
pub use builder::Builder;
pub use error::BuildError;
pub use report::BuildReport;
