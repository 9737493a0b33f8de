//! The binary tree, from the top down to single primitives.
//!
//! A subtree of n primitives has 2n - 1 nodes, so each has its own range of nodes before it is built: subtrees
//! are built at once, and the tree is the same however many cores there are.

use super::{
    BuildError,
    binary::{BinaryNode, BinaryTree},
    input::Input,
    lay_out::prune,
    monitor::{STRIDE, Watch},
    pages,
    parallel::{TASK, join},
    refs::{Bounds, Ref, Refs},
    split::Cut,
    sweep::{self, Leaves},
};
use crate::simd::{Backend, Operation, Simd};
use bytemuck::Zeroable;
use std::vec::Vec;

/// Below this the heuristic is given up for halves: so a cut that takes off little each time costs neither the
/// square of the time nor the stack, on which there are 64 levels, another 24 of halves and 63 of sweeps at most.
const MAX_DEPTH: u32 = 64;

/// The tree over all of `refs`.
///
/// # Errors
/// The build was cancelled.
pub(super) fn build<I: Input>(
    input: &I,
    refs: Refs,
    leaves: Leaves,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    let mut refs = refs.refs;
    if refs.is_empty() {
        return Ok(BinaryTree::default());
    }
    let nodes = subtree(input, &mut refs, 0, 1, leaves, watch);
    watch.check()?;
    let nodes = prune(nodes, leaves, watch);
    let order = refs.iter().map(Ref::id).collect();
    Ok(BinaryTree::new_unchecked(nodes, order))
}

/// The nodes of the tree over `refs`, of which there are some, and which are left in its order. Their places in the
/// order begin at `first`, those of the nodes but the root at `below`.
pub(super) fn subtree<I: Input>(
    input: &I,
    refs: &mut [Ref],
    first: usize,
    below: usize,
    leaves: Leaves,
    watch: &Watch,
) -> Vec<BinaryNode> {
    let centers = bounds_of_centers(refs);
    let mut nodes = pages::filled(BinaryNode::zeroed(), 2 * refs.len() - 1);
    if let [root, nodes @ ..] = &mut nodes[..] {
        Task {
            input,
            refs,
            centers,
            depth: 0,
            root,
            nodes,
            first: first as u32,
            below: below as u32,
            leaves,
            watch,
        }
        .build();
    }
    nodes
}

/// A subtree that is to be built.
struct Task<'a, I> {
    input: &'a I,
    refs: &'a mut [Ref],
    /// The bounds of twice the references' centers.
    centers: Bounds,
    depth: u32,
    root: &'a mut BinaryNode,
    /// All nodes but the root.
    nodes: &'a mut [BinaryNode],
    /// The place of `refs[0]` in the tree's order.
    first: u32,
    /// The place of `nodes[0]` in the tree.
    below: u32,
    leaves: Leaves,
    watch: &'a Watch<'a>,
}

impl<I: Input> Task<'_, I> {
    fn build(self) {
        let Self {
            input,
            refs,
            centers,
            depth,
            root,
            nodes,
            first,
            below,
            leaves,
            watch,
        } = self;
        if refs.len() <= sweep::MAX {
            if watch.advance(refs.len()) {
                sweep::build(input, refs, first, root, nodes, below, leaves);
            }
            return;
        }
        if refs.len() > STRIDE && !watch.advance(0) {
            return;
        }
        let (mid, left_centers, right_centers) = split(refs, &centers, depth);
        let (left_refs, right_refs) = refs.split_at_mut(mid);
        let worth_it = left_refs.len().min(right_refs.len()) > TASK;
        let [left_root, right_root, nodes @ ..] = nodes else {
            return;
        };
        let (left_nodes, right_nodes) = nodes.split_at_mut(2 * mid - 2);
        let below_left = below + 2;
        let below_right = below_left + left_nodes.len() as u32;
        let left = Task {
            input,
            refs: left_refs,
            centers: left_centers,
            depth: depth + 1,
            root: &mut *left_root,
            nodes: left_nodes,
            first,
            below: below_left,
            leaves,
            watch,
        };
        let right = Task {
            input,
            refs: right_refs,
            centers: right_centers,
            depth: depth + 1,
            root: &mut *right_root,
            nodes: right_nodes,
            first: first + mid as u32,
            below: below_right,
            leaves,
            watch,
        };
        join(worth_it, || left.build(), || right.build());
        *root = BinaryNode {
            aabb: left_root.aabb.join(right_root.aabb),
            first: below,
            count: 0,
        };
    }
}

/// Sorts references into those left and right of the cheapest cut, if there is one.
struct CutInTwo<'a> {
    refs: &'a mut [Ref],
    centers: &'a Bounds,
}

impl Operation for CutInTwo<'_> {
    type Output = Option<(usize, Bounds, Bounds)>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Self::Output {
        let cut = Cut::find(self.refs, self.centers)?;
        Some(cut.partition(self.refs))
    }
}

pub(super) fn bounds_of_centers(refs: &[Ref]) -> Bounds {
    refs.iter()
        .fold(Bounds::EMPTY, |centers, r| centers.join_point(r.center2()))
}

/// Sorts `refs`, more than one, into two sides, neither empty. Not inlined, to keep the bins off the
/// recursion's frames.
#[inline(never)]
fn split(refs: &mut [Ref], centers: &Bounds, depth: u32) -> (usize, Bounds, Bounds) {
    if depth < MAX_DEPTH
        && let Some(cut) = Backend::detect().run(CutInTwo { refs, centers })
    {
        return cut;
    }
    // Halves, along the axis on which centers are furthest apart.
    let [x, y, z, _] = (centers.max - centers.min).to_array();
    let mid = refs.len() / 2;
    if x.max(y).max(z) > 0.0 {
        let axis = match () {
            () if x >= y && x >= z => 0,
            () if y >= z => 1,
            () => 2,
        };
        let key = |r: &Ref| (r.center2().to_array()[axis], r.id());
        refs.select_nth_unstable_by(mid, |a, b| {
            let ((a, a_id), (b, b_id)) = (key(a), key(b));
            a.total_cmp(&b).then(a_id.cmp(&b_id))
        });
    }
    let (left, right) = refs.split_at(mid);
    (mid, bounds_of_centers(left), bounds_of_centers(right))
}
