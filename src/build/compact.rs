//! Compact hierarchies from full ones: the same tree, its boxes on the grids of the nodes.

use super::{BuildError, pages};
use crate::{
    geometry::Aabb,
    layout::{
        Bvh, Child, ChildKind, LayoutError, Owned, PrimitiveLeaf, RunLeaf, WideNode, tested_bounds,
    },
    simd::packed_run,
};
use std::vec::Vec;

/// So many nodes are made in one go.
pub(super) const CHUNK: usize = 1 << 9;

/// A hierarchy of nodes as wide, of the same boxes or somewhat larger ones.
///
/// # Errors
/// More primitive numbers than links tell apart.
pub(super) fn compact<N: WideNode, C: WideNode>(
    full: &Bvh<N, PrimitiveLeaf, Owned>,
) -> Result<Bvh<C, RunLeaf, Owned>, BuildError> {
    // Leaves' primitives in the order of leaves, which a builder along a curve has not.
    let mut primitives = pages::with_capacity(full.primitives().len());
    let run = |leaf: &PrimitiveLeaf| {
        let first = primitives.len() as u32;
        primitives.extend_from_slice(&full.primitives()[leaf.range()]);
        Child::leaf(packed_run(first, leaf.range().len() as u32))
    };
    let runs: Vec<Child> = full.leaves().iter().map(run).collect();
    let place = |child: Child| match child.kind() {
        ChildKind::Leaf(leaf) => runs[leaf],
        _ => child,
    };
    let node = |node: &N| {
        let children = (0..N::WIDTH).map(|lane| (node.child_aabb(lane), place(node.child(lane))));
        let is_node = |&(_, child): &(Aabb, Child)| matches!(child.kind(), ChildKind::Node(_));
        let is_leaf = |&(_, child): &(Aabb, Child)| matches!(child.kind(), ChildKind::Leaf(_));
        // Nodes first. The order among them, and that among leaves, is what the layout's is made of, and stays.
        C::from_children(
            children
                .clone()
                .filter(is_node)
                .chain(children.filter(is_leaf)),
        )
    };
    let nodes = pages::made(full.nodes().len(), CHUNK, |first, nodes| {
        let all = &full.nodes()[first..][..nodes.left()];
        all.iter().for_each(|full| nodes.push(node(full)));
    });
    let bounds = tested_bounds(&nodes, *full.bounds());
    let count = primitives.len();
    let compact = Bvh::from_parts(nodes, (), primitives, bounds).map_err(|error| match error {
        LayoutError::TooLarge => BuildError::TooManyPrimitives(count),
        bug => BuildError::Layout(bug),
    })?;
    Ok(compact.with_dropped(full.dropped() as u32))
}
