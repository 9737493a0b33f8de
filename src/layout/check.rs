//! The check that a walk relies on: every place is in range, the nodes are a tree, and it fits the stack.

use super::{Child, ChildKind, Leaves, Link, Storage, WideNode};
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
    /// A lane of a node leads elsewhere than to the next node or leaf in order; or to a node after a lane that leads to a
    /// leaf, in a compact node; or an empty lane is not empty or not last.
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
    /// At this place of the list is the number of a triangle that the mesh has not.
    Primitive(usize),
    /// There is a list of so many numbers, where primitives are in the order of leaves.
    Listed(usize),
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
            Self::TooLarge => write!(f, "more nodes, leaves or primitives than links tell apart"),
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
            Self::Primitive(place) => {
                write!(
                    f,
                    "primitive number at {place}: the mesh has no such triangle"
                )
            }
            Self::Listed(count) => {
                write!(f, "a list of {count} numbers, where none is needed")
            }
            Self::TooDeep(node) => write!(f, "node {node}: deeper than a walk's stack"),
            Self::UnusedNodes(used) => write!(f, "nothing leads to the nodes from {used} on"),
            Self::UnusedLeaves(used) => write!(f, "nothing leads to the leaves from {used} on"),
        }
    }
}

impl Error for LayoutError {}

/// Checks everything that walks take for granted, in linear time, and finds the root.
///
/// What the builder emits of full nodes is so by construction, and is not checked but in debug builds: see
/// [`from_emitted`](super::Bvh::from_emitted). A refit changes boxes alone.
pub(super) fn check<N: WideNode, L: Leaves, S: Storage>(
    nodes: &[N],
    leaves: &L::Store<S>,
    primitives: &[u32],
    bounds: &Aabb,
) -> Result<Child, LayoutError> {
    if !L::LISTED && !primitives.is_empty() {
        return Err(LayoutError::Listed(primitives.len()));
    }
    let count = L::count::<S>(leaves, primitives)?;
    let root = root::<N, L>(nodes.len(), count, L::len::<S>(leaves, primitives))?;
    if let Some(place) = L::unknown::<S>(leaves, primitives) {
        return Err(LayoutError::Primitive(place));
    }
    if nodes.is_empty() {
        return Ok(root);
    }

    // How many nodes and leaves have been led to so far: where the next ones must be.
    let mut next_node = 1;
    let mut next_leaf = 0;
    // Nodes still to be looked at, each with the stack that a walk has in use when it gets there.
    let mut todo = [(0, 0); STACK];
    let mut len = 1;
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
        let mut leaf_met = false;
        for lane in 0..children {
            // SAFETY: the node has so many children.
            let link = unsafe { node.link(lane) };
            // Compact nodes say all links at once as if nodes came first.
            let in_order = link.is_leaf() || !(N::NODES_FIRST && leaf_met);
            leaf_met |= link.is_leaf();
            let fits = if link.is_leaf() {
                let span = L::span(link.leaf());
                let follows = span.start == next_leaf;
                next_leaf = span.end;
                follows && span.end <= count
            } else {
                // Not only its place: a link may lead to the middle of a node.
                let follows = link == Link::node::<N>(next_node as u32);
                next_node += 1;
                follows && next_node <= nodes.len()
            };
            if !(fits && in_order) {
                return Err(LayoutError::Child { node: index, lane });
            }
        }
        for child in (first_node..next_node).rev() {
            todo[len] = (child, used);
            len += 1;
        }
    }
    if next_node < nodes.len() {
        return Err(LayoutError::UnusedNodes(next_node));
    }
    if next_leaf < count {
        return Err(LayoutError::UnusedLeaves(next_leaf));
    }
    Ok(root)
}

/// Where a walk over so many nodes, leaves (or what is counted of them) and primitives begins, if their numbers can tell
/// them apart.
pub(super) fn root<N: WideNode, L: Leaves>(
    nodes: usize,
    count: usize,
    primitives: usize,
) -> Result<Child, LayoutError> {
    let most_nodes = N::PLACES.min(Link::PLACES / (size_of::<N>() / Link::UNIT));
    if nodes > most_nodes || count > N::PLACES || primitives > u32::MAX as usize {
        return Err(LayoutError::TooLarge);
    }
    match (nodes, L::only(count)) {
        (0, _) if count == 0 => Ok(Child::EMPTY),
        (0, Some(place)) => Ok(Child::leaf(place)),
        (0, None) => Err(LayoutError::UnusedLeaves(1)),
        _ => Ok(Child::node(0)),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{CompactNode4, CompactNode8, Node8, RunLeaf, TriangleLeaf};

    /// As many as links tell apart, and one more.
    #[test]
    fn too_large() {
        let ends_at = |most: usize, root: fn(usize) -> Result<Child, LayoutError>| {
            assert_eq!(root(most), Ok(Child::node(0)));
            assert_eq!(root(most + 1), Err(LayoutError::TooLarge));
        };
        ends_at(1 << 28, |count| {
            root::<CompactNode4, RunLeaf>(1, count, count)
        });
        ends_at((1 << 31) - 2, |count| {
            root::<CompactNode8, RunLeaf>(1, count, count)
        });
        ends_at((1 << 31) - 2, |count| {
            root::<Node8, TriangleLeaf>(1, count, count)
        });
        ends_at(1 << 28, |nodes| root::<CompactNode4, RunLeaf>(nodes, 1, 1));
    }
}
