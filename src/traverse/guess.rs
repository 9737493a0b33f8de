//! What a walk goes on with before it is known.
//!
//! A walk is a chain: a node's boxes are tested, from that it follows which child is next, and that one's boxes are loaded.
//! Loaded by a number, they wait for it. But where a branch says which they are, a processor guesses the branch and
//! begins with them while the test is under way. Rays asked about one after the other go similar ways, so it guesses well.
//!
//! Numbers that are guessed: Lipasti, Wilkerson, Shen, "Value locality and load value prediction" (1996).

use core::hint::black_box;

/// The lowest bit set of a mask that is not 0. On x86-64 what follows from it is begun with the one that the processor guesses.
#[inline(always)]
pub(super) fn guessed_lowest(mask: u32) -> usize {
    if cfg!(target_arch = "x86_64") {
        // Branches, not a table of jumps: they are known sooner, and guessed better.
        for lane in 0..7 {
            if mask & 1 << lane != 0 {
                // Opaque to the compiler: it would see that all of this is the number below.
                return black_box(lane);
            }
        }
    }
    mask.trailing_zeros() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_lowest_bit() {
        for mask in 1..1 << 10 {
            assert_eq!(guessed_lowest(mask), mask.trailing_zeros() as usize);
        }
    }
}
