//! The binary tree between a builder, ours or the caller's, and the collapse to wide nodes.

use crate::geometry::Aabb;
use bytemuck::{Pod, Zeroable};
use core::{error::Error, fmt};
use std::{vec, vec::Vec};

/// A node of a [`BinaryTree`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BinaryNode {
    /// The box around all below. Not relied on: the collapse works boxes out from the primitives.
    pub aabb: Aabb,
    /// The first of two children, which are neighbours; in a leaf, where its primitives begin in the
    /// tree's order.
    pub first: u32,
    /// 0, or how many primitives the leaf has.
    pub count: u32,
}

const _: () = assert!(size_of::<BinaryNode>() == 32);

impl BinaryNode {
    /// Whether it has primitives rather than children.
    #[inline]
    pub const fn is_leaf(&self) -> bool {
        self.count > 0
    }

    /// Its two children, if it is no leaf.
    #[inline]
    pub(super) const fn children(&self) -> [usize; 2] {
        [self.first as usize, self.first as usize + 1]
    }

    /// The same in another tree: what is below the root of its own goes to the first of these places, the primitives to
    /// the second.
    #[inline]
    pub(super) fn below(&self, (nodes, places): (u32, u32)) -> Self {
        let first = match self.is_leaf() {
            true => self.first + places,
            false => (self.first + nodes).wrapping_sub(1),
        };
        Self { first, ..*self }
    }
}

/// A binary tree over primitives, of any shape and depth, which is known to be a tree.
///
/// Comes from [`Builder::build_binary`](super::Builder::build_binary) or from any other builder, and
/// goes into [`Builder::build_from_tree`](super::Builder::build_from_tree).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BinaryTree {
    nodes: Vec<BinaryNode>,
    order: Vec<u32>,
}

impl BinaryTree {
    /// A tree whose root is `nodes[0]`; no nodes are the empty tree. A leaf's primitives are
    /// `order[first..first + count]`, any other node's children `nodes[first]` and `nodes[first + 1]`.
    ///
    /// A primitive may be listed more than once, and places of `order` that no leaf has are passed over.
    /// Whether all primitives are listed is seen when a hierarchy is built from the tree.
    ///
    /// # Errors
    /// The first node that makes it no tree, or whose primitives are not there or another leaf's.
    pub fn new(nodes: Vec<BinaryNode>, order: Vec<u32>) -> Result<Self, TreeError> {
        if nodes.len() > u32::MAX as usize {
            return Err(TreeError::TooLarge(nodes.len()));
        }
        // The root counts as led to, so that a way back to it is seen.
        let mut led_to = vec![false; nodes.len()];
        if let Some(root) = led_to.first_mut() {
            *root = true;
        }
        let mut taken = vec![false; order.len()];
        for (index, node) in nodes.iter().enumerate() {
            let first = node.first as usize;
            if node.is_leaf() {
                let places = taken
                    .get_mut(first..)
                    .and_then(|places| places.get_mut(..node.count as usize))
                    .ok_or(TreeError::OrderOutOfRange { node: index })?;
                for (place, taken) in places.iter_mut().enumerate() {
                    if core::mem::replace(taken, true) {
                        return Err(TreeError::PlaceShared {
                            node: index,
                            place: first + place,
                        });
                    }
                }
            } else {
                let children = led_to
                    .get_mut(first..)
                    .and_then(|children| children.get_mut(..2))
                    .ok_or(TreeError::ChildOutOfRange { node: index })?;
                for (child, led_to) in children.iter_mut().enumerate() {
                    if core::mem::replace(led_to, true) {
                        return Err(TreeError::ChildShared {
                            node: index,
                            child: first + child,
                        });
                    }
                }
            }
        }
        // Every node has one parent at most and the root has none, so this ends. What it does not come to
        // has no parent or runs in circles.
        let mut reached = vec![false; nodes.len()];
        let mut todo = Vec::from_iter((!nodes.is_empty()).then_some(0));
        while let Some(index) = todo.pop() {
            reached[index] = true;
            if !nodes[index].is_leaf() {
                todo.extend(nodes[index].children());
            }
        }
        match reached.iter().position(|reached| !reached) {
            Some(node) => Err(TreeError::Unreached { node }),
            None => Ok(Self { nodes, order }),
        }
    }

    /// A tree that is known to be one.
    pub(super) fn new_unchecked(nodes: Vec<BinaryNode>, order: Vec<u32>) -> Self {
        Self { nodes, order }
    }

    /// The nodes, the root first.
    pub fn nodes(&self) -> &[BinaryNode] {
        &self.nodes
    }

    /// What leaves count in: the primitives' numbers.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The nodes and the order, as they went in.
    pub fn into_parts(self) -> (Vec<BinaryNode>, Vec<u32>) {
        (self.nodes, self.order)
    }
}

/// Why nodes are not a tree; names the first offender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TreeError {
    /// More nodes than 32 bits can tell apart.
    TooLarge(usize),
    /// A child of this node is past the nodes.
    ChildOutOfRange {
        /// The node.
        node: usize,
    },
    /// This node leads to another that was led to already, or is the root.
    ChildShared {
        /// The node.
        node: usize,
        /// The other.
        child: usize,
    },
    /// The primitives of this leaf are past the order.
    OrderOutOfRange {
        /// The leaf.
        node: usize,
    },
    /// A primitive's place in this leaf is another leaf's already.
    PlaceShared {
        /// The leaf.
        node: usize,
        /// The place in the order.
        place: usize,
    },
    /// The root does not lead to this node.
    Unreached {
        /// The node.
        node: usize,
    },
}

impl fmt::Display for TreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooLarge(nodes) => write!(f, "{nodes} nodes are more than 2^32 - 1"),
            Self::ChildOutOfRange { node } => write!(f, "node {node}: its children are not there"),
            Self::ChildShared { node, child } => {
                write!(
                    f,
                    "node {node}: its child {child} has a parent or is the root"
                )
            }
            Self::OrderOutOfRange { node } => {
                write!(f, "leaf {node}: its primitives are past the order")
            }
            Self::PlaceShared { node, place } => {
                write!(
                    f,
                    "leaf {node}: place {place} of the order is another leaf's"
                )
            }
            Self::Unreached { node } => write!(f, "node {node}: the root does not lead to it"),
        }
    }
}

impl Error for TreeError {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    fn new(nodes: &[(u32, u32)], places: u32) -> Result<BinaryTree, TreeError> {
        let node = |&(first, count): &(u32, u32)| BinaryNode {
            aabb: Aabb::EMPTY,
            first,
            count,
        };
        BinaryTree::new(nodes.iter().map(node).collect(), (0..places).collect())
    }

    #[test]
    fn trees() {
        assert!(new(&[], 0).is_ok());
        assert!(new(&[(0, 2)], 2).is_ok());
        // Children before their parents, places between leaves that are nobody's.
        assert!(new(&[(3, 0), (0, 1), (5, 1), (4, 1), (1, 0)], 6).is_ok());
    }

    #[test]
    fn no_trees() {
        let error = |nodes: &[(u32, u32)]| new(nodes, 4).unwrap_err();
        let child_out_of_range = |node| TreeError::ChildOutOfRange { node };
        assert_eq!(error(&[(0, 0)]), child_out_of_range(0));
        assert_eq!(error(&[(1, 0), (0, 1)]), child_out_of_range(0));
        assert_eq!(
            error(&[(u32::MAX, 0), (0, 1), (1, 1)]),
            child_out_of_range(0)
        );
        // To the root, to oneself, to another's child.
        let child_shared = |node, child| TreeError::ChildShared { node, child };
        assert_eq!(error(&[(1, 0), (0, 0), (0, 1)]), child_shared(1, 0));
        assert_eq!(error(&[(1, 0), (1, 0), (0, 1)]), child_shared(1, 1));
        assert_eq!(
            error(&[(1, 0), (3, 0), (3, 0), (0, 1), (1, 1)]),
            child_shared(2, 3)
        );
        let order_out_of_range = |node| TreeError::OrderOutOfRange { node };
        assert_eq!(error(&[(1, 0), (0, 1), (3, 2)]), order_out_of_range(2));
        assert_eq!(error(&[(u32::MAX, u32::MAX)]), order_out_of_range(0));
        assert_eq!(
            error(&[(1, 0), (0, 3), (2, 1)]),
            TreeError::PlaceShared { node: 2, place: 2 }
        );
        assert_eq!(error(&[(0, 1), (1, 1)]), TreeError::Unreached { node: 1 });
        // A circle beside the tree.
        let circle = [(0, 1), (3, 0), (1, 1), (1, 0), (2, 1)];
        assert_eq!(error(&circle), TreeError::Unreached { node: 1 });
        // And beyond it a node that has no parent: the circle is first.
        let circle_first = [&circle[..], &[(3, 1)]].concat();
        assert_eq!(error(&circle_first), TreeError::Unreached { node: 1 });
        assert_eq!(
            error(&circle).to_string(),
            "node 1: the root does not lead to it"
        );
    }
}
