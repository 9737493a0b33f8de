//! Who looks for a better place in a round: the nodes of the largest area, but for those that rest.

use super::{CHUNK, Spot};
use crate::build::{pages, parallel};
use std::{vec, vec::Vec};

/// Areas are told apart by their exponents and so many bits more, the largest first.
const BITS: u32 = 3;
/// No area is negative.
const BINS: usize = 1 << (8 + BITS);

/// Nodes that take turns.
pub(super) struct Candidates {
    rests: Vec<Rest>,
    /// Of so many nodes each: memory to be used again.
    chunks: Vec<Awake>,
}

/// For how many rounds a node that found no better place does not look again: one more each time.
#[derive(Clone, Copy, Default)]
struct Rest {
    left: u8,
    next: u8,
}

/// Nodes that do not rest.
#[derive(Clone)]
struct Awake {
    /// The bits of their areas upside down, which are in their order then, the largest first; and the nodes.
    keys: Vec<u64>,
    /// How many there are in each bin.
    counts: [u32; BINS],
}

impl Candidates {
    /// Of so many nodes, none of which rests.
    pub fn new(nodes: usize) -> Self {
        let awake = Awake {
            keys: Vec::new(),
            counts: [0; BINS],
        };
        Self {
            rests: pages::filled(Rest::default(), nodes),
            chunks: vec![awake; nodes.div_ceil(CHUNK)],
        }
    }

    /// Those whose turn it is, `count` of them or all that do not rest, in an order that means nothing.
    pub fn next(&mut self, spots: &[Spot], count: usize) -> Vec<u32> {
        let parts = (self.rests.chunks_mut(CHUNK).zip(spots.chunks(CHUNK))).zip(&mut self.chunks);
        parallel::map(parts.enumerate(), |(index, ((rests, spots), awake))| {
            awake.gather(index * CHUNK, rests, spots);
        });
        let mut counts = [0; BINS];
        for awake in &self.chunks {
            for (all, count) in counts.iter_mut().zip(&awake.counts) {
                *all += *count as usize;
            }
        }
        // All up to some bin are taken, and of the next one those of the largest area.
        let (mut last, mut taken) = (0, 0);
        while last < BINS && taken + counts[last] <= count {
            taken += counts[last];
            last += 1;
        }
        let parted = parallel::map(&self.chunks, |awake| awake.part(last));
        let mut candidates = Vec::with_capacity(count);
        let mut rest = Vec::new();
        for (before, of_last) in parted {
            candidates.extend(before);
            rest.extend(of_last);
        }
        let left = count - taken;
        if left < rest.len() {
            rest.select_nth_unstable(left);
            rest.truncate(left);
        }
        candidates.extend(rest.iter().map(|&key| key as u32));
        candidates
    }

    /// Takes note of whether a node has found a better place.
    pub fn note(&mut self, node: u32, found: bool) {
        let rest = &mut self.rests[node as usize];
        *rest = match found {
            true => Rest::default(),
            false => Rest {
                left: rest.next,
                next: rest.next.saturating_add(1),
            },
        };
    }
}

impl Awake {
    /// Finds those that do not rest, of nodes from `first` on, and has the others rest one round less. The root has no
    /// other place.
    ///
    /// Without a branch on what cannot be foreseen: all are written, and those not meant written over.
    fn gather(&mut self, first: usize, rests: &mut [Rest], spots: &[Spot]) {
        self.counts.fill(0);
        self.keys.resize(rests.len() + 1, 0);
        let mut len = 0;
        for (place, (rest, spot)) in rests.iter_mut().zip(spots).enumerate() {
            let node = first + place;
            let is_awake = (rest.left == 0) & (node > 0);
            rest.left = rest.left.saturating_sub(1);
            let key = (u64::from(!spot.area.to_bits()) << 32) | node as u64;
            self.keys[len] = key;
            self.counts[bin(key)] += u32::from(is_awake);
            len += usize::from(is_awake);
        }
        self.keys.truncate(len);
    }

    /// The nodes in bins before `last`, and the keys of those in it.
    fn part(&self, last: usize) -> (Vec<u32>, Vec<u64>) {
        let many: u32 = self.counts[..last].iter().sum();
        let some = self.counts.get(last).copied().unwrap_or(0);
        // As above.
        let (mut before, mut of_last) = (vec![0; many as usize + 1], vec![0; some as usize + 1]);
        let (mut many, mut some) = (0, 0);
        for &key in &self.keys {
            before[many] = key as u32;
            of_last[some] = key;
            many += usize::from(bin(key) < last);
            some += usize::from(bin(key) == last);
        }
        before.truncate(many);
        of_last.truncate(some);
        (before, of_last)
    }
}

fn bin(key: u64) -> usize {
    (key >> (64 - 9 - BITS)) as usize % BINS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::refs::Bounds;
    use fastrand::Rng;

    /// The same, by sorting all.
    fn by_sorting(spots: &[Spot], rests: &[u32], count: usize) -> Vec<u32> {
        let mut awake: Vec<_> = (1..spots.len()).filter(|&node| rests[node] == 0).collect();
        awake.sort_by(|&a, &b| spots[b].area.total_cmp(&spots[a].area).then(a.cmp(&b)));
        awake.truncate(count);
        let mut nodes: Vec<_> = awake.iter().map(|&node| node as u32).collect();
        nodes.sort_unstable();
        nodes
    }

    #[test]
    fn those_of_the_largest_area_take_turns() {
        let mut rng = Rng::with_seed(5);
        for nodes in [1, 2, 3, 100, CHUNK, CHUNK + 1, 3 * CHUNK + 7] {
            let spots: Vec<_> = (0..nodes)
                .map(|_| {
                    // Some alike, some none, some tiny.
                    let area = match rng.u32(..4) {
                        0 => 0.25,
                        1 => rng.f32() * 1e-30,
                        2 => 0.0,
                        _ => rng.f32(),
                    };
                    Spot {
                        bounds: Bounds::EMPTY,
                        area,
                        parent: 0,
                        first: 0,
                        count: 1,
                    }
                })
                .collect();
            let mut candidates = Candidates::new(nodes);
            // For how many rounds each rests, and how often it has found nothing since it found something.
            let (mut rests, mut in_vain) = (vec![0; nodes], vec![0; nodes]);
            for round in 0..8 {
                let count = [nodes / 15 + 1, nodes / 3 + 1, 2 * nodes][round % 3];
                let mut next = candidates.next(&spots, count);
                next.sort_unstable();
                assert_eq!(next, by_sorting(&spots, &rests, count), "{nodes} {round}");
                for rest in &mut rests {
                    *rest = u32::saturating_sub(*rest, 1);
                }
                for node in next {
                    let found = rng.u32(..3) == 0;
                    candidates.note(node, found);
                    let (rest, in_vain) = (&mut rests[node as usize], &mut in_vain[node as usize]);
                    (*rest, *in_vain) = if found {
                        (0, 0)
                    } else {
                        (*in_vain, *in_vain + 1)
                    };
                }
            }
        }
    }
}
