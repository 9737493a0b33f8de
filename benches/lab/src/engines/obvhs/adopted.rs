//! A tree from another crate's builder, converted into [`BinaryTree`]: what it traces is what brute
//! force finds, bit for bit.

use crate::reference::bits;
use fastrand::Rng;
use glam::Vec3;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    triangle::Triangle,
};
use std::time::Duration;
use wide_bvh::{
    build::{BinaryNode, BinaryTree, Builder},
    geometry::{Aabb, Ray, TriangleMesh},
    reference,
};
use wide_bvh_scenes::{Mesh, shapes::soup};

/// The same tree: both crates keep siblings side by side and count a leaf's primitives in the node.
fn convert(tree: &Bvh2) -> BinaryTree {
    let nodes = tree
        .nodes
        .iter()
        .map(|node| BinaryNode {
            aabb: Aabb::new(node.aabb().min.into(), node.aabb().max.into()),
            first: node.first_index,
            count: node.prim_count,
        })
        .collect();
    BinaryTree::new(nodes, tree.primitive_indices.clone()).expect("it is a tree")
}

fn build(mesh: &Mesh, params: BvhBuildParams) -> Bvh2 {
    let corner = |i: u32| mesh.positions[i as usize].into();
    let triangles: Vec<Triangle> = mesh
        .indices
        .iter()
        .map(|&[a, b, c]| Triangle {
            v0: corner(a),
            v1: corner(b),
            v2: corner(c),
        })
        .collect();
    build_bvh2_from_tris(&triangles, params, &mut Duration::default())
}

/// Rays through the unit cube: from outside and from inside, at random points and exactly at corners.
fn rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let mut rng = Rng::with_seed(1);
    let mut around = |size: f32| {
        let part = Vec3::new(rng.f32(), rng.f32(), rng.f32());
        (part - 0.5) * size + 0.5
    };
    (0..count)
        .map(|ray| {
            let from = around(if ray % 2 == 0 { 3.0 } else { 1.0 });
            let to = if ray % 3 == 0 {
                Vec3::from(mesh.positions[ray % mesh.positions.len()])
            } else {
                around(1.0)
            };
            Ray::new(from, to - from)
        })
        .collect()
}

#[test]
fn a_tree_of_obvhs_traces_like_brute_force() {
    let mesh = soup(2000, 1);
    let rays = rays(&mesh, 2000);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    // One primitive a leaf, and up to eight.
    for params in [
        BvhBuildParams::fastest_build(),
        BvhBuildParams::medium_build(),
    ] {
        let tree = convert(&build(&mesh, params));
        let bvh = Builder::new().build_from_tree(&view, &tree).unwrap();
        let mut hits = 0;
        for ray in &rays {
            let truth = reference::closest_hit(&view, ray);
            assert_eq!(bits(bvh.closest_hit(ray)), bits(truth), "{ray:?}");
            assert_eq!(bvh.any_hit(ray), truth.is_some(), "{ray:?}");
            hits += usize::from(truth.is_some());
        }
        assert!((500..rays.len()).contains(&hits), "{hits} hits say little");
    }
}
