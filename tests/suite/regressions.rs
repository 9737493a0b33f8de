//! Failures that users of other ray tracers reported, each with the tracker's number.
//!
//! *Exactly*: the answer in rationals, of the float ray and the float corners, by the definitions in `benches/lab/src/exact`.
//! Where it says so of all rays, brute force was compared with it ray by ray.

use crate::common::{Variants, part};
use glam::Vec3;
use wide_bvh::geometry::{Hit, Ray};
use wide_bvh_scenes::shapes;

fn hit(scene: &Variants, ray: Ray) -> Option<Hit> {
    scene.check(&ray).unwrap()
}

fn one_triangle(corners: [[f32; 3]; 3]) -> Variants {
    Variants::new(corners.to_vec(), vec![[0, 1, 2]])
}

/// A quad of two triangles in the plane y = 0, `half` to each side.
fn quad(half: f32) -> Variants {
    Variants::new(
        vec![
            [-half, 0.0, -half],
            [half, 0.0, -half],
            [half, 0.0, half],
            [-half, 0.0, half],
        ],
        vec![[0, 2, 1], [0, 3, 2]],
    )
}

/// Embree #181, #174: rays are lost through vertices in robust mode. A fan of triangles around one vertex,
/// seen from many sides: each ray at the vertex has to hit.
///
/// Exactly: all 5,000 rays hit, at t from 1 - 6.1e-8 to 1 + 4.9e-8, the direction being rounded. Computed t are off by 1.1e-7.
#[test]
fn embree_181_174_rays_at_a_vertex() {
    let spokes = 24;
    let mut positions = vec![[0.3, 0.2, 0.1]];
    positions.extend((0..spokes).map(|i| {
        let (sin, cos) = (i as f32 / spokes as f32 * std::f32::consts::TAU).sin_cos();
        [0.3 + cos, 0.2 + sin, 0.1 + 0.05 * (5.0 * sin).sin()]
    }));
    let indices = (0..spokes)
        .map(|i| [0, 1 + i, 1 + (i + 1) % spokes])
        .collect();
    let scene = Variants::new(positions, indices);
    let vertex = Vec3::new(0.3, 0.2, 0.1);
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    for _ in 0..part(5_000) {
        let away = Vec3::new(random.f32() - 0.5, random.f32() - 0.5, 0.6 + random.f32());
        let origin = vertex + away * 10f32.powf(random.f32() * 6.0 - 3.0);
        let hit = hit(&scene, Ray::new(origin, vertex - origin)).expect("a hit at the vertex");
        assert!((hit.t - 1.0).abs() < 2e-7, "{hit:?}");
    }
}

/// Embree #387: in robust mode a hit is reported at t = 12291 on a triangle 600 away, seen at half a
/// degree, with edges of 11.2, 9.7 and 1.4. Any hit must be on the triangle.
///
/// Exactly: 19,009 of the 20,000 rays hit, the same as by brute force, at t from 588.918 to 611.147. Computed t are off by
/// 1.3e-4, 2.1e-7 of themselves. The rest start in the triangle's plane, or are rounded off its edge.
#[test]
fn embree_387_no_hit_beyond_a_triangle_seen_edge_on() {
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    let mut hits = 0;
    for _ in 0..part(20_000) {
        // Edges of 11.2, 9.7 and about 1.4; the plane holds the x axis, or nearly.
        let tilt = (random.f32() - 0.5) * 0.5f32.to_radians() * 2.0;
        let turn = random.f32() * std::f32::consts::TAU;
        let (sin, cos) = turn.sin_cos();
        let place = |x: f32, y: f32| {
            let (x, y) = (x * cos - y * sin, x * sin + y * cos);
            Vec3::new(600.0 + x, y, x * tilt.tan())
        };
        let corners = [place(0.0, 0.0), place(11.2, 0.0), place(9.66, 0.9)];
        let scene = one_triangle(corners.map(|c| c.to_array()));
        let (u, v) = (random.f32(), random.f32() * 0.1);
        let target = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]);
        if let Some(hit) = hit(&scene, Ray::new(Vec3::ZERO, target.normalize())) {
            hits += 1;
            assert!((588.9..611.2).contains(&hit.t), "{hit:?} on {corners:?}");
        }
    }
    // Sines are rounded otherwise elsewhere; and of a part there may be some more or fewer.
    let slack = if part(20_000) < 20_000 {
        part(1_000)
    } else {
        0
    };
    let range = part(18_950) - slack..part(19_070) + slack;
    assert!(range.contains(&hits), "{hits} hits");
}

/// Embree #423: SSE2, SSE4.2 and AVX report a hit that AVX2 does not. Rays that graze edges, on every
/// backend: `check` compares them all with the reference.
///
/// Exactly: 10,185 of the 20,000 rays hit, at t from 1 - 1.6e-7 to 1 + 1.8e-7. By brute force 10,034 do: 1,480 of those and 1,329
/// others, the line passing the edge nearer than a corner's rounding when it is seen from the ray.
#[test]
fn embree_423_backends_agree_at_edges() {
    let scene = one_triangle([[0.1, 0.2, 1.0], [0.9, 0.3, 1.1], [0.4, 0.8, 0.9]]);
    let corners = scene.mesh().triangle(0).unwrap();
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    let mut hits = 0;
    for _ in 0..part(20_000) {
        let i = random.usize(..3);
        let edge = corners[i].lerp(corners[(i + 1) % 3], random.f32());
        let origin = Vec3::new(random.f32(), random.f32(), -random.f32());
        let nudge = Vec3::splat((random.f32() - 0.5) * 1e-7);
        hits += usize::from(hit(&scene, Ray::new(origin, edge + nudge - origin)).is_some());
    }
    if part(20_000) == 20_000 {
        assert_eq!(hits, 10_034);
    }
    assert!(
        (part(5_000)..part(15_000)).contains(&hits),
        "{hits} of {} at an edge",
        part(20_000)
    );
}

/// Embree #416: hits that are not there, when coordinates differ by 60,000 times.
///
/// Exactly: all 20,000 rays miss.
#[test]
fn embree_416_no_phantoms_between_large_and_small() {
    let scene = one_triangle([[0.0, 0.0, 0.0], [60_000.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    for _ in 0..part(20_000) {
        let x = random.f32() * 60_000.0;
        // The triangle lies between the lines y = x / 60000 and y = 1; aim well outside.
        let gap = 0.01 + random.f32();
        let y = if random.bool() {
            x / 60_000.0 - gap
        } else {
            1.0 + gap
        };
        let origin = Vec3::new(x, y, 1.0);
        assert_eq!(hit(&scene, Ray::new(origin, Vec3::NEG_Z)), None, "{origin}");
    }
}

/// Embree #133: a ray that starts on a surface. With t from 0 on, the surface itself is hit at 0; behind the
/// start nothing is, and from t just above 0 on the surface is not hit again.
///
/// Exactly: triangle 0 at t = 0, u = 3/8, v = 3/16, whatever the direction; a miss from 2^-126 on.
#[test]
fn embree_133_from_on_a_surface() {
    let scene = quad(10.0);
    for direction in [Vec3::Y, Vec3::NEG_Y, Vec3::new(0.3, 1.0, -0.2)] {
        let ray = Ray::new([1.25, 0.0, -2.5], direction);
        let surface = Hit {
            t: 0.0,
            u: 0.375,
            v: 0.1875,
            primitive: 0,
        };
        assert_eq!(hit(&scene, ray), Some(surface));
        let beyond = ray.with_range(f32::MIN_POSITIVE, f32::INFINITY);
        assert_eq!(hit(&scene, beyond), None);
    }
}

/// Embree #589: 0·∞ in the box test, for a ray parallel to a slab whose origin lies in its plane.
///
/// Exactly: at y = 0 triangle 8 at t = 1, u = 1/2, v = 0, its edge; at y = 1 triangle 9 at t = 1, u = v = 1/2; beside the box a
/// miss. -0 as 0.
#[test]
fn embree_589_parallel_to_a_slab() {
    let mesh = shapes::cuboid([0.0; 3], [1.0; 3]);
    let scene = Variants::new(mesh.positions, mesh.indices);
    for zero in [0.0, -0.0] {
        for (y, v, primitive) in [(0.0, 0.0, 8), (1.0, 0.5, 9)] {
            let ray = Ray::new([-1.0, y, 0.5], [1.0, zero, zero]);
            let (t, u) = (1.0, 0.5);
            let edge = Hit { t, u, v, primitive };
            assert_eq!(hit(&scene, ray), Some(edge));
        }
        for y in [-0.001, 1.001] {
            let ray = Ray::new([-1.0, y, 0.5], [1.0, zero, zero]);
            assert_eq!(hit(&scene, ray), None);
        }
    }
}

/// tinybvh #168: not watertight on a mesh quantised to an integer grid, for rays along an axis. From
/// outside, at every grid point well within the silhouette.
///
/// Exactly: all 3,942 rays hit, at t from 32 to 41.5, 2,382 of them more than one triangle at a time; all computed t are the
/// exact ones or floats next to them.
#[test]
fn tinybvh_168_rays_along_an_axis_at_a_quantised_mesh() {
    let mesh = shapes::quantised(shapes::icosphere(3), 32);
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    let (centre, radius) = ((min + max) * 0.5, (max - min).min_element() * 0.5);
    let scene = Variants::new(mesh.positions, mesh.indices);
    let mut rays = 0;
    for axis in 0..3 {
        for i in min.x.floor() as i32..=max.x.ceil() as i32 {
            for j in min.x.floor() as i32..=max.x.ceil() as i32 {
                let mut origin = Vec3::ZERO;
                origin[(axis + 1) % 3] = i as f32;
                origin[(axis + 2) % 3] = j as f32;
                let mut across = origin - centre;
                across[axis] = 0.0;
                if across.length() > 0.9 * radius {
                    continue;
                }
                for sign in [1.0, -1.0] {
                    origin[axis] = centre[axis] - sign * 3.0 * radius;
                    let ray = Ray::new(origin, sign * Vec3::AXES[axis]);
                    let hit = hit(&scene, ray);
                    let hit = hit.unwrap_or_else(|| panic!("a leak at {ray:?}"));
                    assert!((32.0..=41.5).contains(&hit.t), "{hit:?}");
                    rays += 1;
                }
            }
        }
    }
    assert_eq!(rays, 3_942);
}

/// tinybvh #283: an absolute epsilon on the determinant drops triangles with edges of 2e-4.
///
/// Exactly: t = edge, u = v = 1/4 but for the rounding of the edge's fourth, of 2e-18 as of 2.
#[test]
fn tinybvh_283_small_triangles() {
    for exponent in -18..=0 {
        let edge = 2.0 * 10f32.powi(exponent);
        let scene = one_triangle([[0.0; 3], [edge, 0.0, 0.0], [0.0, edge, 0.0]]);
        let ray = Ray::new([edge / 4.0, edge / 4.0, edge], [0.0, 0.0, -1.0]);
        let hit = hit(&scene, ray).expect("a hit");
        assert_eq!(hit.t, edge, "edge {edge}");
        let off = (hit.u - 0.25).abs().max((hit.v - 0.25).abs());
        assert!(off <= 3e-8, "{hit:?}, edge {edge}");
    }
}

/// tinybvh #138: fewer than five triangles hang the wide build.
///
/// Exactly: each triangle there is at t = 1, u = v = 1/4; where there is none, a miss.
#[test]
fn tinybvh_138_few_triangles() {
    for count in 0..12 {
        let positions: Vec<_> = (0..count)
            .flat_map(|i| {
                let x = 2.0 * i as f32;
                [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]
            })
            .collect();
        let scene = Variants::new(
            positions,
            (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        );
        for i in 0..12 {
            let ray = Ray::new([2.0 * i as f32 + 0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
            let expected = (i < count).then_some(Hit {
                t: 1.0,
                u: 0.25,
                v: 0.25,
                primitive: i,
            });
            assert_eq!(hit(&scene, ray), expected);
        }
    }
}

/// parry #444: the picture of a bunny littered with one-pixel holes. A picture of a sphere: each pixel well
/// within its outline hits, each well outside does not.
///
/// Exactly: 8,920 of the 16,384 rays hit, the same as by brute force, at t from 0.9990005 to 0.9999611. Computed t are off by
/// 1.5e-7.
#[test]
fn parry_444_no_holes_in_a_picture() {
    let mesh = shapes::icosphere(4);
    let scene = Variants::new(mesh.positions, mesh.indices);
    let (size, mut hits) = (part(128).max(32) as i32, 0);
    for y in 0..size {
        for x in 0..size {
            let pixel = |i: i32| (i as f32 + 0.5) / size as f32 * 2.4 - 1.2;
            let target = Vec3::new(pixel(x), pixel(y), 0.0);
            let origin = Vec3::new(0.0, 0.0, 1.0e3);
            let found = scene.agreed(&Ray::new(origin, target - origin)).unwrap();
            if let Some(hit) = found {
                hits += 1;
                assert!((0.999..0.99997).contains(&hit.t), "{hit:?} at {x}, {y}");
            }
            if target.length() < 0.99 {
                assert!(found.is_some(), "a hole at {x}, {y}");
            } else if target.length() > 1.01 {
                assert_eq!(found, None);
            }
        }
    }
    if size == 128 {
        assert_eq!(hits, 8_920);
    }
}

/// nanort #30: a direction component of -5.3e-17 turns a hit into a miss.
///
/// Exactly: t = 1 for all but the five rays that start above the very edge and lean out, by however little, which miss.
#[test]
fn nanort_30_a_direction_component_next_to_zero() {
    let scene = quad(1.0);
    for tiny in [
        -5.3e-17,
        5.3e-17,
        -1e-30,
        1e-38,
        -f32::from_bits(1),
        0.0,
        -0.0,
    ] {
        for x in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            let ray = Ray::new([x, 1.0, 0.25], [tiny, -1.0, tiny]);
            let leans_out = x.abs() == 1.0 && x * tiny > 0.0;
            let t = hit(&scene, ray).map(|hit| hit.t);
            assert_eq!(t, (!leans_out).then_some(1.0), "{ray:?}");
        }
    }
}

/// bvh #140, #149: an origin in the plane of a box face, with a zero direction component.
///
/// Exactly: t = 1 on the lower quad and 5 on the upper one, at their corners, edges and diagonals as inside.
#[test]
fn bvh_140_149_origin_in_the_plane_of_a_box_face() {
    // Two separate quads, so that there are boxes of no thickness, and faces in the planes x = 0 and x = 1.
    let scene = Variants::new(
        vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0],
            [0.0, 5.0, 0.0],
            [1.0, 5.0, 0.0],
            [1.0, 5.0, 1.0],
            [0.0, 5.0, 1.0],
        ],
        vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    );
    for x in [0.0, 1.0, 0.5] {
        for z in [0.0, 1.0, 0.5] {
            for zero in [0.0, -0.0] {
                let up = Ray::new([x, -1.0, z], [zero, 1.0, zero]);
                assert_eq!(hit(&scene, up).expect("the lower quad").t, 1.0);
                let between = Ray::new([x, 0.0, z], [zero, 1.0, zero]).with_range(0.5, 100.0);
                assert_eq!(hit(&scene, between).expect("the upper quad").t, 5.0);
            }
        }
    }
}

/// bvh #44: degenerate triangles panic the build. Here they build, and are never hit.
///
/// Exactly: a triangle whose corners are on one line has no one point in common with any line, by convention: all miss.
#[test]
fn bvh_44_degenerate_triangles() {
    let positions = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [0.5, 0.0, 0.0],
    ];
    let degenerate = vec![
        [0, 0, 0],
        [0, 1, 1],
        [1, 0, 1],
        [2, 2, 0],
        [0, 1, 2],
        [0, 3, 1],
    ];
    let scene = Variants::new(positions, degenerate);
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    for _ in 0..part(5_000) {
        let origin = Vec3::from([0; 3].map(|_| random.f32() * 4.0 - 2.0));
        let target = Vec3::X * (random.f32() * 2.0);
        assert_eq!(hit(&scene, Ray::new(origin, target - origin)), None);
        assert_eq!(hit(&scene, Ray::segment(target, origin)), None);
    }
}

/// rtbvh #4: axis-aligned quads missed from straight above, not always.
///
/// Exactly: all 4,335 rays hit, borders included, at t = 10, or 10 / 7.5 for the longer direction, which is computed as the float
/// next to it.
#[test]
fn rtbvh_4_quads_from_straight_above() {
    for half in [0.5, 1.0, 3.0, 1.0e3, 0.1] {
        let scene = quad(half);
        let steps = 16;
        for i in 0..=steps {
            for j in 0..=steps {
                let at = |k: i32| half * (k as f32 / steps as f32 * 2.0 - 1.0);
                for direction in [[0.0, -1.0, 0.0], [-0.0, -1.0, 0.0], [0.0, -7.5, -0.0]] {
                    let ray = Ray::new([at(i), 10.0, at(j)], direction);
                    let t = hit(&scene, ray).map(|hit| hit.t);
                    assert_eq!(t, Some(10.0 / -direction[1]), "{ray:?} at ±{half}");
                }
            }
        }
    }
}

/// Found here: `t` by the weights of `f32` overflows where the exact ones have it finite, and the triangle was passed over for
/// being too far.
#[test]
fn t_that_overflows_by_f32() {
    let scene = one_triangle([
        [-1.882_250_4, -1.882_250_1, 1.418_314_7e31],
        [1.882_247, 1.882_25, 6.694_649e31],
        [5.935_84e-8, -8.008_322_5e-7, 4.056_480_5e31],
    ]);
    let direction = [0.0, 0.0, 2f32.powi(-23)];
    let ray = Ray::new([0.0; 3], direction).with_range(0.0, f32::MAX);
    assert!(hit(&scene, ray).is_some_and(|hit| hit.t > 3.402_823e38));
    let behind = Ray::new([0.0; 3], -Vec3::from(direction)).with_range(-f32::MAX, 0.0);
    assert!(hit(&scene, behind).is_some_and(|hit| hit.t < -3.402_823e38));
}
