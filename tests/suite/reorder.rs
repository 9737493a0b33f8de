//! A compact hierarchy and its mesh, put in the order of leaves: the same triangles, and the reference's answers on them.

use crate::common::{SEED, bits, config, part, point, point_on, soup, target};
use fastrand::Rng;
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{
    build::{Builder, ReorderError, ReorderedMesh},
    geometry::{Ray, TriangleMesh},
    layout::{
        AlignedBytes, Borrowed, Bvh, BytesError, CompactNode4, CompactNode8, Counted, LayoutError,
        MeshTooSmall, OrderedBvh8, OrderedLeaf, OrderedMeshBvh8, OrderedMeshLeaf, Owned, WideNode,
    },
    reference,
};
use wide_bvh_scenes::shapes;

/// Reorders, and checks the mesh that comes out.
fn reordered<N: WideNode>(mesh: &TriangleMesh) -> (Bvh<N, OrderedLeaf, Owned>, ReorderedMesh) {
    let builder = Builder::new().splits(0.0).drop_non_finite(true);
    let bvh = builder.build_compact::<N>(mesh).unwrap();
    let (ordered, new) = bvh.reorder(mesh).unwrap();
    assert_eq!(bvh.nodes().len(), ordered.nodes().len());
    assert_eq!(bvh.primitive_count(), ordered.primitive_count());
    assert_eq!(bvh.dropped(), ordered.dropped());
    assert_eq!(ordered.bytes(), size_of_val(ordered.nodes()));
    // Those of the list, then the others, by the numbers that they had.
    let (listed, others) = new.triangles.split_at(bvh.primitive_count());
    assert_eq!(listed, bvh.primitives());
    assert!(others.is_sorted() && others.iter().all(|other| !listed.contains(other)));
    let mut numbers = new.triangles.clone();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(0..mesh.len() as u32));
    assert_eq!(new.indices.len(), new.triangles.len());
    for (corners, &was) in new.indices.iter().zip(&new.triangles) {
        let vertices = corners.map(|corner| new.vertices[corner as usize]);
        assert_eq!(vertices, mesh.indices()[was as usize]);
    }
    let bits = |position: [f32; 3]| position.map(f32::to_bits);
    for (&position, &was) in new.positions.iter().zip(&new.vertices) {
        assert_eq!(bits(position), bits(mesh.positions()[was as usize]));
    }
    // In the order in which they are met, each once.
    let mut next = 0;
    for &vertex in new.indices.iter().flatten() {
        assert!(vertex <= next);
        next = next.max(vertex + 1);
    }
    assert_eq!(next as usize, new.positions.len());
    (ordered, new)
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
    let mut hits = vec![None; rays.len()];
    over.closest_hits(rays, &mut hits);
    for (&hit, ray) in hits.iter().zip(rays) {
        assert_eq!(bits(hit), bits(over.closest_hit(ray)), "{ray:?}");
    }
    in_bytes(&bvh, &view, rays);
}

/// Written with its mesh and without, and opened in place.
fn in_bytes<N: WideNode>(bvh: &Bvh<N, OrderedLeaf, Owned>, mesh: &TriangleMesh, rays: &[Ray]) {
    let alone = AlignedBytes::new(&bvh.to_bytes().unwrap()[..]);
    let alone = Bvh::<N, OrderedLeaf, Borrowed>::from_bytes(&alone).unwrap();
    let over = bvh.over(mesh).unwrap();
    let whole = AlignedBytes::new(&over.to_bytes().unwrap()[..]);
    let whole = Bvh::<N, OrderedMeshLeaf, Borrowed>::from_bytes(&whole).unwrap();
    assert_eq!(alone.primitive_count(), bvh.primitive_count());
    let again = alone.over(mesh).unwrap();
    for ray in rays {
        let hit = bits(over.closest_hit(ray));
        assert_eq!(bits(whole.closest_hit(ray)), hit, "{ray:?}");
        assert_eq!(bits(again.closest_hit(ray)), hit, "{ray:?}");
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
    let bvh = Builder::new().build_compact::<CompactNode8>(&view).unwrap();
    let fewer = &mesh.indices[1..];
    let fewer = TriangleMesh::new(&mesh.positions, fewer).unwrap();
    let error = bvh.reorder(&fewer).unwrap_err();
    let needed = mesh.indices.len();
    assert_eq!(
        error,
        ReorderError::Mesh(MeshTooSmall {
            triangles: needed - 1,
            needed: needed as u64
        })
    );
}

/// A triangle that was cut would have several numbers, and which of them a ray finds is up to the tree.
#[test]
fn cut_triangles() {
    let mut rng = Rng::with_seed(SEED);
    let mut unit = move || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - 1.0;
    // Every third a long one across others' boxes; and many enough for the builder to cut.
    let corners = |i: u32| {
        let at = unit() * 10.0;
        let length = if i.is_multiple_of(3) { 6.0 } else { 0.3 };
        [at, at + unit() * 0.1, at + unit() * length]
    };
    let positions: Vec<_> = (0..1500)
        .flat_map(corners)
        .map(|at| at.to_array())
        .collect();
    let indices: Vec<_> = (0..1500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let view = TriangleMesh::new(&positions, &indices).unwrap();
    let builder = Builder::new().splits(1.0);
    let bvh = builder.build_compact::<CompactNode8>(&view).unwrap();
    let mut listed = bvh.primitives().to_vec();
    listed.sort_unstable();
    let twice = |number: u32| listed.iter().filter(|&&other| other == number).count() > 1;
    match bvh.reorder(&view).unwrap_err() {
        ReorderError::Repeated { primitive } => assert!(twice(primitive as u32)),
        other => panic!("{other}"),
    }
    let rays: Vec<Ray> = (0..300)
        .map(|_| Ray::segment(unit() * 10.0, unit() * 10.0))
        .collect();
    check::<CompactNode8>(&view, &rays);
}

/// Of an ordered hierarchy it is how many primitives there are that has to be right.
#[test]
fn counts() {
    let mesh = shapes::icosphere(2);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let builder = Builder::new().splits(0.0);
    let bvh = builder.build_compact::<CompactNode8>(&view).unwrap();
    let (ordered, new) = bvh.reorder(&view).unwrap();
    let count = ordered.primitive_count();
    let (nodes, bounds) = (ordered.nodes(), *ordered.bounds());
    let of = |count| {
        let counted = Counted { of: (), count };
        OrderedBvh8::from_parts(nodes.to_vec(), counted, vec![], bounds).map(|_| ())
    };
    assert_eq!(of(count), Ok(()));
    assert_eq!(of(count + 1), Err(LayoutError::UnusedLeaves(count)));
    assert!(matches!(of(count - 1), Err(LayoutError::Child { .. })));
    assert_eq!(of(1 << 29), Err(LayoutError::TooLarge));

    let listed =
        OrderedBvh8::from_parts(nodes.to_vec(), Counted { of: (), count }, vec![7], bounds);
    assert_eq!(listed.unwrap_err(), LayoutError::Listed(1));

    let needed = count as u64;
    let triangles = count - 1;
    let fewer = TriangleMesh::new(&new.positions, &new.indices[..triangles]).unwrap();
    let too_small = MeshTooSmall { triangles, needed };
    assert_eq!(ordered.over(&fewer).unwrap_err(), too_small);
    let of = Counted { of: fewer, count };
    let error = OrderedMeshBvh8::from_parts(nodes, of, &[], bounds).unwrap_err();
    assert_eq!(error, LayoutError::Primitive(triangles));

    let bytes = AlignedBytes::new(&ordered.to_bytes().unwrap()[..]);
    let error = OrderedMeshBvh8::from_bytes(&bytes).unwrap_err();
    let no_mesh = MeshTooSmall {
        triangles: 0,
        needed,
    };
    assert_eq!(error, BytesError::MeshTooSmall(no_mesh));
}
