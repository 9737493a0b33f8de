//! The binary tree, from the top down to single primitives.
//!
//! Parts of the tree are built at once; it is the same however many cores there are.

use super::{
    BuildError,
    assembly::Assembly,
    binary::{BinaryNode, BinaryTree},
    input::Input,
    monitor::{STRIDE, Watch},
    pages,
    parallel::{self, TASK, join},
    refs::{Bounds, Ref, Refs},
    split::Cut,
    sweep::{self, Leaves},
};
use crate::simd::{Backend, Operation, Simd};
use bytemuck::Zeroable;
use std::vec::Vec;

/// Below this the heuristic is given up for halves: so a cut that takes off little each time costs neither the
/// square of the time nor the stack, on which there are 64 levels and another 24 of halves at most.
const MAX_DEPTH: u32 = 64;

/// With threads, so many references are one part.
const PART: usize = 2 * TASK;

/// The tree over all of `refs`.
///
/// # Errors
/// The build was cancelled.
pub(super) fn build<I: Input>(
    input: &I,
    refs: Refs,
    leaves: Leaves,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    let mut refs = refs.refs;
    if refs.is_empty() {
        return Ok(BinaryTree::default());
    }
    let tree = subtree(input, &mut refs, leaves, watch).tree();
    watch.check()?;
    Ok(tree)
}

/// The tree over `refs`, of which there are some.
pub(super) fn subtree<I: Input>(
    input: &I,
    refs: &mut [Ref],
    leaves: Leaves,
    watch: &Watch,
) -> Assembly {
    let centers = bounds_of_centers(refs);
    let builder = Binned {
        input,
        leaves,
        whole: match parallel::threads() {
            1 => usize::MAX,
            _ => PART,
        },
        watch,
    };
    builder.grow(refs, &centers, 0)
}

/// What all of it needs.
struct Binned<'a, I> {
    input: &'a I,
    leaves: Leaves,
    /// Up to so many references are one part.
    whole: usize,
    watch: &'a Watch<'a>,
}

impl<I: Input> Binned<'_, I> {
    /// The tree over `refs`; `centers` are the bounds of twice their centers.
    fn grow(&self, refs: &mut [Ref], centers: &Bounds, depth: u32) -> Assembly {
        if refs.len() <= self.whole || !self.watch.advance(0) {
            // Most leaves have two primitives at least. What is not used is not touched.
            let mut nodes = pages::with_capacity(refs.len());
            nodes.push(BinaryNode::zeroed());
            self.build(refs, centers, depth, 0, &mut nodes, 0);
            let order = refs.iter().map(Ref::id).collect();
            return Assembly::Whole(BinaryTree::new_unchecked(nodes, order));
        }
        let (mid, left_centers, right_centers) = split(refs, centers, depth);
        let (left, right) = refs.split_at_mut(mid);
        let (left, right) = join(
            left.len().min(right.len()) > TASK,
            || self.grow(left, &left_centers, depth + 1),
            || self.grow(right, &right_centers, depth + 1),
        );
        Assembly::two(left, right)
    }

    /// The same in one: the root to a place of `nodes`, those below it to their end. `first` is the place of `refs` in
    /// the order.
    fn build(
        &self,
        refs: &mut [Ref],
        centers: &Bounds,
        depth: u32,
        first: usize,
        nodes: &mut Vec<BinaryNode>,
        root: usize,
    ) {
        if refs.len() <= sweep::MAX {
            if self.watch.advance(refs.len()) {
                sweep::build(self.input, refs, first, self.leaves, nodes, root);
            }
            return;
        }
        if refs.len() > STRIDE && !self.watch.advance(0) {
            return;
        }
        let (mid, left_centers, right_centers) = split(refs, centers, depth);
        let (left, right) = refs.split_at_mut(mid);
        let below = nodes.len();
        nodes.extend([BinaryNode::zeroed(); 2]);
        self.build(left, &left_centers, depth + 1, first, nodes, below);
        self.build(
            right,
            &right_centers,
            depth + 1,
            first + mid,
            nodes,
            below + 1,
        );
        nodes[root] = BinaryNode {
            aabb: nodes[below].aabb.join(nodes[below + 1].aabb),
            first: below as u32,
            count: 0,
        };
    }
}

/// Sorts references into those left and right of the cheapest cut, if there is one.
struct CutInTwo<'a> {
    refs: &'a mut [Ref],
    centers: &'a Bounds,
}

impl Operation for CutInTwo<'_> {
    type Output = Option<(usize, Bounds, Bounds)>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Self::Output {
        let cut = Cut::find(self.refs, self.centers)?;
        Some(cut.partition(self.refs))
    }
}

pub(super) fn bounds_of_centers(refs: &[Ref]) -> Bounds {
    refs.iter()
        .fold(Bounds::EMPTY, |centers, r| centers.join_point(r.center2()))
}

/// Sorts `refs`, more than one, into two sides, neither empty. Not inlined, to keep the bins off the
/// recursion's frames.
#[inline(never)]
fn split(refs: &mut [Ref], centers: &Bounds, depth: u32) -> (usize, Bounds, Bounds) {
    if depth < MAX_DEPTH
        && let Some(cut) = Backend::detect().run(CutInTwo { refs, centers })
    {
        return cut;
    }
    // Halves, along the axis on which centers are furthest apart.
    let [x, y, z, _] = (centers.max - centers.min).to_array();
    let mid = refs.len() / 2;
    if x.max(y).max(z) > 0.0 {
        let axis = match () {
            () if x >= y && x >= z => 0,
            () if y >= z => 1,
            () => 2,
        };
        let key = |r: &Ref| (r.center2().to_array()[axis], r.id());
        refs.select_nth_unstable_by(mid, |a, b| {
            let ((a, a_id), (b, b_id)) = (key(a), key(b));
            a.total_cmp(&b).then(a_id.cmp(&b_id))
        });
    }
    let (left, right) = refs.split_at(mid);
    (mid, bounds_of_centers(left), bounds_of_centers(right))
}
