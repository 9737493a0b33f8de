//! `lab corrupt`: a baked file with one byte changed, a million times over.

mod opened;

use crate::{stress::hash, text::align};
use fastrand::Rng;
use glam::Vec3;
use indicatif::{ProgressBar, ProgressStyle};
use opened::{Open, opener};
use rayon::prelude::*;
use std::{
    collections::BTreeMap,
    error::Error,
    fs,
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
    time::{Duration, Instant},
};
use wide_bvh::{
    geometry::{Aabb, Hit, Ray},
    layout::{
        AlignedBytes,
        bytes::{Header, seal},
    },
    simd::Backend,
};

/// A baked file with one byte changed, a million times over: an error, or answers, and nothing else.
///
/// The file is one that `bake` wrote. A byte at random, one in sixteen of them in the header, gets another value;
/// the file is opened, and the byte put back. As it is, every such file has to be refused. Of those that are sealed again,
/// so that the checksum fits, each has to be refused or to answer: any hit as closest hit does, on every backend in turn.
///
/// Stops at the first violation, a panic being one, and fails. Else ends with a table of what was said.
#[derive(clap::Args)]
pub struct Args {
    /// A file that `bake` wrote, with triangles in it
    file: PathBuf,
    /// How many times a byte is changed
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    count: u64,
    /// How many times a byte is changed and the file sealed again
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    resealed: u64,
    /// What the places and values are made from
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
}

/// Rays that are asked of what opens.
const RAYS: usize = 64;
/// Changes that a thread makes in one go.
const BATCH: u64 = 1 << 10;

/// Corrupts, and prints the table.
///
/// # Errors
/// A file that cannot be read or opened; a violation.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let failed = |error: &dyn Error| format!("{}: {error}", args.file.display());
    let file = AlignedBytes::new(&fs::read(&args.file).map_err(|error| failed(&error))?);
    let header = Header::read(&file).map_err(|error| failed(&error))?;
    let open = opener(&header)
        .ok_or_else(|| format!("{}: its leaves are no triangles", args.file.display()))?;
    let rays = {
        let bvh = open(&file, Backend::detect()).map_err(|error| failed(&error))?;
        rays(bvh.bounds(), args.seed)
    };
    let subject = Subject::new(&file, open, rays);

    let progress = ProgressBar::new(args.count + args.resealed).with_style(
        ProgressStyle::with_template("{msg} {wide_bar} {human_pos} of {human_len}, {eta} left")?,
    );
    progress.enable_steady_tick(Duration::from_millis(200));
    let all = |message, count, seal| {
        progress.set_message(message);
        subject.all(count, args.seed, seal, &progress)
    };
    let start = Instant::now();
    let outcome = all("as they are", args.count, false).and_then(|as_they_are| {
        let resealed = all("sealed again", args.resealed, true)?;
        Ok((as_they_are, resealed))
    });
    progress.finish_and_clear();
    let (as_they_are, resealed) = outcome?;
    print!("{}", table(&as_they_are, &resealed));
    println!(
        "{} bytes, seed {}, {:.0} s: no violation. The longest took {:.1} ms, with {RAYS} rays if it opened",
        file.len(),
        args.seed,
        start.elapsed().as_secs_f64(),
        as_they_are.longest.max(resealed.longest).as_secs_f64() * 1e3,
    );
    Ok(())
}

/// From around the bounds at points within.
fn rays(bounds: &Aabb, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::with_seed(seed);
    let mut point = |reach: f32| {
        let from_center = Vec3::from([(); 3].map(|()| rng.f32() - 0.5));
        bounds.center() + reach * from_center * (bounds.max - bounds.min)
    };
    let ray = |_| {
        let (from, to) = (point(3.0), point(0.8));
        Ray::new(from, to - from)
    };
    (0..RAYS).map(ray).collect()
}

/// What is corrupted, and what it answers when it is whole.
struct Subject<'a> {
    file: &'a [u8],
    open: Open,
    rays: Vec<Ray>,
    whole: Vec<Option<Hit>>,
}

/// How often what was said.
#[derive(Default)]
struct Counts {
    said: BTreeMap<String, u64>,
    longest: Duration,
}

impl Counts {
    fn add(mut self, other: Self) -> Self {
        for (said, count) in other.said {
            *self.said.entry(said).or_default() += count;
        }
        self.longest = self.longest.max(other.longest);
        self
    }
}

impl<'a> Subject<'a> {
    fn new(file: &'a [u8], open: Open, rays: Vec<Ray>) -> Self {
        let bvh = open(file, Backend::detect());
        let whole = match &bvh {
            Ok(bvh) => rays.iter().map(|ray| bvh.ask(ray).0).collect(),
            Err(_) => Vec::new(),
        };
        Self {
            file,
            open,
            rays,
            whole,
        }
    }

    /// As many changes, on all cores.
    fn all(
        &self,
        count: u64,
        seed: u64,
        resealed: bool,
        progress: &ProgressBar,
    ) -> Result<Counts, String> {
        let batches: Vec<Range<u64>> = (0..count.div_ceil(BATCH))
            .map(|batch| batch * BATCH..count.min((batch + 1) * BATCH))
            .collect();
        batches
            .into_par_iter()
            .map_init(
                || AlignedBytes::new(self.file),
                |bytes, numbers| {
                    let changed = numbers.end - numbers.start;
                    let counts = self.batch(bytes, numbers, seed, resealed)?;
                    progress.inc(changed);
                    Ok(counts)
                },
            )
            .try_reduce(Counts::default, |a, b| Ok(a.add(b)))
    }

    fn batch(
        &self,
        bytes: &mut AlignedBytes,
        numbers: Range<u64>,
        seed: u64,
        resealed: bool,
    ) -> Result<Counts, String> {
        let kind = if resealed { "sealed" } else { "as is" };
        let mut rng = Rng::with_seed(hash(kind, seed, numbers.start));
        let mut counts = Counts::default();
        for number in numbers {
            let within = match rng.u32(..16) {
                0 => size_of::<Header>(),
                _ => bytes.len(),
            };
            let (place, change) = (rng.usize(..within), rng.u8(1..));
            let start = Instant::now();
            bytes[place] ^= change;
            if resealed {
                seal(bytes);
            }
            let backends = Backend::available().count() as u64;
            let backend = Backend::available().nth((number % backends) as usize);
            let said = catch_unwind(AssertUnwindSafe(|| {
                self.said(bytes, backend.unwrap_or_else(Backend::detect), resealed)
            }))
            .unwrap_or_else(|_| Err("a panic".into()));
            // The checksum's own place, too.
            bytes[place] ^= change;
            bytes[..size_of::<Header>()].copy_from_slice(&self.file[..size_of::<Header>()]);
            let said = said.map_err(|what| {
                let sealed = if resealed { " and sealed again" } else { "" };
                format!("a violation: byte {place} changed by {change:#04x}{sealed}: {what}")
            })?;
            *counts.said.entry(said).or_default() += 1;
            counts.longest = counts.longest.max(start.elapsed());
        }
        Ok(counts)
    }

    /// What is said to the bytes: the kind of error, or how the rays are answered.
    fn said(&self, bytes: &[u8], backend: Backend, may_open: bool) -> Result<String, String> {
        let bvh = match (self.open)(bytes, backend) {
            Ok(bvh) => bvh,
            Err(error) => return Ok(format!("error: {}", kind(&error))),
        };
        if !may_open {
            return Err("it opens".into());
        }
        let mut same = true;
        for (ray, whole) in self.rays.iter().zip(&self.whole) {
            let (closest, any) = bvh.ask(ray);
            if any != closest.is_some() {
                return Err(format!("any hit {any}, closest {closest:?}, {ray:?}"));
            }
            same &= closest == *whole;
        }
        Ok(match same {
            true => "opened, the same hits",
            false => "opened, other hits",
        }
        .to_owned())
    }
}

/// An error's name without its figures.
fn kind(error: &impl std::fmt::Debug) -> String {
    let text = format!("{error:?}");
    let end = text.find([' ', '{']).unwrap_or(text.len());
    let name = text[..end].trim_end_matches(|c: char| !c.is_ascii_alphabetic());
    match name.split_once('(') {
        Some((outer, inner)) if outer == inner => outer.to_owned(),
        _ => name.replace("(\"", " ").replace('(', " "),
    }
}

fn table(as_they_are: &Counts, resealed: &Counts) -> String {
    let mut rows: Vec<(&String, [u64; 2])> = Vec::new();
    for said in as_they_are.said.keys().chain(resealed.said.keys()) {
        if rows.iter().all(|(known, _)| *known != said) {
            let count = |counts: &Counts| counts.said.get(said).copied().unwrap_or(0);
            rows.push((said, [count(as_they_are), count(resealed)]));
        }
    }
    rows.sort_by_key(|&(_, counts)| std::cmp::Reverse(counts));
    let header = ["a byte changed", "as it is", "sealed again"].map(str::to_owned);
    let rows = rows.into_iter().map(|(said, counts)| {
        let counts = counts.map(|count| count.to_string());
        std::iter::once(said.clone()).chain(counts).collect()
    });
    let rows: Vec<Vec<String>> = std::iter::once(header.to_vec()).chain(rows).collect();
    align(&rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::CompactNode8};
    use wide_bvh_scenes::shapes;

    /// Both ways, on a small file; and the check has teeth: a whole file is no error.
    #[test]
    fn a_small_file() {
        let mesh = shapes::icosphere(2);
        let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let tree = Builder::new().build_compact::<CompactNode8>(&mesh).unwrap();
        let file = AlignedBytes::new(&tree.over(&mesh).unwrap().to_bytes().unwrap());
        let open = opener(&Header::read(&file).unwrap()).unwrap();
        let subject = Subject::new(&file, open, rays(tree.bounds(), 1));
        let hidden = ProgressBar::hidden();
        let counts = subject.all(20_000, 1, false, &hidden).unwrap();
        assert_eq!(counts.said.values().sum::<u64>(), 20_000);
        assert!(counts.said["error: Checksum"] > 10_000);
        let counts = subject.all(20_000, 1, true, &hidden).unwrap();
        assert!(counts.said["opened, the same hits"] > 1000);
        assert!(counts.said["opened, other hits"] > 10);
        assert!(counts.said["error: Layout Child"] > 100);
        let violation = subject.said(&file, Backend::detect(), false);
        assert_eq!(violation, Err("it opens".to_owned()));
    }
}
