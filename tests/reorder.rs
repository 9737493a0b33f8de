//! A compact hierarchy and its mesh, put in the order of leaves: the same triangles, and the reference's answers on them.

mod common;

use common::{SEED, bits, config, part, point, point_on, soup, target};
use fastrand::Rng;
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{
    build::{Builder, ReorderedMesh},
    geometry::{Ray, TriangleMesh},
    layout::{Bvh, CompactNode4, CompactNode8, MeshTooSmall, Owned, RunLeaf, WideNode},
    reference,
};
use wide_bvh_scenes::shapes;

/// Reorders, and checks the mesh that comes out.
fn reordered<N: WideNode>(mesh: &TriangleMesh) -> (Bvh<N, RunLeaf, Owned>, ReorderedMesh) {
    let builder = Builder::new().splits(1.0).drop_non_finite(true);
    let mut bvh = builder.build_compact::<N>(mesh).unwrap();
    let before = bvh.primitives().to_vec();
    let new = bvh.reorder(mesh).unwrap();
    // The same triangles, by the numbers that they had.
    assert_eq!(new.triangles.len(), mesh.len());
    assert_eq!(new.indices.len(), mesh.len());
    let mut numbers = new.triangles.clone();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(0..mesh.len() as u32));
    for (corners, &was) in new.indices.iter().zip(&new.triangles) {
        let vertices = corners.map(|corner| new.vertices[corner as usize]);
        assert_eq!(vertices, mesh.indices()[was as usize]);
    }
    let bits = |position: [f32; 3]| position.map(f32::to_bits);
    for (&position, &was) in new.positions.iter().zip(&new.vertices) {
        assert_eq!(bits(position), bits(mesh.positions()[was as usize]));
    }
    // In the order in which they are met, and each vertex is there once.
    let mut next = 0;
    for (&number, &was) in bvh.primitives().iter().zip(&before) {
        assert_eq!(new.triangles[number as usize], was);
        assert!(number <= next);
        next = next.max(number + 1);
    }
    let mut next = 0;
    for &vertex in new.indices.iter().flatten() {
        assert!(vertex <= next);
        next = next.max(vertex + 1);
    }
    assert_eq!(next as usize, new.positions.len());
    (bvh, new)
}

fn check<N: WideNode>(mesh: &TriangleMesh, rays: &[Ray]) {
    let (bvh, new) = reordered::<N>(mesh);
    let view = TriangleMesh::new(&new.positions, &new.indices).unwrap();
    let over = bvh.over(&view).unwrap();
    for ray in rays {
        let expected = reference::closest_hit(&view, ray);
        assert_eq!(bits(over.closest_hit(ray)), bits(expected), "{ray:?}");
        assert_eq!(over.any_hit(ray), expected.is_some(), "{ray:?}");
        let before = reference::closest_hit(mesh, ray);
        assert_eq!(
            expected.map(|hit| hit.t),
            before.map(|hit| hit.t),
            "{ray:?}"
        );
    }
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn soups(
        (positions, indices) in soup(0..60),
        rays in prop::collection::vec((point(), any::<prop::sample::Index>(), target()), 12),
    ) {
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let ray = |(origin, pick, at): &([f32; 3], prop::sample::Index, _)| {
            let triangle = mesh.triangle(pick.index(indices.len().max(1)));
            let target = triangle.map_or(Vec3::ONE, |triangle| point_on(triangle, *at));
            Ray::new(*origin, target - Vec3::from(*origin))
        };
        let rays: Vec<Ray> = rays.iter().map(ray).collect();
        check::<CompactNode4>(&mesh, &rays);
        check::<CompactNode8>(&mesh, &rays);
    }
}

#[test]
fn shapes_out_of_order() {
    let mut rng = Rng::with_seed(SEED);
    for mut mesh in [shapes::icosphere(4), shapes::torus_knot(2, 3, 0.3, 90, 8)] {
        // As far from any order as can be; and some that are left out.
        mesh.positions.push([f32::NAN; 3]);
        let nowhere = mesh.positions.len() as u32 - 1;
        mesh.indices.extend([[0, 1, nowhere], [2, 2, 5]]);
        rng.shuffle(&mut mesh.indices);
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let rays: Vec<Ray> = (0..part(2000))
            .map(|_| {
                let mut point = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 6.0 - 3.0;
                Ray::segment(point(), point())
            })
            .collect();
        check::<CompactNode4>(&view, &rays);
        check::<CompactNode8>(&view, &rays);
    }
}

#[test]
fn another_mesh() {
    let mesh = shapes::icosphere(2);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let mut bvh = Builder::new().build_compact::<CompactNode8>(&view).unwrap();
    let before = bvh.primitives().to_vec();
    let fewer = &mesh.indices[1..];
    let fewer = TriangleMesh::new(&mesh.positions, fewer).unwrap();
    let error = bvh.reorder(&fewer).unwrap_err();
    let needed = mesh.indices.len();
    assert_eq!(
        error,
        MeshTooSmall {
            triangles: needed - 1,
            needed: needed as u64
        }
    );
    assert_eq!(bvh.primitives(), before);
}
