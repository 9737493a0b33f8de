//! Kernels that exist to be measured: one traversal, over this crate's own tree, with the ways known to test boxes
//! and triangles as type parameters. Each variant differs from another in one thing only, so their times and
//! errors compare; they are plain code that the compiler vectorises eight wide, for AVX2 with FMA where the
//! processor has it, and not tuned as this crate's kernel is.
//!
//! Where there is no FMA, the `fma` variants call a function for it: right, and slow.

mod slab;
mod tree;
mod triangle;
mod walk;

use crate::engines::{Batch, Built, Engine};
use slab::{Ize, PlainSlab, SlabTest, ThisCrates};
use std::{rc::Rc, time::Duration};
use tree::{Leaves, Tree};
use triangle::{BaldwinWeber, MollerTrumbore, MollerTrumbore64, TriangleTest, Woop};
use wide_bvh::{
    geometry::{Hit, Ray, TriangleMesh},
    layout::Bvh8,
};

/// What the names of those begin with that differ in the box test. Their triangle test is Woop's with its `f64` step.
pub const SLAB: &str = "slab ";
/// What the names of those begin with that differ in the triangle test. Their box test is this crate's with FMA.
pub const TRIANGLE: &str = "triangle ";

/// All variants over `mesh`, which `bvh` was built on.
pub fn engines(mesh: &TriangleMesh<'_>, bvh: &Bvh8) -> Vec<Box<dyn Engine>> {
    let tree = &Rc::new(Tree::new(bvh));
    let woop = &Rc::new(Leaves::<Woop<true>>::new(mesh, bvh));
    let leaves32 = &Rc::new(Leaves::<MollerTrumbore>::new(mesh, bvh));
    let leaves64 = &Rc::new(Leaves::<MollerTrumbore64>::new(mesh, bvh));
    let matrices = &Rc::new(Leaves::<BaldwinWeber>::new(mesh, bvh));
    let inexact = &Rc::new(Leaves::<Woop<false>>::new(mesh, bvh));
    let mut engines = Vec::new();
    add::<PlainSlab<false>, _>(&mut engines, "slab plain", tree, woop);
    add::<PlainSlab<true>, _>(&mut engines, "slab plain fma", tree, woop);
    add::<Ize<false>, _>(&mut engines, "slab Ize", tree, woop);
    add::<Ize<true>, _>(&mut engines, "slab Ize fma", tree, woop);
    add::<ThisCrates<false>, _>(&mut engines, "slab this crate's", tree, woop);
    add::<ThisCrates<true>, _>(&mut engines, "slab this crate's fma", tree, woop);
    let name = "triangle Möller-Trumbore";
    add::<ThisCrates<true>, _>(&mut engines, name, tree, leaves32);
    let name = "triangle Möller-Trumbore f64";
    add::<ThisCrates<true>, _>(&mut engines, name, tree, leaves64);
    add::<ThisCrates<true>, _>(&mut engines, "triangle Baldwin-Weber", tree, matrices);
    add::<ThisCrates<true>, _>(&mut engines, "triangle Woop without f64", tree, inexact);
    engines
}

fn add<S: SlabTest, T: TriangleTest>(
    engines: &mut Vec<Box<dyn Engine>>,
    name: &'static str,
    tree: &Rc<Tree>,
    leaves: &Rc<Leaves<T>>,
) {
    engines.push(Box::new(Kernel::<S, T> {
        name,
        tree: Rc::clone(tree),
        leaves: Rc::clone(leaves),
        slab: std::marker::PhantomData,
    }));
}

/// One variant.
struct Kernel<S, T: TriangleTest> {
    name: &'static str,
    tree: Rc<Tree>,
    leaves: Rc<Leaves<T>>,
    slab: std::marker::PhantomData<S>,
}

impl<S: SlabTest, T: TriangleTest> Engine for Kernel<S, T> {
    fn name(&self) -> &str {
        self.name
    }

    /// It is converted, not built: no time.
    fn built(&self) -> Built {
        Built {
            time: Duration::ZERO,
            bytes: self.tree.bytes() + self.leaves.bytes(),
        }
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        Box::new(Rays { kernel: self, rays })
    }
}

struct Rays<'a, S, T: TriangleTest> {
    kernel: &'a Kernel<S, T>,
    rays: &'a [Ray],
}

impl<S: SlabTest, T: TriangleTest> Batch for Rays<'_, S, T> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        walk::closest_hits::<S, T>(&self.kernel.tree, &self.kernel.leaves, self.rays, hits);
    }

    fn any(&self, occluded: &mut [bool]) {
        let mut hits = vec![None; self.rays.len()];
        self.closest(&mut hits);
        for (occluded, hit) in occluded.iter_mut().zip(&hits) {
            *occluded = hit.is_some();
        }
    }
}
