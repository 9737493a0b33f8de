//! Compact hierarchies over a mesh: as it is, and in the order of their leaves.

use crate::{Found, ask::ask_mesh, assert_all, of_mesh};
use wide_bvh::{
    build::Builder,
    geometry::{Ray, TriangleMesh},
    layout::{Bvh, CompactNode4, CompactNode8, Order, Owned, Runs, WideNode},
};

/// Holds a compact hierarchy over the mesh to what is true of it, on every backend; then one over the mesh reordered, and both when
/// they have followed it to where it is turned. They are 8 or 4 wide, as the mesh's triangles are even or odd in number.
pub fn assert_compact(builder: &Builder, mesh: &TriangleMesh, rays: &[Ray], truth: &[Found]) {
    match mesh.len() % 2 {
        0 => assert_of::<CompactNode8>(builder, mesh, rays, truth),
        _ => assert_of::<CompactNode4>(builder, mesh, rays, truth),
    }
}

#[inline(never)]
fn assert_of<N: WideNode>(builder: &Builder, mesh: &TriangleMesh, rays: &[Ray], truth: &[Found]) {
    let mut bvh = builder.build_compact::<N>(mesh).expect("a build");
    assert_over(&bvh, mesh, rays, truth);
    let uncut = builder.splits(0.0).build_compact::<N>(mesh);
    let (mut ordered, new) = uncut.expect("a build").reorder(mesh).expect("its mesh");
    let in_order = TriangleMesh::new(&new.positions, &new.indices).expect("a mesh");
    assert_over(&ordered, &in_order, rays, &of_mesh(&in_order, rays));

    // No triangle loses its area by that, or gains one.
    let turned = |&[x, y, z]: &[f32; 3]| [z, -x, y];
    let positions: Vec<_> = mesh.positions().iter().map(turned).collect();
    let moved = TriangleMesh::new(&positions, mesh.indices()).expect("a mesh");
    bvh.refit(&moved).expect("the same triangles");
    assert_over(&bvh, &moved, rays, &of_mesh(&moved, rays));
    let positions: Vec<_> = new.positions.iter().map(turned).collect();
    let moved = TriangleMesh::new(&positions, &new.indices).expect("a mesh");
    ordered.refit(&moved).expect("the same triangles");
    assert_over(&ordered, &moved, rays, &of_mesh(&moved, rays));
}

fn assert_over<N: WideNode, O: Order>(
    bvh: &Bvh<N, Runs<(), O>, Owned>,
    mesh: &TriangleMesh,
    rays: &[Ray],
    truth: &[Found],
) {
    let over = bvh.over(mesh).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, truth);
}
