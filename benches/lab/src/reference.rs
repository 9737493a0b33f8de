//! Whether an engine is right: its answers to a sample of the rays, beside brute force.

use std::{num::NonZero, thread};
use wide_bvh::{
    geometry::{Hit, Ray, TriangleMesh},
    reference::closest_hit,
};

/// How far, relative to the reference's, the distance of another triangle may be off in an engine
/// that rounds in its own way.
pub const TOLERANCE: f32 = 1e-5;

/// The true answers to some of a workload's rays.
pub struct Sample {
    /// Which ray each is of, in ascending order.
    rays: Vec<usize>,
    hits: Vec<Option<Hit>>,
}

impl Sample {
    /// As many rays, spread evenly, as brute force answers with `tests` triangle tests, but `least` at least.
    pub fn trace(mesh: &TriangleMesh<'_>, rays: &[Ray], tests: usize, least: usize) -> Self {
        let size = (tests / mesh.len().max(1)).max(least).min(rays.len());
        let sample: Vec<usize> = (0..size).map(|i| i * rays.len() / size).collect();
        let threads = thread::available_parallelism().map_or(1, NonZero::get);
        let share = size.div_ceil(threads).max(1);
        let hits = thread::scope(|scope| {
            let shares: Vec<_> = sample
                .chunks(share)
                .map(|sample| {
                    let hit = |&ray: &usize| closest_hit(mesh, &rays[ray]);
                    scope.spawn(move || sample.iter().map(hit).collect::<Vec<_>>())
                })
                .collect();
            let join = |share: thread::ScopedJoinHandle<'_, _>| share.join().expect("no panic");
            shares.into_iter().flat_map(join).collect()
        });
        Self { rays: sample, hits }
    }

    /// How many rays there are.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// How many of the sampled answers disagree. An exact engine must give the same bits; another
    /// must hit or miss alike, and hit the same triangle or another at a like distance.
    pub fn wrong_hits(&self, answers: &[Option<Hit>], exact: bool) -> usize {
        let agree = if exact { same_bits } else { alike };
        self.count(|ray, truth| !agree(answers[ray], truth))
    }

    /// How many of the sampled answers to "is anything in the way?" disagree.
    pub fn wrong_occlusions(&self, answers: &[bool]) -> usize {
        self.count(|ray, truth| answers[ray] != truth.is_some())
    }

    fn count(&self, wrong: impl Fn(usize, Option<Hit>) -> bool) -> usize {
        let pairs = self.rays.iter().zip(&self.hits);
        pairs.filter(|&(&ray, &hit)| wrong(ray, hit)).count()
    }
}

/// A hit as bits, for -0 to differ from 0.
pub fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive])
}

fn same_bits(a: Option<Hit>, b: Option<Hit>) -> bool {
    bits(a) == bits(b)
}

fn alike(answer: Option<Hit>, truth: Option<Hit>) -> bool {
    match (answer, truth) {
        (None, None) => true,
        (Some(answer), Some(truth)) => {
            answer.primitive == truth.primitive
                || (answer.t - truth.t).abs() <= TOLERANCE * truth.t.abs()
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HIT: Hit = Hit {
        t: 1.0,
        u: 0.25,
        v: 0.5,
        primitive: 7,
    };

    #[test]
    fn an_exact_engine_is_held_to_every_bit() {
        assert!(same_bits(Some(HIT), Some(HIT)));
        assert!(same_bits(None, None));
        for wrong in [
            Hit {
                t: 1.0_f32.next_up(),
                ..HIT
            },
            Hit {
                u: 0.25_f32.next_up(),
                ..HIT
            },
            Hit {
                v: 0.5_f32.next_up(),
                ..HIT
            },
            Hit {
                primitive: 8,
                ..HIT
            },
        ] {
            assert!(!same_bits(Some(wrong), Some(HIT)));
        }
        let zero = Hit { t: 0.0, ..HIT };
        assert!(!same_bits(Some(Hit { t: -0.0, ..zero }), Some(zero)));
    }

    #[test]
    fn another_may_round_but_not_miss() {
        assert!(alike(Some(Hit { t: 2.0, ..HIT }), Some(HIT)));
        let other = Hit {
            primitive: 8,
            ..HIT
        };
        assert!(alike(
            Some(Hit {
                t: 1.000_005,
                ..other
            }),
            Some(HIT)
        ));
        assert!(!alike(
            Some(Hit {
                t: 1.000_02,
                ..other
            }),
            Some(HIT)
        ));
        assert!(!alike(None, Some(HIT)));
        assert!(!alike(Some(HIT), None));
    }

    #[test]
    fn a_sample_is_no_larger_than_the_rays() {
        let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0_f32]];
        let mesh = TriangleMesh::new(&positions, &[[0, 1, 2_u32]]).unwrap();
        let hit = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
        let miss = Ray::new([2.0, 2.0, 0.0], [0.0, 0.0, 1.0]);
        let sample = Sample::trace(&mesh, &[hit, miss, hit], 1000, 1);
        assert_eq!(sample.len(), 3);
        assert_eq!(sample.wrong_hits(&[None; 3], true), 2);
        assert_eq!(sample.wrong_occlusions(&[true, true, false]), 2);
        assert_eq!(Sample::trace(&mesh, &[hit, miss, hit], 2, 1).len(), 2);
        assert_eq!(Sample::trace(&mesh, &[hit, miss, hit], 0, 1).len(), 1);
        assert_eq!(Sample::trace(&mesh, &[], 1000, 1).len(), 0);
    }
}
