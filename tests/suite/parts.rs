//! Parts that no walk could go through are refused, and so safe.

use glam::Vec3;
use wide_bvh::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, Child, CompactNode4, CompactNode8, LayoutError, MeshBvh8, RunLeaf, WideNode,
    },
};

const POSITIONS: [[f32; 3]; 3] = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];

/// A hierarchy over a mesh may be put together without `over`: its numbers are within the mesh all the same.
#[test]
fn numbers_past_the_mesh() {
    let mesh = TriangleMesh::new(&POSITIONS, &[[0, 1, 2_u32]]).unwrap();
    let over = |primitives| MeshBvh8::from_parts(&[], mesh, primitives, Aabb::EMPTY);
    let refused = over(&[0, 1_000_000_000]).unwrap_err();
    assert_eq!(refused, LayoutError::Primitive(1));
    assert_eq!(over(&[1]).unwrap_err(), LayoutError::Primitive(0));
    let hit = over(&[0])
        .unwrap()
        .closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
    assert_eq!(hit.map(|hit| hit.t), Some(5.0));
}

/// Compact nodes say where all children are as if those that are nodes came first.
#[test]
fn compact_nodes_with_a_node_after_a_leaf() {
    let mut last = CompactNode8::from_children([leaf(0), leaf(1), leaf(2)]);
    // The third child becomes node 1, by a place that wraps around.
    let bytes = bytemuck::bytes_of_mut(&mut last);
    bytes[16..20].copy_from_slice(&u32::MAX.to_ne_bytes());
    bytes[26] = 0;
    assert_eq!(last.child(2), Child::node(1));
    let nodes = [last, CompactNode8::from_children([leaf(2)])];
    assert_eq!(check(&nodes), Err(LayoutError::Child { node: 0, lane: 2 }));

    let node = (aabb(), Child::node(1));
    let nodes = [[leaf(0), node], [leaf(1), leaf(2)]].map(CompactNode4::from_children);
    assert_eq!(check(&nodes), Err(LayoutError::Child { node: 0, lane: 1 }));
    let nodes = [[node, leaf(0)], [leaf(1), leaf(2)]].map(CompactNode4::from_children);
    assert_eq!(check(&nodes), Ok(()));
}

fn aabb() -> Aabb {
    Aabb::new(Vec3::ZERO, Vec3::ONE)
}

fn leaf(place: u32) -> (Aabb, Child) {
    (aabb(), Child::leaf(place))
}

fn check<N: WideNode>(nodes: &[N]) -> Result<(), LayoutError> {
    let bounds = Aabb::new(-Vec3::ONE, 2.0 * Vec3::ONE);
    Bvh::<N, RunLeaf, Borrowed>::from_parts(nodes, (), &[0, 1, 2], bounds).map(|_| ())
}
