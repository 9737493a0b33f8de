//! One case: a mesh, rays, and what besides the contract is expected of them.

use super::{families::Family, variants::Settings};
use fastrand::Rng;
use wide_bvh::{build::BinaryTree, geometry::Ray};
use wide_bvh_scenes::Mesh;

/// A mesh and rays at it. Equal seed, family and number give equal cases.
pub struct Case {
    pub mesh: Mesh,
    /// A tree for the builder to start from, besides its own.
    pub tree: BinaryTree,
    /// For one build more.
    pub settings: Settings,
    pub rays: Vec<Ray>,
    /// Every ray has to hit: it starts within a closed mesh.
    pub closed: bool,
    pub flush: Flush,
    /// One ray in so many is checked in exact arithmetic.
    pub exact_every: usize,
}

/// When denormal numbers are flushed to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flush {
    Never,
    /// In queries, brute force's too, but not in the build: for meshes without denormal coordinates.
    Queries,
    /// In the build, too.
    Throughout,
}

impl Case {
    /// Case `number` of a family.
    pub fn new(family: &Family, seed: u64, number: u64) -> Self {
        let mut rng = Rng::with_seed(hash(family.name, seed, number));
        (family.case)(&mut rng)
    }

    /// A case with a random tree and settings, checked as most are.
    pub fn of(rng: &mut Rng, mesh: Mesh, rays: Vec<Ray>) -> Self {
        Self {
            tree: super::trees::random(rng, mesh.indices.len()),
            settings: Settings::random(rng),
            mesh,
            rays,
            closed: false,
            flush: Flush::Never,
            exact_every: 32,
        }
    }
}

/// A seed of a name and two numbers: FNV-1a.
pub fn hash(name: &str, seed: u64, number: u64) -> u64 {
    let numbers = [seed, number].map(u64::to_le_bytes);
    name.bytes()
        .chain(numbers.into_iter().flatten())
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
}
