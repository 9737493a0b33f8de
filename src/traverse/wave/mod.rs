//! Many rays at once, a step at a time in turn.
//!
//! A ray alone waits: for its node to be loaded, for the boxes to be tested, for what was guessed wrong. Here some are under
//! way together, and one's wait is another's work. What follows from a step is hardly branched on, for it cannot be guessed:
//! a node's children are written to the ray's stack by a permutation, and the ray goes to the list of those at a node, at a
//! leaf, with a hit, with several, with none, or at their end.
//!
//! A step is in parts, of which each is done for another ray than the one before it: a processor sees a few hundred
//! instructions ahead, and one ray's step from its node's place to the next one's, or from its leaf to what is left on its
//! stack, is longer than that allows to hide. So what the one thing that is branched on, a first look at a leaf, has shown
//! is known by the time it is asked for, and a wrong guess costs little.
//!
//! Children on the stack are in the order of lanes, but for the nearest, which comes next.
//!
//! Several rays in flight to hide latency: Wald, Slusallek, Benthin, Wagner, "Interactive rendering with coherent ray
//! tracing" (2001). Children written by a permutation: Fuetterling, Lojewski, Pfreundt, Ebert, "Efficient ray
//! tracing kernels for modern CPU architectures" (2015).

mod lane;
mod leaf_hits;
mod list;

pub(super) use lane::Lane;

use super::{feed::Feed, query::Query};
use crate::{
    layout::{Bvh, Child, Link, Storage, TriangleLeaves, WideNode},
    simd::Simd,
};
use core::{mem::MaybeUninit, ptr};
use list::{List, take};

/// The most lanes of a wave.
pub(super) const MOST_LANES: usize = 64;

/// Traces all rays of `feed`, on `lanes`.
#[inline(always)]
pub(super) fn trace<
    T: Simd,
    N: WideNode,
    L: TriangleLeaves,
    S: Storage,
    Q: Query,
    const LANES: usize,
>(
    token: T,
    bvh: &Bvh<N, L, S>,
    feed: &mut Feed<N, L, S, Q>,
    lanes: &mut [MaybeUninit<Lane>; LANES],
) {
    const { assert!(0 < LANES && LANES <= MOST_LANES) };
    // Lengths apart from what they are of, and both from all else, so that they stay in registers.
    let (mut next, mut lens) = (Next::NONE, NextLens::default());
    // What comes after nodes, and after leaves.
    let (mut at_leaf, mut at_end) = (List::EMPTY, List::EMPTY);
    let (mut at_hit, mut at_hits, mut at_miss) = (List::EMPTY, List::EMPTY, List::EMPTY);
    // Then nodes' links are fetched, too, and of leaves that say where to read on what is there.
    let is_large = bvh.is_large();
    if bvh.root() == Child::EMPTY {
        while let Some((index, ..)) = feed.next() {
            feed.answer(index, None);
        }
        return;
    }
    let root = Link::new::<N>(bvh.root());
    for lane in lanes.iter_mut().map(MaybeUninit::as_mut_ptr) {
        // SAFETY: `lane` is one of them.
        unsafe { Lane::clear(lane) };
        // SAFETY: the same.
        let started = unsafe { Lane::start(lane, root, feed) };
        next.push_if(&mut lens, lane, root, started);
    }
    loop {
        // Leaves wait for company until few rays are at nodes.
        if lens.nodes > LANES / 4 || lens.rest == 0 {
            if lens.nodes == 0 {
                return;
            }
            let count = take(&mut lens.nodes);
            // For there to be one ahead of the last.
            next.at_node.repeat_last(count);
            let mut tested = in_list(next.at_node.get(0)).test_boxes(token, bvh);
            let mut before = root;
            for place in 0..count {
                let lane = next.at_node.get(place);
                let ahead = in_list(next.at_node.get(place + 1)).test_boxes(token, bvh);
                let state = in_list(lane);
                state.take_children::<T, N, Q>(token, &tested);
                fetch(token, bvh, before, is_large);
                (tested, before) = (ahead, state.current());
                next.push_if(&mut lens, lane, before, true);
            }
            fetch(token, bvh, before, is_large);
            continue;
        }
        let (mut leaves, mut ends) = (0, 0);
        for place in 0..take(&mut lens.rest) {
            let lane = next.at_rest.get(place);
            let end = in_list(lane).has_ended();
            at_leaf.push_if(&mut leaves, lane, !end);
            at_end.push_if(&mut ends, lane, end);
        }
        if is_large {
            for place in 0..leaves {
                let leaf = in_list(at_leaf.get(place)).current().leaf();
                // SAFETY: the layout's check saw that all leaves led to are there.
                unsafe { bvh.fetch_next(token, leaf) };
            }
        }
        let (mut one, mut many, mut misses) = (0, 0, 0);
        if leaves > 0 {
            // As among nodes.
            at_leaf.repeat_last(leaves);
            let mut look = in_list(at_leaf.get(0)).look(token, bvh);
            for place in 0..leaves {
                let lane = at_leaf.get(place);
                let ahead = in_list(at_leaf.get(place + 1)).look(token, bvh);
                let mask = in_list(lane).test_leaf::<T, N, L, S, Q>(token, bvh, look);
                look = ahead;
                let several = mask & mask.wrapping_sub(1) != 0;
                at_hit.push_if(&mut one, lane, (mask != 0) & !several);
                at_hits.push_if(&mut many, lane, several);
                at_miss.push_if(&mut misses, lane, mask == 0);
            }
        }
        for place in 0..one {
            in_list(at_hit.get(place)).take_hit::<T, N, L, S, Q>(token, bvh);
        }
        for place in 0..many {
            in_list(at_hits.get(place)).take_nearest_hit(token, bvh);
        }
        for (at, count) in [(&at_hit, one), (&at_hits, many), (&at_miss, misses)] {
            for place in 0..count {
                let lane = at.get(place);
                let state = in_list(lane);
                state.take_last();
                fetch(token, bvh, state.current(), is_large);
                next.push_if(&mut lens, lane, state.current(), true);
            }
        }
        for place in 0..ends {
            let lane = at_end.get(place);
            in_list(lane).answer(feed);
            // SAFETY: it is one of them.
            let started = unsafe { Lane::start(lane, root, feed) };
            next.push_if(&mut lens, lane, root, started);
        }
    }
}

/// Lanes by what is next for them.
struct Next {
    at_node: List,
    /// At a leaf, or at their end.
    at_rest: List,
}

/// How many there are of [`Next`].
#[derive(Default)]
struct NextLens {
    nodes: usize,
    rest: usize,
}

impl Next {
    const NONE: Self = Self {
        at_node: List::EMPTY,
        at_rest: List::EMPTY,
    };

    /// As [`List::push_if`], a lane for which this is next.
    #[inline(always)]
    fn push_if(&mut self, lens: &mut NextLens, lane: *mut Lane, next: Link, wanted: bool) {
        let leaf = next.is_leaf();
        self.at_node.push_if(&mut lens.nodes, lane, wanted & !leaf);
        self.at_rest.push_if(&mut lens.rest, lane, wanted & leaf);
    }
}

/// A lane that is in a list.
#[inline(always)]
fn in_list<'a>(lane: *mut Lane) -> &'a mut Lane {
    // SAFETY: lists have lanes in which `start` has put a ray, and no other reference to one is used after this is made.
    unsafe { &mut *lane }
}

/// Has what is next for a ray fetched, or anything if it has ended. All of a node only if the scene `is_large`.
#[inline(always)]
fn fetch<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
    token: T,
    bvh: &Bvh<N, L, S>,
    next: Link,
    is_large: bool,
) {
    // Not by a branch, nor anything that may become one. The address that is not meant may be of nothing, and past what
    // 32 bits hold.
    let nodes = bvh.nodes().as_ptr();
    let node = nodes.wrapping_byte_add(next.node_offset()).addr();
    let leaf = bvh.leaf_address(next.leaf()).addr();
    let is_leaf = 0usize.wrapping_sub(usize::from(next.is_leaf()));
    let next = ptr::without_provenance(node ^ ((node ^ leaf) & is_leaf));
    token.prefetch(next);
    if is_large {
        N::prefetch_links(token, next);
    }
}
