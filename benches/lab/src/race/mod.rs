//! `lab race`: every engine over the same rays, in one process, on one thread.
//!
//! Figures move by tens of per cent from one minute to the next on a shared machine, so engines take
//! turns: each round traces the workload once with every engine, each round begins with another, and
//! the median of the rounds is the figure.

mod record;
pub mod table;
pub mod workloads;

use crate::{
    engines::{self, Batch, Engine},
    reference::Sample,
};
use indicatif::{ProgressBar, ProgressStyle};
use record::Record;
use std::{
    error::Error,
    fs::File,
    hint::black_box,
    io::{self, Write},
    path::PathBuf,
    time::Instant,
};
use wide_bvh::{
    build::Builder,
    geometry::{Hit, TriangleMesh},
};
use wide_bvh_scenes::{LoadError, Mesh};
use workloads::{Query, Workload};

/// Race this crate beside Embree, obvhs and bvh: single rays, one thread.
///
/// Workloads: `primary`, camera rays in 8x8 tiles; `bounce`, cosine-weighted off each primary hit;
/// `random`, from one point of the scene's bounds towards another, without end; `shadow`, any hit
/// between each primary hit and a light. They are seeded, and the same for every engine.
///
/// Engines take turns, round by round; the median of the rounds is the figure. All are built by one
/// thread, too, from the vertex and index buffers to the first ray. Bytes a triangle are what an engine
/// keeps besides those buffers.
///
/// Answers are compared to brute force on a sample of the rays. Engines of this crate disagree if one
/// bit of t, u, v or the triangle's number differs. Others disagree if they hit where brute force
/// misses or the reverse, or hit another triangle at a t that differs by more than 1e-5 of it. For
/// shadow rays only hit or miss counts.
///
/// Embree is looked for when running, version 4 before 3; without it the rest still race
/// (Debian and Ubuntu: apt-get install libembree-dev).
#[derive(clap::Args)]
pub struct Args {
    /// Also write every figure to this file, as a JSON list
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Meshes to race over (PLY, OBJ, binary glTF); without any, a scene made by code
    #[arg(long, value_name = "FILE", num_args = 1..)]
    scenes: Vec<PathBuf>,
    /// Race only the engines whose names contain one of these
    #[arg(long, value_name = "TEXT", num_args = 1..)]
    engines: Vec<String>,
    /// Few rays and rounds: minutes become seconds, and the figures rough
    #[arg(long)]
    quick: bool,
}

impl Args {
    /// Whether the engine of this name races.
    fn chosen(&self, name: &str) -> bool {
        self.engines.is_empty() || self.engines.iter().any(|text| name.contains(text.as_str()))
    }
}

/// How much to measure.
struct Effort {
    /// Rays of a workload.
    rays: usize,
    rounds: usize,
    /// Triangle tests by brute force for a workload's sample: about a nanosecond each.
    tests: usize,
}

impl Effort {
    const FULL: Self = Self {
        rays: 1 << 18,
        rounds: 9,
        tests: 200_000_000,
    };
    const QUICK: Self = Self {
        rays: 1 << 14,
        rounds: 7,
        tests: 20_000_000,
    };
}

/// Runs the race and prints its tables.
///
/// # Errors
/// A scene that cannot be read, an engine that cannot be built, a JSON file that cannot be written.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let scenes = load_scenes(&args.scenes)?;
    // Now, so that no minutes are spent on figures that cannot be written.
    let create =
        |path: &PathBuf| File::create(path).map_err(|error| format!("{}: {error}", path.display()));
    let json = args.json.as_ref().map(create).transpose()?;
    let effort = if args.quick {
        Effort::QUICK
    } else {
        Effort::FULL
    };

    let mut records = Vec::new();
    let mut out = io::stdout();
    writeln!(out, "{}", engines::about_embree()?)?;
    for scene in &scenes {
        let mut engines = engines::all(&TriangleMesh::new(&scene.positions, &scene.indices)?)?;
        engines.retain(|engine| args.chosen(engine.name()));
        let results = race(scene, &engines, &effort)?;
        write!(out, "\n{}", table::of_scene(&results))?;
        records.extend(results);
    }
    writeln!(out, "{}", table::means(&records))?;
    writeln!(out, "{}", table::legend())?;
    if let Some(file) = json {
        serde_json::to_writer_pretty(file, &records)?;
    }
    Ok(())
}

/// The meshes in `paths`; without any, a scene made by code.
///
/// # Errors
/// A scene that cannot be read.
pub fn load_scenes(paths: &[PathBuf]) -> Result<Vec<Mesh>, LoadError> {
    if paths.is_empty() {
        return Ok(vec![wide_bvh_scenes::default_scene()]);
    }
    let load = |path: &PathBuf| wide_bvh_scenes::load(path);
    paths.iter().map(load).collect()
}

/// One scene: a record of each engine on each workload that has rays.
fn race(
    scene: &Mesh,
    engines: &[Box<dyn Engine>],
    effort: &Effort,
) -> Result<Vec<Record>, Box<dyn Error>> {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let workloads = workloads::workloads(scene, &Builder::new().build(&mesh)?, effort.rays);
    let turns = workloads.len() * engines.len() * (effort.rounds + 1);
    let progress = ProgressBar::new(turns as u64)
        .with_style(ProgressStyle::with_template("{msg} {wide_bar} {percent}%")?);
    let mut records = Vec::new();
    for workload in &workloads {
        progress.set_message(format!("{} {}", scene.name, workload.name));
        if workload.rays.is_empty() {
            continue;
        }
        let sample = Sample::trace(&mesh, &workload.rays, effort.tests);
        for (engine, score) in engines.iter().zip(measure(
            workload,
            engines,
            &sample,
            effort.rounds,
            &progress,
        )) {
            let built = engine.built();
            records.push(Record {
                scene: scene.name.clone(),
                triangles: mesh.len(),
                workload: workload.name,
                engine: engine.name().to_owned(),
                mrays_per_s: score.mrays_per_s,
                build_ms: built.time.as_secs_f64() * 1e3,
                bytes_per_triangle: built.bytes as f64 / mesh.len() as f64,
                sample: sample.len(),
                disagreements: score.disagreements,
            });
        }
    }
    progress.finish_and_clear();
    Ok(records)
}

/// How an engine did on a workload.
struct Score {
    mrays_per_s: f64,
    disagreements: usize,
}

/// One workload, by every engine.
fn measure(
    workload: &Workload,
    engines: &[Box<dyn Engine>],
    sample: &Sample,
    rounds: usize,
    progress: &ProgressBar,
) -> Vec<Score> {
    let mut answers = Answers::new(workload.rays.len());
    let batches: Vec<_> = engines
        .iter()
        .map(|engine| engine.prepare(&workload.rays))
        .collect();
    // The first turn is not timed: it warms up, and its answers are judged.
    let disagreements: Vec<usize> = engines
        .iter()
        .zip(&batches)
        .map(|(engine, batch)| {
            answers.trace(&**batch, workload.query);
            progress.inc(1);
            answers.wrong(sample, workload.query, engine.is_exact())
        })
        .collect();
    let mut seconds = vec![Vec::with_capacity(rounds); engines.len()];
    for round in 0..rounds {
        for turn in 0..engines.len() {
            let engine = (round + turn) % engines.len();
            let start = Instant::now();
            answers.trace(&*batches[engine], workload.query);
            seconds[engine].push(start.elapsed().as_secs_f64());
            progress.inc(1);
        }
    }
    seconds
        .into_iter()
        .zip(disagreements)
        .map(|(seconds, disagreements)| Score {
            mrays_per_s: workload.rays.len() as f64 / median(seconds) / 1e6,
            disagreements,
        })
        .collect()
}

/// Where answers are written, over and over.
struct Answers {
    hits: Vec<Option<Hit>>,
    occluded: Vec<bool>,
}

impl Answers {
    fn new(rays: usize) -> Self {
        Self {
            hits: vec![None; rays],
            occluded: vec![false; rays],
        }
    }

    fn trace(&mut self, batch: &dyn Batch, query: Query) {
        match query {
            Query::Closest => batch.closest(black_box(&mut self.hits)),
            Query::Any => batch.any(black_box(&mut self.occluded)),
        }
    }

    fn wrong(&self, sample: &Sample, query: Query, exact: bool) -> usize {
        match query {
            Query::Closest => sample.wrong_hits(&self.hits, exact),
            Query::Any => sample.wrong_occlusions(&self.occluded),
        }
    }
}

/// The middle value; the mean of the middle two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 {
        values[middle]
    } else {
        (values[middle - 1] + values[middle]) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_engine_finishes_and_this_crate_agrees() {
        let scene = wide_bvh_scenes::shapes::cuboid([-1.0; 3], [1.0; 3]);
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let engines = engines::all(&mesh).unwrap();
        let effort = Effort {
            rays: 400,
            rounds: 2,
            tests: 100_000,
        };
        let records = race(&scene, &engines, &effort).unwrap();
        assert_eq!(records.len(), 4 * engines.len());
        for record in records {
            assert!(record.mrays_per_s > 0.0 && record.bytes_per_triangle > 0.0);
            assert!(record.sample > 50);
            if record.engine.starts_with("wide-bvh ") {
                assert_eq!(record.disagreements, 0, "{record:?}");
            }
        }
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), 2.5);
    }
}
