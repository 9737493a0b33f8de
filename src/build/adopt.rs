//! From a caller's binary tree to one in our order, of single primitives.

use super::{
    BuildError,
    binary::{BinaryNode, BinaryTree},
    binned,
    input::Input,
    lay_out::{Part, below_inner, lay_out},
    monitor::Watch,
    refs::{Ref, Refs},
    sweep::Leaves,
};
use crate::geometry::TriangleMesh;
use core::ops::ControlFlow;
use std::{vec, vec::Vec};

/// `tree` without the primitives that are not in `refs`, its leaves split down to single primitives, its
/// boxes made of theirs.
///
/// # Errors
/// The first place that lists a primitive that is not there; the first of `refs`' primitives that is in no leaf;
/// more places than a tree may have.
pub(super) fn adopt<I: Input>(
    input: &I,
    tree: &BinaryTree,
    refs: &Refs,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    let places = Places::new(input.len(), &refs.refs);
    check(input, tree, &places)?;
    let counts = counts(tree, &places);
    let total = counts.first().copied().unwrap_or(0);
    if total > TriangleMesh::MAX_TRIANGLES {
        return Err(BuildError::TooManyPrimitives(total));
    }
    if total == 0 {
        return Ok(BinaryTree::default());
    }

    Ok(lay_out(total, 0, |mut index| {
        while !tree.nodes()[index].is_leaf() {
            match below_inner(tree, &counts, index) {
                ControlFlow::Continue(only) => index = only,
                ControlFlow::Break(both) => return both,
            }
        }
        let leaf = listed(tree, &tree.nodes()[index]);
        let mut kept: Vec<_> = leaf.filter_map(|&id| places.of(&refs.refs, id)).collect();
        Part::Tree(binned::subtree(input, &mut kept, Leaves::SINGLE, watch).tree())
    }))
}

/// The primitives of a leaf.
fn listed<'a>(tree: &'a BinaryTree, leaf: &BinaryNode) -> core::slice::Iter<'a, u32> {
    let first = leaf.first as usize;
    tree.order()[first..first + leaf.count as usize].iter()
}

/// Every primitive that is kept is listed in a leaf, and none that is not there.
fn check<I: Input>(input: &I, tree: &BinaryTree, places: &Places) -> Result<(), BuildError> {
    let primitives = input.len();
    let mut is_listed = vec![false; primitives];
    let mut offender: Option<usize> = None;
    for leaf in tree.nodes().iter().filter(|node| node.is_leaf()) {
        for (&primitive, place) in listed(tree, leaf).zip(leaf.first as usize..) {
            match is_listed.get_mut(primitive as usize) {
                Some(is_listed) => *is_listed = true,
                None => offender = Some(offender.map_or(place, |first| first.min(place))),
            }
        }
    }
    if let Some(place) = offender {
        return Err(BuildError::PrimitiveOutOfRange {
            place,
            primitive: tree.order()[place],
            primitives,
        });
    }
    let missing = |primitive: &usize| !is_listed[*primitive] && places.is_kept(*primitive as u32);
    match (0..primitives).find(missing) {
        Some(primitive) => Err(BuildError::PrimitiveMissing { primitive }),
        None => Ok(()),
    }
}

/// Where each primitive's reference is.
struct Places {
    /// By number. Nothing, if it is the number's own.
    places: Option<Vec<u32>>,
}

impl Places {
    const LEFT_OUT: u32 = u32::MAX;

    fn new(primitives: usize, refs: &[Ref]) -> Self {
        if refs.len() == primitives {
            return Self { places: None };
        }
        let mut places = vec![Self::LEFT_OUT; primitives];
        for (r, place) in refs.iter().zip(0..) {
            places[r.id() as usize] = place;
        }
        Self {
            places: Some(places),
        }
    }

    fn of(&self, refs: &[Ref], id: u32) -> Option<Ref> {
        let place = self
            .places
            .as_ref()
            .map_or(id, |places| places[id as usize]);
        refs.get(place as usize).copied()
    }

    fn is_kept(&self, id: u32) -> bool {
        self.places
            .as_ref()
            .is_none_or(|places| places[id as usize] != Self::LEFT_OUT)
    }
}

/// How many primitives that are kept each node has below it.
fn counts(tree: &BinaryTree, places: &Places) -> Vec<usize> {
    let nodes = tree.nodes();
    let mut counts = vec![0; nodes.len()];
    // Each node before those below it.
    let mut walk = Vec::with_capacity(nodes.len());
    walk.extend((!nodes.is_empty()).then_some(0));
    let mut next = 0;
    while let Some(&index) = walk.get(next) {
        next += 1;
        if !nodes[index].is_leaf() {
            walk.extend(nodes[index].children());
        }
    }
    for &index in walk.iter().rev() {
        let node = &nodes[index];
        counts[index] = if node.is_leaf() {
            listed(tree, node).filter(|&&id| places.is_kept(id)).count()
        } else {
            let [left, right] = node.children();
            counts[left] + counts[right]
        };
    }
    counts
}
