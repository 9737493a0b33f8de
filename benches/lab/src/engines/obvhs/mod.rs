//! The `obvhs` crate: its compressed 8-wide tree and its binary tree, both from its slowest and best
//! builder. As in its examples the triangles lie in the order of the leaves; they are its type with
//! the edges and the normal worked out beforehand.

#[cfg(test)]
mod adopted;

use super::{Batch, Built, Chosen, Engine, timed};
use glam::Vec3A;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris, node::Bvh2Node},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris, node::CwBvhNode},
    ray::{Ray as ObvhsRay, RayHit},
    rt_triangle::RtTriangle,
    triangle::Triangle,
};
use std::time::Duration;
use wide_bvh::geometry::{Hit, Ray, TriangleMesh};

/// Those of both trees that are chosen.
pub fn engines(mesh: &TriangleMesh<'_>, chosen: Chosen<'_>) -> Vec<Box<dyn Engine>> {
    let mut engines = Vec::new();
    if chosen(CwBvh::NAME) {
        engines.push(engine::<CwBvh>(mesh));
    }
    if chosen(Bvh2::NAME) {
        engines.push(engine::<Bvh2>(mesh));
    }
    engines
}

fn engine<T: Tree>(mesh: &TriangleMesh<'_>) -> Box<dyn Engine> {
    let ((tree, triangles), time) = timed(|| {
        let corners = |i: &[u32; 3]| i.map(|i| Vec3A::from(mesh.positions()[i as usize]));
        let unordered: Vec<Triangle> = mesh
            .indices()
            .iter()
            .map(|indices| {
                let [v0, v1, v2] = corners(indices);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let tree = T::build(&unordered, BvhBuildParams::very_slow_build());
        let triangles: Vec<RtTriangle> = tree
            .order()
            .iter()
            .map(|&primitive| RtTriangle::from(&unordered[primitive as usize]))
            .collect();
        (tree, triangles)
    });
    let bytes = tree.node_bytes() + size_of_val(tree.order()) + size_of_val(&*triangles);
    Box::new(Obvhs {
        built: Built { time, bytes },
        tree,
        triangles,
    })
}

struct Obvhs<T> {
    built: Built,
    tree: T,
    /// In the order of the leaves.
    triangles: Vec<RtTriangle>,
}

impl<T: Tree> Engine for Obvhs<T> {
    fn name(&self) -> &str {
        T::NAME
    }

    fn built(&self) -> Built {
        self.built
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let rays = rays
            .iter()
            .map(|ray| {
                ObvhsRay::new(
                    ray.origin.into(),
                    ray.direction.into(),
                    ray.t_min,
                    ray.t_max,
                )
            })
            .collect();
        Box::new(Rays { engine: self, rays })
    }
}

struct Rays<'a, T> {
    engine: &'a Obvhs<T>,
    rays: Vec<ObvhsRay>,
}

impl<T: Tree> Batch for Rays<'_, T> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        let Obvhs {
            tree, triangles, ..
        } = self.engine;
        for (ray, hit) in self.rays.iter().zip(hits) {
            let mut found = RayHit::none();
            *hit = tree
                .closest(*ray, &mut found, |ray, i| triangles[i].intersect(ray))
                .then(|| Hit {
                    t: found.t,
                    u: 0.0,
                    v: 0.0,
                    primitive: tree.order()[found.primitive_id as usize],
                });
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        let Obvhs {
            tree, triangles, ..
        } = self.engine;
        for (ray, occluded) in self.rays.iter().zip(occluded) {
            *occluded = !tree.misses(*ray, |ray, i| triangles[i].intersect(ray));
        }
    }
}

/// What the trees have in common here.
trait Tree: Sized + 'static {
    const NAME: &'static str;
    fn build(triangles: &[Triangle], params: BvhBuildParams) -> Self;
    /// Which primitive each place of the leaves holds.
    fn order(&self) -> &[u32];
    fn node_bytes(&self) -> usize;
    fn closest(
        &self,
        ray: ObvhsRay,
        hit: &mut RayHit,
        test: impl Fn(&ObvhsRay, usize) -> f32,
    ) -> bool;
    fn misses(&self, ray: ObvhsRay, test: impl Fn(&ObvhsRay, usize) -> f32) -> bool;
}

macro_rules! tree {
    ($name:literal, $tree:ty, $node:ty, $build:path) => {
        impl Tree for $tree {
            const NAME: &'static str = $name;

            fn build(triangles: &[Triangle], params: BvhBuildParams) -> Self {
                let mut time = Duration::ZERO;
                $build(triangles, params, &mut time)
            }

            fn order(&self) -> &[u32] {
                &self.primitive_indices
            }

            fn node_bytes(&self) -> usize {
                let nodes: &[$node] = &self.nodes;
                size_of_val(nodes)
            }

            #[inline]
            fn closest(
                &self,
                ray: ObvhsRay,
                hit: &mut RayHit,
                test: impl Fn(&ObvhsRay, usize) -> f32,
            ) -> bool {
                self.ray_traverse(ray, hit, test)
            }

            #[inline]
            fn misses(&self, ray: ObvhsRay, test: impl Fn(&ObvhsRay, usize) -> f32) -> bool {
                self.ray_traverse_miss(ray, test)
            }
        }
    };
}
tree!("obvhs cwbvh", CwBvh, CwBvhNode, build_cwbvh_from_tris);
tree!("obvhs bvh2", Bvh2, Bvh2Node, build_bvh2_from_tris);
