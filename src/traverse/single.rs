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
use core::{mem::MaybeUninit, ops::ControlFlow, ptr};

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

/// The children left behind: those below `len` were written, the next one last.
type Stack = [MaybeUninit<Entry>; STACK];

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
    walk_boxes(token, bvh, &mut boxes, t_max, visitor);
}

/// [`walk`], however boxes are tested. `bvh` is not empty.
#[inline(always)]
pub(super) fn walk_boxes<
    T: Simd,
    N: WideNode,
    L: Leaves,
    S: Storage,
    B: Boxes<N>,
    V: Visitor<L>,
>(
    token: T,
    bvh: &Bvh<N, L, S>,
    boxes: &mut B,
    t_max: f32,
    visitor: &mut V,
) {
    let margin = boxes.margin();
    let mut t_max = reach_of(t_max, margin);
    // Where any order will do, what is guessed is mostly right, and what caches hold is there in time.
    let fetches = V::NEAREST_FIRST || bvh.is_large();
    // Apart, so that the length stays in a register and nothing is cleared.
    let mut stack: Stack = [MaybeUninit::uninit(); STACK];
    let mut len = 0;
    let mut current = Link::new::<N>(bvh.root());
    loop {
        while !current.is_leaf() {
            visitor.node();
            // SAFETY: the layout's check saw that all nodes led to are there.
            let node = unsafe { bvh.node(current) };
            if fetches {
                // Read when it is known which, too late to wait for a line that the boxes were not in.
                N::prefetch_links(token, ptr::from_ref(node).cast());
                bvh.prefetch_leaves(token, node);
            }
            let (mask, near) = boxes.test(node, t_max);
            if mask == 0 {
                match pop::<L, V>(&stack, &mut len, t_max) {
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
            if others == 0 {
                continue;
            }
            let near = B::nears(near);
            // SAFETY: `mask` has a bit for the lane, and bits for the node's lanes alone.
            let entry = |lane: usize| unsafe {
                let near = if V::NEAREST_FIRST {
                    B::near(&near, lane)
                } else {
                    0.0
                };
                Entry::new(near, node.link(lane))
            };
            let mut nearest = entry(first);
            let base = len;
            loop {
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
                // SAFETY: the layout's check saw that a walk never leaves more than `STACK`
                // children behind.
                unsafe { stack.get_unchecked_mut(len).write(farther) };
                len += 1;
                if others == 0 {
                    break;
                }
            }
            if V::NEAREST_FIRST {
                // SAFETY: these were just written.
                unsafe { sort(stack.get_unchecked_mut(base..len)) };
            }
            current = nearest.link();
        }

        // SAFETY: the layout's check saw that all leaves led to are there.
        let leaf = unsafe { bvh.leaf(current.leaf()) };
        match visitor.leaf(leaf) {
            ControlFlow::Break(()) => return,
            ControlFlow::Continue(t) => t_max = reach_of(t, margin),
        }
        boxes.renew();
        match pop::<L, V>(&stack, &mut len, t_max) {
            Some(link) => current = link,
            None => return,
        }
    }
}

/// The last child left behind that is still near enough: all are where no `t` was kept, for their range never shrinks.
#[inline(always)]
fn pop<L: Leaves, V: Visitor<L>>(stack: &Stack, len: &mut usize, t_max: f32) -> Option<Link> {
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
