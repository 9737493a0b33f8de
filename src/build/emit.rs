//! From the collapsed binary tree to the parts of a hierarchy, in the layout's order.

use super::{
    BuildError,
    binary::BinaryTree,
    collapse::Collapse,
    cuts::Cuts,
    input::{Input, LeafOf},
    monitor::Watch,
    pages::{self, Slots},
    parallel,
    walk::{Walked, walk},
};
use crate::{
    geometry::Aabb,
    layout::{LayoutError, WideNode},
    simd::{Backend, Operation, Simd},
};
use core::{
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering::Relaxed},
};
use std::vec::Vec;

/// So many leaves are filled in one go.
const CHUNK: usize = 1 << 10;
/// Primitives are fetched so many before they are read, and where they are as many before that.
const AHEAD: usize = 32;

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
    let list = |ranges: &[Range<usize>]| List::new(input, order, ranges);
    let mut lists = parallel::map(ranges.chunks(CHUNK), list);
    let mut primitives = pages::with_capacity(order.len());
    for list in &mut lists {
        list.first = primitives.len() as u32;
        primitives.extend_from_slice(&list.primitives);
    }
    let backend = Backend::detect();
    // The first that is none.
    let wrong = AtomicUsize::new(usize::MAX);
    let leaves = pages::made(ranges.len(), CHUNK, |first, leaves| {
        watch.advance(leaves.left());
        let list = &lists[first / CHUNK];
        let filled = backend.run(Fill {
            input,
            list,
            leaves,
        });
        if let Err(place) = filled {
            wrong.fetch_min(first + place, Relaxed);
        }
    });
    match wrong.into_inner() {
        usize::MAX => Ok((leaves, primitives)),
        leaf => Err(LayoutError::Leaf(leaf)),
    }
}

/// What is in [`CHUNK`] leaves.
struct List {
    primitives: Vec<u32>,
    /// Where each leaf ends.
    ends: Vec<usize>,
    /// The place of the first in the list of all.
    first: u32,
}

impl List {
    fn new<I: Input>(input: &I, order: &[u32], ranges: &[Range<usize>]) -> Self {
        let mut primitives = Vec::with_capacity(4 * ranges.len());
        let mut ends = Vec::with_capacity(ranges.len());
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
            ends.push(end);
        }
        Self {
            primitives,
            ends,
            first: 0,
        }
    }
}

struct Fill<'a, 's, I: Input> {
    input: &'a I,
    list: &'a List,
    leaves: &'a mut Slots<'s, I::Leaf>,
}

impl<I: Input> Operation for Fill<'_, '_, I> {
    /// What is no leaf, if anything.
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let Self {
            input,
            list,
            leaves,
        } = self;
        let primitives = &list.primitives[..];
        let mut start = 0;
        for (leaf, &end) in list.ends.iter().enumerate() {
            for place in start..end {
                let soon = [1, 2].map(|times| place + times * AHEAD);
                input.fetch_of(token, primitives, soon);
            }
            let filled = LeafOf {
                input,
                ids: &primitives[start..end],
                first: list.first + start as u32,
            };
            leaves.push(filled.run(token).ok_or(leaf)?);
            start = end;
        }
        Ok(())
    }
}
