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

/// Most of what there is to gain, in a tenth to a fifth of the build: a kitchen goes from 8.8 nodes a bounce ray to 6.7, a
/// temple from 9.0 after five rounds to 7.9. Scans have little to gain and are done early.
const QUICK: Effort = Effort {
    rounds: 12,
    share: 15,
    least_gain: 1e-3,
};

/// What a caller wants of a build.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wants {
    pub preset: Preset,
    pub drop_non_finite: bool,
    pub splits: f32,
}

/// A hierarchy over all primitives that have a place in it.
///
/// # Errors
/// The first primitive that is not finite, unless those are left out, or too many; or the build was cancelled.
pub(super) fn build<N: WideNode, I: Input>(
    input: &I,
    wants: Wants,
    watch: &Watch,
) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
    let (parts, dropped) = match N::WIDTH {
        4 => preset_parts::<N, I, 4>(input, wants, watch),
        _ => preset_parts::<N, I, 8>(input, wants, watch),
    }?;
    finish(parts, dropped, watch)
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
    let parts = match N::WIDTH {
        4 => regrouped::<I, 4>(input, &tree, Leaves::SINGLE, watch)
            .and_then(|tree| collapsed::<N, I, 4>(input, &tree, watch)),
        _ => regrouped::<I, 8>(input, &tree, Leaves::SINGLE, watch)
            .and_then(|tree| collapsed::<N, I, 8>(input, &tree, watch)),
    };
    finish(parts?, refs.dropped, watch)
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
    watch: &Watch,
) -> Result<Bvh<N, L, Owned>, BuildError> {
    let Parts {
        nodes,
        leaves,
        primitives,
        bounds,
    } = parts;
    // What the check looks for: `walk` gives out places in the layout's order and has seen that the stack does; leaves
    // are filled from `primitives`, in their order, and boxes are joins of finite ones.
    let bvh = Bvh::from_emitted(nodes, leaves, primitives, bounds)?;
    watch.finish()?;
    Ok(bvh.with_dropped(dropped as u32))
}

/// What is in a hierarchy, and how many primitives were left out for not being finite.
fn preset_parts<N: WideNode, I: Input, const W: usize>(
    input: &I,
    wants: Wants,
    watch: &Watch,
) -> Result<(Parts<N, I::Leaf>, usize), BuildError> {
    let Wants {
        preset,
        drop_non_finite,
        splits,
    } = wants;
    if let Preset::Fast = preset {
        let built = fast::build::<N, I, W>(input, drop_non_finite, watch);
        let Err(BuildError::Layout(LayoutError::TooDeep(_))) = built else {
            return built;
        };
    }
    let refs = Refs::gather(input, drop_non_finite, watch)?;
    let dropped = refs.dropped;
    let parts = match preset {
        Preset::Fast | Preset::Balanced => {
            let (tree, pieces) = spatial::build(input, refs, splits, Leaves::FULL, watch)?;
            let tree = reinsertion::optimize(tree, QUICK, 0.75, watch)?;
            collapsed::<N, _, W>(&pieces, &tree, watch)
        }
        Preset::Best => {
            let leaves = Leaves::smaller_than(SMALL, &refs.refs);
            let (tree, pieces) = spatial::build(input, refs, splits, leaves, watch)?;
            let tree = reinsertion::optimize(tree, SINGLE, 0.65, watch)?;
            let tree = regrouped::<_, W>(&pieces, &tree, leaves, watch)?;
            let tree = reinsertion::optimize(tree, GROUPED, 0.9, watch)?;
            collapsed::<N, _, W>(&pieces, &tree, watch)
        }
    };
    Ok((parts?, dropped))
}

/// The tree over the leaves that it would be collapsed to, joined. `leaves` is what it was built with.
fn regrouped<I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    leaves: Leaves,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    watch.phase(0.75, tree.nodes().len())?;
    let shape = Collapse::<W>::new(input, tree, leaves, watch);
    watch.phase(0.83, tree.nodes().len())?;
    group(input, tree, &shape, watch)
}

/// What a tree in our order is collapsed to; made shallower first, should queries need more than their stack.
fn collapsed<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    let parts = collapsed_as_is::<N, I, W>(input, tree, watch);
    let Err(BuildError::Layout(LayoutError::TooDeep(_))) = parts else {
        return parts;
    };
    // A wide node takes up a binary level at least and leaves W - 1 children behind at most. So a tree
    // of no more levels than this fits the stack, however it is collapsed; and it has room for halving
    // 2^30 leaves, whatever the width.
    const { assert!((STACK - 1) / (W - 1) >= 30) };
    let levels = ((STACK - 1) / (W - 1)) as u32;
    collapsed_as_is::<N, I, W>(input, &rebalance(tree, levels), watch)
}

fn collapsed_as_is<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    watch.phase(0.93, tree.nodes().len())?;
    let shape = Collapse::<W>::new(input, tree, Leaves::SINGLE, watch);
    watch.phase(1.0, tree.nodes().len())?;
    emit(input, tree, &shape, watch)
}
