//! The `parry3d` crate: its triangle mesh with the tree that it builds by default, and its published ray cast and
//! triangle test.
//!
//! A ray cast of its has no least `t`, so nearer hits are left out where triangles are tested.

use super::{Batch, Built, Chosen, Engine, timed};
use parry3d::{
    math::Vector,
    query::{Ray as ParryRay, RayCast},
    shape::{TriMesh, TriMeshBuilderError},
};
use wide_bvh::geometry::{Hit, Ray, TriangleMesh};

/// Its mesh; none for a mesh without triangles, which it refuses.
///
/// # Errors
/// It cannot build on the mesh.
pub fn engine(
    mesh: &TriangleMesh<'_>,
    chosen: Chosen<'_>,
) -> Result<Option<Box<dyn Engine>>, TriMeshBuilderError> {
    if mesh.is_empty() || !chosen(NAME) {
        return Ok(None);
    }
    let (built, time) = timed(|| {
        let positions = mesh.positions().iter().map(|&p| Vector::from_array(p));
        TriMesh::new(positions.collect(), mesh.indices().to_vec())
    });
    let mesh = built?;
    let bytes = mesh.bvh().heap_memory_size();
    Ok(Some(Box::new(Parry {
        built: Built { time, bytes },
        mesh,
    })))
}

const NAME: &str = "parry3d";

struct Parry {
    built: Built,
    mesh: TriMesh,
}

impl Engine for Parry {
    fn name(&self) -> &str {
        NAME
    }

    fn built(&self) -> Built {
        self.built
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let rays = rays
            .iter()
            .map(|ray| RangedRay {
                ray: ParryRay::new(
                    Vector::from_array(ray.origin.to_array()),
                    Vector::from_array(ray.direction.to_array()),
                ),
                // The greatest float means a miss there.
                range: [ray.t_min, ray.t_max.min(f32::MAX)],
            })
            .collect();
        Box::new(Rays {
            mesh: &self.mesh,
            rays,
        })
    }
}

/// A ray of the crate's, and what that lacks.
struct RangedRay {
    ray: ParryRay,
    range: [f32; 2],
}

struct Rays<'a> {
    mesh: &'a TriMesh,
    rays: Vec<RangedRay>,
}

impl Rays<'_> {
    #[inline]
    fn cast(&self, RangedRay { ray, range }: &RangedRay) -> Option<(u32, f32)> {
        let [t_min, t_max] = *range;
        self.mesh.bvh().cast_ray(ray, t_max, |triangle, best| {
            let triangle = self.mesh.triangle(triangle);
            triangle
                .cast_local_ray(ray, best, true)
                .filter(|&t| t >= t_min)
        })
    }
}

impl Batch for Rays<'_> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        for (ray, hit) in self.rays.iter().zip(hits) {
            *hit = self.cast(ray).map(|(primitive, t)| Hit {
                t,
                u: 0.0,
                v: 0.0,
                primitive,
            });
        }
    }

    /// The crate has no call that stops at the first hit it finds.
    fn any(&self, occluded: &mut [bool]) {
        for (ray, occluded) in self.rays.iter().zip(occluded) {
            *occluded = self.cast(ray).is_some();
        }
    }
}
