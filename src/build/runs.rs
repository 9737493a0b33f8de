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

/// So many are loaded at once: the cache misses of one wait for those of none before it.
const AHEAD: usize = 64;

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
    if !watch.advance(places.len()) {
        return runs;
    }
    let mut filling = I::EMPTY;
    let mut bounds = Bounds::EMPTY;
    let mut cost = 0.0;
    let mut start = 0;
    let mut index = 0;
    let mut loaded = [(Ref::NONE, I::UNLOADED); AHEAD];
    for places in places.chunks(AHEAD) {
        for (loaded, &place) in loaded.iter_mut().zip(places) {
            let r = refs[place as usize];
            *loaded = (r, input.load(r.id()));
        }
        for (r, loaded) in &loaded[..places.len()] {
            let own = r.bounds();
            let own_cost = own.half_area() * I::leaf_cost(1);
            let joined = bounds.join(own);
            let joined_cost = joined.half_area() * I::leaf_cost(index - start + 1);
            let better = joined_cost <= (cost + own_cost) * I::JOINED;
            if index > start && better && I::add_loaded(&mut filling, loaded) {
                (bounds, cost) = (joined, joined_cost);
            } else {
                runs.close::<I>(&filling, index - start, first + start);
                I::clear(&mut filling);
                // One alone always fits.
                I::add_loaded(&mut filling, loaded);
                (bounds, cost, start) = (own, own_cost, index);
            }
            index += 1;
        }
    }
    runs.close::<I>(&filling, index - start, first + start);
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
