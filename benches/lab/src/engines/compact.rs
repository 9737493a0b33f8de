//! This crate's compact hierarchies: nodes of 80 and 48 bytes, leaves that read the mesh's own buffers.

use super::{Batch, Built, Chosen, Engine, timed};
use std::error::Error;
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Borrowed, Bvh, CompactNode4, CompactNode8, MeshLeaf, Owned, RunLeaf, WideNode},
    simd::Backend,
};

/// Both widths, on the fastest backend, built by one thread.
///
/// # Errors
/// The mesh cannot be built on.
pub fn engines<'m>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let both = [
        engine::<CompactNode8>(mesh, chosen)?,
        engine::<CompactNode4>(mesh, chosen)?,
    ];
    Ok(both.into_iter().flatten().collect())
}

fn engine<'m, N: WideNode + Send + 'm>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Option<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let name = format!("wide-bvh {} compact {}", N::WIDTH, Backend::detect().name());
    if !chosen(&name) {
        return Ok(None);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (tree, time) = pool.install(|| timed(|| Builder::new().build_compact::<N>(mesh)));
    let tree = tree?;
    let bytes = tree.bytes();
    Ok(Some(Box::new(Compact {
        name,
        built: Built { time, bytes },
        tree,
        mesh: *mesh,
    })))
}

struct Compact<'m, N: WideNode> {
    name: String,
    built: Built,
    tree: Bvh<N, RunLeaf, Owned>,
    mesh: TriangleMesh<'m>,
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

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let bvh = self.tree.over(&self.mesh);
        Box::new(Rays {
            bvh: bvh.expect("the mesh that it was built on"),
            rays,
        })
    }
}

struct Rays<'a, N: WideNode> {
    bvh: Bvh<N, MeshLeaf<'a>, Borrowed<'a>>,
    rays: &'a [Ray],
}

impl<N: WideNode> Batch for Rays<'_, N> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        for (ray, hit) in self.rays.iter().zip(hits) {
            *hit = self.bvh.closest_hit(ray);
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        for (ray, occluded) in self.rays.iter().zip(occluded) {
            *occluded = self.bvh.any_hit(ray);
        }
    }
}
