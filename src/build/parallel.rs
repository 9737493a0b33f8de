//! Two things at once with feature `rayon`, one after the other without.

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

/// Whether there are no other threads.
pub(super) fn is_alone() -> bool {
    #[cfg(feature = "rayon")]
    return rayon::current_num_threads() == 1;
    #[cfg(not(feature = "rayon"))]
    true
}
