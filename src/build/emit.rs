//! From the collapsed binary tree to the parts of a hierarchy, in the layout's order.

use super::{
    BuildError,
    binary::BinaryTree,
    collapse::Collapse,
    cuts::Cuts,
    input::{Input, leaf_of},
    monitor::Watch,
    pages,
    walk::{Walked, walk},
};
use crate::{
    geometry::Aabb,
    layout::{LayoutError, WideNode},
    simd::{Backend, Simd},
};
use bytemuck::Zeroable;
use core::ops::Range;
use std::vec::Vec;

/// The parts that [`Bvh::from_parts`](crate::layout::Bvh::from_parts) takes.
pub(super) struct Parts<N, L> {
    pub nodes: Vec<N>,
    pub leaves: Vec<L>,
    pub primitives: Vec<u32>,
    pub bounds: Aabb,
}

/// What a binary tree is collapsed to.
pub(super) trait Shape<const W: usize> {
    /// How many binary nodes there are.
    fn len(&self) -> usize;
    /// The root, if there are any.
    fn root(&self) -> usize;
    /// A node's box.
    fn aabb(&self, node: usize) -> &Aabb;
    /// Whether a node becomes a leaf.
    fn is_leaf(&self, node: usize) -> bool;
    /// What a node that becomes a leaf is called.
    fn leaf(&self, node: usize) -> u32;
    /// The two children of a binary node.
    fn below(&self, node: usize) -> [usize; 2];
    /// How the cheapest forests below a node are made.
    fn cuts(&self, node: usize) -> Cuts;

    /// The children of a node that becomes a wide one, in the binary tree's order, and how many.
    #[inline(always)]
    fn children(&self, node: usize) -> ([usize; W], usize) {
        let (mut children, mut count) = ([0; W], 0);
        // Forests still to be taken apart, and how many roots each may have: never more than W in all.
        let mut todo = [(0, 0); W];
        let cut = |node: usize, roots: usize| {
            let [left, right] = self.below(node);
            let lefts = self.cuts(node).left(roots);
            [(right, roots - lefts), (left, lefts)]
        };
        [todo[0], todo[1]] = cut(node, W);
        let mut len = 2;
        while len > 0 {
            len -= 1;
            let (node, roots) = todo[len];
            let roots = self.cuts(node).fewest(roots);
            if roots == 1 {
                children[count] = node;
                count += 1;
            } else {
                [todo[len], todo[len + 1]] = cut(node, roots);
                len += 2;
            }
        }
        (children, count)
    }

    /// Has fetched what [`children`](Self::children) of a node is going to read.
    #[inline(always)]
    fn fetch<S: Simd>(&self, _token: S, _node: usize) {}
}

/// Emits a tree as it was collapsed.
///
/// # Errors
/// The first node to which a walk would need more than its stack; or the build was cancelled.
pub(super) fn emit<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    collapse: &Collapse<W>,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    let Walked { nodes, leaves } = walk(collapse, watch)?;
    let ranges = leaves
        .into_iter()
        .map(|leaf| collapse.places(leaf as usize));
    let ranges: Vec<_> = ranges.collect();
    let (leaves, primitives) = fill(input, tree.order(), &ranges, watch)?;
    watch.check()?;
    let bounds = tree.nodes().first().map_or(Aabb::EMPTY, |root| root.aabb);
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
    watch: &Watch,
) -> Result<(Vec<I::Leaf>, Vec<u32>), LayoutError> {
    let mut primitives = pages::with_capacity(order.len());
    let mut ends = Vec::with_capacity(ranges.len() + 1);
    ends.push(0);
    for range in ranges {
        let first = primitives.len();
        let numbers = order[range.clone()].iter();
        primitives.extend(numbers.map(|&number| input.primitive(number)));
        primitives[first..].sort_unstable();
        // Pieces of a triangle may have met again.
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
    let backend = Backend::detect();
    let mut leaves = pages::filled(I::Leaf::zeroed(), ranges.len());
    let fill = |(index, (leaf, ends)): (usize, (&mut I::Leaf, &[usize]))| {
        watch.advance(1);
        let ids = &primitives[ends[0]..ends[1]];
        let filled = leaf_of(backend, input, ids, ends[0] as u32);
        *leaf = filled.ok_or(LayoutError::Leaf(index))?;
        Ok(())
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let with_ends = leaves.par_iter_mut().zip(ends.par_windows(2));
        with_ends.enumerate().try_for_each(fill)?;
    }
    #[cfg(not(feature = "rayon"))]
    {
        let with_ends = leaves.iter_mut().zip(ends.windows(2));
        with_ends.enumerate().try_for_each(fill)?;
    }
    Ok((leaves, primitives))
}
