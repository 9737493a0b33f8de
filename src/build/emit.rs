//! From the collapsed binary tree to the parts of a hierarchy, in the layout's order.

use super::{
    BuildError,
    binary::BinaryTree,
    collapse::Collapse,
    cost::Measure,
    cuts::Cuts,
    input::{Input, leaf_of},
    monitor::Watch,
    pages,
};
use crate::{
    geometry::Aabb,
    layout::{Child, LayoutError, STACK, WideNode},
    simd::{Backend, Operation, Simd},
};
use bytemuck::Zeroable;
use core::{marker::PhantomData, ops::Range};
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
    let mut ranges = Vec::new();
    let nodes = walk(collapse, watch, |leaf| ranges.push(collapse.places(leaf)))?;
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

/// The wide nodes, in the layout's order; `leaf` is told of the binary ones that become leaves, in theirs.
///
/// # Errors
/// As [`emit`].
pub(super) fn walk<N: WideNode, const W: usize>(
    shape: &impl Shape<W>,
    watch: &Watch,
    leaf: impl FnMut(usize),
) -> Result<Vec<N>, BuildError> {
    Backend::detect().run(Walk {
        shape,
        watch,
        leaf,
        nodes: PhantomData,
    })
}

struct Walk<'a, N, T, F, const W: usize> {
    shape: &'a T,
    watch: &'a Watch<'a>,
    leaf: F,
    nodes: PhantomData<N>,
}

impl<N: WideNode, T: Shape<W>, F: FnMut(usize), const W: usize> Operation for Walk<'_, N, T, F, W> {
    type Output = Result<Vec<N>, BuildError>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let Self {
            shape,
            watch,
            mut leaf,
            ..
        } = self;
        if shape.len() == 0 {
            return Ok(Vec::new());
        }
        // Most trees have more than four leaves a wide node. What is not used is not touched.
        let mut nodes = pages::with_capacity(shape.len() / 8 + 1);
        let mut leaves = 0;
        let root = shape.root();
        let measure = Measure::of_bounds(shape.aabb(root));
        // Binary nodes that become wide ones, their places, and the stack in use when a walk gets there.
        let mut todo = Vec::new();
        if shape.is_leaf(root) {
            leaf(root);
        } else {
            nodes.push(N::zeroed());
            todo.push((root, 0, 0));
        }
        while let Some((node, place, used)) = todo.pop() {
            let (children, count) = shape.children(node);
            let used = used + count - 1;
            if used >= STACK {
                return Err(LayoutError::TooDeep(place).into());
            }
            // The likeliest first: its nodes follow, close by.
            let mut areas = [0.0; W];
            for (area, &child) in areas.iter_mut().zip(&children[..count]) {
                *area = measure.half_area(shape.aabb(child));
            }
            let mut lanes = [0; W];
            for (child, place) in children.into_iter().zip(places_by_size(&areas)) {
                lanes[place as usize % W] = child;
            }
            if N::NODES_FIRST {
                lanes[..count].sort_by_key(|&child| shape.is_leaf(child));
            }
            let (known, first) = (todo.len(), nodes.len());
            let lanes = lanes[..count].iter().map(|&child| {
                let link = if shape.is_leaf(child) {
                    leaf(child);
                    leaves += 1;
                    Child::leaf(leaves - 1)
                } else {
                    let place = first + todo.len() - known;
                    todo.push((child, place, used));
                    shape.fetch(token, child);
                    Child::node(place as u32)
                };
                (*shape.aabb(child), link)
            });
            nodes[place] = N::from_children(lanes);
            nodes.resize(first + todo.len() - known, N::zeroed());
            todo[known..].reverse();
            if !watch.advance(count) {
                return Err(BuildError::Cancelled);
            }
        }
        nodes.shrink_to_fit();
        Ok(nodes)
    }
}

/// The place of each size, none negative, the greatest first; of those that are nearly equal the first. Each is compared
/// with all: which is greater is a toss-up.
#[inline(always)]
fn places_by_size<const W: usize>(sizes: &[f32; W]) -> [u32; W] {
    const { assert!(W <= 8) };
    let mut keys = [0; W];
    for (lane, key) in keys.iter_mut().enumerate() {
        *key = sizes[lane].to_bits() & !7 | (7 - lane as u32);
    }
    let mut places = [0; W];
    for other in keys {
        for (place, key) in places.iter_mut().zip(keys) {
            *place += u32::from(other > key);
        }
    }
    places
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
