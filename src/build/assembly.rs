//! Parts of a binary tree that were built at once, and the tree of them.

use super::{
    binary::{BinaryNode, BinaryTree},
    pages,
    parallel::{TASK, join},
};
use bytemuck::Zeroable;
use std::boxed::Box;

/// A tree in our order, in one or in parts.
pub(super) enum Assembly {
    Whole(BinaryTree),
    Two {
        sides: Box<[Self; 2]>,
        nodes: usize,
        places: usize,
    },
}

impl Assembly {
    /// One over two.
    pub fn two(left: Self, right: Self) -> Self {
        let (left_nodes, left_places) = left.len();
        let (right_nodes, right_places) = right.len();
        Self::Two {
            sides: Box::new([left, right]),
            nodes: 1 + left_nodes + right_nodes,
            places: left_places + right_places,
        }
    }

    /// How many nodes, more than none, and places in the order of primitives.
    fn len(&self) -> (usize, usize) {
        match self {
            Self::Whole(tree) => (tree.nodes().len(), tree.order().len()),
            &Self::Two { nodes, places, .. } => (nodes, places),
        }
    }

    /// The tree.
    pub fn tree(self) -> BinaryTree {
        if let Self::Whole(tree) = self {
            return tree;
        }
        let (nodes, places) = self.len();
        let mut nodes = pages::filled(BinaryNode::zeroed(), nodes);
        let mut order = pages::filled(0, places);
        if let [root, below @ ..] = &mut nodes[..] {
            *root = self.put(below, &mut order, (1, 0));
        }
        BinaryTree::new_unchecked(nodes, order)
    }

    /// Puts what is below the root, and the primitives, where they go; their places there begin at `at`. The root.
    fn put(&self, below: &mut [BinaryNode], order: &mut [u32], at: (u32, u32)) -> BinaryNode {
        match self {
            Self::Whole(tree) => {
                order.copy_from_slice(tree.order());
                let mut nodes = tree.nodes().iter().map(|node| node.below(at));
                let root = nodes.next().unwrap_or(BinaryNode::zeroed());
                for (to, node) in below.iter_mut().zip(nodes) {
                    *to = node;
                }
                root
            }
            Self::Two { sides, .. } => {
                let [left, right] = &**sides;
                let (count, places) = left.len();
                let [left_root, right_root, below @ ..] = below else {
                    return BinaryNode::zeroed();
                };
                let (left_below, right_below) = below.split_at_mut(count - 1);
                let (left_order, right_order) = order.split_at_mut(places);
                let left_at = (at.0 + 2, at.1);
                let right_at = (left_at.0 + count as u32 - 1, at.1 + places as u32);
                (*left_root, *right_root) = join(
                    left_below.len().min(right_below.len()) > TASK,
                    || left.put(left_below, left_order, left_at),
                    || right.put(right_below, right_order, right_at),
                );
                BinaryNode {
                    aabb: left_root.aabb.join(right_root.aabb),
                    first: at.0,
                    count: 0,
                }
            }
        }
    }
}
