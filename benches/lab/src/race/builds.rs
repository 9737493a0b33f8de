//! Building, builder by builder, on one thread and on two.

use super::{Course, measure, progress, record::Record, turns};
use crate::{effort::Effort, engines::Builder, quiet::Quiet, stats::median};
use fastrand::Rng;
use std::{error::Error, time::Instant};

/// On how many threads, and what that is called where a record has its workload.
pub const THREADS: [(usize, &str); 2] = [(1, "build 1 thread"), (2, "build 2 threads")];

/// Whose trees' rays are counted.
const TRACED: &str = "bounce";

/// One scene: a record of each builder on each number of threads. None if there are no bounce rays to tell
/// the trees by.
///
/// Builders take turns until the time is up, once at least. The trees that are traced are those of one thread.
pub fn race(
    course: &Course<'_>,
    builders: &[Builder<'_>],
    effort: &Effort,
    quiet: &mut Quiet,
) -> Result<Vec<Record>, Box<dyn Error>> {
    let traced = |trial: &&super::Trial| trial.workload.name == TRACED;
    let Some(trial) = course.trials.iter().find(traced) else {
        return Ok(Vec::new());
    };
    let mut kinds = Vec::new();
    for builder in builders {
        kinds.extend(THREADS.map(|threads| (builder, threads)));
    }
    let progress = progress((kinds.len() + builders.len()) * (effort.rounds + 1))?;
    progress.set_message(format!("{} builds", course.name));

    // Of the first round, those built by one thread. None of the others outlives its timing: while one of Embree's devices
    // has two threads, all of them do.
    let mut trees = Vec::with_capacity(builders.len());
    for builder in builders {
        trees.push((builder.build)(1)?);
        progress.inc(1);
    }
    let mut seconds = vec![Vec::new(); kinds.len()];
    let mut rng = Rng::with_seed(1);
    let start = Instant::now();
    for round in 0..effort.rounds {
        if round > 0 && start.elapsed() > effort.builds {
            break;
        }
        for kind in turns(kinds.len(), &mut rng) {
            let (builder, (threads, _)) = kinds[kind];
            let tree = (builder.build)(threads)?;
            seconds[kind].push(tree.built().time.as_secs_f64());
            progress.inc(1);
        }
    }
    let scores = measure(trial, &trees, effort.rounds, quiet, &progress);
    progress.finish_and_clear();

    let trees = trees.iter().zip(scores);
    let trees = trees.flat_map(|tree| THREADS.map(|_| (tree.0, tree.1.clone())));
    Ok(kinds
        .iter()
        .zip(trees)
        .zip(seconds)
        .map(|(((builder, (_, name)), (tree, score)), seconds)| Record {
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
