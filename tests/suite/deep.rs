//! Trees that need as much of a walk's stack as there is.

use glam::Vec3;
use wide_bvh::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Bvh, Child, Node4, Node8, Owned, RunLeaf, WideNode},
    simd::Backend,
};

/// How many children a walk's stack has room for, and one more.
const STACK: usize = 256;

enum Tree {
    Node(Vec<Tree>),
    Leaf,
}

use Tree::{Leaf, Node};

/// One child a node: nothing is left behind, and each is alone.
fn chain(levels: usize, end: Tree) -> Tree {
    (0..levels).fold(end, |below, _| Node(vec![below]))
}

/// Each node leaves as many leaves behind as it can.
fn comb(width: usize, levels: usize) -> Tree {
    (0..levels).fold(Leaf, |below, _| {
        let leaves = (1..width).map(|_| Leaf);
        Node([below].into_iter().chain(leaves).collect())
    })
}

/// All boxes are the same, all leaves the same triangle. Also how many nodes there are.
fn bvh<N: WideNode>(tree: &Tree, aabb: Aabb) -> (Bvh<N, RunLeaf, Owned>, u32) {
    let mut nodes = vec![None];
    let mut leaves = 0;
    let mut todo = vec![(0, tree)];
    while let Some((index, tree)) = todo.pop() {
        let Node(children) = tree else {
            unreachable!("leaves are not nodes")
        };
        let mut below = Vec::new();
        let mut links = Vec::new();
        for tree in children {
            links.push(match tree {
                Leaf => {
                    leaves += 1;
                    (aabb, Child::leaf(leaves - 1))
                }
                Node(_) => {
                    below.push((nodes.len(), tree));
                    nodes.push(None);
                    (aabb, Child::node(nodes.len() as u32 - 1))
                }
            });
        }
        nodes[index] = Some(N::from_children(links));
        todo.extend(below.into_iter().rev());
    }
    let count = nodes.len() as u32;
    let nodes = nodes.into_iter().map(Option::unwrap).collect();
    let numbers = vec![0; leaves as usize];
    (Bvh::from_parts(nodes, (), numbers, aabb).unwrap(), count)
}

fn check<N: WideNode>() {
    let width = N::WIDTH;
    // While it follows the chain a walk that looks ahead has time for the combs beside it, before it needs its stack for
    // the one below.
    let levels = (STACK - 1) / (width - 1) - 1;
    let beside = (1..width).map(|_| comb(width, levels));
    let first = chain(300, comb(width, levels));
    let tree = Node([first].into_iter().chain(beside).collect());

    let positions = [[0.0, 0.0, 0.5], [0.1, 0.0, 0.5], [0.0, 0.1, 0.5]];
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]).unwrap();
    let (tree, nodes) = bvh::<N>(&tree, Aabb::new(Vec3::ZERO, Vec3::ONE));
    let mut bvh = tree.over(&mesh).unwrap();
    let past = Ray::new([0.9, 0.9, -1.0], [0.0, 0.0, 1.0]);
    let through = Ray::new([0.02, 0.02, -1.0], [0.0, 0.0, 1.0]);
    for backend in Backend::available() {
        bvh.set_backend(backend);
        for looks_ahead in [false, true] {
            bvh.set_looks_ahead(looks_ahead);
            let (hit, counts) = bvh.closest_hit_counted(&past);
            assert_eq!((hit, counts.nodes), (None, nodes));
            assert_eq!((bvh.closest_hit(&past), bvh.any_hit(&past)), (None, false));
            assert_eq!(bvh.closest_hit(&through).map(|hit| hit.t), Some(1.5));
            assert!(bvh.any_hit(&through));
        }
    }
}

#[test]
fn the_stack_is_enough() {
    check::<Node4>();
    check::<Node8>();
}
