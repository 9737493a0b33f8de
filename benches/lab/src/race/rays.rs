//! Tracing, engine by engine.

use super::{Course, Engine, measure, progress, record::Record};
use crate::{effort::Effort, quiet::Quiet};
use std::error::Error;

/// One scene: a record of each engine on each workload.
pub fn race(
    course: &Course<'_>,
    engines: &[Box<dyn Engine + '_>],
    effort: &Effort,
    quiet: &mut Quiet,
) -> Result<Vec<Record>, Box<dyn Error>> {
    let progress = progress(course.trials.len() * engines.len() * (effort.rounds + 1))?;
    let mut records = Vec::new();
    for trial in &course.trials {
        progress.set_message(format!("{} {}", course.name, trial.workload.name));
        let scores = measure(trial, engines, effort.rounds, quiet, &progress);
        for (engine, score) in engines.iter().zip(scores) {
            let built = engine.built();
            records.push(Record {
                scene: course.name.to_owned(),
                triangles: course.mesh.len(),
                workload: trial.workload.name,
                engine: engine.name().to_owned(),
                takes: engine.takes(),
                mrays_per_s: score.mrays_per_s,
                build_ms: built.time.as_secs_f64() * 1e3,
                bytes_per_triangle: built.bytes as f64 / course.mesh.len() as f64,
                sample: trial.sample.len(),
                disagreements: score.disagreements,
            });
        }
    }
    progress.finish_and_clear();
    Ok(records)
}
