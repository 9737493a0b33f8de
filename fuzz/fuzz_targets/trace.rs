//! Meshes and rays of any bits, for both widths, every layout, query and backend, held to the reference.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::layout::{Node4, Node8};
use wide_bvh_fuzz::{
    MeshBytes, RayBytes, Settings, Width, assert_all, assert_compact, of_mesh, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    mesh: MeshBytes,
    settings: Settings,
    rays: Vec<RayBytes>,
}

fuzz_target!(|input: Input| {
    let mesh = input.mesh.mesh();
    let most = if mesh.is_large() { 8 } else { 80 };
    let rays = rays(&input.rays, &mesh.corners(), most);
    let mesh = mesh.view();
    let builder = input.settings.builder().drop_non_finite(true);
    let wide = Node8::build(&builder, &mesh).expect("a build");
    let narrow = Node4::build(&builder, &mesh).expect("a build");
    let truth = of_mesh(&mesh, &rays);
    assert_all(
        &Node8::ask(wide.as_borrowed(), &rays, u64::MAX),
        &rays,
        &truth,
    );
    assert_all(
        &Node4::ask(narrow.as_borrowed(), &rays, u64::MAX),
        &rays,
        &truth,
    );
    assert_compact(&builder, &mesh, &rays, &truth);
});
