//! Leaves of primitives that follow each other along a curve.

use super::{input::Input, ploc::Node, refs::Bounds};
use crate::simd::{Backend, Operation, Simd};
use std::vec::Vec;
use wide::f32x4;

/// Leaves, in the order of the curve, and for each a node.
pub(super) struct Runs<'a, L> {
    pub leaves: &'a mut Vec<L>,
    pub nodes: &'a mut Vec<Node>,
}

/// So many are loaded at once, while those after them are fetched: their cache misses wait for nothing.
const AHEAD: usize = 64;

/// How many times as much a run may cost as leaves that are joined elsewhere: so there are 15 % fewer of them, which is
/// as much off the time for the tree over them, for 1 to 2 % of its cost.
const LONGER: f32 = 1.25;

/// Cuts a part of the curve, whose primitives are given, into leaves: each goes on for as long as there is room and the
/// heuristic has it better than two. `first` is where the part begins, `scale` what areas are measured in. The leaves go
/// to the end of `runs`.
pub(super) fn cut<I: Input>(input: &I, ids: &[u32], first: usize, scale: f32, runs: Runs<I::Leaf>) {
    Backend::detect().run(Cut {
        input,
        ids,
        first: first as u32,
        scale,
        runs,
    });
}

struct Cut<'a, I: Input> {
    input: &'a I,
    ids: &'a [u32],
    first: u32,
    scale: f32,
    runs: Runs<'a, I::Leaf>,
}

impl<I: Input> Operation for Cut<'_, I> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            input,
            ids,
            first,
            scale,
            mut runs,
        } = self;
        let Some(&id) = ids.first() else {
            return;
        };
        let loaded = input.load(id);
        let mut filling = I::begin(token, &loaded);
        let mut bounds = I::bounds(&loaded);
        let mut cost = f32::INFINITY;
        let mut count = 0;
        let mut place = first;
        // Those of the next `AHEAD`, once their turn comes.
        let mut places = [I::Place::default(); AHEAD];
        let mut ahead = [I::UNLOADED; AHEAD];
        for (place, &id) in places.iter_mut().zip(ids) {
            *place = input.place(id);
        }
        let mut later = ids;
        while !later.is_empty() {
            let now = later.len().min(AHEAD);
            later = &later[now..];
            for (loaded, &place) in ahead.iter_mut().zip(&places[..now]) {
                *loaded = input.load_from(place);
            }
            for (index, loaded) in ahead[..now].iter().enumerate() {
                if let Some(&id) = later.get(index) {
                    places[index] = input.place(id);
                    input.fetch(token, places[index]);
                }
                if let Some(&id) = later.get(index + AHEAD) {
                    input.fetch_place(token, id);
                }
                let own = I::bounds(loaded);
                let own_cost = half_area(own, scale) * I::leaf_cost(1);
                let joined = bounds.join(own);
                let joined_cost = half_area(joined, scale) * I::leaf_cost(count + 1);
                let better = joined_cost <= (cost + own_cost) * (I::JOINED * LONGER);
                // The first of all is in the leaf.
                if count == 0 {
                    (cost, count) = (own_cost, 1);
                } else if better && I::add(token, &mut filling, loaded) {
                    (bounds, cost) = (joined, joined_cost);
                    count += 1;
                } else {
                    runs.close::<I, S>(&filling, bounds, count, place);
                    place += count as u32;
                    filling = I::begin(token, loaded);
                    (bounds, cost, count) = (own, own_cost, 1);
                }
            }
        }
        runs.close::<I, S>(&filling, bounds, count, place);
    }
}

impl<L> Runs<'_, L> {
    #[inline(always)]
    fn close<I: Input<Leaf = L>, S: Simd>(
        &mut self,
        filling: &I::Filling<S>,
        bounds: Bounds,
        count: usize,
        first: u32,
    ) {
        let number = self.leaves.len() as u32;
        self.nodes
            .push(Node::leaf(bounds.aabb(), number, count as u32));
        self.leaves.push(I::leaf(filling, first));
    }
}

/// Half the area of a box, scaled first so that no square overflows or vanishes.
#[inline(always)]
fn half_area(bounds: Bounds, scale: f32) -> f32 {
    let scale = f32x4::splat(scale);
    let [x, y, z, _] = (bounds.max * scale - bounds.min * scale).to_array();
    x * y + (x + y) * z
}
