//! Compact hierarchies over a mesh: as it is, and in the order of their leaves.

use crate::{Found, ask::ask_mesh, assert_all, of_mesh};
use wide_bvh::{
    build::{Builder, ReorderError},
    geometry::{Ray, TriangleMesh},
    layout::{CompactNode4, CompactNode8, WideNode},
};

/// Holds a compact hierarchy over the mesh to what is true of it, on every backend; then one over the mesh reordered. It is 8 or 4
/// wide, as the mesh's triangles are even or odd in number.
pub fn assert_compact(builder: &Builder, mesh: &TriangleMesh, rays: &[Ray], truth: &[Found]) {
    match mesh.len() % 2 {
        0 => assert_of::<CompactNode8>(builder, mesh, rays, truth),
        _ => assert_of::<CompactNode4>(builder, mesh, rays, truth),
    }
}

#[inline(never)]
fn assert_of<N: WideNode>(builder: &Builder, mesh: &TriangleMesh, rays: &[Ray], truth: &[Found]) {
    let bvh = builder.build_compact::<N>(mesh).expect("a build");
    let over = bvh.over(mesh).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, truth);

    let (ordered, new) = match bvh.reorder(mesh) {
        Err(ReorderError::Repeated { primitive }) => {
            let number = |&&other: &&u32| other == primitive as u32;
            assert!(bvh.primitives().iter().filter(number).count() > 1);
            return;
        }
        reordered => reordered.expect("its mesh"),
    };
    let mesh = TriangleMesh::new(&new.positions, &new.indices).expect("a mesh");
    let over = ordered.over(&mesh).expect("its mesh");
    assert_all(&ask_mesh(over, rays), rays, &of_mesh(&mesh, rays));
}
