//! The steps of a build, one after the other, as a preset has them.

use super::{
    BinaryTree, BuildError, Preset, adopt, binned,
    collapse::Collapse,
    emit::{Parts, emit},
    fast,
    group::group,
    input::Input,
    monitor::Watch,
    rebalance::rebalance,
    refs::Refs,
    reinsertion::{self, Effort},
    spatial,
    sweep::Leaves,
};
use crate::layout::{Bvh, LayoutError, Leaf, Owned, STACK, WideNode};

/// For a tree whose leaves are single primitives where they are large: those find their place before leaves are made.
const SINGLE: Effort = Effort {
    rounds: 20,
    share: 15,
    least_gain: 1e-3,
};

/// What has less than this of the scene's area is a leaf at once, should it fit: so builds take 10 to 20 % less, and
/// queries are the same from 1e-6 to 1e-3. If all is, a kitchen and a temple pay 2 to 30 %.
const SMALL: f32 = 2e-4;

/// For a tree of leaves, of which there are a fourth as many. Together the two take a kitchen from 8.5 to 6.4
/// nodes a bounce ray, game levels from 8.5, 8.2 and 8.6 to 7.2, 7.8 and 7.5, for as much time again as the
/// build takes without; more rounds bring 1 % more at most. A scan gains 1 % and is done after a few.
const GROUPED: Effort = Effort {
    rounds: 40,
    share: 3,
    least_gain: 1e-3,
};

/// Most of what there is to gain, in a few rounds.
const QUICK: Effort = Effort {
    rounds: 5,
    share: 10,
    least_gain: 1e-2,
};

/// A hierarchy over `refs`.
///
/// # Errors
/// The build was cancelled.
pub(super) fn from_refs<N: WideNode, I: Input>(
    input: &I,
    refs: Refs,
    preset: Preset,
    splits: f32,
    watch: &Watch,
) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
    let dropped = refs.dropped;
    let parts = match preset {
        Preset::Fast => {
            let parts = match N::WIDTH {
                4 => fast::build::<N, I, 4>(input, &refs, watch),
                _ => fast::build::<N, I, 8>(input, &refs, watch),
            };
            match parts {
                Err(BuildError::Layout(LayoutError::TooDeep(_))) => {
                    return from_refs(input, refs, Preset::Balanced, splits, watch);
                }
                parts => parts,
            }
        }
        Preset::Balanced => {
            let (tree, pieces) = spatial::build(input, refs, splits, Leaves::FULL, watch)?;
            parts(&pieces, tree, Leaves::FULL, Some(QUICK), watch)
        }
        Preset::Best => {
            let leaves = Leaves::smaller_than(SMALL, &refs.refs);
            let (tree, pieces) = spatial::build(input, refs, splits, leaves, watch)?;
            let tree = reinsertion::optimize(tree, SINGLE, 0.65, watch)?;
            parts(&pieces, tree, leaves, Some(GROUPED), watch)
        }
    }?;
    let bvh = finish(parts, dropped)?;
    watch.finish()?;
    Ok(bvh)
}

/// A hierarchy from a caller's tree.
///
/// # Errors
/// What is wrong with the tree; or the build was cancelled.
pub(super) fn from_tree<N: WideNode, I: Input>(
    input: &I,
    refs: &Refs,
    tree: &BinaryTree,
    watch: &Watch,
) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
    let tree = adopt::adopt(input, tree, refs, watch)?;
    let bvh = finish(
        parts(input, tree, Leaves::SINGLE, None, watch)?,
        refs.dropped,
    )?;
    watch.finish()?;
    Ok(bvh)
}

/// The binary tree over `refs`.
///
/// # Errors
/// The build was cancelled.
pub(super) fn binary<I: Input>(
    input: &I,
    refs: Refs,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    watch.phase(0.7, refs.refs.len())?;
    let tree = binned::build(input, refs, Leaves::SINGLE, watch)?;
    let tree = reinsertion::optimize(tree, SINGLE, 1.0, watch)?;
    watch.finish()?;
    Ok(tree)
}

/// The hierarchy of these parts.
fn finish<N: WideNode, L: Leaf>(
    parts: Parts<N, L>,
    dropped: usize,
) -> Result<Bvh<N, L, Owned>, BuildError> {
    let Parts {
        nodes,
        leaves,
        primitives,
        bounds,
    } = parts;
    let bvh = Bvh::from_parts(nodes, leaves, primitives, bounds)?;
    Ok(bvh.with_dropped(dropped as u32))
}

/// The parts of the hierarchy that a tree in our order is collapsed to.
fn parts<N: WideNode, I: Input>(
    input: &I,
    tree: BinaryTree,
    leaves: Leaves,
    effort: Option<Effort>,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    match N::WIDTH {
        4 => collapse::<N, I, 4>(input, &tree, leaves, effort, watch),
        _ => collapse::<N, I, 8>(input, &tree, leaves, effort, watch),
    }
}

fn collapse<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    leaves: Leaves,
    effort: Option<Effort>,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    watch.phase(0.75, tree.nodes().len())?;
    let shape = Collapse::<W>::new(input, tree, leaves, watch);
    watch.phase(0.83, tree.nodes().len())?;
    let mut tree = group(input, tree, &shape, watch)?;
    drop(shape);
    if let Some(effort) = effort {
        tree = reinsertion::optimize(tree, effort, 0.9, watch)?;
    }
    let parts = emit_best::<N, I, W>(input, &tree, watch);
    let Err(BuildError::Layout(LayoutError::TooDeep(_))) = parts else {
        return parts;
    };
    // A wide node takes up a binary level at least and leaves W - 1 children behind at most. So a tree
    // of no more levels than this fits the stack, however it is collapsed; and it has room for halving
    // 2^30 leaves, whatever the width.
    const { assert!((STACK - 1) / (W - 1) >= 30) };
    let levels = ((STACK - 1) / (W - 1)) as u32;
    emit_best::<N, I, W>(input, &rebalance(&tree, levels), watch)
}

fn emit_best<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    watch.phase(0.93, tree.nodes().len())?;
    let shape = Collapse::<W>::new(input, tree, Leaves::SINGLE, watch);
    watch.phase(1.0, tree.nodes().len())?;
    emit(input, tree, &shape, watch)
}
