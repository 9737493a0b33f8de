//! Leaves of primitives that follow each other along a curve.

use super::{
    binary::BinaryNode,
    input::Input,
    monitor::Watch,
    refs::{Bounds, Ref},
};
use std::vec::Vec;

/// Leaves, in the order of the curve, and for each the node of a binary tree: its box, how many primitives it has, and
/// as `first` its number, counted from that of the first primitive on.
pub(super) struct Runs<L> {
    pub leaves: Vec<L>,
    pub nodes: Vec<BinaryNode>,
    base: u32,
}

/// Cuts a part of the curve, the places of whose references among `refs` are given, into leaves: each goes on for as
/// long as there is room and the heuristic has it better than two. `first` is where the part begins.
pub(super) fn cut<I: Input>(
    input: &I,
    refs: &[Ref],
    places: &[u32],
    first: usize,
    watch: &Watch,
) -> Runs<I::Leaf> {
    let mut runs = Runs {
        base: first as u32,
        leaves: Vec::with_capacity(places.len() / 2),
        nodes: Vec::with_capacity(places.len() / 2),
    };
    let mut filling = I::EMPTY;
    let mut bounds = Bounds::EMPTY;
    let mut cost = 0.0;
    let mut start = 0;
    if !watch.advance(places.len()) {
        return runs;
    }
    for (index, &place) in places.iter().enumerate() {
        let r = &refs[place as usize];
        let own = r.bounds();
        let own_cost = own.half_area() * I::leaf_cost(1);
        if index > start {
            let joined = bounds.join(own);
            let joined_cost = joined.half_area() * I::leaf_cost(index - start + 1);
            let better = joined_cost <= (cost + own_cost) * I::JOINED;
            if better && input.add(&mut filling, r.id()) {
                (bounds, cost) = (joined, joined_cost);
                continue;
            }
            runs.close::<I>(&filling, index - start, first + start);
            start = index;
        }
        I::clear(&mut filling);
        // One alone always fits.
        input.add(&mut filling, r.id());
        (bounds, cost) = (own, own_cost);
    }
    runs.close::<I>(&filling, places.len() - start, first + start);
    runs
}

impl<L> Runs<L> {
    fn close<I: Input<Leaf = L>>(&mut self, filling: &I::Filling, count: usize, first: usize) {
        if let Some(leaf) = I::leaf(filling, first as u32) {
            self.nodes.push(BinaryNode {
                aabb: I::aabb_of(filling),
                first: self.base + self.leaves.len() as u32,
                count: count as u32,
            });
            self.leaves.push(leaf);
        }
    }
}
