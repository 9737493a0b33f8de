//! Keys in their order, digit by digit from the lowest on.

#[cfg(all(feature = "rayon", target_has_atomic = "64"))]
mod at_once;

use super::{
    morton::{BITS, CELLS, ID_BITS},
    pages,
};
use std::vec::Vec;

/// Of a code.
const DIGITS: usize = 3;

fn id(key: u64) -> u32 {
    key as u32 & ((1 << ID_BITS) - 1)
}

/// The numbers in keys, which are in order below the code, in the order of keys.
pub(super) fn sorted(mut keys: Vec<u64>) -> Vec<u32> {
    #[cfg(all(feature = "rayon", target_has_atomic = "64"))]
    if super::parallel::is_worth_it(keys.len()) {
        return at_once::sorted(keys);
    }
    let mut counts = [[0; CELLS]; DIGITS];
    for &key in &keys {
        for (place, counts) in counts.iter_mut().enumerate() {
            counts[digit(key, place)] += 1;
        }
    }
    for counts in &mut counts {
        to_starts(core::slice::from_mut(counts));
    }
    let [low, middle, high] = counts;
    let mut other = pages::filled(0, keys.len());
    by_digit(0, low, keys.iter().copied(), |to, key| other[to] = key);
    by_digit(1, middle, other.iter().copied(), |to, key| keys[to] = key);
    drop(other);
    let mut order = pages::filled(0, keys.len());
    by_digit(2, high, keys.iter().copied(), |to, key| order[to] = id(key));
    order
}

#[inline(always)]
fn digit(key: u64, place: usize) -> usize {
    (key >> (ID_BITS + BITS * place as u32)) as usize & (CELLS - 1)
}

/// Makes of how often each digit is in each run of keys where the first of them goes.
fn to_starts(runs: &mut [[u32; CELLS]]) {
    let mut next = 0;
    for digit in 0..CELLS {
        for counts in &mut *runs {
            next += core::mem::replace(&mut counts[digit], next);
        }
    }
}

/// Puts a run of keys where a digit, of which it is known where the first goes, has them.
#[inline(always)]
fn by_digit(
    place: usize,
    mut starts: [u32; CELLS],
    keys: impl Iterator<Item = u64>,
    mut put: impl FnMut(usize, u64),
) {
    for key in keys {
        let start = &mut starts[digit(key, place)];
        put(*start as usize, key);
        *start += 1;
    }
}
