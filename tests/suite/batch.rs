//! Batches and packets give the answers of one ray a call, bit for bit: whatever comes next to what, in whatever number,
//! on every width and backend.

use crate::common::{SEED, bits};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, CompactBvh8, Node4, Node8, Storage, TriangleLeaves, WideNode},
    reference,
    simd::Backend,
    traverse::Scratch,
};
use wide_bvh_scenes::{Mesh, shapes};

/// A soup, a closed mesh of fine triangles, one that lies on a grid, large triangles, and surfaces that are there twice or more.
fn meshes() -> Vec<Mesh> {
    vec![
        shapes::soup(150, SEED),
        shapes::icosphere(3),
        shapes::quantised(shapes::icosphere(2), 6),
        shapes::cuboid([-1.0; 3], [1.0; 3]),
        doubled(shapes::icosphere(2)),
    ]
}

/// Each triangle two to four times, turned any way around, all in any order: what is hit is as near as others, in its leaf
/// and in others.
fn doubled(mut mesh: Mesh) -> Mesh {
    let mut rng = Rng::with_seed(SEED);
    let once = mesh.indices.clone();
    for &[a, b, c] in &once {
        for _ in 0..rng.usize(1..4) {
            mesh.indices
                .push([[b, c, a], [c, b, a], [a, b, c]][rng.usize(0..3)]);
        }
    }
    rng.shuffle(&mut mesh.indices);
    mesh
}

/// Runs of rays that are alike, and of rays that are not, so long that bundles, waves and the ends of both are met.
fn rays(mesh: &Mesh, rng: &mut Rng) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < 1500 {
        let count = rng.usize(1..200);
        let eye = point(rng) * 3.0;
        match rng.u32(0..8) {
            // A camera's, next to one another; some straight at vertices.
            0 | 1 => {
                let (target, width) = (vertex(mesh, rng), rng.f32() * 0.5);
                rays.extend((0..count).map(|_| {
                    let aim = if rng.u32(0..4) == 0 {
                        vertex(mesh, rng)
                    } else {
                        target + point(rng) * width
                    };
                    Ray::new(eye, aim - eye)
                }));
            }
            // Towards a light, from on the surface.
            2 => rays.extend((0..count).map(|_| Ray::segment(vertex(mesh, rng), eye))),
            // Along an axis, from points of a grid: zero and negative zero.
            3 => {
                let mut direction = Vec3::splat([0.0, -0.0][rng.usize(0..2)]);
                direction[rng.usize(0..3)] = [1.0, -1.0][rng.usize(0..2)];
                rays.extend((0..count).map(|_| {
                    let at = point(rng) * 6.0;
                    Ray::new(at.round() / 6.0 - direction * 3.0, direction)
                }));
            }
            // Alike but for lengths and ranges.
            4 => {
                let (direction, exponent) = (point(rng), rng.i32(-40..40));
                rays.extend((0..count).map(|_| {
                    let scale = f32::exp2(exponent as f32) * (1.0 + rng.f32());
                    let nudged = direction + point(rng) * 0.01;
                    Ray::new(eye, nudged * scale)
                        .with_range(rng.f32() - 0.5, rng.f32() * 4.0 / scale)
                }));
            }
            5 => rays.extend((0..count).map(|_| Ray::new(point(rng), point(rng)))),
            // Alike in direction, from anywhere: bundles that are given up.
            6 => {
                let direction = point(rng);
                rays.extend((0..count).map(|_| {
                    let nudged = direction + point(rng) * 0.2 * direction.length();
                    Ray::new(point(rng) * 4.0, nudged)
                }));
            }
            // Any bits.
            _ => rays.extend((0..count).map(|_| {
                let mut any = || f32::from_bits(rng.u32(..));
                let ray = Ray::new([any(), any(), any()], [any(), any(), any()]);
                ray.with_range(any(), any())
            })),
        }
        // One that is not like the others, among them.
        if rng.bool() {
            let odd = rng.usize(0..rays.len());
            rays[odd].direction.x =
                [f32::NAN, 0.0, -0.0, 1e30, -rays[odd].direction.x][rng.usize(0..5)];
        }
    }
    rays
}

fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - 1.0
}

fn vertex(mesh: &Mesh, rng: &mut Rng) -> Vec3 {
    mesh.positions[rng.usize(0..mesh.positions.len())].into()
}

/// Runs `check` on every mesh, width and backend, with rays and the reference's answers to them.
fn on_all(mut check: impl FnMut(&dyn Batches, &[Ray], &[Option<Hit>])) {
    let mut rng = Rng::with_seed(SEED);
    for mesh in meshes() {
        let rays = rays(&mesh, &mut rng);
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let hits: Vec<_> = rays
            .iter()
            .map(|ray| reference::closest_hit(&view, ray))
            .collect();
        assert!(hits.iter().filter(|hit| hit.is_some()).count() > 100);
        for backend in Backend::available() {
            let mut eight = Builder::new().build_as::<Node8>(&view).unwrap();
            let mut four = Builder::new().build_as::<Node4>(&view).unwrap();
            let mut fast = Builder::new().preset(Preset::Fast).build(&view).unwrap();
            eight.set_backend(backend);
            four.set_backend(backend);
            fast.set_backend(backend);
            check(&eight, &rays, &hits);
            check(&four, &rays, &hits);
            check(&fast, &rays, &hits);
            let mut compact: CompactBvh8 = Builder::new().build_compact(&view).unwrap();
            compact.set_backend(backend);
            check(&compact.over(&view).unwrap(), &rays, &hits);
        }
    }
}

/// The batches of either width.
trait Batches {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]);
    fn any(&self, rays: &[Ray], occluded: &mut [bool]);
    fn closest_in<const LANES: usize>(&self, rays: &[Ray]) -> Vec<Option<Hit>>
    where
        Self: Sized;
    fn closest_in_all(&self, rays: &[Ray]) -> [Vec<Option<Hit>>; 3];
    fn any_in(&self, rays: &[Ray]) -> Vec<bool>;
    fn packet_8(&self, rays: &[Ray; 8], active: u64) -> ([Option<Hit>; 8], [bool; 8]);
    fn packet_4(&self, rays: &[Ray; 4], active: u64) -> ([Option<Hit>; 4], [bool; 4]);
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Batches for Bvh<N, L, S> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits(rays, hits);
    }
    fn any(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.any_hits(rays, occluded);
    }
    fn closest_in<const LANES: usize>(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        self.closest_hits_in(&mut Box::new(Scratch::<LANES>::new()), rays, &mut hits);
        hits
    }
    fn closest_in_all(&self, rays: &[Ray]) -> [Vec<Option<Hit>>; 3] {
        [
            self.closest_in::<1>(rays),
            self.closest_in::<3>(rays),
            self.closest_in::<64>(rays),
        ]
    }
    fn any_in(&self, rays: &[Ray]) -> Vec<bool> {
        let mut occluded = vec![false; rays.len()];
        self.any_hits_in(&mut Scratch::<4>::new(), rays, &mut occluded);
        occluded
    }
    fn packet_8(&self, rays: &[Ray; 8], active: u64) -> ([Option<Hit>; 8], [bool; 8]) {
        (
            self.closest_hit_packet(rays, active),
            self.any_hit_packet(rays, active),
        )
    }
    fn packet_4(&self, rays: &[Ray; 4], active: u64) -> ([Option<Hit>; 4], [bool; 4]) {
        (
            self.closest_hit_packet(rays, active),
            self.any_hit_packet(rays, active),
        )
    }
}

#[track_caller]
fn assert_same(rays: &[Ray], hits: &[Option<Hit>], expected: &[Option<Hit>]) {
    for ((ray, &hit), &expected) in rays.iter().zip(hits).zip(expected) {
        assert_eq!(
            bits(hit),
            bits(expected),
            "{hit:?}, not {expected:?}, for {ray:?}"
        );
    }
}

#[test]
fn a_batch_answers_as_the_reference_does() {
    on_all(|bvh, rays, expected| {
        let mut hits = vec![None; rays.len()];
        bvh.closest(rays, &mut hits);
        assert_same(rays, &hits, expected);
        let mut occluded = vec![false; rays.len()];
        bvh.any(rays, &mut occluded);
        for ((ray, any), hit) in rays.iter().zip(occluded).zip(expected) {
            assert_eq!(any, hit.is_some(), "{ray:?}");
        }
    });
}

#[test]
fn so_it_does_in_the_callers_memory() {
    on_all(|bvh, rays, expected| {
        for hits in bvh.closest_in_all(rays) {
            assert_same(rays, &hits, expected);
        }
        for (any, hit) in bvh.any_in(rays).into_iter().zip(expected) {
            assert_eq!(any, hit.is_some());
        }
    });
}

#[test]
fn batches_of_every_length_and_of_any_part() {
    let mut rng = Rng::with_seed(SEED);
    on_all(|bvh, rays, expected| {
        for length in (0..140).chain([500]) {
            let from = rng.usize(0..rays.len() - length);
            let mut hits = vec![None; length];
            bvh.closest(&rays[from..from + length], &mut hits);
            assert_same(&rays[from..], &hits, &expected[from..from + length]);
        }
    });
}

#[test]
fn packets_answer_for_their_active_rays() {
    let mut rng = Rng::with_seed(SEED);
    on_all(|bvh, rays, expected| {
        let (rays, expected) = (rays.as_chunks::<8>().0, expected.as_chunks::<8>().0);
        for (rays, expected) in rays.iter().zip(expected) {
            let active = [0xff, 0, rng.u64(..)][rng.usize(0..3)];
            let check = |lane: usize, hit: Option<Hit>, any: bool| {
                let expected = expected[lane].filter(|_| active >> lane & 1 != 0);
                assert_eq!(bits(hit), bits(expected), "{:?}", rays[lane]);
                assert_eq!(any, expected.is_some(), "{:?}", rays[lane]);
            };
            let (hits, any) = bvh.packet_8(rays, active);
            (0..8).for_each(|lane| check(lane, hits[lane], any[lane]));
            let (hits, any) = bvh.packet_4(rays.first_chunk().unwrap(), active);
            (0..4).for_each(|lane| check(lane, hits[lane], any[lane]));
        }
    });
}

#[test]
fn what_has_no_partner_is_left_alone() {
    let mesh = shapes::cuboid([-1.0; 3], [1.0; 3]);
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let bvh = Builder::new().build(&mesh).unwrap();
    let rays = [Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]); 100];
    let mut occluded = [false; 130];
    bvh.any_hits(&rays, &mut occluded);
    assert!(occluded[..100].iter().all(|&any| any) && !occluded[100..].iter().any(|&any| any));
    let mut hits = [None; 70];
    bvh.closest_hits(&rays, &mut hits);
    assert!(hits.iter().all(|hit| hit.is_some_and(|hit| hit.t == 2.0)));
}

#[test]
fn an_empty_hierarchy_is_missed() {
    let none: [[f32; 3]; 0] = [];
    let bvh = Builder::new()
        .build(&TriangleMesh::new(&none, &[[0u32; 3]; 0]).unwrap())
        .unwrap();
    let mut hits = [Some(Hit {
        t: 1.0,
        u: 0.0,
        v: 0.0,
        primitive: 0,
    }); 70];
    bvh.closest_hits(&[Ray::new([0.0; 3], [1.0; 3]); 70], &mut hits);
    assert_eq!(hits, [None; 70]);
    assert_eq!(
        bvh.any_hit_packet(&[Ray::new([0.0; 3], [1.0; 3]); 4], 0xf),
        [false; 4]
    );
}

#[cfg(feature = "rayon")]
#[test]
fn threads_change_nothing() {
    let mesh = shapes::icosphere(3);
    let rays: Vec<_> = (0..10)
        .flat_map(|_| rays(&mesh, &mut Rng::with_seed(SEED)))
        .collect();
    let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let bvh = Builder::new().build(&mesh).unwrap();
    let mut hits = [vec![None; rays.len()], vec![None; rays.len()]];
    bvh.closest_hits(&rays, &mut hits[0]);
    bvh.par_closest_hits(&rays, &mut hits[1]);
    assert_same(&rays, &hits[1], &hits[0]);
    let mut occluded = vec![false; rays.len()];
    bvh.par_any_hits(&rays, &mut occluded);
    assert!(
        occluded
            .iter()
            .zip(&hits[0])
            .all(|(&any, hit)| any == hit.is_some())
    );
}

/// Rays are sorted out by many thousands at a time: more of them, and some.
#[test]
fn more_rays_than_are_sorted_at_once() {
    on_all(|bvh, rays, expected| {
        let many = |count: usize| (0..count).map(|place| place * 7 % rays.len());
        let places: Vec<usize> = many(2 * 16384 + 77).collect();
        let rays: Vec<Ray> = places.iter().map(|&place| rays[place]).collect();
        let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
        bvh.closest(&rays, &mut hits);
        bvh.any(&rays, &mut occluded);
        for ((place, hit), any) in places.into_iter().zip(hits).zip(occluded) {
            assert_eq!(bits(hit), bits(expected[place]));
            assert_eq!(any, expected[place].is_some());
        }
    });
}

/// A ray whose range is of infinities, among others that are alike: what is worked out of it may be NaN, of theirs never.
#[test]
fn ranges_of_infinities_take_nothing_from_their_neighbours() {
    let mesh = shapes::icosphere(3);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let eye = Vec3::new(0.1, 0.2, 5.0);
    let camera: Vec<_> = (0..64)
        .map(|i| {
            let aim = Vec3::new((i % 8) as f32 - 3.5, (i / 8) as f32 - 3.5, 0.0) / 8.0;
            Ray::new(eye, aim - eye)
        })
        .collect();
    let answer = |ray: &Ray| reference::closest_hit(&view, ray);
    let of_camera: Vec<_> = camera.iter().map(answer).collect();
    assert!(of_camera.iter().all(Option::is_some));
    let mut bvh = Builder::new().build(&view).unwrap();
    let (inf, max) = (f32::INFINITY, f32::MAX);
    for (t_min, t_max) in [(-inf, -inf), (-inf, -max), (-inf, inf), (max, inf)] {
        for odd in 0..camera.len() {
            let (mut rays, mut expected) = (camera.clone(), of_camera.clone());
            rays[odd] = rays[odd].with_range(t_min, t_max);
            expected[odd] = answer(&rays[odd]);
            for backend in Backend::available() {
                bvh.set_backend(backend);
                let mut hits = vec![None; rays.len()];
                bvh.closest_hits(&rays, &mut hits);
                assert_same(&rays, &hits, &expected);
                let mut occluded = vec![false; rays.len()];
                bvh.any_hits(&rays, &mut occluded);
                for (any, hit) in occluded.into_iter().zip(&expected) {
                    assert_eq!(any, hit.is_some());
                }
            }
        }
    }
}
