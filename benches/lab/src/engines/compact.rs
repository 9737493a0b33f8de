//! This crate's compact hierarchies: nodes of 80 and 48 bytes, leaves that read the mesh's own buffers.

use super::{Batch, Built, Chosen, Engine, Takes, timed};
use std::{error::Error, rc::Rc};
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Borrowed, Bvh, CompactNode4, CompactNode8, MeshLeaf, Owned, RunLeaf, WideNode},
    simd::Backend,
};

/// Both widths, on the fastest backend, built by one thread; each called ray by ray, and with all rays at once.
///
/// # Errors
/// The mesh cannot be built on.
pub fn engines<'m>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let mut engines = of_width::<CompactNode8>(mesh, chosen)?;
    engines.extend(of_width::<CompactNode4>(mesh, chosen)?);
    Ok(engines)
}

fn of_width<'m, N: WideNode + Send + 'm>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let name = format!("wide-bvh {} compact {}", N::WIDTH, Backend::detect().name());
    let batch = format!("{name} batch");
    let mut calls = vec![(name, Takes::OneRay), (batch, Takes::Batches)];
    calls.retain(|(name, _)| chosen(name));
    if calls.is_empty() {
        return Ok(Vec::new());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (tree, time) = pool.install(|| timed(|| Builder::new().build_compact::<N>(mesh)));
    let tree = Rc::new(tree?);
    let bytes = tree.bytes();
    let engine = |(name, takes): (String, Takes)| {
        Box::new(Compact {
            name,
            built: Built { time, bytes },
            tree: Rc::clone(&tree),
            mesh: *mesh,
            takes,
        }) as Box<dyn Engine + 'm>
    };
    Ok(calls.into_iter().map(engine).collect())
}

/// A tree that both calls share.
struct Compact<'m, N: WideNode> {
    name: String,
    built: Built,
    tree: Rc<Bvh<N, RunLeaf, Owned>>,
    mesh: TriangleMesh<'m>,
    takes: Takes,
}

impl<N: WideNode> Engine for Compact<'_, N> {
    fn name(&self) -> &str {
        &self.name
    }

    fn built(&self) -> Built {
        self.built
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn takes(&self) -> Takes {
        self.takes
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let bvh = self.tree.over(&self.mesh);
        Box::new(Rays {
            bvh: bvh.expect("the mesh that it was built on"),
            rays,
            takes: self.takes,
        })
    }
}

struct Rays<'a, N: WideNode> {
    bvh: Bvh<N, MeshLeaf<'a>, Borrowed<'a>>,
    rays: &'a [Ray],
    takes: Takes,
}

impl<N: WideNode> Batch for Rays<'_, N> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        match self.takes {
            Takes::Batches => self.bvh.closest_hits(self.rays, hits),
            Takes::OneRay => {
                for (ray, hit) in self.rays.iter().zip(hits) {
                    *hit = self.bvh.closest_hit(ray);
                }
            }
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        match self.takes {
            Takes::Batches => self.bvh.any_hits(self.rays, occluded),
            Takes::OneRay => {
                for (ray, occluded) in self.rays.iter().zip(occluded) {
                    *occluded = self.bvh.any_hit(ray);
                }
            }
        }
    }
}
