//! Committed meshes, rays and bits of hits: every instruction set has to give these very bits, whatever machine they were
//! found on.
//!
//! `cargo test --test vectors -- --ignored` fills files that are empty, and fails where one would become another: that is a
//! change of what the crate answers.

mod file;
mod generate;

use file::{Vectors, bits};
use generate::generate;
use std::path::Path;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, Node4, Node8, Owned, TriangleLeaf, WideNode},
    reference,
    simd::Backend,
    traverse::Scratch,
};

macro_rules! files {
    ($($name:literal),*) => {
        [$(($name, include_bytes!(concat!($name, ".bin")).as_slice())),*]
    };
}

/// Names and contents.
static FILES: [(&str, &[u8]); 4] = files!["knot", "soup", "grid", "range"];

/// Runs `check` on each file.
fn on_all(check: impl Fn(&Vectors, &str)) {
    for (name, bytes) in FILES {
        check(&Vectors::parse(bytes), name);
    }
}

/// Runs `check` on each preset and backend under `N`-wide nodes.
fn on_variants<N: WideNode>(
    vectors: &Vectors,
    check: impl Fn(&Bvh<N, TriangleLeaf, Owned>, &dyn Fn(usize, Option<Hit>)),
) {
    let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices).unwrap();
    for preset in [Preset::Best, Preset::Balanced, Preset::Fast] {
        let mut bvh = Builder::preset(preset).build_as::<N>(&mesh).unwrap();
        for backend in Backend::available() {
            bvh.set_backend(backend);
            check(&bvh, &|ray, hit| {
                let expected = vectors.hits[ray];
                assert_eq!(
                    bits(hit),
                    bits(expected),
                    "{hit:?}, not {expected:?}, for ray {ray}, {:?}; {preset:?}, {}-wide, {backend:?}",
                    vectors.rays[ray],
                    N::WIDTH,
                );
            });
        }
    }
}

#[test]
fn the_reference() {
    on_all(|vectors, name| {
        let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices).unwrap();
        for (number, (ray, &expected)) in vectors.rays.iter().zip(&vectors.hits).enumerate() {
            let hit = reference::closest_hit(&mesh, ray);
            assert_eq!(bits(hit), bits(expected), "{name}, ray {number}, {ray:?}");
            assert_eq!(reference::any_hit(&mesh, ray), expected.is_some());
        }
    });
}

fn single<N: WideNode>(vectors: &Vectors) {
    on_variants::<N>(vectors, |bvh, check| {
        for (number, ray) in vectors.rays.iter().enumerate() {
            check(number, bvh.closest_hit(ray));
            check(number, bvh.as_borrowed().closest_hit(ray));
            check(number, bvh.closest_hit_counted(ray).0);
            let any = vectors.hits[number].is_some();
            assert_eq!(bvh.any_hit(ray), any, "ray {number}, {ray:?}");
            assert_eq!(bvh.any_hit_counted(ray).0, any, "ray {number}, {ray:?}");
        }
    });
}

#[test]
fn one_ray_a_call() {
    on_all(|vectors, _| {
        single::<Node8>(vectors);
        single::<Node4>(vectors);
    });
}

fn batch<N: WideNode>(vectors: &Vectors) {
    let rays = &vectors.rays;
    on_variants::<N>(vectors, |bvh, check| {
        let check_all = |hits: &[Option<Hit>], any: &[bool]| {
            for (number, (&hit, &any)) in hits.iter().zip(any).enumerate() {
                check(number, hit);
                assert_eq!(any, hit.is_some(), "ray {number}, {:?}", rays[number]);
            }
        };
        let (mut hits, mut any) = (vec![None; rays.len()], vec![false; rays.len()]);
        bvh.closest_hits(rays, &mut hits);
        bvh.any_hits(rays, &mut any);
        check_all(&hits, &any);
        let mut scratch = Scratch::<3>::new();
        bvh.closest_hits_in(&mut scratch, rays, &mut hits);
        bvh.any_hits_in(&mut scratch, rays, &mut any);
        check_all(&hits, &any);
    });
}

#[test]
fn batches() {
    on_all(|vectors, _| {
        batch::<Node8>(vectors);
        batch::<Node4>(vectors);
    });
}

/// Packets of as many rays, and packets of one ray again and again: alike, they go through the tree side by side.
fn packet<N: WideNode, const RAYS: usize>(vectors: &Vectors) {
    on_variants::<N>(vectors, |bvh, check| {
        let packet = |rays: &[Ray; RAYS], number: &dyn Fn(usize) -> usize| {
            let hits = bvh.closest_hit_packet(rays, u64::MAX);
            let any = bvh.any_hit_packet(rays, u64::MAX);
            for lane in 0..RAYS {
                check(number(lane), hits[lane]);
                assert_eq!(any[lane], hits[lane].is_some(), "{:?}", rays[lane]);
            }
        };
        for (chunk, rays) in vectors.rays.as_chunks().0.iter().enumerate() {
            packet(rays, &|lane| RAYS * chunk + lane);
        }
        for (number, &ray) in vectors.rays.iter().enumerate().step_by(3) {
            packet(&[ray; RAYS], &|_| number);
        }
    });
}

#[test]
fn packets() {
    on_all(|vectors, _| {
        packet::<Node8, 8>(vectors);
        packet::<Node4, 4>(vectors);
    });
}

/// They would prove nothing if few rays hit, or none were odd.
#[test]
fn the_files_are_worth_their_bytes() {
    let mut bytes = 0;
    on_all(|vectors, name| {
        let count = |is: fn(&f32) -> bool| {
            let numbers = |ray: &Ray| [ray.origin.to_array(), ray.direction.to_array()].concat();
            let rays = vectors.rays.iter();
            rays.filter(|ray| numbers(ray).iter().any(is)).count()
        };
        let hits = vectors.hits.iter().flatten().count();
        assert!(hits * 5 > vectors.rays.len() * 2, "{name}: {hits} hits");
        assert!(count(|x| x.is_nan()) >= 5, "{name}");
        assert!(count(|x| x.is_infinite()) >= 5, "{name}");
        assert!(count(|x| x.is_subnormal()) >= 5, "{name}");
        assert!(count(|&x| x == 0.0) >= 30, "{name}");
        // What is written is what is read.
        let file = FILES.iter().find(|file| file.0 == name).unwrap();
        assert_eq!(vectors.to_bytes(), file.1);
    });
    for (_, file) in FILES {
        bytes += file.len();
    }
    assert!(bytes <= 150 << 10, "{bytes} bytes");
}

#[test]
#[ignore = "writes the files that are empty"]
fn write() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors");
    for (name, there) in FILES {
        let bytes = generate(name).to_bytes();
        if there.is_empty() {
            std::fs::write(folder.join(name).with_extension("bin"), bytes).unwrap();
        } else {
            assert!(
                there == bytes,
                "{name}.bin would be another: empty it if that is meant"
            );
        }
    }
}
