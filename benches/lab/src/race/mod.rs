//! `lab race`: every engine over the same rays, in one process, on one thread; and every builder over the
//! same meshes.
//!
//! Figures move by tens of per cent from one minute to the next on a shared machine, so engines take
//! turns: each round traces the workload once with every engine, in another order each time, and the
//! median of the rounds is the figure. Orders are random, and the same in every run: an engine that always
//! came after another over the same tree would always find that in the caches. While another program shares the
//! core, a turn waits.

mod builds;
mod rays;
mod record;
mod table;

use crate::{
    effort::{self, Effort},
    engines::{self, Batch, Engine},
    output,
    quiet::{Quiet, median_seconds},
    reference::Sample,
    scenes,
    workloads::{Query, Workload, workloads},
};
use fastrand::Rng;
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    error::Error,
    hint::black_box,
    io::{self, Write},
    path::PathBuf,
};
use wide_bvh::{
    build::Builder,
    geometry::{Hit, TriangleMesh},
};
use wide_bvh_scenes::Mesh;

/// Race this crate beside Embree, obvhs and bvh: tracing on one thread, building on one and two.
///
/// Workloads: `primary`, camera rays in 8x8 tiles; `bounce`, cosine-weighted off each primary hit;
/// `random`, from one point of the scene's bounds towards another, without end; `shadow`, any hit
/// between each primary hit and a light. They are seeded, and the same for every engine.
///
/// Engines take turns in random orders, round by round; the median of the rounds is the figure. On shared
/// machines a turn waits for its core to be quiet, for 20 minutes in all at most. All are
/// built by one thread, too, from the vertex and index buffers to the first ray. Bytes a triangle are what
/// an engine keeps besides those buffers.
///
/// Embree's calls: `embree HIGH`, single rays; `8` and `16`, packets; `1M`, streams (Embree 3 has them,
/// Embree 4 none); `coherent`, with the flag that says so. They share one tree. Rays are in an engine's own
/// format beforehand, in the order of the workload; copying what a call overwrites is timed.
///
/// This crate's: `8` and `4`, the width; `quantized`, compact nodes over leaves of their own; `compact`, over the
/// mesh's own buffers; `reordered`, over those in the order of the leaves; `approximate`, the triangle test in
/// `f32` alone; `batch` and `packet 8`, calls for many rays. `portable` is what the program was compiled for, others
/// are the processor's.
///
/// Builders take turns likewise. Their trees are compared by how fast bounce rays are traced, one a call, by
/// one thread.
///
/// Answers are compared to brute force on a sample of the rays. Engines of this crate, but approximate and
/// reordered ones, disagree if one bit of t, u, v or the triangle's number differs. Others disagree if they hit
/// where brute force misses or the reverse, or hit another triangle at a t that differs by more than 1e-5 of it.
/// For shadow rays only hit or miss counts.
///
/// Embree is looked for when running, version 4 before 3; without it the rest still race
/// (Debian and Ubuntu: apt-get install libembree-dev).
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    scenes: scenes::Args,
    /// Race only the engines and builders whose names contain one of these
    #[arg(long, value_name = "TEXT", num_args = 1..)]
    engines: Vec<String>,
    /// Race one of the two alone
    #[arg(long, value_name = "PART")]
    only: Option<Part>,
    #[command(flatten)]
    effort: effort::Args,
    /// Also write every figure to this file, as a JSON list. Builders' have the workload `build 1 thread` or
    /// `build 2 threads`, and rays a second, sample and disagreements of bounce rays through their trees
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What is raced.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Tracing
    Rays,
    /// Building
    Builds,
}

impl Args {
    /// Whether the engine or builder of this name races.
    fn chosen(&self, name: &str) -> bool {
        self.engines.is_empty() || self.engines.iter().any(|text| name.contains(text.as_str()))
    }

    fn races(&self, part: Part) -> bool {
        self.only.is_none_or(|only| only == part)
    }
}

/// Runs the race and prints its tables.
///
/// # Errors
/// A scene that cannot be read, an engine that cannot be built, a JSON file that cannot be written.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let scenes = args.scenes.load()?;
    let json = output::create(args.json.as_deref())?;
    let effort = args.effort.effort();
    let chosen = |name: &str| args.chosen(name);
    let quiet = &mut Quiet::new(effort.patience);

    let (mut traced, mut built) = (Vec::new(), Vec::new());
    let mut out = io::stdout();
    writeln!(out, "{}", engines::about_embree()?)?;
    for scene in &scenes {
        let course = Course::new(scene, &effort)?;
        if args.races(Part::Rays) {
            let results = rays::race(
                &course,
                &engines::all(&course.mesh, &chosen)?,
                &effort,
                quiet,
            )?;
            write!(out, "\n{}", table::rays::of_scene(&results))?;
            traced.extend(results);
        }
        if args.races(Part::Builds) {
            let mut builders = engines::builders(&course.mesh);
            builders.retain(|builder| chosen(builder.name));
            let results = builds::race(&course, &builders, &effort, quiet)?;
            write!(out, "\n{}", table::builds::of_scene(&results))?;
            built.extend(results);
        }
    }
    write!(out, "{}", table::rays::means(&traced))?;
    write!(out, "{}", table::builds::means(&built))?;
    writeln!(out, "{}", table::legend(quiet.turns()))?;
    if let Some(file) = json {
        traced.extend(built);
        serde_json::to_writer_pretty(file, &traced)?;
    }
    Ok(())
}

/// A scene, and the rays that are raced through it.
struct Course<'a> {
    name: &'a str,
    mesh: TriangleMesh<'a>,
    /// Those that have rays.
    trials: Vec<Trial>,
}

/// Rays, and what some of them hit.
struct Trial {
    workload: Workload,
    sample: Sample,
}

impl<'a> Course<'a> {
    fn new(scene: &'a Mesh, effort: &Effort) -> Result<Self, Box<dyn Error>> {
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
        let mut workloads = Vec::from(workloads(scene, &Builder::new().build(&mesh)?, effort.rays));
        workloads.retain(|workload| !workload.rays.is_empty());
        let trial = |workload: Workload| Trial {
            sample: Sample::trace(&mesh, &workload.rays, effort.tests, effort.least_sample),
            workload,
        };
        Ok(Self {
            name: &scene.name,
            trials: workloads.into_iter().map(trial).collect(),
            mesh,
        })
    }
}

/// How far along a race of so many steps is.
fn progress(steps: usize) -> Result<ProgressBar, Box<dyn Error>> {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {percent}%")?;
    Ok(ProgressBar::new(steps as u64).with_style(style))
}

/// The turns of one round: every number below `count`, in random order.
fn turns(count: usize, rng: &mut Rng) -> Vec<usize> {
    let mut turns: Vec<usize> = (0..count).collect();
    rng.shuffle(&mut turns);
    turns
}

/// How an engine did on a workload.
#[derive(Clone)]
struct Score {
    mrays_per_s: f64,
    disagreements: usize,
}

/// One workload, by every engine; `rounds + 1` steps for each.
fn measure(
    Trial { workload, sample }: &Trial,
    engines: &[Box<dyn Engine + '_>],
    rounds: usize,
    quiet: &mut Quiet,
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
    let mut timed: Vec<_> = engines.iter().map(|_| Vec::with_capacity(rounds)).collect();
    let mut rng = Rng::with_seed(1);
    for _ in 0..rounds {
        for engine in turns(engines.len(), &mut rng) {
            let turn = quiet.time(|| answers.trace(&*batches[engine], workload.query));
            timed[engine].push(turn);
            progress.inc(1);
        }
    }
    timed
        .iter()
        .zip(disagreements)
        .map(|(turns, disagreements)| Score {
            mrays_per_s: workload.rays.len() as f64 / median_seconds(turns) / 1e6,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{engines::Takes, workloads};
    use std::time::Duration;

    const EFFORT: Effort = Effort {
        rays: 400,
        rounds: 2,
        tests: 100_000,
        least_sample: 1,
        builds: Duration::ZERO,
        patience: Duration::ZERO,
    };

    #[test]
    fn every_engine_finishes_and_this_crate_agrees() {
        let scene = wide_bvh_scenes::shapes::cuboid([-1.0; 3], [1.0; 3]);
        let course = Course::new(&scene, &EFFORT).unwrap();
        let engines = engines::all(&course.mesh, &|_| true).unwrap();
        let records =
            rays::race(&course, &engines, &EFFORT, &mut Quiet::new(EFFORT.patience)).unwrap();
        assert_eq!(records.len(), workloads::NAMES.len() * engines.len());
        for record in records {
            assert!(record.mrays_per_s > 0.0 && record.bytes_per_triangle > 0.0);
            assert!(record.sample > 50);
            // Batches of Embree's end with packets that are not full.
            if record.engine.starts_with("wide-bvh ") || record.takes == Takes::Batches {
                assert_eq!(record.disagreements, 0, "{record:?}");
            }
        }
    }

    #[test]
    fn every_builder_finishes_and_its_tree_agrees() {
        let scene = wide_bvh_scenes::shapes::torus_knot(2, 3, 0.2, 100, 12);
        let course = Course::new(&scene, &EFFORT).unwrap();
        let builders = engines::builders(&course.mesh);
        let records = builds::race(
            &course,
            &builders,
            &EFFORT,
            &mut Quiet::new(EFFORT.patience),
        )
        .unwrap();
        assert_eq!(records.len(), 2 * builders.len());
        for record in records {
            assert!(record.build_ms > 0.0 && record.mrays_per_s > 0.0);
            assert!(record.sample > 10);
            assert_eq!(record.disagreements, 0, "{record:?}");
        }
    }

    #[test]
    fn what_is_not_chosen_is_not_there() {
        let scene = wide_bvh_scenes::shapes::cuboid([-1.0; 3], [1.0; 3]);
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let engines = engines::all(&mesh, &|name| name == "obvhs bvh2").unwrap();
        let names: Vec<&str> = engines.iter().map(|engine| engine.name()).collect();
        assert_eq!(names, ["obvhs bvh2"]);
    }

    #[test]
    fn every_engine_has_a_turn_each_round_and_orders_differ() {
        let mut rng = Rng::with_seed(1);
        let rounds: Vec<_> = (0..9).map(|_| turns(5, &mut rng)).collect();
        for round in &rounds {
            let mut sorted = round.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, [0, 1, 2, 3, 4]);
        }
        assert!(rounds.iter().any(|round| *round != rounds[0]));
    }
}
