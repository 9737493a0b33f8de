//! The cheapest collapse of a tree whose leaves stay what they are: as [`collapse`](super::collapse), but for speed.
//!
//! The costs of a node's forests are needed for its parent's, and then no more. What is kept is how each is made.

use super::{
    cost::{self, Measure},
    cuts::{Cuts, Forest, Joined, MAX_WIDTH},
    emit::Shape,
    input::Input,
    monitor::{STRIDE, Watch},
    pages,
    ploc::Node,
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Operation, Simd},
};
use core::marker::PhantomData;
use std::vec::Vec;

/// The cheapest collapse to nodes `W` wide.
pub(super) struct LeafCollapse<'a, const W: usize> {
    nodes: &'a [Node],
    cuts: Vec<Cuts>,
}

impl<'a, const W: usize> LeafCollapse<'a, W> {
    pub fn new<I: Input>(nodes: &'a [Node], watch: &Watch) -> Self {
        let bounds = nodes.last().map_or(Aabb::EMPTY, |root| root.aabb);
        let cuts = Backend::detect().run(Solve::<I, W> {
            nodes,
            measure: Measure::of_bounds(&bounds),
            watch,
            input: PhantomData,
        });
        Self { nodes, cuts }
    }
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
    measure: Measure,
    watch: &'a Watch<'a>,
    input: PhantomData<I>,
}

impl<I: Input, const W: usize> Operation for Solve<'_, I, W> {
    type Output = Vec<Cuts>;

    /// Every node after those below it.
    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Vec<Cuts> {
        let mut forests = pages::with_capacity::<Forest>(self.nodes.len());
        let mut all = pages::with_capacity(self.nodes.len());
        for nodes in self.nodes.chunks(STRIDE) {
            self.watch.advance(nodes.len());
            for node in nodes {
                let area = self.measure.half_area(&node.aabb);
                if node.is_leaf() {
                    forests.push([area * I::leaf_cost(node.count()); MAX_WIDTH]);
                    all.push(Cuts::NONE);
                    continue;
                }
                let [left, right] = node.children();
                let joined = Joined::new::<W>(token, &forests[left], &forests[right]);
                let whole = joined.most::<W>() + area * cost::NODE;
                let (forest, cuts) = joined.below::<W>(token, whole);
                forests.push(forest);
                all.push(cuts);
            }
        }
        all
    }
}
