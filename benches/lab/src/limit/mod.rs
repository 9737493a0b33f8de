//! `lab limit`: how far tracing single rays is from what its own tests allow.

mod floor;
mod table;

use crate::{
    effort::{self, Effort},
    output, scenes,
    stats::median,
    workloads::{Query, Workload, workloads},
};
use floor::Sweeps;
use serde::Serialize;
use std::{error::Error, hint::black_box, path::PathBuf, time::Instant};
use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::Bvh8, traverse::Counts};

/// Compare the time of a ray to the time of its tests alone.
///
/// The floor of a workload is what its rays would take if they were nothing but tests of nodes and of leaves
/// at full throughput: nodes a ray by nanoseconds a node, and leaves a ray by nanoseconds a leaf. What the
/// time is longer by goes into the walk: waiting for memory and for the test before, mispredicted branches,
/// the stack, and setting the ray up.
///
/// Nodes and leaves a ray are counted. Nanoseconds a node and a leaf are measured without a walk: some of the
/// workload's rays against a few nodes and leaves of the scene's own tree, one after another, over and over, out
/// of the first-level cache, a ray's setup not included. Those leaves are mostly missed, which is
/// a little faster than a hit; a shadow ray's are tested as a closest hit's are, which is a little slower.
///
/// Measured in turns, for 8-wide nodes on the best backend; the median of the rounds is the figure.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    scenes: scenes::Args,
    #[command(flatten)]
    effort: effort::Args,
    /// Also write every figure to this file, as a JSON list
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// One workload over one scene. Times are in nanoseconds.
#[derive(Clone, Debug, Serialize)]
struct Record {
    scene: String,
    triangles: usize,
    workload: &'static str,
    backend: &'static str,
    /// Taken by a ray.
    ns_per_ray: f64,
    nodes_per_ray: f64,
    leaves_per_ray: f64,
    /// Taken by a node's test at full throughput.
    ns_per_node: f64,
    /// Taken by a leaf's.
    ns_per_leaf: f64,
    /// Taken by setting up a ray for the tests of nodes. Not part of the floor.
    ns_of_setup: f64,
}

impl Record {
    /// What the tests alone would take of a ray.
    fn floor(&self) -> f64 {
        self.nodes_per_ray * self.ns_per_node + self.leaves_per_ray * self.ns_per_leaf
    }
}

/// Measures and prints the table.
///
/// # Errors
/// A scene that cannot be read or built on, a JSON file that cannot be written.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let scenes = args.scenes.load()?;
    let json = output::create(args.json.as_deref())?;
    let effort = args.effort.effort();
    let mut records = Vec::new();
    for scene in &scenes {
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
        let bvh = Builder::new().build(&mesh)?;
        for workload in workloads(scene, &bvh, effort.rays) {
            if !workload.rays.is_empty() {
                let record = measure(&bvh, &workload, &effort);
                records.push(Record {
                    scene: scene.name.clone(),
                    triangles: mesh.len(),
                    ..record
                });
            }
        }
    }
    print!("{}", table::of(&records));
    if let Some(file) = json {
        serde_json::to_writer_pretty(file, &records)?;
    }
    Ok(())
}

/// A workload that has rays, over a scene that is still to be named.
fn measure(bvh: &Bvh8, workload: &Workload, effort: &Effort) -> Record {
    let sweeps = Sweeps::new(bvh, &workload.rays);
    let mut times: [Vec<f64>; 4] = Default::default();
    // The first round warms up.
    for round in 0..=effort.rounds {
        let start = Instant::now();
        trace(bvh, workload);
        let seconds = start.elapsed().as_secs_f64();
        let ray = seconds * 1e9 / workload.rays.len() as f64;
        let tests = sweeps.time();
        if round > 0 {
            let figures = [ray, tests.node, tests.leaf, tests.setup];
            times
                .iter_mut()
                .zip(figures)
                .for_each(|(times, figure)| times.push(figure));
        }
    }
    let [ray, node, leaf, setup] = times.map(median);
    let [nodes, leaves] = counts(bvh, workload);
    Record {
        scene: String::new(),
        triangles: 0,
        workload: workload.name,
        backend: bvh.backend().name(),
        ns_per_ray: ray,
        nodes_per_ray: nodes,
        leaves_per_ray: leaves,
        ns_per_node: node,
        ns_per_leaf: leaf,
        ns_of_setup: setup,
    }
}

fn trace(bvh: &Bvh8, workload: &Workload) {
    for ray in &workload.rays {
        match workload.query {
            Query::Closest => {
                black_box(bvh.closest_hit(ray));
            }
            Query::Any => {
                black_box(bvh.any_hit(ray));
            }
        }
    }
}

/// Nodes and leaves a ray.
fn counts(bvh: &Bvh8, workload: &Workload) -> [f64; 2] {
    let count = |ray| -> Counts {
        match workload.query {
            Query::Closest => bvh.closest_hit_counted(ray).1,
            Query::Any => bvh.any_hit_counted(ray).1,
        }
    };
    let sums = workload.rays.iter().map(count).fold([0, 0], |sums, count| {
        [
            sums[0] + u64::from(count.nodes),
            sums[1] + u64::from(count.leaves),
        ]
    });
    sums.map(|sum| sum as f64 / workload.rays.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use wide_bvh_scenes::shapes::torus_knot;

    #[test]
    fn counted_queries_answer_alike_and_are_timed() {
        let scene = torus_knot(2, 3, 0.3, 200, 24);
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let bvh = Builder::new().build(&mesh).unwrap();
        let effort = Effort {
            rays: 4096,
            rounds: 3,
            tests: 0,
            least_sample: 0,
            builds: Duration::ZERO,
            patience: Duration::ZERO,
        };
        for workload in workloads(&scene, &bvh, effort.rays) {
            for ray in &workload.rays {
                let (hit, of_closest) = bvh.closest_hit_counted(ray);
                let (any, of_any) = bvh.any_hit_counted(ray);
                assert_eq!(hit, bvh.closest_hit(ray));
                assert_eq!(any, hit.is_some());
                // Any hit ends with the first leaf that has one; else both see the same.
                assert!(any || of_any == of_closest);
            }
            let record = measure(&bvh, &workload, &effort);
            assert!(record.nodes_per_ray >= 1.0, "{record:?}");
            assert!(record.ns_per_ray > 0.0, "{record:?}");
        }
    }
}
