//! The walk of one ray through a hierarchy.

use super::{
    boxes::{AtOnce, Boxes},
    guess::guessed_lowest,
};
use crate::{
    layout::{Bvh, Child, Leaves, Link, STACK, Storage, WideNode},
    simd::Simd,
    slab::{NarrowRay, reach_of},
};
use core::{
    mem::{self, MaybeUninit},
    ops::ControlFlow,
    ptr,
};

/// What is done on the way.
pub(crate) trait Visitor<L: Leaves> {
    /// Whether children are wanted the nearest first. Any order will do to find out that something is
    /// in the way, and then the `t` up to which to look on stays as it is.
    const NEAREST_FIRST: bool;

    /// A node is tested.
    #[inline(always)]
    fn node(&mut self) {}

    /// A leaf is reached. The `t` up to which to look on, or `Break` if enough is known.
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32>;
}

/// A child to come back to, and the `t` from which on the ray is in its box: the bits of `t` above those
/// of the child, so that entries compare as their `t` do. Where boxes are tested one by one it may be negative: those come
/// first, though not in order among themselves, which costs time and nothing else.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry(i64);

impl Entry {
    #[inline(always)]
    fn new(near: f32, link: Link) -> Self {
        Self(i64::from(near.to_bits()) << 32 | i64::from(link.to_bits()))
    }

    #[inline(always)]
    fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn link(self) -> Link {
        Link::from_bits(self.0 as u32)
    }
}

/// The children left behind: those below a length were written, the next one last.
type Stack<const ROOM: usize> = [MaybeUninit<Entry>; ROOM];

/// How many children a walk has room for to leave behind. With more than [`STACK`] it looks ahead: see [`walk_boxes`].
pub(super) struct Room<const CHILDREN: usize>;

/// While more children than this are left behind a walk does not look ahead.
const AHEAD: usize = 64;
/// The most children of a node.
const WIDEST: usize = 8;
/// Room for what a walk leaves behind that looks ahead: what was there once it last did, and what it leaves behind since, no more
/// than one that does not.
const ROOM_AHEAD: usize = AHEAD + WIDEST + STACK;

/// Takes `visitor` to every leaf whose box the ray passes within its range, which ends at `t_max` and shrinks on the way.
#[inline(always)]
pub(crate) fn walk<T: Simd, N: WideNode, L: Leaves, S: Storage, V: Visitor<L>>(
    token: T,
    bvh: &Bvh<N, L, S>,
    ray: &NarrowRay,
    t_max: f32,
    visitor: &mut V,
) {
    if bvh.root() == Child::EMPTY {
        return;
    }
    let mut boxes = AtOnce::new(token, ray);
    if T::FETCHES && bvh.looks_ahead() {
        let room = Room::<ROOM_AHEAD>;
        walk_boxes(token, bvh, &mut boxes, t_max, visitor, room);
    } else {
        let room = Room::<STACK>;
        walk_boxes(token, bvh, &mut boxes, t_max, visitor, room);
    }
}

/// [`walk`], however boxes are tested. `bvh` is not empty.
///
/// If there is room, it looks ahead: where caches do not hold the hierarchy, what is next is not there yet when it is known. While
/// it comes, the node that was left behind last is walked, which has been fetched since: all of its children are left behind in its
/// place, and fetched. That is in vain if what is next has a nearer hit: over ten million triangles bounce rays meet a fiftieth more
/// nodes, random ones a tenth.
#[inline(always)]
pub(super) fn walk_boxes<
    T: Simd,
    N: WideNode,
    L: Leaves,
    S: Storage,
    B: Boxes<N>,
    V: Visitor<L>,
    const ROOM: usize,
>(
    token: T,
    bvh: &Bvh<N, L, S>,
    boxes: &mut B,
    t_max: f32,
    visitor: &mut V,
    _: Room<ROOM>,
) {
    const { assert!(N::WIDTH <= WIDEST) };
    let looks_ahead = const { ROOM >= ROOM_AHEAD };
    let margin = boxes.margin();
    let mut t_max = reach_of(t_max, margin);
    // Where any order will do, what is guessed is mostly right, and what caches hold is there in time.
    let fetches = V::NEAREST_FIRST || looks_ahead || bvh.is_large();
    // Apart, so that the length stays in a register and nothing is cleared.
    let mut stack: Stack<ROOM> = [MaybeUninit::uninit(); ROOM];
    let mut len = 0;
    let mut current = Link::new::<N>(bvh.root());
    // What is next, while another node is walked in its place; a leaf until it is tested. Else empty.
    let mut waiting = Link::EMPTY;
    loop {
        while !current.is_leaf() {
            visitor.node();
            // SAFETY: the layout's check saw that all nodes led to are there.
            let node = unsafe { bvh.node(current) };
            if fetches {
                // Read when it is known which, too late to wait for a line that the boxes were not in.
                N::prefetch_links(token, ptr::from_ref(node).cast());
                bvh.prefetch_leaves(token, node);
                if looks_ahead {
                    bvh.prefetch_vertices(token, node);
                }
            }
            let is_ahead = looks_ahead && waiting != Link::EMPTY;
            let (mask, nears) = boxes.test(node, t_max);
            if mask == 0 {
                if is_ahead {
                    current = resume(&mut waiting);
                    continue;
                }
                match pop::<L, V, ROOM>(&stack, &mut len, t_max) {
                    Some(link) => current = link,
                    None => return,
                }
                continue;
            }
            let mut others = mask & (mask - 1);
            // Of several the nearest is found by numbers, which takes less than guesses that are wrong.
            let first = if others == 0 || !V::NEAREST_FIRST {
                guessed_lowest(mask)
            } else {
                mask.trailing_zeros() as usize
            };
            // SAFETY: `mask` has bits for the node's lanes alone.
            current = unsafe { node.link(first) };
            if others == 0 && !is_ahead {
                // A leaf is looked after below. With several children the last one left behind has not been fetched, either.
                if looks_ahead
                    && !current.is_leaf()
                    && let Some(ahead) = pop_node::<L, V, ROOM>(&stack, &mut len, t_max)
                {
                    bvh.prefetch(token, current);
                    waiting = mem::replace(&mut current, ahead);
                }
                continue;
            }
            // SAFETY: `mask` has a bit for the lane, and bits for the node's lanes alone.
            let entry = |lane: usize| unsafe {
                let near = if V::NEAREST_FIRST {
                    B::near(&nears, lane)
                } else {
                    0.0
                };
                Entry::new(near, node.link(lane))
            };
            let mut nearest = entry(first);
            let base = len;
            while others != 0 {
                let other = entry(others.trailing_zeros() as usize);
                others &= others - 1;
                let farther = if V::NEAREST_FIRST {
                    let farther = nearest.max(other);
                    nearest = nearest.min(other);
                    farther
                } else {
                    other
                };
                if fetches {
                    bvh.prefetch(token, farther.link());
                }
                // SAFETY: the layout's check saw that a walk never leaves `STACK` children behind. One that looks ahead leaves
                // them on top of what was there when it last did: less than `AHEAD`, and a node's children.
                unsafe { stack.get_unchecked_mut(len).write(farther) };
                len += 1;
            }
            if V::NEAREST_FIRST {
                // SAFETY: these were just written.
                unsafe { sort(stack.get_unchecked_mut(base..len)) };
            }
            current = nearest.link();
            if is_ahead {
                bvh.prefetch(token, current);
                // SAFETY: `pop_node` left less than `AHEAD`, and on top are no more than a node's children.
                unsafe { stack.get_unchecked_mut(len).write(nearest) };
                len += 1;
                current = resume(&mut waiting);
            }
        }

        if looks_ahead {
            if waiting == Link::EMPTY
                && let Some(ahead) = pop_node::<L, V, ROOM>(&stack, &mut len, t_max)
            {
                // SAFETY: the layout's check saw that all leaves led to are there.
                unsafe { bvh.fetch_next(token, current.leaf()) };
                waiting = mem::replace(&mut current, ahead);
                continue;
            }
            waiting = Link::EMPTY;
        }
        // SAFETY: the layout's check saw that all leaves led to are there.
        let leaf = unsafe { bvh.leaf(current.leaf()) };
        match visitor.leaf(leaf) {
            ControlFlow::Break(()) => return,
            ControlFlow::Continue(t) => t_max = reach_of(t, margin),
        }
        boxes.renew();
        match pop::<L, V, ROOM>(&stack, &mut len, t_max) {
            Some(link) => current = link,
            None => return,
        }
    }
}

/// The last child left behind that is still near enough: all are where no `t` was kept, for their range never shrinks.
#[inline(always)]
fn pop<L: Leaves, V: Visitor<L>, const ROOM: usize>(
    stack: &Stack<ROOM>,
    len: &mut usize,
    t_max: f32,
) -> Option<Link> {
    while *len > 0 {
        *len -= 1;
        // SAFETY: those below the length were written.
        let entry = unsafe { stack.get_unchecked(*len).assume_init() };
        if !V::NEAREST_FIRST || entry.near() <= t_max {
            return Some(entry.link());
        }
    }
    None
}

/// The last child left behind, if that is a node and near enough, and if no more than [`AHEAD`] are.
#[inline(always)]
fn pop_node<L: Leaves, V: Visitor<L>, const ROOM: usize>(
    stack: &Stack<ROOM>,
    len: &mut usize,
    t_max: f32,
) -> Option<Link> {
    let last = len.wrapping_sub(1);
    if last >= AHEAD {
        return None;
    }
    // SAFETY: those below the length were written.
    let entry = unsafe { stack.get_unchecked(last).assume_init() };
    if entry.link().is_leaf() || V::NEAREST_FIRST && entry.near() > t_max {
        return None;
    }
    *len = last;
    Some(entry.link())
}

/// What waits. A leaf is kept in mind, not to wait again.
#[inline(always)]
fn resume(waiting: &mut Link) -> Link {
    let link = *waiting;
    if !link.is_leaf() {
        *waiting = Link::EMPTY;
    }
    link
}

/// Sorts a few entries, the nearest last.
///
/// # Safety
/// All were written.
#[inline(always)]
unsafe fn sort(entries: &mut [MaybeUninit<Entry>]) {
    for sorted in 1..entries.len() {
        // SAFETY: the caller's promise; `place` is at most `sorted`.
        unsafe {
            let entry = entries.get_unchecked(sorted).assume_init();
            let mut place = sorted;
            while place > 0 && entries.get_unchecked(place - 1).assume_init() < entry {
                *entries.get_unchecked_mut(place) = *entries.get_unchecked(place - 1);
                place -= 1;
            }
            entries.get_unchecked_mut(place).write(entry);
        }
    }
}
