//! Compact hierarchies over a mesh: as it is, and in the order of their leaves.

use crate::{Found, ask::ask_mesh, assert_all, of_mesh};
use wide_bvh::{
    build::Builder,
    geometry::{Ray, TriangleMesh},
    layout::{CompactNode4, CompactNode8, WideNode},
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
    let over = bvh.over(mesh).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, truth);

    let uncut = builder.splits(0.0).build_compact::<N>(mesh);
    let (mut ordered, new) = uncut.expect("a build").reorder(mesh).expect("its mesh");
    let in_order = TriangleMesh::new(&new.positions, &new.indices).expect("a mesh");
    let over = ordered.over(&in_order).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, &of_mesh(&in_order, rays));

    // No triangle loses its area by that, or gains one.
    let turned = mesh.positions().iter().map(|&[x, y, z]| [z, -x, y]);
    let turned: Vec<_> = turned.collect();
    let turned = TriangleMesh::new(&turned, mesh.indices()).expect("a mesh");
    bvh.refit(&turned).expect("the same triangles");
    let over = bvh.over(&turned).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, &of_mesh(&turned, rays));
    let positions = new
        .vertices
        .iter()
        .map(|&vertex| turned.positions()[vertex as usize]);
    let positions: Vec<_> = positions.collect();
    let in_order = TriangleMesh::new(&positions, &new.indices).expect("a mesh");
    ordered.refit(&in_order).expect("the same triangles");
    let over = ordered.over(&in_order).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, &of_mesh(&in_order, rays));
}
