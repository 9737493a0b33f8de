//! Large vectors on large pages.
//!
//! A ray in a large tree goes to a page or two for every node, and the processor remembers where some hundreds of small ones
//! are. Linux gives large ones for the asking alone, wherever it is not set to give them always or never.

use core::mem::MaybeUninit;
use std::vec::Vec;

/// An empty vector with room for so many, on large pages if the system has them.
pub(super) fn with_capacity<T>(capacity: usize) -> Vec<T> {
    let vector: Vec<T> = Vec::with_capacity(capacity);
    ask_for_large_pages(vector.as_ptr().cast(), capacity * size_of::<T>());
    vector
}

/// The items as a vector, on large pages if the system has them.
pub(super) fn collected<T>(items: impl ExactSizeIterator<Item = T>) -> Vec<T> {
    let mut vector = with_capacity(items.len());
    vector.extend(items);
    vector
}

/// A vector of so many times `value`, on large pages if the system has them.
///
/// With `rayon` all threads write it: for the system, too, new memory is work.
pub(super) fn filled<T: Copy + Send>(value: T, len: usize) -> Vec<T> {
    let mut vector = with_capacity(len);
    #[cfg(feature = "rayon")]
    if len * size_of::<T>() >= LARGE && super::parallel::threads() > 1 {
        use rayon::prelude::*;
        vector.par_extend(rayon::iter::repeat_n(value, len));
        return vector;
    }
    vector.resize(len, value);
    vector
}

/// So many bytes are worth more than one thread.
#[cfg(feature = "rayon")]
const LARGE: usize = 1 << 18;

/// A vector of `len`, on large pages if the system has them, of which every `chunk` are made in one go, at once with
/// others. `make` is told which is the first of them; if it makes less than there is room for, the vector is empty.
pub(super) fn made<T: Copy + Send>(
    len: usize,
    chunk: usize,
    make: impl Fn(usize, &mut Slots<T>) + Sync,
) -> Vec<T> {
    let mut vector = with_capacity(len);
    let make = |(index, slots): (usize, &mut [MaybeUninit<T>])| {
        let mut slots = Slots { slots, written: 0 };
        make(index * chunk, &mut slots);
        slots.written == slots.slots.len()
    };
    let slots = &mut vector.spare_capacity_mut()[..len];
    #[cfg(feature = "rayon")]
    let all_made = {
        use rayon::prelude::*;
        slots.par_chunks_mut(chunk).enumerate().all(make)
    };
    #[cfg(not(feature = "rayon"))]
    let all_made = slots.chunks_mut(chunk).enumerate().all(make);
    if all_made {
        // SAFETY: all chunks of so many, and every slot of each, have been written: it was asked above.
        unsafe { vector.set_len(len) };
    }
    vector
}

/// Slots that are written one after the other.
pub(super) struct Slots<'a, T> {
    slots: &'a mut [MaybeUninit<T>],
    written: usize,
}

impl<T> Slots<'_, T> {
    /// How many are left.
    #[inline(always)]
    pub fn left(&self) -> usize {
        self.slots.len() - self.written
    }

    /// Writes the next, if one is left.
    #[inline(always)]
    pub fn push(&mut self, value: T) {
        if let Some(slot) = self.slots.get_mut(self.written) {
            slot.write(value);
            self.written += 1;
        }
    }
}

#[cfg(target_os = "linux")]
fn ask_for_large_pages(start: *const u8, bytes: usize) {
    /// The least page there is: the start of a range has to be that of a page.
    const PAGE: usize = 1 << 16;
    /// Less than this hardly holds one large page, which begin at multiples of 2 MiB.
    const LEAST: usize = 1 << 22;
    if bytes < LEAST {
        return;
    }
    let offset = start.addr().wrapping_neg() % PAGE;
    let first = start.wrapping_add(offset).cast_mut();
    let rest = (bytes - offset) / PAGE * PAGE;
    // SAFETY: whole pages within one allocation. The advice changes how they are mapped, not what is in them. An error
    // means that there are no large pages, and nothing has been done.
    unsafe { libc::madvise(first.cast(), rest, libc::MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn ask_for_large_pages(_: *const u8, _: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_made_or_none() {
        // Three more than there is room for, as many, and one less in one chunk.
        for (more, len) in [(3, 10), (0, 10), (-1, 0)] {
            let numbers = made(10, 4, |first, slots| {
                let count = slots.left() as isize + if first == 4 { more } else { 0 };
                (first..first + count as usize).for_each(|number| slots.push(number));
            });
            assert!(numbers.iter().copied().eq(0..len));
        }
    }
}
