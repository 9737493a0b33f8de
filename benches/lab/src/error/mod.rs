//! `lab error`: run time against error. Every engine of the race, and kernels that differ in one test alone, on the
//! same rays, their answers held to exact arithmetic.
//!
//! New layouts, packets and batches join by being engines: [`variants`] is the one place.

mod chart;
mod judge;
mod kernels;
mod measure;
mod rays;
mod record;
mod statistics;
mod table;
mod truth;

use crate::{
    engines::{self, Engine},
    output, scenes, workloads,
};
use indicatif::{ProgressBar, ProgressStyle};
use measure::Outcome;
use rays::RaySet;
use record::{Figures, Pool, Record};
use std::{
    collections::BTreeMap,
    error::Error,
    io::{self, Write},
    path::PathBuf,
};
use truth::Truth;
use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::Bvh8};
use wide_bvh_scenes::Mesh;

/// Plot run time against error: lost rays, phantom hits, leaks, and how far t, u and v are off.
///
/// Variants: every engine of the race (this crate's widths and backends, and its peers), and kernels of the lab's own
/// that walk this crate's tree and differ in their box test or their triangle test alone.
///
/// Rays: the race's closest-hit workloads; rays aimed at vertices, at edges, at silhouettes, and from the
/// surface at either; rays from inside closed meshes made by code, at their corners, edges and faces; and rays at a
/// ball of needles.
///
/// Truth is exact arithmetic on the floats given. A ray that no float test can decide, because it passes an
/// outline within the rounding of a triangle to the ray, is counted apart; the tables' legend tells how.
#[derive(clap::Args)]
pub struct Args {
    /// Also write every figure to this file, as a JSON list
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Also draw the chart of all scenes together to this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    scenes: scenes::Args,
    /// Only the variants whose names contain one of these
    #[arg(long, value_name = "TEXT", num_args = 1..)]
    variants: Vec<String>,
    /// Few rays and rounds: minutes become seconds, and the figures rough
    #[arg(long)]
    quick: bool,
}

/// How much to measure.
struct Effort {
    /// Rays of a set.
    rays: usize,
    rounds: usize,
}

impl Effort {
    const FULL: Self = Self {
        rays: 1 << 15,
        rounds: 5,
    };
    const QUICK: Self = Self {
        rays: 1 << 11,
        rounds: 3,
    };
}

/// Measures, prints the tables, draws the chart.
///
/// # Errors
/// A scene that cannot be read, an engine that cannot be built, a file that cannot be written.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let scenes = args.scenes.load()?;
    let json = output::create(args.json.as_deref())?;
    let svg = output::create(args.svg.as_deref())?;
    let effort = if args.quick {
        Effort::QUICK
    } else {
        Effort::FULL
    };

    let mut out = io::stdout();
    writeln!(out, "{}", engines::about_embree()?)?;
    let mut results = Results::default();
    for scene in &scenes {
        let sets = |bvh: &Bvh8| rays::of_scene(scene, bvh, effort.rays);
        results.add_scene(scene, sets, args, &effort)?;
    }
    for (scene, depths) in &rays::closed_meshes() {
        let sets = |_: &Bvh8| vec![rays::from_inside(scene, *depths, effort.rays)];
        results.add_scene(scene, sets, args, &effort)?;
    }
    let needles = rays::needles();
    let sets = |_: &Bvh8| vec![rays::at_needles(&needles, effort.rays)];
    results.add_scene(&needles, sets, args, &effort)?;
    let Tables {
        records,
        sets,
        own,
        all,
    } = results.finish();
    for (set, rows) in &sets {
        writeln!(out, "\n{}", table::of_set(set, rows))?;
    }
    writeln!(out, "\n{}", table::of_set(OWN, &own))?;
    writeln!(out, "\n{}", table::of_set("all sets together", &all))?;
    writeln!(out, "{}", table::LEGEND)?;
    if let Some(file) = json {
        serde_json::to_writer_pretty(file, &records)?;
    }
    if let Some(mut file) = svg {
        let wrong = chart::wrong_answers(&all);
        let t = chart::errors_of_t(&own);
        file.write_all(chart::draw(&wrong, &t)?.as_bytes())?;
    }
    Ok(())
}

/// Every variant over `mesh`, which `bvh` was built on.
fn variants<'m>(
    mesh: &TriangleMesh<'m>,
    bvh: &Bvh8,
    args: &Args,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let chosen = |name: &str| {
        args.variants.is_empty()
            || args
                .variants
                .iter()
                .any(|text| name.contains(text.as_str()))
    };
    let mut variants = engines::all(mesh, &chosen)?;
    variants.extend(kernels::engines(mesh, bvh));
    variants.retain(|variant| chosen(variant.name()));
    Ok(variants)
}

/// Figures by variant, in the variants' order.
type Rows = Vec<(String, Figures)>;

/// The sets of rays that the race traces, too.
const OWN: &str = "scenes' own rays (primary, bounce, random)";

/// What has been measured so far.
#[derive(Default)]
struct Results {
    records: Vec<Record>,
    variants: Vec<String>,
    sets: Vec<&'static str>,
    /// By set, then variant: places in the lists above.
    pools: BTreeMap<(usize, usize), Pool>,
    /// By variant, over the sets of the race.
    own: BTreeMap<usize, Pool>,
    /// By variant, over all sets.
    all: BTreeMap<usize, Pool>,
}

/// What has been measured.
struct Tables {
    records: Vec<Record>,
    sets: Vec<(&'static str, Rows)>,
    own: Rows,
    all: Rows,
}

impl Results {
    fn add_scene(
        &mut self,
        scene: &Mesh,
        sets: impl Fn(&Bvh8) -> Vec<RaySet>,
        args: &Args,
        effort: &Effort,
    ) -> Result<(), Box<dyn Error>> {
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
        let bvh = Builder::new().build(&mesh)?;
        let variants = variants(&mesh, &bvh, args)?;
        let truth = Truth::new(mesh, &bvh);
        let sets = sets(&bvh);
        let turns = sets.len() * variants.len() * (effort.rounds + 1);
        let progress = ProgressBar::new(turns as u64)
            .with_style(ProgressStyle::with_template("{msg} {wide_bar} {percent}%")?);
        for set in &sets {
            progress.set_message(format!("{} {}", scene.name, set.name));
            let outcomes = measure::measure(&truth, set, &variants, effort.rounds, &progress);
            for (variant, outcome) in variants.iter().zip(&outcomes) {
                self.add(set, variant.name(), outcome);
                let mut alone = Pool::default();
                alone.add(set.name, outcome);
                self.records.push(Record {
                    scene: scene.name.clone(),
                    triangles: mesh.len(),
                    set: set.name,
                    variant: variant.name().to_owned(),
                    figures: alone.figures(),
                });
            }
        }
        progress.finish_and_clear();
        Ok(())
    }

    /// Takes an outcome into all pools that it belongs to.
    fn add(&mut self, set: &RaySet, variant: &str, outcome: &Outcome) {
        let variant = place(&mut self.variants, &variant.to_owned());
        let of_set = (place(&mut self.sets, &set.name), variant);
        let pools = [
            Some(self.pools.entry(of_set).or_default()),
            Some(self.all.entry(variant).or_default()),
            workloads::NAMES
                .contains(&set.name)
                .then(|| self.own.entry(variant).or_default()),
        ];
        for pool in pools.into_iter().flatten() {
            pool.add(set.name, outcome);
        }
    }

    fn finish(self) -> Tables {
        let row = |variant: usize, pool: Pool| (self.variants[variant].clone(), pool.figures());
        let rows = |pools: BTreeMap<usize, Pool>| -> Rows {
            let pools = pools.into_iter();
            pools.map(|(variant, pool)| row(variant, pool)).collect()
        };
        let mut sets: Vec<(&str, Rows)> = self.sets.iter().map(|&set| (set, Rows::new())).collect();
        for ((set, variant), pool) in self.pools {
            sets[set].1.push(row(variant, pool));
        }
        Tables {
            sets,
            own: rows(self.own),
            all: rows(self.all),
            records: self.records,
        }
    }
}

/// Where `item` is in `list`, at whose end it is put if it is new.
fn place<T: Clone + PartialEq>(list: &mut Vec<T>, item: &T) -> usize {
    let known = list.iter().position(|known| known == item);
    known.unwrap_or_else(|| {
        list.push(item.clone());
        list.len() - 1
    })
}
