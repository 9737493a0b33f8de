//! The binary tree, from the top down to single primitives.
//!
//! A subtree of n primitives has 2n - 1 nodes, so each has its own range of nodes before it is built: subtrees
//! are built at once, and the tree is the same however many cores there are.

use super::{
    binary::{BinaryNode, BinaryTree},
    input::Input,
    parallel::{TASK, join},
    refs::{Bounds, Ref, Refs},
    split::Cut,
    sweep,
};
use crate::geometry::Aabb;
use bytemuck::Zeroable;
use std::{vec, vec::Vec};

/// Below this the heuristic is given up for halves. It bounds the recursion, at 64 levels and another 31; and the
/// time, should each cut take off only little. Trees over scenes we know of are less than 50 deep.
const MAX_DEPTH: u32 = 64;

/// The tree over all of `refs`, one primitive a leaf, leaves in the order of the walk.
pub(super) fn build<I: Input>(input: &I, refs: Refs) -> BinaryTree {
    let Refs {
        mut refs, centers, ..
    } = refs;
    if refs.is_empty() {
        return BinaryTree::default();
    }
    let mut nodes = vec![BinaryNode::zeroed(); 2 * refs.len() - 1];
    if let [root, below @ ..] = &mut nodes[..] {
        subtree(input, &mut refs, centers, 0, root, below, 1, 0);
    }
    let order = refs.iter().map(Ref::id).collect::<Vec<_>>();
    BinaryTree::new_unchecked(nodes, order)
}

/// The tree over `refs`, which are left in its order: its root, and the nodes below in `below`, whose
/// place is `at`. The place of `refs` in the tree's order is `first`.
#[expect(clippy::too_many_arguments, reason = "the state of a recursion")]
pub(super) fn subtree<I: Input>(
    input: &I,
    refs: &mut [Ref],
    centers: Bounds,
    first: u32,
    root: &mut BinaryNode,
    below: &mut [BinaryNode],
    at: u32,
    depth: u32,
) {
    if refs.len() <= sweep::MAX {
        sweep::build(input, refs, first, root, below, at);
        return;
    }
    let (mid, left_centers, right_centers) = split(refs, &centers, depth);
    let (left_refs, right_refs) = refs.split_at_mut(mid);
    let [left, right, below @ ..] = below else {
        return;
    };
    let (left_below, right_below) = below.split_at_mut(2 * left_refs.len() - 2);
    let left_at = at + 2;
    let right_at = left_at + left_below.len() as u32;
    let right_first = first + mid as u32;
    let worth_it = left_refs.len().min(right_refs.len()) > TASK;
    let depth = depth + 1;
    join(
        worth_it,
        || {
            subtree(
                input,
                left_refs,
                left_centers,
                first,
                left,
                left_below,
                left_at,
                depth,
            )
        },
        || {
            subtree(
                input,
                right_refs,
                right_centers,
                right_first,
                right,
                right_below,
                right_at,
                depth,
            )
        },
    );
    *root = BinaryNode {
        aabb: Aabb::join(left.aabb, right.aabb),
        first: at,
        count: 0,
    };
}

/// Sorts `refs`, of which there are some, into two sides, neither empty. Not inlined, to keep the bins off the recursion's frames.
#[inline(never)]
fn split(refs: &mut [Ref], centers: &Bounds, depth: u32) -> (usize, Bounds, Bounds) {
    if depth < MAX_DEPTH
        && let Some(cut) = Cut::find(refs, centers)
    {
        return cut.partition(refs);
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
    let centers = |refs: &[Ref]| {
        refs.iter()
            .fold(Bounds::EMPTY, |centers, r| centers.join_point(r.center2()))
    };
    let (left, right) = refs.split_at(mid);
    (mid, centers(left), centers(right))
}
