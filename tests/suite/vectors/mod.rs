//! Committed meshes, rays and bits of hits: every instruction set has to give these very bits, whatever machine they were
//! found on.
//!
//! `cargo test --test suite -- --ignored vectors` fills files that are empty, and fails where one would become another: that
//! is a change of what the crate answers.

mod file;
mod generate;

use file::Vectors;
pub use file::bits;
use generate::generate;
use std::{fmt::Debug, path::Path};
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, CompactBvh4, CompactBvh8, Node4, Node8, Storage, TriangleLeaves, WideNode},
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

/// A question asked of every hierarchy.
trait Ask {
    /// Fails where an answer is not the file's.
    fn ask<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        bvh: &Bvh<N, L, S>,
        vectors: &Vectors,
    );

    /// Asks on every file, preset, width and backend, and on the compact layouts.
    fn ask_all(&self) {
        on_all(|vectors, _| {
            let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices).unwrap();
            for preset in [Preset::Best, Preset::Balanced, Preset::Fast] {
                let builder = Builder::new().preset(preset);
                self.ask_on_backends(builder.build_as::<Node8>(&mesh).unwrap(), vectors);
                self.ask_on_backends(builder.build_as::<Node4>(&mesh).unwrap(), vectors);
            }
            let compact: CompactBvh8 = Builder::new().build_compact(&mesh).unwrap();
            self.ask_on_backends(compact.over(&mesh).unwrap(), vectors);
            let compact: CompactBvh4 = Builder::new().build_compact(&mesh).unwrap();
            self.ask_on_backends(compact.over(&mesh).unwrap(), vectors);
        });
    }

    fn ask_on_backends<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        mut bvh: Bvh<N, L, S>,
        vectors: &Vectors,
    ) {
        for backend in Backend::available() {
            bvh.set_backend(backend);
            for looks_ahead in [false, true] {
                bvh.set_looks_ahead(looks_ahead);
                self.ask(&bvh, vectors);
            }
        }
    }
}

/// Fails if these are not the answers to ray `number` of a file.
#[track_caller]
fn check(bvh: &impl Debug, vectors: &Vectors, number: usize, hit: Option<Hit>, any: bool) {
    let (ray, expected) = (vectors.rays[number], vectors.hits[number]);
    assert!(
        bits(hit) == bits(expected) && any == expected.is_some(),
        "{hit:?} and {any}, not {expected:?}, for ray {number}, {ray:?}; {bvh:?}"
    );
}

#[test]
fn the_reference() {
    on_all(|vectors, name| {
        let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices).unwrap();
        for (number, ray) in vectors.rays.iter().enumerate() {
            let hit = reference::closest_hit(&mesh, ray);
            let any = reference::any_hit(&mesh, ray);
            check(&name, vectors, number, hit, any);
        }
    });
}

struct Single;

impl Ask for Single {
    fn ask<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        bvh: &Bvh<N, L, S>,
        vectors: &Vectors,
    ) {
        for (number, ray) in vectors.rays.iter().enumerate() {
            check(bvh, vectors, number, bvh.closest_hit(ray), bvh.any_hit(ray));
            let (hit, any) = (bvh.closest_hit_counted(ray), bvh.any_hit_counted(ray));
            check(bvh, vectors, number, hit.0, any.0);
        }
    }
}

#[test]
fn one_ray_a_call() {
    Single.ask_all();
}

struct Batch;

impl Ask for Batch {
    fn ask<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        bvh: &Bvh<N, L, S>,
        vectors: &Vectors,
    ) {
        let rays = &vectors.rays;
        let check_all = |hits: &[Option<Hit>], any: &[bool]| {
            for (number, (&hit, &any)) in hits.iter().zip(any).enumerate() {
                check(bvh, vectors, number, hit, any);
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
    }
}

#[test]
fn batches() {
    Batch.ask_all();
}

/// Packets of as many rays, and packets of one ray again and again: alike, they go through the tree side by side.
struct Packet<const RAYS: usize>;

impl<const RAYS: usize> Ask for Packet<RAYS> {
    fn ask<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        bvh: &Bvh<N, L, S>,
        vectors: &Vectors,
    ) {
        let packet = |rays: &[Ray; RAYS], number: &dyn Fn(usize) -> usize| {
            let hits = bvh.closest_hit_packet(rays, u64::MAX);
            let any = bvh.any_hit_packet(rays, u64::MAX);
            for lane in 0..RAYS {
                check(bvh, vectors, number(lane), hits[lane], any[lane]);
            }
        };
        for (chunk, rays) in vectors.rays.as_chunks().0.iter().enumerate() {
            packet(rays, &|lane| RAYS * chunk + lane);
        }
        for (number, &ray) in vectors.rays.iter().enumerate().step_by(5) {
            packet(&[ray; RAYS], &|_| number);
        }
    }
}

#[test]
fn packets() {
    Packet::<8>.ask_all();
    Packet::<4>.ask_all();
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
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/vectors");
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
