//! Lists of lanes.

use super::{Lane, MOST_LANES};
use core::ptr;

/// Lanes that are to do the same next. How many is known apart.
pub(super) struct List([*mut Lane; MOST_LANES + 1]);

impl List {
    pub(super) const EMPTY: Self = Self([ptr::null_mut(); MOST_LANES + 1]);

    #[inline(always)]
    pub(super) fn get(&self, place: usize) -> *mut Lane {
        // SAFETY: `place` is at most the length, which is at most the number of lanes.
        unsafe { *self.0.get_unchecked(place) }
    }

    /// For there to be one ahead of the last, of `len`, more than none: it again.
    #[inline(always)]
    pub(super) fn repeat_last(&mut self, len: usize) {
        self.0[len] = self.get(len - 1);
    }

    /// Written always, kept or not: no branch.
    #[inline(always)]
    pub(super) fn push_if(&mut self, len: &mut usize, lane: *mut Lane, wanted: bool) {
        // SAFETY: a lane is in a list once at most, so `len` is at most `MOST_LANES`.
        unsafe { *self.0.get_unchecked_mut(*len) = lane };
        *len += usize::from(wanted);
    }
}

/// Empties a list. Its places can be read until others are pushed over them.
#[inline(always)]
pub(super) fn take(len: &mut usize) -> usize {
    core::mem::take(len)
}
