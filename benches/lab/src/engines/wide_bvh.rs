//! This crate: each width on each of the processor's backends. A width is built once; its backends
//! trace the same tree in the same memory.

use super::{Batch, Built, Engine, timed};
use std::{cell::RefCell, error::Error, rc::Rc, time::Duration};
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, Node4, Owned, TriangleLeaf, WideNode},
    simd::Backend,
};

/// Both widths on every backend.
///
/// # Errors
/// The mesh cannot be built on.
pub fn engines(mesh: &TriangleMesh<'_>) -> Result<Vec<Box<dyn Engine>>, Box<dyn Error>> {
    let (bvh8, time8) = timed(|| Builder::new().build(mesh));
    let (bvh4, time4) = timed(|| Builder::new().build_as::<Node4>(mesh));
    let mut engines = on_every_backend(bvh8?, time8);
    engines.extend(on_every_backend(bvh4?, time4));
    Ok(engines)
}

type Triangles<N> = Bvh<N, TriangleLeaf, Owned>;

fn on_every_backend<N: WideNode + 'static>(
    bvh: Triangles<N>,
    time: Duration,
) -> Vec<Box<dyn Engine>> {
    let built = Built {
        time,
        bytes: bvh.bytes(),
    };
    let bvh = Rc::new(RefCell::new(bvh));
    Backend::available()
        .map(|backend| {
            Box::new(WideBvh {
                name: format!("wide-bvh {} {}", N::WIDTH, backend.name()),
                built,
                bvh: Rc::clone(&bvh),
                backend,
            }) as Box<dyn Engine>
        })
        .collect()
}

/// One width on one backend.
struct WideBvh<N: WideNode> {
    name: String,
    built: Built,
    bvh: Rc<RefCell<Triangles<N>>>,
    backend: Backend,
}

impl<N: WideNode> Engine for WideBvh<N> {
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
        Box::new(Rays { engine: self, rays })
    }
}

struct Rays<'a, N: WideNode> {
    engine: &'a WideBvh<N>,
    rays: &'a [Ray],
}

impl<N: WideNode> Rays<'_, N> {
    /// Runs `trace` with the hierarchy on this engine's backend.
    fn on_backend(&self, trace: impl FnOnce(&Triangles<N>)) {
        let mut bvh = self.engine.bvh.borrow_mut();
        bvh.set_backend(self.engine.backend);
        trace(&bvh);
    }
}

impl<N: WideNode> Batch for Rays<'_, N> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        self.on_backend(|bvh| {
            for (ray, hit) in self.rays.iter().zip(hits) {
                *hit = bvh.closest_hit(ray);
            }
        });
    }

    fn any(&self, occluded: &mut [bool]) {
        self.on_backend(|bvh| {
            for (ray, occluded) in self.rays.iter().zip(occluded) {
                *occluded = bvh.any_hit(ray);
            }
        });
    }
}
