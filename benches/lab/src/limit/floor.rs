//! How fast the tests are by themselves.

use std::{array, hint::black_box, time::Instant};
use wide_bvh::{
    geometry::Ray,
    layout::{Bvh8, Node8, TriangleLeaf},
    traverse::sweep,
};

/// How many nodes and leaves: 8 KiB and 4 KiB, both of which a first-level cache holds twice over.
const FEW: usize = 32;

/// How many rays are tested against each.
const RAYS: usize = 2048;

/// Some rays of a workload, and a few nodes and leaves of a tree, spread evenly; each of those twice.
pub struct Sweeps<'a> {
    bvh: &'a Bvh8,
    rays: Vec<Ray>,
    nodes: Vec<Node8>,
    leaves: Vec<TriangleLeaf>,
}

/// Nanoseconds.
pub struct Tests {
    /// A node's test.
    pub node: f64,
    /// A leaf's test.
    pub leaf: f64,
    /// Setting up a ray for the tests of nodes.
    pub setup: f64,
}

impl<'a> Sweeps<'a> {
    pub fn new(bvh: &'a Bvh8, rays: &[Ray]) -> Self {
        Self {
            bvh,
            rays: spread(rays, RAYS),
            nodes: spread(bvh.nodes(), FEW).repeat(2),
            leaves: spread(bvh.leaves(), FEW).repeat(2),
        }
    }

    /// One round. The second half of a sweep repeats the first and needs no setup of the ray, so it is what the
    /// whole takes longer than the first.
    pub fn time(&self) -> Tests {
        let backend = self.bvh.backend();
        let boxes = self.halves(&self.nodes, |nodes, ray| {
            sweep::count_boxes(backend, nodes, self.bvh.bounds(), ray)
        });
        let triangles = self.halves(&self.leaves, |leaves, ray| {
            sweep::count_triangles(backend, leaves, ray)
        });
        let each =
            |[half, whole]: [f64; 2], items: usize| (whole - half) / (items.max(2) / 2) as f64;
        Tests {
            node: each(boxes, self.nodes.len()),
            leaf: each(triangles, self.leaves.len()),
            setup: 2.0 * boxes[0] - boxes[1],
        }
    }

    /// Nanoseconds a ray of the first half and of the whole.
    fn halves<T>(&self, items: &[T], test: impl Fn(&[T], &Ray) -> u32) -> [f64; 2] {
        let parts = [&items[..items.len() / 2], items];
        array::from_fn(|part| {
            let start = Instant::now();
            for ray in &self.rays {
                black_box(test(black_box(parts[part]), ray));
            }
            start.elapsed().as_secs_f64() * 1e9 / self.rays.len() as f64
        })
    }
}

/// So many of `items`, or all if there are fewer.
fn spread<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    let count = count.min(items.len());
    (0..count).map(|i| items[i * items.len() / count]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spread_is_in_order_and_from_all_over() {
        assert_eq!(spread(&[0, 1, 2, 3, 4, 5, 6], 3), [0, 2, 4]);
        assert_eq!(spread(&[7, 8], 3), [7, 8]);
        assert!(spread::<u8>(&[], 3).is_empty());
    }
}
