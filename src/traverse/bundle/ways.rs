//! Where rays of a bundle are still to go.

use crate::{
    layout::{Bvh, Leaves, Link, STACK, Storage, WideNode},
    simd::Simd,
};
use core::mem::MaybeUninit;

/// A child to go to, for some of the rays.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub link: Link,
    /// From which `t` on any of them may meet its box.
    pub near: f32,
    /// The node whose child it is.
    pub parent: Link,
    /// Its lane there if the rays are still to be tested against its box, else [`TESTED`](Self::TESTED).
    pub lane: u8,
    /// Whether all of the bundle's rays pass the box, or nearly, as far as it was known then.
    pub by_all: bool,
    pub rays: u64,
}

impl Entry {
    /// No lane.
    pub(super) const TESTED: u8 = u8::MAX;
}

/// A stack of them. How many there are is known apart, so that it stays in a register.
pub(super) type Ways = [MaybeUninit<Entry>; STACK];

/// Puts an entry where it belongs among those from `base` on, of which the nearest is the last; of equals, it comes last.
/// Has what it leads to fetched.
///
/// # Safety
/// Those below `len` were written, `base` is no more than that, and there is room for another.
#[inline(always)]
pub(super) unsafe fn insert<T: Simd, N: WideNode, L: Leaves, S: Storage>(
    token: T,
    bvh: &Bvh<N, L, S>,
    ways: &mut Ways,
    base: usize,
    len: &mut usize,
    entry: Entry,
) {
    bvh.prefetch(token, entry.link);
    let mut place = *len;
    // SAFETY: the caller's promise: `place` is from `base` to the length.
    unsafe {
        while place > base {
            let before = ways.get_unchecked(place - 1).assume_init();
            if before.near >= entry.near {
                break;
            }
            ways.get_unchecked_mut(place).write(before);
            place -= 1;
        }
        ways.get_unchecked_mut(place).write(entry);
    }
    *len += 1;
}
