//! The cheapest collapse of a tree whose leaves stay what they are: as [`collapse`](super::collapse), but for speed.
//!
//! What is kept of a node's forests is how each is made: their costs are needed for its parent's, and then no more.

use super::{
    cost::{self, Measure},
    cuts::{Cuts, Forest, Joined, MAX_WIDTH},
    emit::Shape,
    input::Input,
    pages,
    ploc::Node,
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Operation, Simd},
};
use core::marker::PhantomData;
use std::vec::Vec;

/// The cheapest collapse to nodes `W` wide: a tree, and how its forests are made.
pub(super) struct LeafCollapse<'a, const W: usize> {
    pub nodes: &'a [Node],
    pub cuts: &'a [Cuts],
}

/// The forests of all nodes, of which the first are known, and how the others are made. A node comes after those below it.
pub(super) fn solve<I: Input, const W: usize>(
    nodes: &[Node],
    forests: Vec<Forest>,
    measure: Measure,
) -> (Vec<Forest>, Vec<Cuts>) {
    Backend::detect().run(Solve::<I, W> {
        nodes,
        forests,
        measure,
        input: PhantomData,
    })
}

impl<const W: usize> Shape<W> for LeafCollapse<'_, W> {
    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn root(&self) -> usize {
        self.nodes.len() - 1
    }

    #[inline(always)]
    fn aabb(&self, node: usize) -> &Aabb {
        &self.nodes[node].aabb
    }

    #[inline(always)]
    fn is_leaf(&self, node: usize) -> bool {
        self.nodes[node].is_leaf()
    }

    /// By its number.
    #[inline(always)]
    fn leaf(&self, node: usize) -> u32 {
        self.nodes[node].number() as u32
    }

    #[inline(always)]
    fn below(&self, node: usize) -> [usize; 2] {
        self.nodes[node].children()
    }

    #[inline(always)]
    fn cuts(&self, node: usize) -> Cuts {
        self.cuts[node]
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, node: usize) {
        for child in self.below(node) {
            token.prefetch((&raw const self.nodes[child]).cast());
        }
    }
}

struct Solve<'a, I, const W: usize> {
    nodes: &'a [Node],
    forests: Vec<Forest>,
    measure: Measure,
    input: PhantomData<I>,
}

impl<I: Input, const W: usize> Operation for Solve<'_, I, W> {
    type Output = (Vec<Forest>, Vec<Cuts>);

    /// Every node after those below it.
    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let Self {
            nodes,
            forests: mut all,
            measure,
            ..
        } = self;
        let nodes = &nodes[all.len()..];
        let mut all_cuts = pages::with_capacity(nodes.len());
        for node in nodes {
            let area = measure.half_area(&node.aabb);
            if node.is_leaf() {
                all.push([area * I::leaf_cost(node.count()); MAX_WIDTH]);
                all_cuts.push(Cuts::NONE);
                continue;
            }
            let [left, right] = node.children();
            let joined = Joined::new::<W>(token, &all[left], &all[right]);
            let whole = joined.most::<W>() + area * cost::NODE;
            let (forest, cuts) = joined.below::<W>(token, whole);
            all.push(forest);
            all_cuts.push(cuts);
        }
        (all, all_cuts)
    }
}
