//! The one order in which all binary trees in here have their nodes.
//!
//! The children of a node are neighbours; then come all nodes below the left one, then all below the right. So a
//! node comes before those below it; what is below it is one range; and the leaves, from left to right, have
//! the tree's order of primitives from its beginning to its end.

use super::{
    binary::{BinaryNode, BinaryTree},
    pages,
};
use crate::geometry::Aabb;
use bytemuck::Zeroable;
use core::ops::ControlFlow;
use std::vec;

/// What is next in a new tree. `T` is whatever tells the parts of the old one apart.
pub(super) enum Part<'a, T> {
    /// A leaf: its box and its primitives.
    Leaf(Aabb, &'a [u32]),
    /// A node over two parts.
    Inner([T; 2]),
    /// A node and all below it.
    Tree(BinaryTree),
}

/// What an inner node of `tree` is over in a new tree, `counts` being the new leaves below each node: both its
/// sides, or the only one that has any, which takes its place.
pub(super) fn below_inner<'a>(
    tree: &BinaryTree,
    counts: &[usize],
    index: usize,
) -> ControlFlow<Part<'a, usize>, usize> {
    let [left, right] = tree.nodes()[index].children();
    match (counts[left], counts[right]) {
        (0, _) => ControlFlow::Continue(right),
        (_, 0) => ControlFlow::Continue(left),
        _ => ControlFlow::Break(Part::Inner([left, right])),
    }
}

/// The tree of `root`. `part` is asked for every part from left to right. There is room for so many leaves at once.
pub(super) fn lay_out<'a, T>(
    leaves: usize,
    root: T,
    mut part: impl FnMut(T) -> Part<'a, T>,
) -> BinaryTree {
    let mut nodes = pages::with_capacity(2 * leaves);
    let mut order = pages::with_capacity(leaves);
    nodes.push(BinaryNode::zeroed());
    // A part and its place.
    let mut todo = vec![(root, 0)];
    while let Some((next, place)) = todo.pop() {
        match part(next) {
            Part::Leaf(aabb, primitives) => {
                nodes[place] = BinaryNode {
                    aabb,
                    first: order.len() as u32,
                    count: primitives.len() as u32,
                };
                order.extend_from_slice(primitives);
            }
            Part::Inner([left, right]) => {
                let below = nodes.len();
                nodes[place].first = below as u32;
                nodes.extend([BinaryNode::zeroed(); 2]);
                todo.push((right, below + 1));
                todo.push((left, below));
            }
            Part::Tree(tree) => {
                let before = (nodes.len() as u32, order.len() as u32);
                let mut below = tree.nodes().iter().map(|node| node.below(before));
                nodes[place] = below.next().unwrap_or(BinaryNode::zeroed());
                nodes.extend(below);
                order.extend_from_slice(tree.order());
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
    BinaryTree::new_unchecked(nodes, order)
}
