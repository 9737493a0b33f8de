//! What a walk goes on with before it is known.
//!
//! A walk is a chain: a node's boxes are tested, from that it follows which child is next, and that one's boxes are loaded.
//! Loaded by a number, they wait for it. But where a branch says which they are, a processor guesses the branch and
//! begins with them while the test is under way. Rays asked about one after the other go similar ways, so it guesses well.
//!
//! Numbers that are guessed: Lipasti, Wilkerson, Shen, "Value locality and load value prediction" (1996).

use core::hint::black_box;

/// `lane`, at most 8. On x86-64 what follows from it is begun with the number that the processor guesses.
#[inline(always)]
pub(super) fn guessed(lane: usize) -> usize {
    if !cfg!(target_arch = "x86_64") {
        return lane;
    }
    // Opaque to the compiler: it would see that all of this is `lane`.
    match lane {
        0 => black_box(0),
        1 => black_box(1),
        2 => black_box(2),
        3 => black_box(3),
        4 => black_box(4),
        5 => black_box(5),
        6 => black_box(6),
        7 => black_box(7),
        _ => lane,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_lane_itself() {
        for lane in 0..=8 {
            assert_eq!(guessed(black_box(lane)), lane);
        }
    }
}
