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
    let bounds = tree.nodes().first().map_or(Aabb::EMPTY, |root| root.aabb);
    let measure = Measure::of_bounds(&bounds);
    let area = |node: usize| measure.half_area(&tree.nodes()[node].aabb);
    let mut nodes = Vec::new();
    let mut leaves = Vec::new();
    // Binary nodes that become wide ones, their places, and the stack in use when a walk gets there.
    let mut todo = Vec::new();
    if !tree.nodes().is_empty() {
        match collapse.leaf(0) {
            Some(leaf) => leaves.push(leaf),
            None => {
                nodes.push(N::zeroed());
                todo.push((0, 0, 0));
            }
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
        children.sort_by(|&a, &b| area(b).total_cmp(&area(a)));
        let (known, first) = (todo.len(), nodes.len());
        let lanes = children.iter().map(|&child| {
            let link = match collapse.leaf(child) {
                Some(leaf) => {
                    leaves.push(leaf);
                    Child::leaf(leaves.len() as u32 - 1)
                }
                None => {
                    let place = first + todo.len() - known;
                    todo.push((child, place, used));
                    Child::node(place as u32)
                }
            };
            (tree.nodes()[child].aabb, link)
        });
        let wide = N::from_children(lanes);
        nodes[place] = wide;
        nodes.resize(first + todo.len() - known, N::zeroed());
        todo[known..].reverse();
    }
    let (leaves, primitives) = fill(input, tree.order(), &leaves)?;
    Ok(Parts {
        nodes,
        leaves,
        primitives,
        bounds,
    })
}

/// Leaves of ranges of the tree's order, and the list of primitives that they count in.
fn fill<I: Input>(
    input: &I,
    order: &[u32],
    ranges: &[Range<usize>],
) -> Result<(Vec<I::Leaf>, Vec<u32>), LayoutError> {
    let mut primitives = Vec::with_capacity(order.len());
    let mut ends = Vec::with_capacity(ranges.len() + 1);
    ends.push(0);
    for range in ranges {
        let first = primitives.len();
        primitives.extend_from_slice(&order[range.clone()]);
        primitives[first..].sort_unstable();
        // Pieces of a triangle that have met again.
        let mut end = first;
        for place in first..primitives.len() {
            if place == first || primitives[place] != primitives[place - 1] {
                primitives[end] = primitives[place];
                end += 1;
            }
        }
        primitives.truncate(end);
        ends.push(primitives.len());
    }
    let leaf = |(index, ends): (usize, &[usize])| {
        let leaf = input.leaf(&primitives[ends[0]..ends[1]], ends[0] as u32);
        leaf.ok_or(LayoutError::Leaf(index))
    };
    #[cfg(feature = "rayon")]
    let leaves = {
        use rayon::prelude::*;
        let ends = ends.par_windows(2).enumerate();
        ends.map(leaf).collect::<Result<_, _>>()
    };
    #[cfg(not(feature = "rayon"))]
    let leaves = ends
        .windows(2)
        .enumerate()
        .map(leaf)
        .collect::<Result<_, _>>();
    Ok((leaves?, primitives))
}
