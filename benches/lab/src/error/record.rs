//! The figures as they stand in the JSON, and pooled over scenes.

use super::{
    judge::Counts,
    measure::{Errors, Outcome},
    rays,
    statistics::{Spread, geometric_mean},
};
use serde::Serialize;

/// How a variant did on one set of rays over one scene.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    /// The scene's name.
    pub scene: String,
    /// How many triangles it has.
    pub triangles: usize,
    /// The set of rays.
    pub set: &'static str,
    /// The variant: an engine of the race, or one of the lab's own kernels (`slab …`, `triangle …`).
    pub variant: String,
    /// The rest.
    #[serde(flatten)]
    pub figures: Figures,
}

/// What is measured.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Nanoseconds a ray; of several scenes, the geometric mean.
    pub ns_per_ray: f64,
    /// Right and wrong answers.
    #[serde(flatten)]
    pub counts: Counts,
    /// From inside closed meshes: how many rays got out.
    pub leaks: Option<usize>,
    /// The error of `t` of right answers, in units of the last place.
    pub t_ulps: Option<Spread>,
    /// The same in parts of `t`.
    pub t_relative: Option<Spread>,
    /// The error of `u` and `v`, if the variant tells them.
    pub weights: Option<Spread>,
}

/// What a variant did on sets of rays, put together.
#[derive(Default)]
pub struct Pool {
    ns_per_ray: Vec<f64>,
    counts: Counts,
    leaks: Option<usize>,
    errors: Errors,
}

impl Pool {
    /// Takes in the outcome of one set of rays over one scene.
    pub fn add(&mut self, set: &str, outcome: &Outcome) {
        self.ns_per_ray.push(outcome.ns_per_ray);
        self.counts += outcome.counts;
        if set == rays::INSIDE {
            *self.leaks.get_or_insert(0) += outcome.misses;
        }
        self.errors.t_ulps.extend(&outcome.errors.t_ulps);
        self.errors.t_relative.extend(&outcome.errors.t_relative);
        self.errors.weights.extend(&outcome.errors.weights);
    }

    /// The figures of all that it took in.
    pub fn figures(mut self) -> Figures {
        Figures {
            ns_per_ray: geometric_mean(self.ns_per_ray).unwrap_or(f64::NAN),
            counts: self.counts,
            leaks: self.leaks,
            t_ulps: Spread::of(&mut self.errors.t_ulps),
            t_relative: Spread::of(&mut self.errors.t_relative),
            weights: Spread::of(&mut self.errors.weights),
        }
    }
}
