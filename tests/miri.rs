//! The kernel's unsafe code, in few steps: every walk, both widths, owned and borrowed, as an interpreter that sees what
//! is undefined can do it in a minute: `cargo +nightly miri test --test miri`, where the backend is the portable one. Compiled
//! for nothing else, as the suite asks more.
#![cfg(miri)]

use std::sync::LazyLock;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Aabb, Hit, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, CompactBvh8, LayoutError, Node4, Node8, Owned, PrimitiveLeaf, TriangleLeaf,
        WideNode,
    },
    primitive::Cuboids,
    reference,
    simd::Backend,
    traverse::{
        Scratch,
        sweep::{count_boxes, count_triangles},
    },
};
use wide_bvh_scenes::{Mesh, shapes};

type Triangles<'a, N> = Bvh<N, TriangleLeaf, Borrowed<'a>>;

/// A closed mesh: some levels of nodes, and leaves that share vertices.
fn mesh() -> Mesh {
    shapes::icosphere(1)
}

fn build<N: WideNode>(mesh: &Mesh) -> Bvh<N, TriangleLeaf, Owned> {
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    Builder::new().preset(Preset::Fast).build_as(&mesh).unwrap()
}

/// Rays that are alike, hits and misses; at vertices, from inside, along an axis, of bad numbers, out of proportion.
fn rays(mesh: &Mesh) -> Vec<Ray> {
    let mut rays: Vec<Ray> = (0..9)
        .map(|i| Ray::new([0.1 * i as f32 - 0.6, 0.05, -3.0], [0.0, 0.01, 1.0]))
        .collect();
    let at = |vertex: usize| mesh.positions[vertex];
    rays.extend([
        Ray::segment([3.0, 2.0, 1.0], at(0)),
        Ray::new(at(5), [1.0, 0.0, -0.0]),
        Ray::new([0.0; 3], at(7)),
        Ray::new([0.0; 3], [f32::NAN, 0.0, 1.0]),
        Ray::new([0.0, 0.1, -1e3], [0.0, 0.0, 1e30]),
        Ray::new([5.0, 5.0, 5.0], [1.0, 0.0, 0.0]),
        Ray::new([0.0, 0.0, 3.0], [0.0, 0.0, -1.0]).with_range(2.5, 1e9),
    ]);
    rays
}

fn truth(mesh: &Mesh, rays: &[Ray]) -> Vec<Option<Hit>> {
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let hit = |ray| reference::closest_hit(&mesh, ray);
    let truth: Vec<_> = rays.iter().map(hit).collect();
    let hits = truth.iter().flatten().count();
    assert!((8..rays.len()).contains(&hits), "{hits} hits");
    truth
}

/// What is asked of, made once: it takes longer than the questions.
struct Scene {
    rays: Vec<Ray>,
    truth: Vec<Option<Hit>>,
    wide: Bvh<Node8, TriangleLeaf, Owned>,
    narrow: Bvh<Node4, TriangleLeaf, Owned>,
}

static SCENE: LazyLock<Scene> = LazyLock::new(|| {
    let mesh = mesh();
    let rays = rays(&mesh);
    Scene {
        truth: truth(&mesh, &rays),
        rays,
        wide: build(&mesh),
        narrow: build(&mesh),
    }
});

/// What a kind of query is held to.
fn on_each_width(check: fn(&[Ray], &[Option<Hit>], Answer)) {
    let Scene {
        rays,
        truth,
        wide,
        narrow,
    } = &*SCENE;
    check(rays, truth, Answer::Wide(wide.as_borrowed()));
    check(rays, truth, Answer::Narrow(narrow.as_borrowed()));
}

enum Answer<'a> {
    Wide(Triangles<'a, Node8>),
    Narrow(Triangles<'a, Node4>),
}

/// The same of both.
macro_rules! with {
    ($answer:expr, $bvh:ident => $do:expr) => {
        match $answer {
            Answer::Wide($bvh) => $do,
            Answer::Narrow($bvh) => $do,
        }
    };
}

#[test]
fn miri_has_the_portable_backend() {
    assert_eq!(
        Backend::available().collect::<Vec<_>>(),
        [Backend::PORTABLE]
    );
    assert_eq!(Backend::detect(), Backend::PORTABLE);
}

#[test]
fn one_ray() {
    on_each_width(|rays, truth, answer| {
        for (ray, &hit) in rays.iter().zip(truth) {
            with!(&answer, bvh => {
                assert_eq!(bvh.closest_hit(ray), hit);
                assert_eq!(bvh.any_hit(ray), hit.is_some());
            });
        }
        with!(&answer, bvh => {
            assert_eq!(bvh.closest_hit_counted(&rays[0]).0, truth[0]);
            assert_eq!(bvh.any_hit_counted(&rays[0]).0, truth[0].is_some());
        });
    });
}

#[track_caller]
fn assert_occluded(occluded: &[bool], truth: &[Option<Hit>]) {
    let mut pairs = occluded.iter().zip(truth);
    assert!(pairs.all(|(&any, hit)| any == hit.is_some()));
}

/// Fewer lanes than rays, so that lanes are used again with what is left in them.
#[test]
fn waves() {
    on_each_width(|rays, truth, answer| {
        let mut scratch = Scratch::<3>::new();
        let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
        with!(answer, bvh => {
            bvh.closest_hits_in(&mut scratch, rays, &mut hits);
            bvh.any_hits_in(&mut scratch, rays, &mut occluded);
        });
        assert_eq!(hits, truth);
        assert_occluded(&occluded, truth);
    });
}

/// The first rays are a bundle; all of them are none.
#[test]
fn bundles_and_batches() {
    on_each_width(|rays, truth, answer| {
        for count in [9, rays.len()] {
            let (mut hits, mut occluded) = (vec![None; count], vec![false; count]);
            with!(&answer, bvh => {
                bvh.closest_hits(&rays[..count], &mut hits);
                bvh.any_hits(&rays[..count], &mut occluded);
            });
            assert_eq!(hits, truth[..count]);
            assert_occluded(&occluded, truth);
        }
    });
}

/// Compact nodes, and leaves that are read where the mesh has them: by themselves, and brought together for a bundle.
#[test]
fn over_a_mesh() {
    let Scene { rays, truth, .. } = &*SCENE;
    let mesh = mesh();
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let builder = Builder::new().preset(Preset::Fast);
    let compact: CompactBvh8 = builder.build_compact(&mesh).unwrap();
    let bvh = compact.over(&mesh).unwrap();
    for (ray, &hit) in rays.iter().zip(truth) {
        assert_eq!(bvh.closest_hit(ray), hit);
    }
    let (mut hits, mut occluded) = ([None; 9], [false; 9]);
    bvh.closest_hits(&rays[..9], &mut hits);
    bvh.any_hits(&rays[..9], &mut occluded);
    assert_eq!(hits, truth[..9]);
    assert_occluded(&occluded, truth);
}

#[test]
fn packets() {
    on_each_width(|rays, truth, answer| {
        let packet = rays.first_chunk::<8>().unwrap();
        let mixed = rays.last_chunk::<4>().unwrap();
        with!(&answer, bvh => {
            let hits = bvh.closest_hit_packet(packet, 0b1011_0111);
            let occluded = bvh.any_hit_packet(packet, 0b1011_0111);
            for lane in 0..8 {
                let hit = truth[lane].filter(|_| ![3, 6].contains(&lane));
                assert_eq!((hits[lane], occluded[lane]), (hit, hit.is_some()));
            }
            let hits = bvh.closest_hit_packet(mixed, u64::MAX);
            assert_eq!(hits, truth[truth.len() - 4..]);
        });
    });
}

/// The same, read from bytes that are aligned to nothing.
fn through_bytes<T: bytemuck::Pod>(items: &[T]) -> Vec<T> {
    let bytes: &[u8] = bytemuck::cast_slice(items);
    let shifted = [&[0], bytes].concat();
    let item = |at: usize| &shifted[1 + at * size_of::<T>()..][..size_of::<T>()];
    (0..items.len())
        .map(|at| bytemuck::pod_read_unaligned(item(at)))
        .collect()
}

#[test]
fn parts_of_bytes() {
    fn check<N: WideNode>(built: &Bvh<N, TriangleLeaf, Owned>) {
        let mut nodes = through_bytes(built.nodes());
        let leaves = through_bytes(built.leaves());
        let (primitives, bounds) = (built.primitives(), *built.bounds());
        let parts = Triangles::<N>::from_parts(&nodes, &leaves, primitives, bounds).unwrap();
        let (rays, mut hits) = (&SCENE.rays, [None; 4]);
        parts.closest_hits(rays, &mut hits);
        assert_eq!(hits, SCENE.truth[..4]);

        let backend = Backend::detect();
        let mut passed = 0;
        for ray in &rays[..2] {
            passed += count_boxes(backend, &nodes, &bounds, ray);
            assert!(count_triangles(backend, &leaves, ray) > 0);
        }
        assert!(passed > 0);

        // A link to where nothing is.
        let links = N::WIDTH * size_of::<u32>();
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut nodes[..1]);
        let link = bytes.len() - links;
        bytes[link + 2] ^= 0x40;
        let error = Triangles::<N>::from_parts(&nodes, &leaves, primitives, bounds).unwrap_err();
        assert_eq!(error, LayoutError::Child { node: 0, lane: 0 });
    }
    check(&SCENE.wide);
    check(&SCENE.narrow);
}

#[test]
fn primitives() {
    fn check<N: WideNode>() {
        let at = |i: usize| glam::Vec3::new(i as f32 * 1.5, (i % 3) as f32, (i % 5) as f32);
        let boxes: Vec<Aabb> = (0..20).map(|i| Aabb::new(at(i), at(i) + 1.0)).collect();
        let builder = Builder::new().preset(Preset::Fast);
        let bvh: Bvh<N, PrimitiveLeaf, Owned> = builder.build_primitives(&boxes).unwrap();
        let cuboids = Cuboids(&boxes);
        let mut hits = 0;
        for i in 0..5 {
            let ray = Ray::new([-1.0, 0.1 * i as f32, 0.3 * i as f32], [1.0, 0.01, 0.02]);
            let truth = reference::closest_primitive(&cuboids, 20, &ray);
            assert_eq!(bvh.closest_hit(&cuboids, &ray), truth);
            assert_eq!(bvh.any_hit(&cuboids, &ray), truth.is_some());
            hits += usize::from(truth.is_some());
        }
        assert!(hits > 2, "{hits} hits");
    }
    check::<Node8>();
    check::<Node4>();
}
