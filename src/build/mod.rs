//! Building hierarchies.
//!
//! | over | [`Builder`] | is a |
//! | --- | --- | --- |
//! | a mesh | [`build`](Builder::build), [`build_as`](Builder::build_as) | [`Bvh8`](crate::layout::Bvh8), [`Bvh4`](crate::layout::Bvh4) |
//! | a mesh that stays where it is, in little memory | [`build_compact`](Builder::build_compact) | [`CompactBvh8`](crate::layout::CompactBvh8), [`CompactBvh4`](crate::layout::CompactBvh4) |
//! | primitives of your own | [`build_primitives`](Builder::build_primitives) | [`PrimitiveBvh8`](crate::layout::PrimitiveBvh8), [`PrimitiveBvh4`](crate::layout::PrimitiveBvh4) |
//! | the same, in little memory | [`build_compact_primitives`](Builder::build_compact_primitives) | [`CompactBvh8`](crate::layout::CompactBvh8), [`CompactBvh4`](crate::layout::CompactBvh4) |
//! | the same, or a mesh, from a binary tree of your own | [`build_from_tree`](Builder::build_from_tree), [`build_primitives_from_tree`](Builder::build_primitives_from_tree) | as above |
//!
//! How much time a build may take is its [`Preset`]; what moves can be [`refit`](crate::layout::Bvh::refit); a [`Monitor`] shows
//! progress and cancels. With the feature `rayon` builds take the threads of the current pool, one that a
//! `rayon::ThreadPool::install` around the call has chosen, say; the hierarchy is the same.

// How it is done: from primitives to a binary tree, from there to wide nodes.
//
// 1. `refs`: every primitive of the `input` is looked at; its box and its number.
// 2. `spatial`, for large triangles, some of which become `pieces`, by `clip`; then `binned`, by `split` and
//    `sweep`: the binary tree, from the top down, in parts, of which `assembly` makes one. Or `adopt`: a caller's.
// 3. `reinsertion`: subtrees are moved to where they cost least.
// 4. `collapse`: which subtrees are leaves and which nodes become one wide one, at the least `cost`; `cuts`, how.
// 5. `group`: leaves are joined; then 3 and 4 once more, over leaves.
// 6. `walk`, `emit`: the parts, in the layout's order; `rebalance`, should they need more than a walk's stack.
//
// `pipeline` has them one after the other, as a `preset` wants them, for each node that is `buildable`. Its fast way is
// `fast`:
//
// 1. `morton`, `radix`: the primitives along a curve.
// 2. `sections` of the curve, each by itself: `runs`, leaves of what follows each other; `ploc`, the binary tree over
//    leaves, from the bottom up; `leaf_collapse`, as 4 above. Then their trees are joined.
// 3. `walk`, as of 6.
//
// `refit` makes boxes anew when primitives have moved; `reorder` puts a mesh in the order of leaves.
//
// But for the fast one, all binary trees on the way have their nodes in the order of `lay_out`. No step recurses
// deeper than a bound, whatever the tree. `monitor` is told of all that takes long.

mod adopt;
mod assembly;
mod binary;
mod binned;
mod buildable;
mod builder;
mod clip;
mod collapse;
mod compact;
mod cost;
mod cuts;
mod emit;
mod error;
mod fast;
mod fill;
mod group;
mod input;
mod lay_out;
mod leaf_collapse;
mod monitor;
mod morton;
mod pages;
mod parallel;
mod pieces;
mod pipeline;
mod planes;
mod ploc;
mod preset;
mod radix;
mod rebalance;
mod refit;
mod refs;
mod reinsertion;
mod reorder;
mod report;
mod runs;
mod sections;
mod spatial;
mod split;
mod sweep;
#[cfg(test)]
mod tests;
mod walk;

pub use binary::{BinaryNode, BinaryTree, TreeError};
pub(crate) use buildable::Buildable;
pub use builder::Builder;
pub use error::{BuildError, RefitError, ReorderError};
pub use monitor::Monitor;
pub use preset::Preset;
pub use reorder::ReorderedMesh;
pub use report::BuildReport;
