//! The sort by many threads. No two write to one place, which the compiler is told by atomics: they are as fast.

use super::{CELLS, by_digit, digit, id, pages, to_starts};
use crate::build::parallel::threads;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use rayon::prelude::*;
use std::vec::Vec;

/// More runs, a thread each, would have more counts than keys.
const MOST_RUNS: usize = 16;

pub(super) fn sorted(keys: Vec<u64>) -> Vec<u32> {
    let len = keys.len();
    let atomic = |keys: Vec<u64>| keys.into_iter().map(AtomicU64::new).collect::<Vec<_>>();
    let (keys, other) = (atomic(keys), atomic(pages::filled(0, len)));
    let order = pages::filled(0, len).into_iter().map(AtomicU32::new);
    let order: Vec<_> = order.collect();
    sort(0, &keys, |to, key| other[to].store(key, Relaxed));
    sort(1, &other, |to, key| keys[to].store(key, Relaxed));
    sort(2, &keys, |to, key| order[to].store(id(key), Relaxed));
    order.into_iter().map(AtomicU32::into_inner).collect()
}

fn sort(place: usize, keys: &[AtomicU64], put: impl Fn(usize, u64) + Sync) {
    let runs = threads().min(MOST_RUNS);
    let runs = keys.par_chunks(keys.len().div_ceil(runs));
    let count = |keys: &[AtomicU64]| {
        let mut counts = [0; CELLS];
        for key in keys {
            counts[digit(key.load(Relaxed), place)] += 1;
        }
        counts
    };
    let mut starts: Vec<_> = runs.clone().map(count).collect();
    to_starts(&mut starts);
    let with_starts = runs.zip(starts);
    with_starts.for_each(|(keys, starts)| {
        by_digit(
            place,
            starts,
            keys.iter().map(|key| key.load(Relaxed)),
            &put,
        );
    });
}
