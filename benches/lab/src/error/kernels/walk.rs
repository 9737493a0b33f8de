//! The traversal that all variants share: the nearest child first, the others on a stack.

use super::{
    slab::SlabTest,
    tree::{self, LeafOf, Leaves, Link, Tree},
    triangle::{TriangleTest, WIDTH},
};
use wide_bvh::geometry::{Hit, Ray};

/// More than any tree that this crate builds has a walk leave behind.
const STACK: usize = 256;

/// The first hit of each ray, with the best instructions there are.
pub fn closest_hits<S: SlabTest, T: TriangleTest>(
    tree: &Tree,
    leaves: &Leaves<T>,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions.
        unsafe { closest_hits_avx2::<S, T>(tree, leaves, rays, hits) };
        return;
    }
    trace::<S, T>(tree, leaves, rays, hits);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
fn closest_hits_avx2<S: SlabTest, T: TriangleTest>(
    tree: &Tree,
    leaves: &Leaves<T>,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) {
    trace::<S, T>(tree, leaves, rays, hits);
}

#[inline(always)]
fn trace<S: SlabTest, T: TriangleTest>(
    tree: &Tree,
    leaves: &Leaves<T>,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) {
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = closest_hit::<S, T>(tree, leaves, ray);
    }
}

#[inline(always)]
fn closest_hit<S: SlabTest, T: TriangleTest>(
    tree: &Tree,
    leaves: &Leaves<T>,
    ray: &Ray,
) -> Option<Hit> {
    let slabs = S::new(ray, &tree.bounds);
    let triangle_ray = T::ray(ray);
    let mut best = None;
    let mut t_max = ray.t_max;
    let mut reach = slabs.reach(t_max);
    let mut stack: [(f32, Link); STACK] = [(0.0, 0); STACK];
    stack[0] = (f32::NEG_INFINITY, tree.root);
    let mut len = 1;
    while len > 0 {
        len -= 1;
        let (near, link) = stack[len];
        if near > reach {
            continue;
        }
        if let Some(leaf) = tree::leaf(link) {
            if let Some(leaf) = leaves.0.get(leaf)
                && let Some(hit) = test_leaf::<T>(leaf, &triangle_ray, [ray.t_min, t_max], &best)
            {
                t_max = hit.t;
                reach = slabs.reach(t_max);
                best = Some(hit);
            }
            continue;
        }
        let node = &tree.nodes[link as usize];
        let (mut mask, near) = slabs.test(&node.planes, reach);
        let from = len;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            // The nearest on top.
            let mut place = len;
            while place > from && stack[place - 1].0 < near[lane] {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = (near[lane], node.links[lane]);
            len += 1;
        }
    }
    best
}

/// A better hit, if the leaf has one: closer, or as close and of a lesser number.
#[inline(always)]
fn test_leaf<T: TriangleTest>(
    leaf: &LeafOf<T>,
    ray: &T::Ray,
    range: [f32; 2],
    best: &Option<Hit>,
) -> Option<Hit> {
    let (mask, hits) = T::test(&leaf.triangles, ray, range);
    let mut mask = mask & ((1 << leaf.count) - 1);
    let mut better = None;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % WIDTH;
        mask &= mask - 1;
        let hit = Hit {
            t: hits.t[lane],
            u: hits.u[lane],
            v: hits.v[lane],
            primitive: leaf.primitives[lane],
        };
        let closer = |best: &Hit| (hit.t, hit.primitive) < (best.t, best.primitive);
        if better.as_ref().or(best.as_ref()).is_none_or(closer) {
            better = Some(hit);
        }
    }
    better
}
