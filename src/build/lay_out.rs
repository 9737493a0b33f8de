//! The one order in which all binary trees in here have their nodes.
//!
//! The children of a node are neighbours; then come all nodes below the left one, then all below the right. So a
//! node comes before those below it; what is below it is one range; and the leaves, from left to right, have
//! the tree's order of primitives from its beginning to its end.

use super::{
    binary::{BinaryNode, BinaryTree},
    monitor::Watch,
    pages,
    sweep::Leaves,
};
use crate::geometry::Aabb;
use bytemuck::Zeroable;
use core::ops::ControlFlow;
use std::{vec, vec::Vec};

/// The nodes that the root leads to, if there may be others.
pub(super) fn prune(nodes: Vec<BinaryNode>, leaves: Leaves, watch: &Watch) -> Vec<BinaryNode> {
    if leaves.below == 0.0 {
        return nodes;
    }
    let mut counts = pages::filled(1u32, nodes.len());
    for (index, node) in nodes.iter().enumerate().rev() {
        if !node.is_leaf() {
            let [left, right] = node.children();
            counts[index] = counts[left] + counts[right];
        }
    }
    lay_out(counts[0] as usize, 0, |index: usize, _| {
        watch.advance(1);
        let node = nodes[index];
        if node.is_leaf() {
            return Part::Leaf(node);
        }
        let [left, right] = node.children();
        Part::Inner {
            left,
            right,
            left_leaves: counts[left] as usize,
        }
    })
}

/// What goes into a place of a new tree. `T` is whatever tells the parts of the old one apart.
pub(super) enum Part<T> {
    /// A leaf, with its box.
    Leaf(BinaryNode),
    /// A node over two parts.
    Inner {
        left: T,
        right: T,
        /// How many leaves are in the left part.
        left_leaves: usize,
    },
    /// A node and all below it, in order; the place of the second is the one that was given.
    Tree(Vec<BinaryNode>),
}

/// What an inner node of `tree` is over in a new tree, `counts` being the new leaves below each node: both its
/// sides, or the only one that has any, which takes its place.
pub(super) fn below_inner(
    tree: &BinaryTree,
    counts: &[usize],
    index: usize,
) -> ControlFlow<Part<usize>, usize> {
    let [left, right] = tree.nodes()[index].children();
    match (counts[left], counts[right]) {
        (0, _) => ControlFlow::Continue(right),
        (_, 0) => ControlFlow::Continue(left),
        (left_leaves, _) => ControlFlow::Break(Part::Inner {
            left,
            right,
            left_leaves,
        }),
    }
}

/// The nodes of a tree of so many leaves, more than none. `part` is asked for every part from left to right, and
/// told where the nodes below it go.
pub(super) fn lay_out<T>(
    leaves: usize,
    root: T,
    mut part: impl FnMut(T, usize) -> Part<T>,
) -> Vec<BinaryNode> {
    let mut nodes = pages::filled(BinaryNode::zeroed(), 2 * leaves - 1);
    // A part, its place, and that of the nodes below it.
    let mut todo = vec![(root, 0, 1)];
    while let Some((old, place, below)) = todo.pop() {
        match part(old, below) {
            Part::Leaf(leaf) => nodes[place] = leaf,
            Part::Inner {
                left,
                right,
                left_leaves,
            } => {
                nodes[place] = BinaryNode {
                    aabb: Aabb::EMPTY,
                    first: below as u32,
                    count: 0,
                };
                let below_left = below + 2;
                let below_right = below_left + 2 * left_leaves - 2;
                todo.push((right, below + 1, below_right));
                todo.push((left, below, below_left));
            }
            Part::Tree(tree) => {
                nodes[place] = tree[0];
                nodes[below..][..tree.len() - 1].copy_from_slice(&tree[1..]);
            }
        }
    }
    for index in (0..nodes.len()).rev() {
        let [left, right] = nodes[index].children();
        // A part of a build that was cancelled may have children that are not there.
        if !nodes[index].is_leaf() && left.max(right) < nodes.len() {
            nodes[index].aabb = nodes[left].aabb.join(nodes[right].aabb);
        }
    }
    nodes
}
