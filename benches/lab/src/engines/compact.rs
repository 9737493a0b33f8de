//! This crate's compact hierarchies: nodes of 80 and 48 bytes, leaves that read the mesh's own buffers.

use super::{
    Batch, Built, Chosen, Engine, Takes, timed,
    wide_bvh::{AllAtOnce, Call, OneByOne, pool},
};
use std::{error::Error, marker::PhantomData, rc::Rc};
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
    let mut kinds: Vec<(String, Make<'m, N>)> = vec![
        (name, Compact::<N, OneByOne>::boxed),
        (batch, Compact::<N, AllAtOnce>::boxed),
    ];
    kinds.retain(|(name, _)| chosen(name));
    if kinds.is_empty() {
        return Ok(Vec::new());
    }
    let (tree, time) = pool(1)?.install(|| timed(|| Builder::new().build_compact::<N>(mesh)));
    let tree = Rc::new(tree?);
    let bytes = tree.bytes();
    let built = Built { time, bytes };
    let engine = |(name, make): (String, Make<'m, N>)| make(name, built, Rc::clone(&tree), *mesh);
    Ok(kinds.into_iter().map(engine).collect())
}

/// Makes an engine of the tree and its mesh.
type Make<'m, N> =
    fn(String, Built, Rc<Bvh<N, RunLeaf, Owned>>, TriangleMesh<'m>) -> Box<dyn Engine + 'm>;

/// A tree that both calls share.
struct Compact<'m, N: WideNode, C> {
    name: String,
    built: Built,
    tree: Rc<Bvh<N, RunLeaf, Owned>>,
    mesh: TriangleMesh<'m>,
    call: PhantomData<C>,
}

impl<'m, N: WideNode + 'm, C: Call + 'm> Compact<'m, N, C> {
    fn boxed(
        name: String,
        built: Built,
        tree: Rc<Bvh<N, RunLeaf, Owned>>,
        mesh: TriangleMesh<'m>,
    ) -> Box<dyn Engine + 'm> {
        Box::new(Self {
            name,
            built,
            tree,
            mesh,
            call: PhantomData,
        })
    }
}

impl<N: WideNode, C: Call> Engine for Compact<'_, N, C> {
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
        C::TAKES
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let bvh = self.tree.over(&self.mesh);
        Box::new(Rays {
            bvh: bvh.expect("the mesh that it was built on"),
            rays,
            call: PhantomData::<C>,
        })
    }
}

struct Rays<'a, N: WideNode, C> {
    bvh: Bvh<N, MeshLeaf<'a>, Borrowed<'a>>,
    rays: &'a [Ray],
    call: PhantomData<C>,
}

impl<N: WideNode, C: Call> Batch for Rays<'_, N, C> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        C::closest(&self.bvh, self.rays, hits);
    }

    fn any(&self, occluded: &mut [bool]) {
        C::any(&self.bvh, self.rays, occluded);
    }
}
