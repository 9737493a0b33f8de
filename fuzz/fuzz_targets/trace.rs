//! Meshes and rays of any bits, on every width and backend, held to the reference.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, Node4, Node8, Owned, TriangleLeaf, WideNode},
    reference,
    simd::Backend,
};

#[derive(Arbitrary, Debug)]
struct Input {
    positions: Vec<[u32; 3]>,
    triangles: Vec<[u8; 3]>,
    rays: Vec<RayBits>,
}

#[derive(Arbitrary, Debug)]
struct RayBits {
    origin: [u32; 3],
    direction: [u32; 3],
    range: Option<[u32; 2]>,
}

fn floats<const N: usize>(bits: [u32; N]) -> [f32; N] {
    bits.map(f32::from_bits)
}

fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive])
}

fn check<N: WideNode>(mesh: &TriangleMesh, rays: &[Ray]) {
    let mut bvh: Bvh<N, TriangleLeaf, Owned> =
        Builder::new().drop_non_finite(true).build_as(mesh).expect("a build");
    for backend in Backend::available() {
        bvh.set_backend(backend);
        for ray in rays {
            let expected = reference::closest_hit(mesh, ray);
            assert_eq!(bits(bvh.closest_hit(ray)), bits(expected), "{backend:?} {ray:?}");
            assert_eq!(bvh.any_hit(ray), expected.is_some(), "{backend:?} {ray:?}");
        }
    }
}

fuzz_target!(|input: Input| {
    if input.positions.is_empty() {
        return;
    }
    let positions: Vec<[f32; 3]> = input.positions.into_iter().map(floats).collect();
    let count = positions.len() as u32;
    let indices: Vec<[u32; 3]> = input
        .triangles
        .into_iter()
        .map(|t| t.map(|i| u32::from(i) % count))
        .collect();
    let rays: Vec<Ray> = input
        .rays
        .into_iter()
        .map(|ray| {
            let [t_min, t_max] = ray.range.map_or([0.0, f32::INFINITY], floats);
            Ray::new(floats(ray.origin), floats(ray.direction)).with_range(t_min, t_max)
        })
        .collect();
    let mesh = TriangleMesh::new(&positions, &indices).expect("indices in range");
    check::<Node8>(&mesh, &rays);
    check::<Node4>(&mesh, &rays);
});
