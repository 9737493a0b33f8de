//! The parts of a query and the whole: slab test, triangle test, traversal, build.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Bvh, Child, Node4, Node8, Owned, TriangleLeaf, WideNode},
    simd::Backend,
    traverse::sweep,
};
use wide_bvh_scenes::shapes;

/// Nodes of small random boxes in the unit cube: few enough to stay in the first-level cache.
fn nodes<N: WideNode>() -> Vec<N> {
    let mut random = fastrand::Rng::with_seed(1);
    let mut child = || {
        let min = Vec3::from([0; 3].map(|_| random.f32() * 0.8));
        (Aabb::new(min, min + random.f32() * 0.2), Child::leaf(0))
    };
    (0..32)
        .map(|_| N::from_children(std::array::from_fn::<_, 8, _>(|_| child())))
        .collect()
}

/// Leaves of strips: 8 vertices, 6 triangles each.
fn leaves() -> Vec<TriangleLeaf> {
    let mut random = fastrand::Rng::with_seed(2);
    let mut leaf = || {
        let vertices = [0; 8].map(|_| Vec3::from([0; 3].map(|_| random.f32())));
        let triangles: Vec<_> = vertices.windows(3).map(|t| [t[0], t[1], t[2]]).collect();
        TriangleLeaf::new(&triangles, 0).expect("a strip fits")
    };
    (0..32).map(|_| leaf()).collect()
}

fn rays(count: usize) -> Vec<Ray> {
    let mut random = fastrand::Rng::with_seed(3);
    let mut point = || Vec3::from([0; 3].map(|_| random.f32()));
    (0..count).map(|_| Ray::segment(point(), point())).collect()
}

fn slab(c: &mut Criterion) {
    fn width<N: WideNode>(c: &mut Criterion) {
        let (nodes, rays) = (nodes::<N>(), rays(32));
        let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let mut group = c.benchmark_group("slab test");
        group.throughput(Throughput::Elements((nodes.len() * rays.len()) as u64));
        for backend in Backend::available() {
            let id = BenchmarkId::new(format!("ray against {} boxes", N::WIDTH), backend.name());
            group.bench_function(id, |b| {
                b.iter(|| -> u32 {
                    let boxes = |ray| sweep::count_boxes(backend, black_box(&nodes), &bounds, ray);
                    rays.iter().map(boxes).sum()
                });
            });
        }
    }
    width::<Node4>(c);
    width::<Node8>(c);
}

fn triangle(c: &mut Criterion) {
    let (leaves, rays) = (leaves(), rays(32));
    let mut group = c.benchmark_group("triangle test");
    group.throughput(Throughput::Elements((leaves.len() * rays.len()) as u64));
    for backend in Backend::available() {
        group.bench_function(
            BenchmarkId::new("ray against a leaf", backend.name()),
            |b| {
                b.iter(|| -> u32 {
                    let hits = |ray| sweep::count_triangles(backend, black_box(&leaves), ray);
                    rays.iter().map(hits).sum()
                });
            },
        );
    }
}

fn traversal(c: &mut Criterion) {
    fn width<N: WideNode>(c: &mut Criterion, mesh: &TriangleMesh, rays: &[Ray]) {
        let mut bvh: Bvh<N, TriangleLeaf, Owned> =
            Builder::new().build_as(mesh).expect("a sound mesh");
        let mut group = c.benchmark_group("traversal");
        group.throughput(Throughput::Elements(rays.len() as u64));
        for backend in Backend::available() {
            bvh.set_backend(backend);
            let name = |query| format!("{query}, {} wide", N::WIDTH);
            group.bench_function(BenchmarkId::new(name("closest hit"), backend.name()), |b| {
                b.iter(|| rays.iter().filter_map(|ray| bvh.closest_hit(ray)).count());
            });
            group.bench_function(BenchmarkId::new(name("any hit"), backend.name()), |b| {
                b.iter(|| rays.iter().filter(|ray| bvh.any_hit(ray)).count());
            });
            let mut hits = vec![None; rays.len()];
            group.bench_function(
                BenchmarkId::new(name("closest hits"), backend.name()),
                |b| {
                    b.iter(|| bvh.closest_hits(black_box(rays), &mut hits));
                },
            );
        }
    }
    let mesh = shapes::torus_knot(2, 3, 0.3, 512, 64);
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).expect("indices in range");
    let bvh = Builder::new().build(&mesh).expect("a sound mesh");
    let (min, size) = (bvh.bounds().min, bvh.bounds().size());
    let rays: Vec<Ray> = rays(1024)
        .into_iter()
        .map(|ray| Ray::new(min + size * ray.origin, size * ray.direction))
        .collect();
    width::<Node8>(c, &mesh, &rays);
    width::<Node4>(c, &mesh, &rays);
}

fn build(c: &mut Criterion) {
    let mesh = shapes::torus_knot(2, 3, 0.3, 512, 64);
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).expect("indices in range");
    let mut group = c.benchmark_group("build");
    group.sample_size(10);
    group.throughput(Throughput::Elements(mesh.len() as u64));
    for preset in [Preset::Fast, Preset::Balanced, Preset::Best] {
        group.bench_function(format!("8 wide, {preset:?}"), |b| {
            b.iter(|| Builder::new().preset(preset).build(&mesh))
        });
    }
    group.bench_function("4 wide", |b| {
        b.iter(|| Builder::new().build_as::<Node4>(&mesh))
    });
}

criterion_group!(benches, slab, triangle, traversal, build);
criterion_main!(benches);
