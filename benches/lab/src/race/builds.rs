//! Building, builder by builder, on one thread and on two.

use super::{Course, measure, progress, record::Record, turns};
use crate::{effort::Effort, engines::Builder, stats::median};
use fastrand::Rng;
use std::{error::Error, time::Instant};

/// On how many threads, and what that is called where a record has its workload.
pub const THREADS: [(usize, &str); 2] = [(1, "build 1 thread"), (2, "build 2 threads")];

/// Whose trees' rays are counted.
const TRACED: &str = "bounce";

/// One scene: a record of each builder on each number of threads. None if there are no bounce rays to tell
/// the trees by.
///
/// Builders take turns until the time is up, once at least; the trees of the first round are kept and traced.
pub fn race(
    course: &Course<'_>,
    builders: &[Builder<'_>],
    effort: &Effort,
) -> Result<Vec<Record>, Box<dyn Error>> {
    let traced = |trial: &&super::Trial| trial.workload.name == TRACED;
    let Some(trial) = course.trials.iter().find(traced) else {
        return Ok(Vec::new());
    };
    let mut kinds = Vec::new();
    for builder in builders {
        kinds.extend(THREADS.map(|threads| (builder, threads)));
    }
    let progress = progress(kinds.len() * 2 * (effort.rounds + 1))?;
    progress.set_message(format!("{} builds", course.name));

    let mut trees = Vec::with_capacity(kinds.len());
    let mut seconds = Vec::with_capacity(kinds.len());
    for (builder, (threads, _)) in &kinds {
        let tree = (builder.build)(*threads)?;
        seconds.push(vec![tree.built().time.as_secs_f64()]);
        trees.push(tree);
        progress.inc(1);
    }
    let mut rng = Rng::with_seed(1);
    let start = Instant::now();
    for _ in 0..effort.rounds {
        if start.elapsed() > effort.builds {
            break;
        }
        for kind in turns(kinds.len(), &mut rng) {
            let (builder, (threads, _)) = kinds[kind];
            let tree = (builder.build)(threads)?;
            seconds[kind].push(tree.built().time.as_secs_f64());
            progress.inc(1);
        }
    }
    let scores = measure(trial, &trees, effort.rounds, &progress);
    progress.finish_and_clear();

    let parts = kinds.iter().zip(&trees).zip(seconds).zip(scores);
    Ok(parts
        .map(|((((builder, (_, name)), tree), seconds), score)| Record {
            scene: course.name.to_owned(),
            triangles: course.mesh.len(),
            workload: name,
            engine: builder.name.to_owned(),
            takes: tree.takes(),
            mrays_per_s: score.mrays_per_s,
            build_ms: median(seconds) * 1e3,
            bytes_per_triangle: tree.built().bytes as f64 / course.mesh.len() as f64,
            sample: trial.sample.len(),
            disagreements: score.disagreements,
        })
        .collect())
}
