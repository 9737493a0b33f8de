//! This crate's tree in the variants' own form: the same boxes and the same leaves.

use super::triangle::{TriangleTest, WIDTH};
use std::mem::size_of_val;
use wide_bvh::{
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh8, Child, ChildKind, Leaf, WideNode},
};

/// The planes of eight boxes: by axis, then `min` and `max`, then box.
pub type Planes = [[[f32; WIDTH]; 2]; 3];

/// A place in the tree. With the highest bit it is a leaf's, else a node's.
pub type Link = u32;

const LEAF: u32 = 1 << 31;

/// Leads nowhere: a leaf that is not there.
const NOTHING: Link = u32::MAX;

/// Which leaf a link leads to, if it is one's.
#[inline(always)]
pub fn leaf(link: Link) -> Option<usize> {
    (link & LEAF != 0).then_some((link & !LEAF) as usize)
}

/// Eight children.
#[repr(C, align(32))]
pub struct Node {
    pub planes: Planes,
    pub links: [Link; WIDTH],
}

/// The nodes.
pub struct Tree {
    pub nodes: Vec<Node>,
    pub root: Link,
    pub bounds: Aabb,
}

impl Tree {
    pub fn new(bvh: &Bvh8) -> Self {
        let link = |child: Child| match child.kind() {
            ChildKind::Empty => NOTHING,
            ChildKind::Node(index) => index as u32,
            ChildKind::Leaf(index) => index as u32 | LEAF,
        };
        let nodes = bvh
            .nodes()
            .iter()
            .map(|node| {
                let mut planes = [[[0.0; WIDTH]; 2]; 3];
                let mut links = [NOTHING; WIDTH];
                for lane in 0..WIDTH {
                    let aabb = node.child_aabb(lane);
                    for (axis, [min, max]) in planes.iter_mut().enumerate() {
                        min[lane] = aabb.min[axis];
                        max[lane] = aabb.max[axis];
                    }
                    links[lane] = link(node.child(lane));
                }
                Node { planes, links }
            })
            .collect();
        Self {
            nodes,
            root: link(bvh.root()),
            bounds: *bvh.bounds(),
        }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// Up to eight triangles in the form that a test wants, and their numbers.
pub struct LeafOf<T: TriangleTest> {
    pub triangles: T::Triangles,
    pub primitives: [u32; WIDTH],
    pub count: u32,
}

/// The leaves.
pub struct Leaves<T: TriangleTest>(pub Vec<LeafOf<T>>);

impl<T: TriangleTest> Leaves<T> {
    pub fn new(mesh: &TriangleMesh<'_>, bvh: &Bvh8) -> Self {
        let leaves = bvh.leaves().iter().map(|leaf| {
            let places = leaf.primitives();
            let places = places.start as usize..places.end as usize;
            let of_leaf = &bvh.primitives()[places];
            // Lanes past the last repeat the first: no other numbers than those of triangles that are there.
            let mut primitives = [of_leaf[0]; WIDTH];
            primitives[..of_leaf.len()].copy_from_slice(of_leaf);
            let corners = primitives.map(|primitive| {
                let triangle = mesh.triangle(primitive as usize);
                triangle.expect("a triangle of the mesh")
            });
            LeafOf {
                triangles: T::triangles(&corners),
                primitives,
                count: of_leaf.len() as u32,
            }
        });
        Self(leaves.collect())
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.0)
    }
}
