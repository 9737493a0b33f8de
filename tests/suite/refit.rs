//! A hierarchy that has followed its primitives answers as the reference does on them where they are.

use crate::common::{SEED, bits, config, coordinate, point, point_on, soup, target};
use fastrand::Rng;
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{
    build::{BuildError, Builder, Preset, RefitError},
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Bvh, Bvh8, Node4, Owned, TriangleLeaf, WideNode},
    reference,
};
use wide_bvh_scenes::shapes;

type Positions = Vec<[f32; 3]>;

/// Builders of trees of every kind.
fn builders() -> [Builder<'static>; 4] {
    [
        Builder::new(),
        Builder::new().splits(3.0),
        Builder::new().preset(Preset::Balanced),
        Builder::new().preset(Preset::Fast),
    ]
    .map(|builder| builder.drop_non_finite(true))
}

fn check<N: WideNode>(
    bvh: &Bvh<N, TriangleLeaf, Owned>,
    mesh: &TriangleMesh,
    ray: &Ray,
) -> Result<(), TestCaseError> {
    let expected = reference::closest_hit(mesh, ray);
    let hit = bvh.closest_hit(ray);
    prop_assert_eq!(bits(hit), bits(expected), "{:?}", ray);
    prop_assert_eq!(bvh.any_hit(ray), expected.is_some());
    Ok(())
}

/// The parts are still those of a sound hierarchy.
fn check_parts<N: WideNode>(bvh: &Bvh<N, TriangleLeaf, Owned>) {
    let (nodes, leaves) = (bvh.nodes().to_vec(), bvh.leaves().to_vec());
    let parts = Bvh::<N, TriangleLeaf, Owned>::from_parts(
        nodes,
        leaves,
        bvh.primitives().to_vec(),
        *bvh.bounds(),
    );
    assert!(parts.is_ok(), "{:?}", parts.err());
}

fn bytes(bvh: &Bvh8) -> (Vec<u8>, Vec<u8>, Aabb) {
    (
        bytemuck::cast_slice(bvh.nodes()).to_vec(),
        bytemuck::cast_slice(bvh.leaves()).to_vec(),
        *bvh.bounds(),
    )
}

/// A triangle that can be hit: as the hierarchy that is built on it alone has it.
fn has_area(mesh: &TriangleMesh, triangle: usize) -> bool {
    let corners = [mesh.indices()[triangle]];
    let one = TriangleMesh::new(mesh.positions(), &corners).unwrap();
    let bvh = Builder::new().drop_non_finite(true).build(&one).unwrap();
    !bvh.primitives().is_empty()
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn vertices_moved_anywhere(
        (positions, indices) in soup(1..60),
        motions in prop::collection::vec(
            prop::collection::vec((any::<prop::sample::Index>(), [coordinate(), coordinate(), coordinate()]), 0..40),
            1..4,
        ),
        rays in prop::collection::vec((point(), any::<prop::sample::Index>(), target()), 12),
    ) {
        for builder in builders() {
            let mesh = TriangleMesh::new(&positions, &indices).unwrap();
            let mut wide = builder.build(&mesh).unwrap();
            let mut narrow = builder.build_as::<Node4>(&mesh).unwrap();
            let mut moved = positions.clone();
            for motion in &motions {
                for (vertex, to) in motion {
                    moved[vertex.index(positions.len())] = *to;
                }
                let mesh = TriangleMesh::new(&moved, &indices).unwrap();
                let before = bytes(&wide);
                let refitted = wide.refit(&mesh);
                match refitted {
                    Ok(()) => {}
                    Err(RefitError::PrimitiveLeftOut { primitive }) => {
                        prop_assert!(!wide.primitives().contains(&(primitive as u32)));
                        prop_assert!(has_area(&mesh, primitive));
                    }
                    Err(RefitError::VerticesParted { primitive }) => {
                        prop_assert!(wide.primitives().contains(&(primitive as u32)));
                    }
                    Err(error) => prop_assert!(false, "{}", error),
                }
                if refitted.is_err() {
                    prop_assert!(bytes(&wide) == before);
                    wide = builder.build(&mesh).unwrap();
                }
                if narrow.refit(&mesh).is_err() {
                    narrow = builder.build_as::<Node4>(&mesh).unwrap();
                }
                check_parts(&wide);
                check_parts(&narrow);
                for (origin, pick, at) in &rays {
                    let triangle = mesh.triangle(pick.index(indices.len())).unwrap();
                    let ray = Ray::new(*origin, point_on(triangle, *at) - Vec3::from(*origin));
                    check(&wide, &mesh, &ray)?;
                    check(&narrow, &mesh, &ray)?;
                }
            }
        }
    }
}

/// Shapes that bend, with every triangle's corners moved a little too.
#[test]
fn shapes_that_bend() {
    let mut rng = Rng::with_seed(SEED);
    for mesh in [
        shapes::icosphere(3),
        shapes::torus_knot(2, 3, 0.3, 90, 8),
        shapes::soup(700, 3),
        shapes::cuboid([0.0; 3], [1.0, 2.0, 3.0]),
    ] {
        let indices = &mesh.indices;
        let view = TriangleMesh::new(&mesh.positions, indices).unwrap();
        let mut trees = builders().map(|builder| builder.build(&view).unwrap());
        for frame in 1..6 {
            let bend = frame as f32 * 0.4;
            let moved: Positions = mesh
                .positions
                .iter()
                .map(|&[x, y, z]| {
                    let (sin, cos) = (bend * y).sin_cos();
                    [cos * x + sin * z, y * (1.0 + bend), cos * z - sin * x]
                })
                .collect();
            let view = TriangleMesh::new(&moved, indices).unwrap();
            let mut hits = 0;
            for bvh in &mut trees {
                bvh.refit(&view).unwrap();
                check_parts(bvh);
                for _ in 0..60 {
                    let origin = 4.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 2.0;
                    let triangle = view.triangle(rng.usize(..indices.len())).unwrap();
                    let at = (rng.f32() * 0.5, rng.f32() * 0.5);
                    let ray = Ray::new(origin, point_on(triangle, at) - origin);
                    check(bvh, &view, &ray).unwrap();
                    hits += usize::from(bvh.closest_hit(&ray).is_some());
                }
            }
            assert!(hits > 120);
        }
    }
}

/// To where it was is what it was, if no triangle is in pieces.
#[test]
fn there_and_back() {
    let mesh = shapes::icosphere(3);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let built = Builder::new().splits(0.0).build(&view).unwrap();
    let mut bvh = built.clone();
    bvh.refit(&view).unwrap();
    assert!(bytes(&bvh) == bytes(&built));
    // Over a place where no triangle has an area.
    for flat in [[0.0; 3], [1.0, 0.0, 0.0]] {
        let flattened: Positions = mesh
            .positions
            .iter()
            .map(|p| [p[0] * flat[0], p[1] * flat[1], p[2] * flat[2]])
            .collect();
        let flattened = TriangleMesh::new(&flattened, &mesh.indices).unwrap();
        bvh.refit(&flattened).unwrap();
        check_parts(&bvh);
        let mut rng = Rng::with_seed(SEED);
        for _ in 0..200 {
            let origin = Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5;
            assert!(!bvh.any_hit(&Ray::new(origin, -origin)));
            assert!(!bvh.any_hit(&Ray::new(origin, Vec3::X * 0.5 - origin)));
        }
        bvh.refit(&view).unwrap();
    }
    let places = |bvh: &Bvh8| {
        (
            bytemuck::cast_slice::<_, u8>(bvh.nodes()).to_vec(),
            *bvh.bounds(),
        )
    };
    assert!(places(&bvh) == places(&built));
}

#[test]
fn offenders_are_named_and_change_nothing() {
    let mesh = shapes::soup(300, 5);
    let (mut positions, mut indices) = (mesh.positions, mesh.indices);
    // One without area, one that is not finite.
    let vertex = |corner: usize| indices[7][corner] as usize;
    positions[vertex(1)] = positions[vertex(0)];
    let lost = indices[9][2] as usize;
    let was = positions[lost];
    positions[lost] = [f32::NAN; 3];
    let view = TriangleMesh::new(&positions, &indices).unwrap();
    for builder in builders() {
        let built = builder.build(&view).unwrap();
        let refit = |positions: &Positions, indices: &[[u32; 3]]| {
            let mut bvh = built.clone();
            let result = bvh.refit(&TriangleMesh::new(positions, indices).unwrap());
            assert_eq!(bytes(&bvh) == bytes(&built), result.is_err());
            result.unwrap_err()
        };
        assert_eq!(
            refit(&positions, &indices[..200]),
            RefitError::PrimitiveGone { primitive: 200 }
        );
        let mut more = indices.clone();
        more.extend([indices[7], indices[8]]);
        assert_eq!(
            refit(&positions, &more),
            RefitError::PrimitiveLeftOut { primitive: 301 }
        );
        let mut moved = positions.clone();
        moved[lost] = was;
        let left_out = RefitError::PrimitiveLeftOut { primitive: 9 };
        assert_eq!(refit(&moved, &indices), left_out);
        moved[indices[7][1] as usize][1] += 1.0;
        let left_out = RefitError::PrimitiveLeftOut { primitive: 7 };
        assert_eq!(refit(&moved, &indices), left_out);
        moved[indices[250][1] as usize][2] = f32::INFINITY;
        moved[indices[40][0] as usize][2] = f32::NAN;
        let error = refit(&moved, &indices);
        assert_eq!(error.primitive(), 40);
        assert!(matches!(
            error,
            RefitError::Primitive {
                error: BuildError::NonFinitePosition {
                    triangle: 40,
                    corner: 0,
                    ..
                },
                ..
            }
        ));
    }
    indices.clear();
    let none = TriangleMesh::new(&positions, &indices).unwrap();
    let mut bvh = Builder::new().build(&none).unwrap();
    assert_eq!(bvh.refit(&none), Ok(()));
    assert!(bvh.bounds().is_empty());
}

/// Parts may list primitives that no leaf has: those are in no hierarchy.
#[test]
fn what_is_listed_and_in_no_leaf_was_left_out() {
    let mesh = shapes::soup(40, 5);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let built = Builder::new().build(&view).unwrap();
    let mut bare =
        Bvh8::from_parts(vec![], vec![], built.primitives().to_vec(), *built.bounds()).unwrap();
    let left_out = RefitError::PrimitiveLeftOut { primitive: 0 };
    assert_eq!(bare.refit(&view), Err(left_out));
}

/// A strip whose every triangle has vertices of its own.
#[test]
fn vertices_that_part() {
    let corner = |i: u32| [(i / 2) as f32, (i % 2) as f32, 0.0];
    let positions: Positions = (0..40)
        .flat_map(|i| [i, i + 1, i + 2].map(corner))
        .collect();
    let indices: Vec<[u32; 3]> = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let view = TriangleMesh::new(&positions, &indices).unwrap();
    for builder in builders() {
        let built = builder.build(&view).unwrap();
        // All together: they are still one.
        let moved: Positions = positions.iter().map(|&[x, y, _]| [x, y, x * x]).collect();
        let mut bvh = built.clone();
        bvh.refit(&TriangleMesh::new(&moved, &indices).unwrap())
            .unwrap();
        // Each apart: leaves of more than two have no room.
        let shrunk: Positions = (0..120)
            .map(|i| {
                let [x, y, z] = positions[i];
                let [cx, cy, cz] = positions[i - i % 3];
                [(x + cx) / 2.0, (y + cy) / 2.0, (z + cz) / 2.0]
            })
            .collect();
        let error = bvh
            .refit(&TriangleMesh::new(&shrunk, &indices).unwrap())
            .unwrap_err();
        assert!(
            matches!(error, RefitError::VerticesParted { .. }),
            "{error}"
        );
    }
}
