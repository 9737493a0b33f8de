//! Meshes and rays of any bits, on every width and backend, held to the reference.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::{Builder, Preset},
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
    /// Rays that repeat the first's origin and direction but for some last bits, so that they make bundles.
    alike: Vec<[u8; 6]>,
    preset: u8,
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

fn check<N: WideNode>(mesh: &TriangleMesh, rays: &[Ray], preset: Preset) {
    let mut bvh: Bvh<N, TriangleLeaf, Owned> =
        Builder::preset(preset).drop_non_finite(true).build_as(mesh).expect("a build");
    let expected: Vec<_> = rays.iter().map(|ray| reference::closest_hit(mesh, ray)).collect();
    for backend in Backend::available() {
        bvh.set_backend(backend);
        let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
        bvh.closest_hits(rays, &mut hits);
        bvh.any_hits(rays, &mut occluded);
        for (((ray, &expected), hit), any) in rays.iter().zip(&expected).zip(hits).zip(occluded) {
            assert_eq!(bits(bvh.closest_hit(ray)), bits(expected), "{backend:?} {ray:?}");
            assert_eq!(bvh.any_hit(ray), expected.is_some(), "{backend:?} {ray:?}");
            assert_eq!(bits(hit), bits(expected), "batch, {backend:?} {ray:?}");
            assert_eq!(any, expected.is_some(), "batch, {backend:?} {ray:?}");
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
    let mut rays: Vec<Ray> = input
        .rays
        .into_iter()
        .map(|ray| {
            let [t_min, t_max] = ray.range.map_or([0.0, f32::INFINITY], floats);
            Ray::new(floats(ray.origin), floats(ray.direction)).with_range(t_min, t_max)
        })
        .collect();
    if let Some(&first) = rays.first() {
        rays.extend(input.alike.iter().map(|nudge| {
            let nudged = |x: f32, by: u8| f32::from_bits(x.to_bits() ^ u32::from(by));
            let [a, b, c, d, e, f] = *nudge;
            let (o, r) = (first.origin, first.direction);
            let origin = [nudged(o.x, a), nudged(o.y, b), nudged(o.z, c)];
            let direction = [nudged(r.x, d), nudged(r.y, e), nudged(r.z, f)];
            Ray::new(origin, direction).with_range(first.t_min, first.t_max)
        }));
    }
    let preset = [Preset::Best, Preset::Balanced, Preset::Fast][usize::from(input.preset % 3)];
    let mesh = TriangleMesh::new(&positions, &indices).expect("indices in range");
    check::<Node8>(&mesh, &rays, preset);
    check::<Node4>(&mesh, &rays, preset);
});
