//! Leaves of a collapsed tree, joined where one leaf is better than two.
//!
//! The collapse makes leaves of whole subtrees alone, and a subtree often has one vertex too many. Those of cousins
//! are then each half full, and close by.

use super::{
    BuildError,
    binary::BinaryTree,
    collapse::Collapse,
    cost::Measure,
    cuts::MAX_WIDTH,
    emit::Shape,
    input::{Input, leaf_of},
    lay_out::{Part, below_inner, lay_out},
    monitor::Watch,
    pages, parallel,
};
use crate::{geometry::Aabb, simd::Backend};
use core::ops::ControlFlow;
use std::{vec, vec::Vec};

/// The most primitives that a leaf of any kind has.
const MAX_LEAF: usize = 8;

/// The leaves of so many wide nodes are joined in one go.
const CHUNK: usize = 1 << 7;

/// A leaf to be.
#[derive(Clone, Copy)]
struct Group {
    /// The binary node in whose place it is.
    node: usize,
    aabb: Aabb,
    ids: [u32; MAX_LEAF],
    len: usize,
}

impl Group {
    const NONE: Self = Self {
        node: 0,
        aabb: Aabb::EMPTY,
        ids: [0; _],
        len: 0,
    };

    fn new(node: usize, aabb: Aabb, primitives: impl IntoIterator<Item = u32>) -> Self {
        let mut group = Self {
            node,
            aabb,
            ..Self::NONE
        };
        group.add(primitives);
        group
    }

    /// Adds primitives, once each.
    fn add(&mut self, primitives: impl IntoIterator<Item = u32>) {
        for id in primitives {
            if !self.ids().contains(&id) {
                self.ids[self.len] = id;
                self.len += 1;
            }
        }
    }

    fn ids(&self) -> &[u32] {
        &self.ids[..self.len]
    }

    fn join(&self, other: &Self) -> Self {
        let mut joined = *self;
        joined.aabb = self.aabb.join(other.aabb);
        joined.add(other.ids().iter().copied());
        joined
    }
}

/// The tree whose leaves are those that it is collapsed to, joined.
///
/// # Errors
/// The build was cancelled.
pub(super) fn group<I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    collapse: &Collapse<W>,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    let Some(root) = tree.nodes().first() else {
        return Ok(BinaryTree::default());
    };
    let groups = groups(
        input,
        tree,
        collapse,
        &Measure::of_bounds(&root.aabb),
        watch,
    );
    watch.check()?;

    // The group that a node has become, and how many there are below a node. Below a group there is none.
    const NONE: u32 = u32::MAX;
    let mut group_at = pages::filled(NONE, tree.nodes().len());
    for (group, index) in groups.iter().zip(0..) {
        group_at[group.node] = index;
    }
    let mut counts = pages::filled(0, tree.nodes().len());
    for (index, node) in tree.nodes().iter().enumerate().rev() {
        if group_at[index] != NONE {
            counts[index] = 1;
        } else if !node.is_leaf() {
            let [left, right] = node.children();
            counts[index] = counts[left] + counts[right];
        }
    }

    Ok(lay_out(groups.len(), 0, |mut index: usize| {
        loop {
            if let Some(group) = groups.get(group_at[index] as usize) {
                return Part::Leaf(group.aabb, group.ids());
            }
            match below_inner(tree, &counts, index) {
                ControlFlow::Continue(only) => index = only,
                ControlFlow::Break(both) => return both,
            }
        }
    }))
}

/// The leaves of every wide node, joined.
fn groups<I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    collapse: &Collapse<W>,
    measure: &Measure,
    watch: &Watch,
) -> Vec<Group> {
    let leaf = |node: usize| {
        let numbers = &tree.order()[collapse.places(node)];
        let primitives = numbers.iter().map(|&number| input.primitive(number));
        Group::new(node, tree.nodes()[node].aabb, primitives)
    };
    if collapse.is_leaf(0) {
        return vec![leaf(0)];
    }
    // By wide node, as the ends of runs.
    let (mut leaves, mut ends) = (Vec::new(), Vec::new());
    let mut todo = vec![0];
    while let Some(node) = todo.pop() {
        let (children, count) = collapse.children(node);
        for &child in &children[..count] {
            match collapse.is_leaf(child) {
                true => leaves.push(child),
                false => todo.push(child),
            }
        }
        ends.push(leaves.len());
    }
    let mut start = 0;
    let chunks = ends.chunks(CHUNK).map(|ends| {
        let first = start;
        start = ends[ends.len() - 1];
        (first, ends)
    });
    let joined = |(mut start, ends): (usize, &[usize])| {
        let mut groups = Vec::with_capacity(ends[ends.len() - 1] - start);
        for &end in ends {
            if !watch.advance(W) {
                break;
            }
            let mut alike = [Group::NONE; W];
            let run = &leaves[start..end];
            for (group, &node) in alike.iter_mut().zip(run) {
                *group = leaf(node);
            }
            groups.extend_from_slice(join_pairs(input, measure, &mut alike[..run.len()]));
            start = end;
        }
        groups
    };
    parallel::map(chunks, joined).concat()
}

/// Joins leaves, the best pair first, for as long as it is worth it: those that are left.
fn join_pairs<'a, I: Input>(input: &I, measure: &Measure, leaves: &'a mut [Group]) -> &'a [Group] {
    const { assert!(I::MAX_LEAF <= MAX_LEAF) };
    let backend = Backend::detect();
    let cost = |aabb: &Aabb, len: usize| measure.half_area(aabb) * I::leaf_cost(len);
    let mut len = leaves.len();
    // Pairs for which there is no room in one leaf.
    let mut too_many = [[false; MAX_WIDTH]; MAX_WIDTH];
    loop {
        let mut best = 0.0;
        let mut pair = None;
        for second in 1..len {
            for first in 0..second {
                let (a, b) = (&leaves[first], &leaves[second]);
                if a.len + b.len > I::MAX_LEAF || too_many[second][first] {
                    continue;
                }
                let joined = cost(&a.aabb.join(b.aabb), a.len + b.len);
                let apart = cost(&a.aabb, a.len) + cost(&b.aabb, b.len);
                let gain = apart * I::JOINED - joined;
                if gain > best {
                    let joined = a.join(b);
                    if leaf_of(backend, input, joined.ids(), 0).is_some() {
                        best = gain;
                        pair = Some((first, second, joined));
                    } else {
                        too_many[second][first] = true;
                    }
                }
            }
        }
        let Some((first, second, joined)) = pair else {
            return &leaves[..len];
        };
        leaves[first] = joined;
        len -= 1;
        leaves[second] = leaves[len];
        for changed in [first, second] {
            too_many[changed] = [false; MAX_WIDTH];
            for others in &mut too_many {
                others[changed] = false;
            }
        }
    }
}
