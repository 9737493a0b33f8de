//! From the collapsed binary tree to the parts of a hierarchy, in the layout's order.

use super::{binary::BinaryTree, collapse::Collapse, cost::Measure, input::Input};
use crate::{
    geometry::Aabb,
    layout::{Child, LayoutError, STACK, WideNode},
};
use core::ops::Range;
use std::vec::Vec;

/// The parts that [`Bvh::from_parts`](crate::layout::Bvh::from_parts) takes.
pub(super) struct Parts<N, L> {
    pub nodes: Vec<N>,
    pub leaves: Vec<L>,
    pub primitives: Vec<u32>,
    pub bounds: Aabb,
}

/// Emits a tree as it was collapsed.
///
/// # Errors
/// The first node to which a walk would need more than its stack.
pub(super) fn emit<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    collapse: &Collapse<W>,
) -> Result<Parts<N, I::Leaf>, LayoutError> {
    let Some(root) = tree.nodes().first() else {
        return Ok(Parts {
            nodes: Vec::new(),
            leaves: Vec::new(),
            primitives: Vec::new(),
            bounds: Aabb::EMPTY,
        });
    };
    let measure = Measure::of_bounds(&root.aabb);
    let mut nodes = Vec::new();
    let mut leaves = Vec::new();
    // Binary nodes that become wide ones, their places, and the stack in use when a walk gets there.
    let mut todo = Vec::new();
    match collapse.leaf(0) {
        Some(leaf) => leaves.push(leaf),
        None => {
            nodes.push(N::zeroed());
            todo.push((0, 0, 0));
        }
    }
    while let Some((node, place, used)) = todo.pop() {
        let (mut children, count) = collapse.children(node);
        let children = &mut children[..count];
        let used = used + count - 1;
        if used >= STACK {
            return Err(LayoutError::TooDeep(place));
        }
        // The likeliest first: its nodes follow, close by.
        children.sort_by(|&a, &b| {
            let area = |node: usize| measure.half_area(&tree.nodes()[node].aabb);
            area(b).total_cmp(&area(a))
        });
        let below = todo.len();
        let lanes = children.iter().map(|&child| {
            let link = match collapse.leaf(child) {
                Some(leaf) => {
                    leaves.push(leaf);
                    Child::leaf(leaves.len() as u32 - 1)
                }
                None => {
                    let place = nodes.len() + todo.len() - below;
                    todo.push((child, place, used));
                    Child::node(place as u32)
                }
            };
            (tree.nodes()[child].aabb, link)
        });
        let wide = N::from_children(lanes);
        nodes[place] = wide;
        nodes.resize(nodes.len() + todo.len() - below, N::zeroed());
        todo[below..].reverse();
    }
    let (leaves, primitives) = fill(input, tree.order(), &leaves)?;
    Ok(Parts {
        nodes,
        leaves,
        primitives,
        bounds: root.aabb,
    })
}

/// Leaves from ranges of the tree's order, and the list of primitives that they count in.
fn fill<I: Input>(
    input: &I,
    order: &[u32],
    ranges: &[Range<usize>],
) -> Result<(Vec<I::Leaf>, Vec<u32>), LayoutError> {
    let mut primitives = Vec::with_capacity(order.len());
    let mut firsts = Vec::with_capacity(ranges.len() + 1);
    for range in ranges {
        let first = primitives.len();
        firsts.push(first);
        primitives.extend_from_slice(&order[range.clone()]);
        primitives[first..].sort_unstable();
    }
    firsts.push(primitives.len());
    let leaf = |(index, ends): (usize, &[usize])| {
        let leaf = input.leaf(&primitives[ends[0]..ends[1]], ends[0] as u32);
        leaf.ok_or(LayoutError::Leaf(index))
    };
    #[cfg(feature = "rayon")]
    let leaves = {
        use rayon::prelude::*;
        firsts
            .par_windows(2)
            .enumerate()
            .map(leaf)
            .collect::<Result<_, _>>()
    };
    #[cfg(not(feature = "rayon"))]
    let leaves = firsts
        .windows(2)
        .enumerate()
        .map(leaf)
        .collect::<Result<_, _>>();
    Ok((leaves?, primitives))
}
