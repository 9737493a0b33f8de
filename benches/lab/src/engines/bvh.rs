//! The `bvh` crate, through its published iterators and its published triangle test.
//!
//! Of its iterators the unordered one serves best: though it meets every box on the ray's way, it has no
//! heap to keep, and was up to 1.8 times as fast as the one by distance. Its stack is short, so deeper
//! trees go by distance.
//!
//! Its triangle test culls back faces, so each triangle is asked for both ways round. Its rays have no
//! range, so that is checked here; and no length, so distances are scaled back.

use super::{Batch, Built, Chosen, Engine, timed};
use bvh::{
    aabb::{Aabb, Bounded},
    bounding_hierarchy::BHShape,
    bvh::{Bvh, BvhNode},
    ray::Ray as BvhRay,
};
use nalgebra::{Point3, Vector3};
use wide_bvh::geometry::{Hit, Ray, TriangleMesh};

const NAME: &str = "bvh";

/// Its tree, built without threads, if it is chosen.
pub fn engine(mesh: &TriangleMesh<'_>, chosen: Chosen<'_>) -> Option<Box<dyn Engine>> {
    if !chosen(NAME) {
        return None;
    }
    let ((tree, shapes), time) = timed(|| {
        let corners = |i: &[u32; 3]| i.map(|i| Point3::from(mesh.positions()[i as usize]));
        let mut shapes: Vec<Shape> = mesh
            .indices()
            .iter()
            .zip(0..)
            .map(|(indices, primitive)| Shape::new(corners(indices), primitive))
            .collect();
        (Bvh::build(&mut shapes), shapes)
    });
    let bytes = size_of_val(&*tree.nodes) + size_of_val(&*shapes);
    let shallow = depth(&tree) <= ITERATOR_STACK;
    Some(Box::new(BvhCrate {
        built: Built { time, bytes },
        tree,
        shapes,
        shallow,
    }))
}

/// How many nodes the unordered iterator can remember before it panics.
const ITERATOR_STACK: usize = 32;

/// How many nodes the longest way from the root to a leaf has.
fn depth(tree: &Bvh<f32, 3>) -> usize {
    let mut deepest = 0;
    let mut stack = vec![(0, 1)];
    while let Some((node, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        if let Some(&BvhNode::Node {
            child_l_index,
            child_r_index,
            ..
        }) = tree.nodes.get(node)
        {
            stack.extend([(child_l_index, depth + 1), (child_r_index, depth + 1)]);
        }
    }
    deepest
}

struct BvhCrate {
    built: Built,
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
    /// Whether the unordered iterator's stack suffices.
    shallow: bool,
}

impl Engine for BvhCrate {
    fn name(&self) -> &str {
        NAME
    }

    fn built(&self) -> Built {
        self.built
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let rays = rays.iter().map(RangedRay::new).collect();
        Box::new(Rays { engine: self, rays })
    }
}

struct Rays<'a> {
    engine: &'a BvhCrate,
    rays: Vec<RangedRay>,
}

impl Batch for Rays<'_> {
    fn closest(&self, hits: &mut [Option<Hit>]) {
        for (ray, hit) in self.rays.iter().zip(hits) {
            *hit = self.engine.closest(ray);
        }
    }

    fn any(&self, occluded: &mut [bool]) {
        let BvhCrate { tree, shapes, .. } = self.engine;
        for (ray, occluded) in self.rays.iter().zip(occluded) {
            let hit = |shape: &Shape| shape.intersect(ray).is_some();
            *occluded = if self.engine.shallow {
                tree.traverse_iterator(&ray.ray, shapes).any(hit)
            } else {
                tree.nearest_traverse_iterator(&ray.ray, shapes).any(hit)
            };
        }
    }
}

impl BvhCrate {
    fn closest(&self, ray: &RangedRay) -> Option<Hit> {
        let Self { tree, shapes, .. } = self;
        let mut best: Option<(f32, u32)> = None;
        let mut meet = |shape: &Shape| {
            if let Some(distance) = shape.intersect(ray)
                && best.is_none_or(|(best, _)| distance < best)
            {
                best = Some((distance, shape.primitive));
            }
            best
        };
        if self.shallow {
            tree.traverse_iterator(&ray.ray, shapes).for_each(|shape| {
                meet(shape);
            });
        } else {
            // Shapes come in the order in which the ray enters their boxes, so the first box that is
            // entered past the best hit ends the search.
            let past = |shape: &Shape, best: f32| {
                let range = ray.ray.intersection_slice_for_aabb(&shape.aabb);
                range.is_some_and(|(near, _)| near > best)
            };
            let mut reached = f32::INFINITY;
            for shape in tree.nearest_traverse_iterator(&ray.ray, shapes) {
                if past(shape, reached) {
                    break;
                }
                if let Some((distance, _)) = meet(shape) {
                    reached = distance;
                }
            }
        }
        best.map(|(distance, primitive)| Hit {
            t: distance / ray.length,
            u: 0.0,
            v: 0.0,
            primitive,
        })
    }
}

/// A ray of the crate's, and what that lacks.
struct RangedRay {
    ray: BvhRay<f32, 3>,
    /// Of the direction it was made with.
    length: f32,
    /// As distances.
    range: [f32; 2],
}

impl RangedRay {
    fn new(ray: &Ray) -> Self {
        let length = ray.direction.length();
        Self {
            ray: BvhRay::new(
                Point3::from(ray.origin.to_array()),
                Vector3::from(ray.direction.to_array()),
            ),
            length,
            range: [ray.t_min * length, ray.t_max * length],
        }
    }
}

/// A triangle as the crate's tree holds it.
struct Shape {
    corners: [Point3<f32>; 3],
    aabb: Aabb<f32, 3>,
    primitive: u32,
    node: usize,
}

impl Shape {
    fn new(corners: [Point3<f32>; 3], primitive: u32) -> Self {
        let [a, b, c] = &corners;
        Self {
            aabb: Aabb::empty().grow(a).grow(b).grow(c),
            corners,
            primitive,
            node: 0,
        }
    }

    /// The distance to the hit within the ray's range.
    #[inline]
    fn intersect(&self, ray: &RangedRay) -> Option<f32> {
        let [a, b, c] = &self.corners;
        let front = ray.ray.intersects_triangle(a, b, c).distance;
        let distance = if front.is_finite() {
            front
        } else {
            ray.ray.intersects_triangle(a, c, b).distance
        };
        let [min, max] = ray.range;
        (distance.is_finite() && min <= distance && distance <= max).then_some(distance)
    }
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.aabb
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}
