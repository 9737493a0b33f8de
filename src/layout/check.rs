//! The check that a walk relies on: every place is in range, the nodes are a tree, and it fits the stack.

use super::{Child, ChildKind, Leaf, Link, WideNode};
use crate::geometry::Aabb;
use core::{error::Error, fmt};

/// How many entries a walk's stack has. A walk that descends from a node of k children leaves k - 1 behind,
/// so this is 36 levels of full 8-wide nodes, 85 of 4-wide ones.
pub(crate) const STACK: usize = 256;

/// Why parts are not a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LayoutError {
    /// More nodes, leaves or primitives than their numbers can tell apart.
    TooLarge,
    /// A lane of a node leads elsewhere than to the next node or leaf in order, or an empty lane is not
    /// empty or not last.
    Child {
        /// The node.
        node: usize,
        /// Its lane.
        lane: usize,
    },
    /// A child's box is NaN, infinite, inside out or outside the bounds.
    Box {
        /// The node.
        node: usize,
        /// Its lane.
        lane: usize,
    },
    /// A leaf is empty, over-full, or its primitives or corners are out of range.
    Leaf(usize),
    /// The way to this node needs more stack than a walk has.
    TooDeep(usize),
    /// This many nodes are led to from the root, and there are more.
    UnusedNodes(usize),
    /// This many leaves are led to from the root, and there are more.
    UnusedLeaves(usize),
}

impl fmt::Display for LayoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooLarge => write!(f, "more nodes or leaves than 31 bits tell apart"),
            Self::Child { node, lane } => {
                write!(
                    f,
                    "node {node}, lane {lane}: not the next node or leaf in order"
                )
            }
            Self::Box { node, lane } => {
                write!(f, "node {node}, lane {lane}: no box within the bounds")
            }
            Self::Leaf(leaf) => {
                write!(f, "leaf {leaf}: its primitives or corners are out of range")
            }
            Self::TooDeep(node) => write!(f, "node {node}: deeper than a walk's stack"),
            Self::UnusedNodes(used) => write!(f, "nothing leads to the nodes from {used} on"),
            Self::UnusedLeaves(used) => write!(f, "nothing leads to the leaves from {used} on"),
        }
    }
}

impl Error for LayoutError {}

/// Checks everything that walks take for granted, in linear time, and finds the root.
pub(super) fn check<N: WideNode, L: Leaf>(
    nodes: &[N],
    leaves: &[L],
    primitives: &[u32],
    bounds: &Aabb,
) -> Result<Child, LayoutError> {
    let root = root::<N>(nodes.len(), leaves.len(), primitives.len())?;
    for (index, leaf) in leaves.iter().enumerate() {
        if !leaf.is_sound() || leaf.primitives().end > primitives.len() as u64 {
            return Err(LayoutError::Leaf(index));
        }
    }

    // How many nodes and leaves have been led to so far: where the next ones must be.
    let mut next_node = usize::from(!nodes.is_empty());
    let mut next_leaf = usize::from(nodes.is_empty() && !leaves.is_empty());
    // Nodes still to be looked at, each with the stack that a walk has in use when it gets there.
    let mut todo = [(0, 0); STACK];
    let mut len = next_node;
    while len > 0 {
        len -= 1;
        let (index, used) = todo[len];
        let node = &nodes[index];
        let children = count_children(index, node, bounds)?;
        // A walk leaves all children but one behind.
        let used = used + children.saturating_sub(1);
        if used >= STACK {
            return Err(LayoutError::TooDeep(index));
        }
        let first_node = next_node;
        for lane in 0..children {
            let child = node.child(lane);
            let (expected, count) = match child.kind() {
                ChildKind::Leaf(_) => (Child::leaf(next_leaf as u32), leaves.len()),
                _ => (Child::node(next_node as u32), nodes.len()),
            };
            if child != expected || child.index() >= count {
                return Err(LayoutError::Child { node: index, lane });
            }
            next_leaf += usize::from(child.is_leaf());
            next_node += usize::from(!child.is_leaf());
        }
        for child in (first_node..next_node).rev() {
            todo[len] = (child, used);
            len += 1;
        }
    }
    if next_node < nodes.len() {
        return Err(LayoutError::UnusedNodes(next_node));
    }
    if next_leaf < leaves.len() {
        return Err(LayoutError::UnusedLeaves(next_leaf));
    }
    Ok(root)
}

/// Where a walk over so many nodes, leaves and primitives begins, if their numbers can tell them apart.
pub(super) fn root<N: WideNode>(
    nodes: usize,
    leaves: usize,
    primitives: usize,
) -> Result<Child, LayoutError> {
    let most = (1 << 31) - 2;
    let most_nodes = most / (size_of::<N>() / Link::UNIT);
    if nodes > most_nodes || leaves > most || primitives > u32::MAX as usize {
        return Err(LayoutError::TooLarge);
    }
    Ok(match (nodes, leaves) {
        (0, 0) => Child::EMPTY,
        (0, _) => Child::leaf(0),
        _ => Child::node(0),
    })
}

/// How many children a node has: its first lanes, each with a box within `bounds`. The others lead
/// nowhere and have the box that no ray passes.
fn count_children<N: WideNode>(
    index: usize,
    node: &N,
    bounds: &Aabb,
) -> Result<usize, LayoutError> {
    let mut count = 0;
    for lane in 0..N::WIDTH {
        let child = node.child(lane);
        let aabb = node.child_aabb(lane);
        if child.kind() == ChildKind::Empty {
            if aabb != Aabb::EMPTY {
                return Err(LayoutError::Box { node: index, lane });
            }
        } else {
            if count < lane {
                return Err(LayoutError::Child { node: index, lane });
            }
            if aabb.is_empty() || !aabb.is_finite() || aabb.join(*bounds) != *bounds {
                return Err(LayoutError::Box { node: index, lane });
            }
            count += 1;
        }
    }
    Ok(count)
}
