//! Two things or many at once with feature `rayon`, one after the other without.

use std::vec::Vec;

/// Fewer primitives than this are not worth handing over: they take some 300 µs, a hand-over a few.
pub(super) const TASK: usize = 1024;

/// Both results. At once, if `worth_it`.
#[cfg(feature = "rayon")]
pub(super) fn join<A: Send, B: Send>(
    worth_it: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if worth_it {
        rayon::join(a, b)
    } else {
        (a(), b())
    }
}

/// Both results.
#[cfg(not(feature = "rayon"))]
pub(super) fn join<A, B>(_worth_it: bool, a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// What is made of all items, in their order: many at once.
pub(super) fn map<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    make: impl Fn(T) -> R + Send + Sync,
) -> Vec<R> {
    #[cfg(feature = "rayon")]
    let items: Vec<T> = items.into_iter().collect();
    #[cfg(feature = "rayon")]
    if items.len() > 1 {
        use rayon::prelude::*;
        return items.into_par_iter().map(make).collect();
    }
    items.into_iter().map(make).collect()
}

/// How many threads there are.
pub(super) fn threads() -> usize {
    #[cfg(feature = "rayon")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "rayon"))]
    1
}

/// Whether work on so many primitives, or what there is of them, is worth being shared, and there is another thread.
#[cfg(feature = "rayon")]
pub(super) fn is_worth_it(count: usize) -> bool {
    count > 4 * TASK && threads() > 1
}
