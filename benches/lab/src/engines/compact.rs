//! This crate's compact hierarchies: nodes of 80 and 48 bytes, leaves that read the mesh's own buffers.

use super::{
    Batch, Built, Chosen, Engine, Takes, timed,
    wide_bvh::{AllAtOnce, Call, OneByOne, pool},
};
use std::{error::Error, marker::PhantomData, rc::Rc};
use wide_bvh::{
    build::{Builder, ReorderedMesh},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, CompactNode4, CompactNode8, Order, OrderedLeaf, Owned, RunLeaf, Runs,
        WideNode,
    },
    simd::Backend,
};

/// Both widths, on the fastest backend, built by one thread; each called ray by ray, and with all rays at once. The wider one over
/// a reordered mesh, too.
///
/// # Errors
/// The mesh cannot be built on.
pub fn engines<'m>(
    mesh: &TriangleMesh<'m>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let mut engines = of_order::<CompactNode8>(mesh, false, chosen)?;
    engines.extend(of_order::<CompactNode8>(mesh, true, chosen)?);
    engines.extend(of_order::<CompactNode4>(mesh, false, chosen)?);
    Ok(engines)
}

/// Those over the mesh as it is, or reordered.
fn of_order<'m, N: WideNode + Send + 'm>(
    mesh: &TriangleMesh<'m>,
    reorder: bool,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine + 'm>>, Box<dyn Error>> {
    let (width, backend) = (N::WIDTH, Backend::detect().name());
    let name = match reorder {
        true => format!("wide-bvh {width} compact reordered {backend}"),
        false => format!("wide-bvh {width} compact {backend}"),
    };
    let batch = format!("{name} batch");
    let mut kinds: Vec<(String, Make<'m, N>)> = vec![
        (name, Compact::<N, OneByOne>::boxed),
        (batch, Compact::<N, AllAtOnce>::boxed),
    ];
    kinds.retain(|(name, _)| chosen(name));
    if kinds.is_empty() {
        return Ok(Vec::new());
    }
    let build = || -> Result<_, Box<dyn Error + Send + Sync>> {
        if !reorder {
            return Ok(Tree::ByList(Builder::new().build_compact(mesh)?, *mesh));
        }
        let uncut = Builder::new().splits(0.0).build_compact::<N>(mesh)?;
        let (tree, reordered) = uncut.reorder(mesh)?;
        Ok(Tree::InOrder(tree, reordered))
    };
    let (built, time) = pool(1)?.install(|| timed(build));
    let tree = Rc::new(built.map_err(|error| -> Box<dyn Error> { error })?);
    let bytes = tree.bytes();
    let built = Built { time, bytes };
    let engine = |(name, make): (String, Make<'m, N>)| make(name, built, Rc::clone(&tree));
    Ok(kinds.into_iter().map(engine).collect())
}

/// Makes an engine of a tree.
type Make<'m, N> = fn(String, Built, Rc<Tree<'m, N>>) -> Box<dyn Engine + 'm>;

/// A tree, which both calls share.
enum Tree<'m, N: WideNode> {
    /// Over the mesh as it was.
    ByList(Bvh<N, RunLeaf, Owned>, TriangleMesh<'m>),
    /// Over one in the order of leaves.
    InOrder(Bvh<N, OrderedLeaf, Owned>, ReorderedMesh),
}

impl<N: WideNode> Tree<'_, N> {
    /// What there is beside a mesh.
    fn bytes(&self) -> usize {
        match self {
            Self::ByList(tree, _) => tree.bytes(),
            Self::InOrder(tree, _) => tree.bytes(),
        }
    }
}

/// A tree and how it is called.
struct Compact<'m, N: WideNode, C> {
    name: String,
    built: Built,
    tree: Rc<Tree<'m, N>>,
    call: PhantomData<C>,
}

impl<'m, N: WideNode + 'm, C: Call + 'm> Compact<'m, N, C> {
    fn boxed(name: String, built: Built, tree: Rc<Tree<'m, N>>) -> Box<dyn Engine + 'm> {
        Box::new(Self {
            name,
            built,
            tree,
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

    /// Of triangles that are hit at one `t` the one of least number is another where numbers are.
    fn is_exact(&self) -> bool {
        matches!(*self.tree, Tree::ByList(..))
    }

    fn takes(&self) -> Takes {
        C::TAKES
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        match &*self.tree {
            Tree::ByList(tree, mesh) => Box::new(Rays {
                bvh: tree.over(mesh).expect("the mesh that it was built on"),
                numbers: None,
                rays,
                call: PhantomData::<C>,
            }),
            Tree::InOrder(tree, new) => {
                let mesh = TriangleMesh::new(&new.positions, &new.indices).expect("a mesh");
                Box::new(Rays {
                    bvh: tree.over(&mesh).expect("the mesh that it is over"),
                    numbers: Some(&*new.triangles),
                    rays,
                    call: PhantomData::<C>,
                })
            }
        }
    }
}

struct Rays<'a, N: WideNode, O: Order, C> {
    bvh: Bvh<N, Runs<TriangleMesh<'a>, O>, Borrowed<'a>>,
    /// The numbers that triangles had, if they have others.
    numbers: Option<&'a [u32]>,
    rays: &'a [Ray],
    call: PhantomData<C>,
}

impl<N: WideNode, O: Order, C: Call> Batch for Rays<'_, N, O, C> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        C::closest(&self.bvh, self.rays, hits);
        if let Some(numbers) = self.numbers {
            for hit in hits.iter_mut().flatten() {
                hit.primitive = numbers[hit.primitive as usize];
            }
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        C::any(&self.bvh, self.rays, occluded);
    }
}
