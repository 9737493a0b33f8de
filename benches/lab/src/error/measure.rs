//! One set of rays by every variant: answers judged, errors taken, turns timed.

use super::{
    judge::{Counts, Verdict, judge},
    rays::RaySet,
    truth::{ExactRay, First, Truth},
};
use crate::engines::Engine;
use indicatif::ProgressBar;
use rayon::prelude::*;
use std::{hint::black_box, time::Instant};
use wide_bvh::geometry::{Hit, Ray};

/// How a variant did.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// In the quickest of the rounds: what else the machine does only adds.
    pub ns_per_ray: f64,
    pub counts: Counts,
    /// How many rays hit nothing.
    pub misses: usize,
    pub errors: Errors,
}

/// How far off right answers are, one each.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    /// `t`, in units of the last place of the exact one.
    pub t_ulps: Vec<f32>,
    /// `t`, in parts of the exact one.
    pub t_relative: Vec<f32>,
    /// `u` or `v`, the worse. Empty if the variant does not tell them: all are zero.
    pub weights: Vec<f32>,
}

/// Every variant on the same rays. Variants take turns, as in the race: each round begins with another.
pub fn measure(
    truth: &Truth<'_>,
    set: &RaySet,
    engines: &[Box<dyn Engine + '_>],
    rounds: usize,
    progress: &ProgressBar,
) -> Vec<Outcome> {
    let rays = &set.rays;
    let firsts: Vec<Option<First>> = rays
        .par_iter()
        .map(|ray| truth.first(&ExactRay::from(ray)))
        .collect();
    let mut hits = vec![None; rays.len()];
    let batches: Vec<_> = engines.iter().map(|engine| engine.prepare(rays)).collect();
    // The first turn's answers are judged.
    let mut outcomes: Vec<Outcome> = batches
        .iter()
        .map(|batch| {
            batch.closest(&mut hits);
            progress.inc(1);
            assess(truth, rays, &firsts, &hits)
        })
        .collect();
    let mut seconds = vec![f64::INFINITY; engines.len()];
    for round in 0..rounds {
        for turn in 0..engines.len() {
            let engine = (round + turn) % engines.len();
            // Once without the clock: variants that share a tree would find it in the caches, and others not.
            batches[engine].closest(black_box(&mut hits));
            let start = Instant::now();
            batches[engine].closest(black_box(&mut hits));
            seconds[engine] = start.elapsed().as_secs_f64().min(seconds[engine]);
            progress.inc(1);
        }
    }
    for (outcome, seconds) in outcomes.iter_mut().zip(seconds) {
        outcome.ns_per_ray = seconds * 1e9 / rays.len() as f64;
    }
    outcomes
}

/// All but the time.
fn assess(
    truth: &Truth<'_>,
    rays: &[Ray],
    firsts: &[Option<First>],
    hits: &[Option<Hit>],
) -> Outcome {
    let judged: Vec<(Verdict, Option<RayErrors>)> = rays
        .par_iter()
        .zip(firsts)
        .zip(hits)
        .map(|((ray, first), hit)| {
            let verdict = judge(truth, ray, first.as_ref(), hit.as_ref());
            let right = (verdict == Verdict::Right)
                .then_some(hit.as_ref())
                .flatten();
            (
                verdict,
                right.and_then(|hit| RayErrors::new(truth, ray, hit)),
            )
        })
        .collect();
    let mut outcome = Outcome {
        misses: hits.iter().filter(|hit| hit.is_none()).count(),
        ..Outcome::default()
    };
    for (verdict, errors) in judged {
        outcome.counts.add(verdict);
        if let Some(errors) = errors {
            outcome.errors.t_ulps.push(errors.t_ulps);
            outcome.errors.t_relative.push(errors.t_relative);
            outcome.errors.weights.push(errors.weights);
        }
    }
    let tells_weights = hits
        .iter()
        .flatten()
        .any(|hit| hit.u != 0.0 || hit.v != 0.0);
    if !tells_weights {
        outcome.errors.weights.clear();
    }
    outcome
}

/// Of one right answer.
struct RayErrors {
    t_ulps: f32,
    t_relative: f32,
    weights: f32,
}

impl RayErrors {
    fn new(truth: &Truth<'_>, ray: &Ray, hit: &Hit) -> Option<Self> {
        let exact = truth.hit(&ExactRay::from(ray), hit.primitive)?;
        let off = |float: f32, exact: f64| (f64::from(float) - exact).abs();
        let t = off(hit.t, exact.t);
        // A right answer at a `t` of zero has no error; any other is infinitely worse.
        let relative = if t == 0.0 { 0.0 } else { t / exact.t.abs() };
        Some(Self {
            t_ulps: (t / ulp(exact.t)) as f32,
            t_relative: relative as f32,
            weights: off(hit.u, exact.u).max(off(hit.v, exact.v)) as f32,
        })
    }
}

/// The distance between the floats of type `f32` around `x`.
fn ulp(x: f64) -> f64 {
    let x = x
        .abs()
        .clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX));
    let power = f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000);
    power * f64::from(f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{kernels, rays};
    use wide_bvh::{build::Builder, geometry::TriangleMesh};

    #[test]
    fn ulps_are_the_distances_between_floats() {
        for x in [1.0_f32, 1.5, 0.1, 3e7, 1e-30] {
            let distance = f64::from(x.next_up()) - f64::from(x);
            assert_eq!(ulp(f64::from(x)), distance);
            assert_eq!(ulp(-f64::from(x)), distance);
        }
    }

    /// Every variant over a closed mesh from inside: this crate's box test with Woop's test loses nothing, and the
    /// numbers are of the size that floats give.
    #[test]
    fn variants_are_measured() {
        let (mesh, depths) = rays::closed_meshes().into_iter().next().unwrap();
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let bvh = Builder::new().build(&view).unwrap();
        let truth = Truth::new(view, &bvh);
        let set = rays::from_inside(&mesh, depths, 3000);
        let engines = kernels::engines(&view, &bvh);
        let outcomes = measure(&truth, &set, &engines, 1, &ProgressBar::hidden());
        assert_eq!(outcomes.len(), engines.len());
        for (engine, outcome) in engines.iter().zip(outcomes) {
            let (name, counts) = (engine.name(), outcome.counts);
            assert_eq!(counts.rays, 3000, "{name}");
            assert!(outcome.ns_per_ray > 0.0, "{name}");
            assert!(outcome.errors.t_ulps.len() > 1500, "{name}: {counts:?}");
            assert!(
                outcome.errors.weights.iter().any(|&error| error > 0.0),
                "{name}"
            );
            assert!(
                outcome.errors.weights.iter().all(|&error| error < 0.1),
                "{name}"
            );
            if name == "slab this crate's fma" {
                assert_eq!((counts.lost, counts.phantoms, outcome.misses), (0, 0, 0));
            }
        }
    }
}
