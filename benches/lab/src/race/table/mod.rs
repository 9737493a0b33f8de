//! The race's figures as text for a terminal.

pub mod builds;
pub mod rays;

use super::record::Record;
use crate::{reference::TOLERANCE, workloads};

/// The engine that others are measured by.
const YARDSTICK: &str = "embree HIGH";

/// How this crate's engines are told from others.
const OURS: &str = "wide-bvh ";

/// What the columns mean. Of so many turns so many were disturbed.
pub fn legend((turns, disturbed): (usize, usize)) -> String {
    format!(
        "
Figures: million rays a second, the median of the rounds; one thread. In brackets: times {YARDSTICK}.
While another program shared the core: {disturbed} of {turns} turns, which count where an engine had no three others.
Build: by one thread. Bytes a triangle: what is kept besides the vertex and index buffers.
Wrong: of a sample of the rays ({}), those answered otherwise than by brute force.
For {OURS}engines but approximate and reordered ones one bit of t, u, v or the triangle's number is enough; for
others, a hit for a miss or the reverse, or another triangle with t off by more than {TOLERANCE:e} of it.
Means: the first is over {YARDSTICK}; the second over whichever of Embree's calls is the fastest at that
workload in that scene: of those for single rays for an engine that takes one ray a call, of all for batches.
Embree's robust mode is none of them.
Builds: bounce rays are traced one a call, by one thread.",
        workloads::NAMES.join("/"),
    )
}

/// Every engine's name, in the order of the race.
fn engines<'a>(records: impl IntoIterator<Item = &'a Record>) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for record in records {
        if !names.contains(&record.engine.as_str()) {
            names.push(&record.engine);
        }
    }
    names
}

fn find<'a>(records: &'a [Record], engine: &str, workload: &str) -> Option<&'a Record> {
    let is = |record: &&Record| record.engine == engine && record.workload == workload;
    records.iter().find(is)
}

#[cfg(test)]
fn record(scene: &str, engine: &str, workload: &'static str, mrays_per_s: f64) -> Record {
    Record {
        scene: scene.to_owned(),
        triangles: 12,
        workload,
        engine: engine.to_owned(),
        takes: crate::engines::Takes::OneRay,
        mrays_per_s,
        build_ms: 3.4,
        bytes_per_triangle: 50.0,
        sample: 9,
        disagreements: 1,
    }
}
