//! Large vectors on large pages.
//!
//! A ray in a large tree goes to a page or two for every node, and the processor remembers where some hundreds of small ones
//! are. Linux gives large ones for the asking alone, wherever it is not set to give them always or never.

use std::vec::Vec;

/// An empty vector with room for so many, on large pages if the system has them.
pub(super) fn with_capacity<T>(capacity: usize) -> Vec<T> {
    let vector: Vec<T> = Vec::with_capacity(capacity);
    ask_for_large_pages(vector.as_ptr().cast(), capacity * size_of::<T>());
    vector
}

/// A vector of so many times `value`, on large pages if the system has them.
pub(super) fn filled<T: Copy>(value: T, len: usize) -> Vec<T> {
    let mut vector = with_capacity(len);
    vector.resize(len, value);
    vector
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
