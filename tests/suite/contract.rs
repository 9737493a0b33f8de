//! Every width and backend gives the reference's answer, bit for bit, to rays of every kind.

use crate::common::{Variants, any_float, config, coordinate, point, point_on, soup, target};
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{build::Builder, geometry::Ray};

/// How a ray relates to the scene: `pick` chooses a triangle or a vertex of it.
#[derive(Clone, Debug)]
enum Aim {
    Anywhere {
        origin: [f32; 3],
        direction: [f32; 3],
    },
    /// From a point to a vertex, an edge or the inside of a triangle.
    AtTriangle {
        origin: [f32; 3],
        pick: prop::sample::Index,
        target: (f32, f32),
    },
    /// From a vertex, an edge or the inside of a triangle.
    FromTriangle {
        pick: prop::sample::Index,
        target: (f32, f32),
        direction: [f32; 3],
    },
    /// Along an axis, in the planes through a vertex: the planes of box faces, too.
    AlongAxis {
        pick: prop::sample::Index,
        target: (f32, f32),
        axis: usize,
        from: f32,
        negative_zero: bool,
    },
    /// In the plane of a triangle.
    InPlane {
        pick: prop::sample::Index,
        from: (f32, f32),
        to: (f32, f32),
        back: f32,
    },
}

fn aim() -> impl Strategy<Value = Aim> {
    let pick = any::<prop::sample::Index>;
    prop_oneof![
        (point(), point()).prop_map(|(origin, direction)| Aim::Anywhere { origin, direction }),
        (point(), pick(), target()).prop_map(|(origin, pick, target)| Aim::AtTriangle {
            origin,
            pick,
            target
        }),
        (pick(), target(), point()).prop_map(|(pick, target, direction)| Aim::FromTriangle {
            pick,
            target,
            direction
        }),
        (pick(), target(), 0usize..3, coordinate(), any::<bool>()).prop_map(
            |(pick, target, axis, from, negative_zero)| Aim::AlongAxis {
                pick,
                target,
                axis,
                from,
                negative_zero
            }
        ),
        (pick(), target(), target(), -2.0f32..2.0).prop_map(|(pick, from, to, back)| {
            Aim::InPlane {
                pick,
                from,
                to,
                back,
            }
        }),
    ]
}

impl Aim {
    fn ray(&self, scene: &Variants) -> Ray {
        let mesh = scene.mesh();
        let triangle =
            |pick: &prop::sample::Index| mesh.triangle(pick.index(mesh.len().max(1))).unwrap();
        match *self {
            Aim::Anywhere { origin, direction } => Ray::new(origin, direction),
            Aim::AtTriangle {
                origin,
                pick,
                target,
            } => {
                let origin = Vec3::from(origin);
                Ray::new(origin, point_on(triangle(&pick), target) - origin)
            }
            Aim::FromTriangle {
                pick,
                target,
                direction,
            } => Ray::new(point_on(triangle(&pick), target), direction),
            Aim::AlongAxis {
                pick,
                target,
                axis,
                from,
                negative_zero,
            } => {
                let mut origin = point_on(triangle(&pick), target);
                let mut direction = Vec3::splat(if negative_zero { -0.0 } else { 0.0 });
                direction[axis] = (origin[axis] - from).signum();
                origin[axis] = from;
                Ray::new(origin, direction)
            }
            Aim::InPlane {
                pick,
                from,
                to,
                back,
            } => {
                let (from, to) = (
                    point_on(triangle(&pick), from),
                    point_on(triangle(&pick), to),
                );
                Ray::new(from + back * (from - to), to - from)
            }
        }
    }
}

/// A range of `t` that begins or ends at the closest hit, if there is one.
fn around(scene: &Variants, ray: Ray) -> Result<(), TestCaseError> {
    let hit = scene.check(&ray).map_err(TestCaseError::fail)?;
    for (t_min, t_max) in hit.map_or([(-1.0, 0.0); 4], |hit| {
        let t = hit.t;
        [
            (0.0, t),
            (t, t),
            (t.next_up(), f32::INFINITY),
            (f32::NEG_INFINITY, t.next_down()),
        ]
    }) {
        scene
            .check(&ray.with_range(t_min, t_max))
            .map_err(TestCaseError::fail)?;
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(600))]

    #[test]
    fn rays_at_a_soup(
        (positions, indices) in soup(1..60),
        aims in prop::collection::vec(aim(), 40),
    ) {
        let scene = Variants::new(positions, indices);
        for aim in aims {
            around(&scene, aim.ray(&scene))?;
        }
    }

    #[test]
    fn rays_at_a_scaled_and_moved_soup(
        (positions, indices) in soup(1..30),
        aims in prop::collection::vec(aim(), 20),
        exponent in -60i32..60,
        offset in prop_oneof![Just(0.0f32), -1e6f32..1e6],
        direction_exponent in -100i32..100,
    ) {
        let (scale, stretch) = (2f32.powi(exponent), 2f32.powi(direction_exponent));
        let moved = |p: Vec3| (p + offset) * scale;
        let positions = positions.into_iter().map(|p| moved(p.into()).to_array()).collect();
        let scene = Variants::new(positions, indices);
        for aim in aims {
            let ray = match aim {
                Aim::Anywhere { origin, direction } => {
                    Ray::new(moved(origin.into()), Vec3::from(direction))
                }
                Aim::AtTriangle { origin, pick, target } => {
                    let origin = moved(origin.into()).to_array();
                    Aim::AtTriangle { origin, pick, target }.ray(&scene)
                }
                aim => aim.ray(&scene),
            };
            around(&scene, Ray::new(ray.origin, ray.direction * stretch))?;
        }
    }

    #[test]
    fn rays_of_any_bits(
        (positions, indices) in soup(1..20),
        rays in prop::collection::vec(
            ([any_float(), any_float(), any_float()], [any_float(), any_float(), any_float()],
             any_float(), any_float()),
            40,
        ),
    ) {
        let scene = Variants::new(positions, indices);
        for (origin, direction, t_min, t_max) in rays {
            let ray = Ray::new(origin, direction);
            scene.check(&ray).map_err(TestCaseError::fail)?;
            scene.check(&ray.with_range(t_min, t_max)).map_err(TestCaseError::fail)?;
        }
    }

    #[test]
    fn one_field_of_any_bits(
        (positions, indices) in soup(1..20),
        aims in prop::collection::vec((aim(), 0usize..8, any_float()), 20),
    ) {
        let scene = Variants::new(positions, indices);
        for (aim, field, value) in aims {
            let mut ray = aim.ray(&scene);
            match field {
                0..3 => ray.origin[field] = value,
                3..6 => ray.direction[field - 3] = value,
                6 => ray.t_min = value,
                _ => ray.t_max = value,
            }
            scene.check(&ray).map_err(TestCaseError::fail)?;
        }
    }

    #[test]
    fn vertices_of_any_bits(
        positions in prop::collection::vec([any_float(), any_float(), any_float()], 3..20),
        corners in prop::collection::vec(any::<[prop::sample::Index; 3]>(), 1..20),
        aims in prop::collection::vec(aim(), 20),
    ) {
        let indices = corners.iter().map(|t| t.map(|i| i.index(positions.len()) as u32)).collect();
        let scene = Variants::new(positions, indices);
        for aim in aims {
            scene.check(&aim.ray(&scene)).map_err(TestCaseError::fail)?;
        }
    }
}

#[test]
fn rays_that_hit_nothing() {
    let scene = Variants::new(
        vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2]],
    );
    let ray = Ray::new([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]);
    assert_eq!(scene.check(&ray).unwrap().unwrap().t, 1.0);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = (ray.origin, ray.direction);
            origin[axis] = bad;
            direction[axis] = bad;
            assert_eq!(scene.check(&Ray { origin, ..ray }).unwrap(), None);
            assert_eq!(scene.check(&Ray { direction, ..ray }).unwrap(), None);
        }
    }
    let nothing = [
        ray.with_range(f32::NAN, 2.0),
        ray.with_range(0.0, f32::NAN),
        ray.with_range(2.0, 0.5),
        ray.with_range(0.0, 0.5),
        Ray::new(ray.origin, [0.0; 3]),
        Ray::new(ray.origin, [-0.0, 0.0, -0.0]),
        Ray::segment([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]),
    ];
    for ray in nothing {
        assert_eq!(scene.check(&ray).unwrap(), None, "{ray:?}");
    }
}

#[test]
fn directions_of_every_length() {
    let scene = Variants::new(
        vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2]],
    );
    for exponent in -149..=127 {
        let length = 2f64.powi(exponent) as f32;
        let ray = Ray::new([0.1, 0.1, -1.0], [0.0, -0.0, length]);
        let hit = scene.check(&ray).unwrap().expect("a hit");
        let exact = 1.0 / f64::from(length);
        let representable = exact.min(f64::from(f32::MAX)) as f32;
        assert_eq!(hit.t, representable, "length 2^{exponent}");
    }
}

/// Found by fuzzing: a `t` that is zero once it is in the caller's unit was -0 on one backend and 0 on another.
#[test]
fn zero_is_positive() {
    let scene = Variants::new(
        vec![[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]],
        vec![[0, 1, 2]],
    );
    for behind in [1e-39, 1e-20, 1.0f32] {
        for length in [1e30, f32::MAX, 1.0] {
            for end in [0.0, -0.0] {
                let ray = Ray::new([0.0, -behind, 0.0], [0.0, -length, 0.0]);
                let hit = scene.check(&ray.with_range(-f32::MAX, end)).unwrap();
                assert!(hit.is_some(), "{ray:?}");
                let t = hit.map_or(0.0, |hit| hit.t);
                assert!(t < 0.0 || t.to_bits() == 0, "{t:?} for {ray:?}");
            }
        }
    }
}

/// Long triangles that cross one another, enough of them for the builder to cut some.
#[test]
fn triangles_in_pieces() {
    let mut random = fastrand::Rng::with_seed(crate::common::SEED);
    let mut near = |centre: Vec3, size: f32| {
        (centre + size * Vec3::from([0; 3].map(|_| random.f32() - 0.5))).to_array()
    };
    let positions: Vec<_> = (0..3000)
        .flat_map(|i| {
            let centre = Vec3::from(near(Vec3::ZERO, 20.0));
            let far = Vec3::from(near(centre, if i % 3 == 0 { 8.0 } else { 0.5 }));
            [near(centre, 0.1), near(centre, 0.1), near(far, 0.1)]
        })
        .collect();
    let indices = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let rays: Vec<_> = (0..500)
        .map(|i| {
            let origin = Vec3::from(near(Vec3::ZERO, 25.0));
            let target = match i % 2 {
                0 => Vec3::from(positions[(i * 17) % positions.len()]),
                _ => Vec3::from(near(Vec3::ZERO, 15.0)),
            };
            Ray::new(origin, target - origin)
        })
        .collect();
    let scene = Variants::new(positions, indices);
    let report = Builder::new().build(&scene.mesh()).unwrap().report();
    assert!(report.references > report.primitives, "{report:?}");
    let hits = rays
        .iter()
        .filter(|ray| scene.check(ray).unwrap().is_some());
    assert!(hits.count() > 100);
}
