//! Building hierarchies: from primitives to a binary tree, from there to wide nodes.
//!
//! 1. `refs`: every primitive of the `input` is looked at; its box and its number.
//! 2. `spatial`, for large triangles, some of which become `pieces`, by `clip`; then `binned`, by `split` and
//!    `sweep`: the binary tree, from the top down. Or `adopt`: a caller's.
//! 3. `reinsertion`: subtrees are moved to where they cost least.
//! 4. `collapse`: which subtrees are leaves and which nodes become one wide one, at the least `cost`.
//! 5. `group`: leaves are joined; then 3 and 4 once more, over leaves.
//! 6. `emit`: the parts, in the layout's order; `rebalance`, should they need more than a walk's stack.
//!
//! All binary trees on the way have their nodes in the order of `lay_out`. No step recurses deeper than a
//! bound, whatever the tree.

mod adopt;
mod binary;
mod binned;
mod builder;
mod clip;
mod collapse;
mod cost;
mod emit;
mod error;
mod group;
mod input;
mod lay_out;
mod parallel;
mod pieces;
mod rebalance;
mod refs;
mod reinsertion;
mod report;
mod spatial;
mod split;
mod sweep;
#[cfg(test)]
mod tests;

pub use binary::{BinaryNode, BinaryTree, TreeError};
pub use builder::Builder;
pub use error::BuildError;
pub use report::BuildReport;
