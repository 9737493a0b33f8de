//! This crate: each width on each of the processor's backends, a ray a call or all at once; on the
//! best one also eight a call, approximately, and with compact nodes. A width is built once; its backends
//! trace the same tree in the same memory.

use super::{Batch, Built, Chosen, Engine, Takes, timed};
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use std::{
    cell::RefCell,
    collections::BTreeMap,
    error::Error,
    marker::PhantomData,
    rc::Rc,
    sync::{Arc, Mutex, PoisonError},
};
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{
        Bvh, CompactNode8, Node4, Node8, Owned, Storage, TriangleLeaf, TriangleLeaves, WideNode,
    },
    simd::Backend,
};

/// Both widths on every backend, and compact nodes over leaves of their own on the best, built by one thread.
///
/// # Errors
/// The mesh cannot be built on.
pub fn engines(
    mesh: &TriangleMesh<'_>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine>>, Box<dyn Error>> {
    let every: Vec<Backend> = Backend::available().collect();
    let mut engines = of_nodes::<Node8>("8", mesh, &every, chosen)?;
    engines.extend(of_nodes::<Node4>("4", mesh, &every, chosen)?);
    let best = [Backend::detect()];
    engines.extend(of_nodes::<CompactNode8>(
        "8 quantized",
        mesh,
        &best,
        chosen,
    )?);
    Ok(engines)
}

/// Every way to build, by name. All make trees of 8-wide nodes.
fn recipes() -> [(&'static str, Builder<'static>); 3] {
    [
        ("wide-bvh 8 Fast", Preset::Fast),
        ("wide-bvh 8 Balanced", Preset::Balanced),
        ("wide-bvh 8 Best", Preset::Best),
    ]
    .map(|(name, preset)| (name, Builder::new().preset(preset)))
}

/// Its builders.
pub fn builders<'a>(mesh: &'a TriangleMesh<'_>) -> Vec<super::Builder<'a>> {
    let builder = |(name, recipe): (&'static str, Builder<'static>)| super::Builder {
        name,
        build: Box::new(move |threads| {
            let (tree, built) = build::<Node8>(&recipe, mesh, threads)?;
            let backend = Backend::detect();
            let name = name.to_owned();
            Ok(WideBvh::<_, OneByOne>::boxed(name, built, tree, backend))
        }),
    };
    recipes().into_iter().map(builder).collect()
}

type Triangles<N> = Bvh<N, TriangleLeaf, Owned>;

/// A tree that engines share, each of which sets its backend before it traces.
type Shared<N> = Rc<RefCell<Triangles<N>>>;

fn of_nodes<N: WideNode + Send + 'static>(
    nodes: &str,
    mesh: &TriangleMesh<'_>,
    backends: &[Backend],
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine>>, Box<dyn Error>> {
    let mut kinds: Vec<(String, Backend, Make<N>)> = Vec::new();
    for &backend in backends {
        let name = format!("wide-bvh {nodes} {}", backend.name());
        kinds.push((name.clone(), backend, WideBvh::<N, OneByOne>::boxed));
        kinds.push((
            format!("{name} batch"),
            backend,
            WideBvh::<N, AllAtOnce>::boxed,
        ));
        if nodes == "8" && backend == Backend::detect() {
            let make = WideBvh::<N, InPackets>::boxed;
            kinds.push((format!("{name} packet 8"), backend, make));
            let make = WideBvh::<N, Approximately<OneByOne>>::boxed;
            kinds.push((format!("{name} approximate"), backend, make));
            let make = WideBvh::<N, Approximately<AllAtOnce>>::boxed;
            kinds.push((format!("{name} approximate batch"), backend, make));
        }
    }
    kinds.retain(|(name, ..)| chosen(name));
    if kinds.is_empty() {
        return Ok(Vec::new());
    }
    let (tree, built) = build(&Builder::new(), mesh, 1)?;
    let engine = |(name, backend, make): (String, Backend, Make<N>)| {
        make(name, built, Rc::clone(&tree), backend)
    };
    Ok(kinds.into_iter().map(engine).collect())
}

/// A tree built by so many threads.
fn build<N: WideNode + Send>(
    builder: &Builder,
    mesh: &TriangleMesh<'_>,
    threads: usize,
) -> Result<(Shared<N>, Built), Box<dyn Error>> {
    let pool = pool(threads)?;
    let (tree, time) = pool.install(|| timed(|| builder.build_as(mesh)));
    let tree: Triangles<N> = tree?;
    let built = Built {
        time,
        bytes: tree.bytes(),
    };
    Ok((Rc::new(RefCell::new(tree)), built))
}

/// So many threads: the same ones each time, as Embree's are. New ones would begin with memory that nobody has used.
pub(super) fn pool(threads: usize) -> Result<Arc<ThreadPool>, ThreadPoolBuildError> {
    static POOLS: Mutex<BTreeMap<usize, Arc<ThreadPool>>> = Mutex::new(BTreeMap::new());
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = pools.get(&threads) {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(ThreadPoolBuilder::new().num_threads(threads).build()?);
    pools.insert(threads, Arc::clone(&pool));
    Ok(pool)
}

/// How rays are handed over.
pub(super) trait Call {
    const TAKES: Takes;
    /// Whether answers are the reference's.
    const EXACT: bool = true;

    fn closest<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    );

    fn any<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        occluded: &mut [bool],
    );
}

/// A ray a call.
pub(super) struct OneByOne;

impl Call for OneByOne {
    const TAKES: Takes = Takes::OneRay;

    fn closest<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = bvh.closest_hit(ray);
        }
    }

    fn any<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = bvh.any_hit(ray);
        }
    }
}

/// All in one call.
pub(super) struct AllAtOnce;

impl Call for AllAtOnce {
    const TAKES: Takes = Takes::Batches;

    fn closest<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        bvh.closest_hits(rays, hits);
    }

    fn any<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        bvh.any_hits(rays, occluded);
    }
}

/// Eight at a time.
struct InPackets;

impl InPackets {
    const RAYS: usize = 8;

    /// Every eight rays and a bit for each; the last ones may be fewer.
    fn packets(rays: &[Ray]) -> impl Iterator<Item = ([Ray; Self::RAYS], u64)> {
        rays.chunks(Self::RAYS).map(|rays| {
            let mut packet = [rays[0]; Self::RAYS];
            packet[..rays.len()].copy_from_slice(rays);
            (packet, (1 << rays.len()) - 1)
        })
    }
}

impl Call for InPackets {
    const TAKES: Takes = Takes::Batches;

    fn closest<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        for ((packet, active), hits) in Self::packets(rays).zip(hits.chunks_mut(Self::RAYS)) {
            let found = bvh.closest_hit_packet(&packet, active);
            hits.copy_from_slice(&found[..hits.len()]);
        }
    }

    fn any<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        for ((packet, active), occluded) in Self::packets(rays).zip(occluded.chunks_mut(Self::RAYS))
        {
            let found = bvh.any_hit_packet(&packet, active);
            occluded.copy_from_slice(&found[..occluded.len()]);
        }
    }
}

/// In another way, with the triangle test in `f32` alone.
struct Approximately<C>(PhantomData<C>);

impl<C: Call> Call for Approximately<C> {
    const TAKES: Takes = C::TAKES;
    const EXACT: bool = false;

    fn closest<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        C::closest(&bvh.approximate(), rays, hits);
    }

    fn any<N: WideNode, L: TriangleLeaves, S: Storage>(
        bvh: &Bvh<N, L, S>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        C::any(&bvh.approximate(), rays, occluded);
    }
}

/// Makes an engine of the tree, with the name and the backend.
type Make<N> = fn(String, Built, Shared<N>, Backend) -> Box<dyn Engine>;

/// One width on one backend, called in one way.
struct WideBvh<N: WideNode, C> {
    name: String,
    built: Built,
    bvh: Shared<N>,
    backend: Backend,
    call: PhantomData<C>,
}

impl<N: WideNode + 'static, C: Call + 'static> WideBvh<N, C> {
    fn boxed(name: String, built: Built, bvh: Shared<N>, backend: Backend) -> Box<dyn Engine> {
        Box::new(Self {
            name,
            built,
            bvh,
            backend,
            call: PhantomData,
        })
    }
}

impl<N: WideNode, C: Call> Engine for WideBvh<N, C> {
    fn name(&self) -> &str {
        &self.name
    }

    fn built(&self) -> Built {
        self.built
    }

    fn is_exact(&self) -> bool {
        C::EXACT
    }

    fn takes(&self) -> Takes {
        C::TAKES
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        Box::new(Rays { engine: self, rays })
    }
}

struct Rays<'a, N: WideNode, C> {
    engine: &'a WideBvh<N, C>,
    rays: &'a [Ray],
}

impl<N: WideNode, C> Rays<'_, N, C> {
    /// Runs `trace` with the hierarchy on this engine's backend.
    fn on_backend(&self, trace: impl FnOnce(&Triangles<N>)) {
        let mut bvh = self.engine.bvh.borrow_mut();
        bvh.set_backend(self.engine.backend);
        trace(&bvh);
    }
}

impl<N: WideNode, C: Call> Batch for Rays<'_, N, C> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        self.on_backend(|bvh| C::closest(bvh, self.rays, hits));
    }

    fn any(&self, occluded: &mut [bool]) {
        self.on_backend(|bvh| C::any(bvh, self.rays, occluded));
    }
}
