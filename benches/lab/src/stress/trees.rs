//! Binary trees of odd shapes, as another builder might hand them over.

use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{
    build::{BinaryNode, BinaryTree},
    geometry::Aabb,
};

/// A tree over `count` primitives: balanced or not, a chain or a mix, in order or shuffled, with leaves of one to
/// eight primitives, some listed twice.
pub fn random(rng: &mut Rng, count: usize) -> BinaryTree {
    let shape = match rng.u32(..4) {
        0 => Shape::Chain,
        1 => Shape::Lopsided,
        2 => Shape::Random,
        _ => Shape::Balanced,
    };
    let most = rng.usize(1..=8);
    let mut order: Vec<u32> = (0..count as u32).collect();
    if rng.bool() {
        rng.shuffle(&mut order);
    }
    if count > 0 && rng.u32(..4) == 0 {
        order.extend((0..rng.usize(..8)).map(|_| rng.u32(..count as u32)));
    }
    of_shape(rng, order, shape, most)
}

/// A chain: every node has a leaf of one primitive and all the rest.
pub fn chain(rng: &mut Rng, count: usize) -> BinaryTree {
    of_shape(rng, (0..count as u32).collect(), Shape::Chain, 1)
}

#[derive(Clone, Copy)]
enum Shape {
    Chain,
    /// One in eight to the left.
    Lopsided,
    Random,
    Balanced,
}

fn of_shape(rng: &mut Rng, order: Vec<u32>, shape: Shape, most: usize) -> BinaryTree {
    if order.is_empty() {
        return BinaryTree::default();
    }
    // Not the primitives' boxes: they are not to be relied on.
    let node = |first: usize, count: usize| BinaryNode {
        aabb: Aabb::new(Vec3::ZERO, Vec3::ONE),
        first: first as u32,
        count: count as u32,
    };
    let mut nodes = vec![node(0, 0)];
    let mut todo = vec![(0, 0..order.len())];
    while let Some((index, places)) = todo.pop() {
        let len = places.len();
        if len <= most {
            nodes[index] = node(places.start, len);
            continue;
        }
        let left = match shape {
            Shape::Chain => 1,
            Shape::Lopsided => len.div_ceil(8),
            Shape::Random => rng.usize(1..len),
            Shape::Balanced => len / 2,
        };
        let first = nodes.len();
        nodes[index] = node(first, 0);
        nodes.extend([node(0, 0); 2]);
        let middle = places.start + left;
        todo.push((first, places.start..middle));
        todo.push((first + 1, middle..places.end));
    }
    BinaryTree::new(nodes, order).expect("a tree by construction")
}
