//! The kernels that race, each behind the same two traits; a file each.
//!
//! What an engine may do untimed: build itself, and turn rays into its own format. Every engine is
//! built by one thread, of the same buffers, and timed from those buffers to the first ray; those that differ
//! only in how they trace share a tree.

mod bvh;
mod compact;
mod embree;
mod obvhs;
mod parry;
mod wide_bvh;

use ::wide_bvh::geometry::{Hit, Ray, TriangleMesh};
use std::{
    error::Error,
    time::{Duration, Instant},
};

/// A kernel over one scene.
pub trait Engine {
    /// Its name in tables and JSON.
    fn name(&self) -> &str;

    /// How it was built.
    fn built(&self) -> Built;

    /// Whether it promises the reference's answers bit for bit. Others may round differently.
    fn is_exact(&self) -> bool {
        false
    }

    /// How many rays it is handed at a time.
    fn takes(&self) -> Takes {
        Takes::OneRay
    }

    /// Turns rays into its own format.
    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a>;
}

/// Rays in an engine's own format. A call traces them all, one after another.
pub trait Batch {
    /// The first hit of each ray. `u` and `v` are zero where the engine does not tell them.
    ///
    /// `hits` is as long as the rays are.
    fn closest(&self, hits: &mut [Option<Hit>]);

    /// Whether anything is in each ray's way.
    ///
    /// `occluded` is as long as the rays are.
    fn any(&self, occluded: &mut [bool]);
}

/// What building an engine cost.
#[derive(Clone, Copy)]
pub struct Built {
    /// From the mesh's buffers to the first ray.
    pub time: Duration,
    /// What it keeps besides the mesh's buffers.
    pub bytes: usize,
}

/// How many rays a call of an engine takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// One.
    OneRay,
    /// Several, which it may trace together.
    Batches,
}

/// Whether the engine of a name is wanted. What is not is not built.
pub type Chosen<'a> = &'a dyn Fn(&str) -> bool;

/// The chosen engines over `mesh`; this crate's come first.
///
/// # Errors
/// An engine cannot be built.
pub fn all<'m>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let mut engines: Vec<Box<dyn Engine + 'm>> = Vec::new();
    for engine in wide_bvh::engines(mesh, chosen)? {
        engines.push(engine);
    }
    engines.extend(compact::engines(mesh, chosen)?);
    engines.extend(embree::engines(mesh, chosen)?);
    engines.extend(obvhs::engines(mesh, chosen));
    engines.extend(bvh::engine(mesh, chosen));
    engines.extend(parry::engine(mesh, chosen)?);
    Ok(engines)
}

/// A way to build a tree.
pub struct Builder<'a> {
    /// In tables and JSON.
    pub name: &'static str,
    /// Builds by so many threads, into what takes one ray a call.
    pub build: Box<dyn Fn(usize) -> Outcome + 'a>,
}

/// What a builder makes, or why it cannot.
pub type Outcome = Result<Box<dyn Engine>, Box<dyn Error>>;

/// This crate's builders and Embree's, over `mesh`.
pub fn builders<'a>(mesh: &'a TriangleMesh<'_>) -> Vec<Builder<'a>> {
    let mut builders = wide_bvh::builders(mesh);
    builders.extend(embree::builders(mesh));
    builders
}

/// A line on Embree: its version, or how to get it.
///
/// # Errors
/// It is there, and does not work.
pub fn about_embree() -> Result<String, Box<dyn Error>> {
    Ok(embree::about()?)
}

/// What `build` makes, and how long it took.
fn timed<T>(build: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let made = build();
    (made, start.elapsed())
}
