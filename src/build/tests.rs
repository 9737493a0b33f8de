//! Whole builds, held to what every hierarchy must be.

use super::{BinaryNode, BinaryTree, BuildError, Builder, Preset};
#[cfg(feature = "rayon")]
use crate::layout::{CompactNode4, CompactNode8};
use crate::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Bvh, ChildKind, Leaf, Node4, Node8, Owned, TriangleLeaf, WideNode},
};
use core::ops::ControlFlow;
use glam::Vec3;
use std::{format, sync::Mutex, vec, vec::Vec};

type Position = [f32; 3];

/// Numbers that look random: a linear congruence (Knuth's MMIX), its upper bits.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }

    /// In 0 to 1.
    fn unit(&mut self) -> f32 {
        self.bits() as f32 / (1u32 << 31) as f32
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

/// Three corners a triangle, in order.
fn soup(corners: &[Position]) -> Vec<[u32; 3]> {
    (0..corners.len() as u32 / 3)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect()
}

/// Small triangles all over the unit cube.
fn dust(count: usize, seed: u64) -> Vec<Position> {
    let mut random = Random(seed);
    let mut positions = Vec::new();
    for _ in 0..count {
        let p = random.point();
        for _ in 0..3 {
            positions.push((p + 0.02 * random.point()).to_array());
        }
    }
    positions
}

/// A square of `side` times `side` quads, which share their vertices.
fn grid(side: u32) -> (Vec<Position>, Vec<[u32; 3]>) {
    let place = |x: u32, y: u32| y * (side + 1) + x;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for y in 0..=side {
        for x in 0..=side {
            let (x, y) = (x as f32, y as f32);
            positions.push([x, y, (x * 0.7).sin() + (y * 0.4).cos()]);
        }
    }
    for y in 0..side {
        for x in 0..side {
            let [a, b, c, d] = [
                place(x, y),
                place(x + 1, y),
                place(x, y + 1),
                place(x + 1, y + 1),
            ];
            indices.extend([[a, b, c], [b, d, c]]);
        }
    }
    (positions, indices)
}

/// Every one of `expected` is in one leaf, and every box is the least around what is below it.
fn check_bvh<N: WideNode, L: Leaf>(
    bvh: &Bvh<N, L, Owned>,
    expected: &[u32],
    aabb: impl Fn(u32) -> Aabb,
) {
    let mut seen = bvh.primitives().to_vec();
    seen.sort_unstable();
    assert_eq!(seen, expected);

    let leaf_aabb = |leaf: usize| {
        let places = bvh.leaves()[leaf].primitives();
        let ids = &bvh.primitives()[places.start as usize..places.end as usize];
        ids.iter().fold(Aabb::EMPTY, |all, &id| all.join(aabb(id)))
    };
    let mut boxes = vec![Aabb::EMPTY; bvh.nodes().len()];
    for (index, node) in bvh.nodes().iter().enumerate().rev() {
        for lane in 0..N::WIDTH {
            let child = node.child(lane);
            let below = match child.kind() {
                ChildKind::Empty => continue,
                ChildKind::Node(node) => boxes[node],
                ChildKind::Leaf(leaf) => leaf_aabb(leaf),
            };
            assert_eq!(node.child_aabb(lane), below, "node {index}, lane {lane}");
            boxes[index] = boxes[index].join(below);
        }
    }
    let root = match bvh.root().kind() {
        ChildKind::Empty => Aabb::EMPTY,
        ChildKind::Node(node) => boxes[node],
        ChildKind::Leaf(leaf) => leaf_aabb(leaf),
    };
    assert_eq!(*bvh.bounds(), root);
}

/// Every one of `expected` is in a leaf, once each; boxes are the least around those below; every point of a triangle
/// is in the box of a leaf that has it, and so in those above.
fn check_pieces<N: WideNode>(
    bvh: &Bvh<N, TriangleLeaf, Owned>,
    expected: &[u32],
    mesh: &TriangleMesh,
) {
    let mut seen = bvh.primitives().to_vec();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen, expected);
    assert_eq!(bvh.report().primitives, expected.len());
    assert_eq!(bvh.report().references, bvh.primitives().len());

    let mut boxes = vec![Aabb::EMPTY; bvh.nodes().len()];
    let mut leaf_boxes = vec![*bvh.bounds(); bvh.leaves().len()];
    for (index, node) in bvh.nodes().iter().enumerate().rev() {
        for lane in 0..N::WIDTH {
            let child = node.child(lane);
            let aabb = node.child_aabb(lane);
            match child.kind() {
                ChildKind::Empty => continue,
                ChildKind::Node(node) => assert_eq!(aabb, boxes[node]),
                ChildKind::Leaf(leaf) => leaf_boxes[leaf] = aabb,
            }
            boxes[index] = boxes[index].join(aabb);
        }
    }
    let corners = |id: u32| mesh.triangle(id as usize).unwrap();
    let all = expected.iter().flat_map(|&id| corners(id));
    assert_eq!(*bvh.bounds(), Aabb::from_points(all));

    let mut parts = vec![Vec::new(); mesh.len()];
    for (leaf, aabb) in bvh.leaves().iter().zip(&leaf_boxes) {
        let places = leaf.primitives();
        let ids = &bvh.primitives()[places.start as usize..places.end as usize];
        assert!(ids.is_sorted_by(|a, b| a < b));
        for &id in ids {
            parts[id as usize].push(*aabb);
        }
    }
    let mut random = Random(31);
    for &id in expected {
        let [a, b, c] = corners(id).map(|corner| corner.as_dvec3());
        // The sample itself is rounded.
        let slack = a.abs().max(b.abs()).max(c.abs()).max_element() * 1e-15;
        let samples = if parts[id as usize].len() > 1 { 200 } else { 4 };
        for sample in 0..samples {
            let (mut v, mut w) = (f64::from(random.unit()), f64::from(random.unit()));
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            if sample % 8 == 0 {
                w = 0.0;
            }
            let p = a * (1.0 - v - w) + b * v + c * w;
            let is_in = |aabb: &Aabb| {
                let (min, max) = (aabb.min.as_dvec3() - slack, aabb.max.as_dvec3() + slack);
                p.cmpge(min).all() && p.cmple(max).all()
            };
            assert!(parts[id as usize].iter().any(is_in), "{id}: {p}");
        }
    }
}

/// Both widths, and the way over a binary tree, of triangles that all are kept.
fn check_mesh(positions: &[Position], indices: &[[u32; 3]]) {
    let mesh = TriangleMesh::new(positions, indices).unwrap();
    let all: Vec<u32> = (0..indices.len() as u32).collect();
    let aabb = |id: u32| Aabb::from_points(mesh.triangle(id as usize).unwrap());
    let builder = Builder::new().splits(0.0);
    let cutting = Builder::new().splits(2.0);
    check_pieces(&cutting.build(&mesh).unwrap(), &all, &mesh);
    check_pieces(&cutting.build_as::<Node4>(&mesh).unwrap(), &all, &mesh);
    let bvh = builder.build(&mesh).unwrap();
    check_bvh(&bvh, &all, aabb);
    check_bvh(&builder.build_as::<Node4>(&mesh).unwrap(), &all, aabb);
    for preset in [Preset::Fast, Preset::Balanced] {
        let builder = Builder::new().preset(preset);
        check_bvh(&builder.build(&mesh).unwrap(), &all, aabb);
        check_bvh(&builder.build_as::<Node4>(&mesh).unwrap(), &all, aabb);
    }

    let tree = builder.build_binary(&mesh).unwrap();
    let (nodes, order) = tree.into_parts();
    assert_eq!(nodes.len(), 2 * indices.len() - 1);
    let tree = BinaryTree::new(nodes, order).unwrap();
    check_bvh(&builder.build_from_tree(&mesh, &tree).unwrap(), &all, aabb);
}

fn assert_same<N: WideNode>(a: &Bvh<N, TriangleLeaf, Owned>, b: &Bvh<N, TriangleLeaf, Owned>) {
    assert!(bytes_of(a) == bytes_of(b));
}

fn bytes_of<N: WideNode>(bvh: &Bvh<N, TriangleLeaf, Owned>) -> (&[u8], &[u8], &[u32]) {
    (
        bytemuck::cast_slice(bvh.nodes()),
        bytemuck::cast_slice(bvh.leaves()),
        bvh.primitives(),
    )
}

#[test]
fn every_triangle_is_in_a_leaf() {
    for count in [1, 2, 3, 8, 9, 33, 64, 65, 300, 5000] {
        let positions = dust(count, 7);
        check_mesh(&positions, &soup(&positions));
    }
    for side in [1, 2, 3, 10, 50] {
        let (positions, indices) = grid(side);
        check_mesh(&positions, &indices);
    }
}

#[test]
fn leaves_are_filled_where_vertices_are_shared() {
    let (positions, indices) = grid(64);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let shared = Builder::new().build(&mesh).unwrap();
    // A leaf of 8 vertices holds 6 triangles of a strip.
    assert!(shared.leaves().len() * 3 < indices.len(), "{shared:?}");

    // Vertices that are shared by place alone do as well.
    let corners: Vec<Position> = indices
        .iter()
        .flatten()
        .map(|&i| positions[i as usize])
        .collect();
    let indices = soup(&corners);
    let mesh = TriangleMesh::new(&corners, &indices).unwrap();
    assert_same(&shared, &Builder::new().build(&mesh).unwrap());
}

#[test]
fn nothing_builds_and_misses() {
    let mesh = TriangleMesh::new::<[f32; 3], [u32; 3]>(&[], &[]).unwrap();
    let bvh = Builder::new().build(&mesh).unwrap();
    assert_eq!(bvh.report().leaves, 0);
    assert_eq!(bvh.closest_hit(&Ray::new([0.0; 3], [1.0, 0.0, 0.0])), None);
    let tree = Builder::new().build_binary(&mesh).unwrap();
    assert_eq!(tree, BinaryTree::default());
    let bvh = Builder::new().build_from_tree(&mesh, &tree).unwrap();
    assert_eq!(bvh.leaves().len(), 0);
    let bvh = Builder::new().build_primitives::<Node4>(&[]).unwrap();
    assert_eq!(bvh.report().primitives, 0);
}

#[test]
fn the_first_offender_is_named() {
    let mut positions = dust(100_000, 3);
    let indices = soup(&positions);
    positions[3 * 70_000] = [0.0, f32::NAN, 0.0];
    positions[3 * 40_000 + 2] = [f32::INFINITY, 0.0, 1.0];
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let error = BuildError::NonFinitePosition {
        triangle: 40_000,
        corner: 2,
        vertex: 120_002,
        position: Vec3::new(f32::INFINITY, 0.0, 1.0),
    };
    assert_eq!(Builder::new().build(&mesh).unwrap_err(), error);
    assert_eq!(
        format!("{error}"),
        "triangle 40000, corner 2: vertex 120002 is not finite, but (inf, 0, 1)"
    );

    let bvh = Builder::new().drop_non_finite(true).build(&mesh).unwrap();
    assert_eq!(bvh.report().dropped, 2);
    assert_eq!(bvh.report().primitives, indices.len() - 2);

    let mut boxes = vec![Aabb::new(Vec3::ZERO, Vec3::ONE); 9];
    boxes[3] = Aabb::EMPTY;
    boxes[5].max.y = f32::NAN;
    let build = |builder: Builder, boxes: &[Aabb]| builder.build_primitives::<Node8>(boxes);
    let dropping = Builder::new().drop_non_finite(true);
    let error = BuildError::NonFiniteBox { primitive: 5 };
    assert_eq!(build(Builder::new(), &boxes).unwrap_err(), error);
    assert_eq!(build(dropping, &boxes).unwrap().report().dropped, 1);
    boxes[2].max.y = -1.0;
    let error = BuildError::InvalidBox { primitive: 2 };
    assert_eq!(build(Builder::new(), &boxes).unwrap_err(), error);
    assert_eq!(build(dropping, &boxes).unwrap_err(), error);
}

#[test]
fn triangles_without_area_are_left_out() {
    let mut positions = dust(100, 5);
    let indices = soup(&positions);
    // Two corners at one place; all three in a line.
    positions[30] = positions[31];
    positions[93] = [-0.0, 0.0, 0.5];
    positions[95] = [0.0, -0.0, 0.5];
    positions[60] = [0.0; 3];
    positions[61] = [0.25; 3];
    positions[62] = [0.5; 3];
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let kept: Vec<u32> = (0..100).filter(|id| ![10, 20, 31].contains(id)).collect();
    let bvh = Builder::new().build(&mesh).unwrap();
    check_bvh(&bvh, &kept, |id| {
        Aabb::from_points(mesh.triangle(id as usize).unwrap())
    });

    // A tree that lists them is pruned: to nothing, if there is nothing else.
    let tree = chain(100);
    let bvh = Builder::new().build_from_tree(&mesh, &tree).unwrap();
    check_bvh(&bvh, &kept, |id| {
        Aabb::from_points(mesh.triangle(id as usize).unwrap())
    });
    let mesh = TriangleMesh::new(&[[0.0f32; 3]; 3], &[[0, 1, 2], [0u32, 0, 1]]).unwrap();
    let bvh = Builder::new().build_from_tree(&mesh, &chain(2)).unwrap();
    assert!(bvh.bounds().is_empty());
}

#[test]
fn one_place_for_all() {
    let triangle = [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0], [1.0, 3.0, 3.5]];
    let positions = triangle.repeat(20_000);
    check_mesh(&positions, &soup(&positions));
    check_mesh(&triangle, &[[0, 1, 2]].repeat(20_000));
}

#[test]
fn one_giant_among_dust() {
    let mut positions = dust(20_000, 11);
    positions.extend([[-1e30, -1e30, 0.0], [1e30, -1e30, 0.3], [0.0, 1e30, 0.6]]);
    check_mesh(&positions, &soup(&positions));
}

#[test]
fn numbers_at_the_ends_of_their_range() {
    for scale in [f32::MAX, 1e30, 1e-30, 1e-38, 1e-44] {
        let positions: Vec<Position> = dust(3000, 13)
            .iter()
            .map(|p| p.map(|x| (1.9 * x - 0.95) * scale))
            .collect();
        let indices = soup(&positions);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let pieces = Builder::new().splits(2.0).build(&mesh).unwrap();
        let bvh = Builder::new().splits(0.0).build(&mesh).unwrap();
        check_pieces(&pieces, &bvh.sorted_primitives(), &mesh);
        check_bvh(&bvh, &bvh.sorted_primitives(), |id| {
            Aabb::from_points(mesh.triangle(id as usize).unwrap())
        });
        assert!(bvh.report().sah_cost.is_finite());
    }
    // Both ends at once, and everything between.
    let mut random = Random(17);
    let positions: Vec<Position> = (0..9000)
        .map(|_| [0; 3].map(|_| f32::from_bits(random.bits() << 1 & 0xbf7f_ffff)))
        .collect();
    let mesh_indices = soup(&positions);
    check_mesh(&positions, &mesh_indices);
    let positions: Vec<Position> = (0..9000)
        .map(|i| [0, 1, 2].map(|axis| [f32::MAX, -f32::MAX, 1.0][(i + axis + i / 3) % 3]))
        .collect();
    check_mesh(&positions, &soup(&positions));
}

/// Triangles all over the unit cube, each as long as a third of it and one in a hundred as wide.
fn needles(count: usize, seed: u64) -> Vec<Position> {
    let mut random = Random(seed);
    let mut positions = Vec::new();
    for triangle in 0..count {
        let p = random.point();
        let q = p + 0.3 * random.point();
        let width = if triangle % 100 == 0 { 0.3 } else { 0.01 };
        positions.extend([p, q, q + width * random.point()].map(|p| p.to_array()));
    }
    positions
}

#[test]
fn large_triangles_are_cut() {
    for scale in [1.0, f32::MAX / 2.0, 1e-38, 1e-43] {
        let positions: Vec<_> = needles(5000, 37)
            .iter()
            .map(|p| p.map(|x| x * scale))
            .collect();
        let indices = soup(&positions);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        for preset in [Preset::Best, Preset::Balanced] {
            let builder = Builder::new().preset(preset);
            let whole = builder.splits(0.0).build(&mesh).unwrap();
            let kept = whole.sorted_primitives();
            for fraction in [0.1, 0.5, f32::INFINITY] {
                let cut = builder.splits(fraction).build(&mesh).unwrap();
                check_pieces(&cut, &kept, &mesh);
                let report = cut.report();
                let most = (kept.len() as f32 * (1.0 + fraction)) as usize;
                assert!(report.references <= most);
                assert!(scale < 1e-40 || report.references > report.primitives);
                let compact = builder.splits(fraction).build_compact::<Node8>(&mesh);
                let mut numbers = compact.unwrap().primitives().to_vec();
                numbers.sort_unstable();
                numbers.dedup();
                assert_eq!(numbers, kept);
            }
            for fraction in [-1.0, f32::NAN] {
                assert_same(&whole, &builder.splits(fraction).build(&mesh).unwrap());
            }
        }
    }
}

#[test]
fn spacing_that_doubles() {
    // Each cut of the heuristic takes off little.
    let positions: Vec<Position> = (0..2000)
        .flat_map(|i| {
            let x = 2.0f32.powf(i as f32 / 2000.0 * 250.0 - 125.0);
            [[x, 0.0, 0.0], [x, x, 0.0], [x, 0.0, x]]
        })
        .collect();
    check_mesh(&positions, &soup(&positions));
}

fn node(first: u32, count: u32) -> BinaryNode {
    BinaryNode {
        aabb: Aabb::EMPTY,
        first,
        count,
    }
}

/// A tree as deep as can be: every node has a leaf, now left, now right, and the rest.
fn chain(leaves: u32) -> BinaryTree {
    let mut nodes = vec![node(0, 1)];
    let mut rest = 0;
    for leaf in 0..leaves - 1 {
        nodes[rest] = node(nodes.len() as u32, 0);
        rest = nodes.len() + usize::from(leaf % 3 > 0);
        nodes.extend([node(leaf, 1); 2]);
        nodes[rest] = node(leaf + 1, 1);
    }
    BinaryTree::new(nodes, (0..leaves).collect()).unwrap()
}

#[test]
fn a_chain_of_a_million_nodes() {
    let boxes: Vec<Aabb> = (0..1_000_000u32)
        .map(|i| {
            let x = (i as f32).sqrt();
            Aabb::new(Vec3::splat(x), Vec3::splat(x + 1.0))
        })
        .collect();
    let tree = chain(boxes.len() as u32);
    let all: Vec<u32> = (0..boxes.len() as u32).collect();
    let aabb = |id: u32| boxes[id as usize];
    let builder = Builder::new();
    let bvh = builder.build_primitives_from_tree::<Node8>(&boxes, &tree);
    check_bvh(&bvh.unwrap(), &all, aabb);
    let bvh = builder.build_primitives_from_tree::<Node4>(&boxes, &tree);
    check_bvh(&bvh.unwrap(), &all, aabb);
}

#[test]
fn trees_of_others() {
    let positions = dust(4, 19);
    let indices = soup(&positions);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let build = |nodes: Vec<BinaryNode>, order: Vec<u32>| {
        let tree = BinaryTree::new(nodes, order).unwrap();
        Builder::new().build_from_tree(&mesh, &tree)
    };
    // Children before their parents, a leaf of several, two listed twice, a place that is nobody's. All are few
    // enough for one leaf, which has each once.
    let nodes = vec![node(3, 0), node(0, 3), node(4, 1), node(1, 0), node(5, 2)];
    let bvh = build(nodes.clone(), vec![3, 1, 0, 9, 2, 1, 2]).unwrap();
    check_bvh(&bvh, &[0, 1, 2, 3], |id| {
        Aabb::from_points(mesh.triangle(id as usize).unwrap())
    });
    assert_eq!(
        build(nodes.clone(), vec![3, 1, 1, 0, 2, 1, 2]).unwrap_err(),
        BuildError::PrimitiveMissing { primitive: 0 }
    );
    assert_eq!(
        build(nodes, vec![3, 1, 0, 0, 2, 1, 4]).unwrap_err(),
        BuildError::PrimitiveOutOfRange {
            place: 6,
            primitive: 4,
            primitives: 4
        }
    );
    assert_eq!(
        build(vec![], vec![]).unwrap_err(),
        BuildError::PrimitiveMissing { primitive: 0 }
    );
}

/// A tree of ours lists what can be hit, and is one that goes in.
#[test]
fn trees_of_ours_where_some_are_left_out() {
    let mut positions = dust(4, 29);
    positions[1] = [f32::NAN; 3];
    let mut indices = soup(&positions);
    indices.push([2; 3]);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let builder = Builder::new().drop_non_finite(true);
    let tree = builder.build_binary(&mesh).unwrap();
    let bvh = builder.build_from_tree(&mesh, &tree).unwrap();
    check_bvh(&bvh, &[1, 2, 3], |id| {
        Aabb::from_points(mesh.triangle(id as usize).unwrap())
    });
    assert_eq!(bvh.dropped(), 1);
}

#[test]
fn trees_of_any_shape_fit_the_stack() {
    let mut random = Random(23);
    for round in 0..60 {
        let count = 1 + random.bits() % 3000;
        let positions = dust(count as usize, round);
        let indices = soup(&positions);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        // Split a node drawn at random, or, to get deep, one of the latest, until all leaves are single.
        let mut nodes = vec![node(0, count)];
        let mut open = vec![0usize];
        while !open.is_empty() {
            let recent = (round as usize % 3 + 1).min(open.len());
            let pick = open.len() - 1 - random.bits() as usize % recent;
            let index = open.swap_remove(pick);
            let BinaryNode { first, count, .. } = nodes[index];
            if count == 1 {
                continue;
            }
            let left = match round % 4 {
                0 => 1 + random.bits() % (count - 1),
                1 => 1,
                2 => count - 1,
                _ => (count / 8).max(1),
            };
            nodes[index] = node(nodes.len() as u32, 0);
            open.extend([nodes.len(), nodes.len() + 1]);
            nodes.extend([node(first, left), node(first + left, count - left)]);
        }
        let tree = BinaryTree::new(nodes, (0..count).collect()).unwrap();
        let all: Vec<u32> = (0..count).collect();
        let aabb = |id: u32| Aabb::from_points(mesh.triangle(id as usize).unwrap());
        let builder = Builder::new();
        let bvh = builder.build_from_tree_as::<Node8>(&mesh, &tree).unwrap();
        check_bvh(&bvh, &all, aabb);
        let bvh = builder.build_from_tree_as::<Node4>(&mesh, &tree).unwrap();
        check_bvh(&bvh, &all, aabb);
    }
}

#[cfg(feature = "rayon")]
fn check_threads<N: WideNode>(mesh: &TriangleMesh, preset: Preset) {
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let builder = Builder::new().preset(preset);
        pool.unwrap()
            .install(|| builder.build_as::<N>(mesh).unwrap())
    };
    let one = build(1);
    for threads in [2, 7] {
        assert_same(&one, &build(threads));
    }
}

#[cfg(feature = "rayon")]
#[test]
fn the_same_on_any_number_of_threads() {
    let mut positions = dust(150_000, 29);
    positions.extend(needles(10_000, 41));
    let indices = soup(&positions);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    for preset in [Preset::Fast, Preset::Balanced, Preset::Best] {
        check_threads::<Node8>(&mesh, preset);
    }
    check_threads::<Node4>(&mesh, Preset::Fast);
    check_threads::<CompactNode8>(&mesh, Preset::Fast);
    check_threads::<CompactNode4>(&mesh, Preset::Fast);
    for count in [0, 1, 2, 4096, 4097] {
        let mesh = TriangleMesh::new(&positions, &indices[..count]).unwrap();
        check_threads::<Node8>(&mesh, Preset::Fast);
    }
}

/// What a monitor is told, which stops the build when told so often.
fn watched<T>(
    stop_at: usize,
    builder: Builder,
    build: impl Fn(Builder) -> Result<T, BuildError>,
) -> (Result<T, BuildError>, Vec<f32>) {
    let told = Mutex::new(Vec::new());
    let monitor = |fraction: f32| {
        let mut told = told.lock().unwrap();
        told.push(fraction);
        match told.len() > stop_at {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let built = build(builder.monitor(&monitor));
    (built, told.into_inner().unwrap())
}

fn check_cancel<T>(builder: Builder, build: impl Fn(Builder) -> Result<T, BuildError>) {
    let watched = |stop_at| watched(stop_at, builder, &build);
    let (built, told) = watched(usize::MAX);
    assert!(built.is_ok());
    assert!(told.len() > 8 && told.is_sorted(), "{told:?}");
    assert!(told[0] >= 0.0 && told[told.len() - 1] == 1.0, "{told:?}");
    for stop_at in 0..told.len() {
        let (built, told) = watched(stop_at);
        // Threads that would tell at once tell once, so one build may be over before it is told as often as another.
        let stopped = told.len() > stop_at;
        assert!(
            stopped || stop_at > 0 && cfg!(feature = "rayon"),
            "{stop_at}"
        );
        assert_eq!(
            built.err(),
            stopped.then_some(BuildError::Cancelled),
            "{stop_at}"
        );
        assert!(told.len() <= stop_at + 1);
    }
}

#[test]
fn progress_and_cancel() {
    let positions = needles(3000, 43);
    let indices = soup(&positions);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    for preset in [Preset::Fast, Preset::Balanced, Preset::Best] {
        check_cancel(Builder::new().preset(preset), |builder| {
            builder.build(&mesh)
        });
    }
    let (tree, new) = (chain(3000), Builder::new());
    check_cancel(new, |builder| builder.build_from_tree(&mesh, &tree));
    check_cancel(new, |builder| builder.build_binary(&mesh));
    let boxes: Vec<_> = (0..3000)
        .map(|id| Aabb::from_points(mesh.triangle(id).unwrap()))
        .collect();
    check_cancel(new, |builder| builder.build_primitives::<Node4>(&boxes));
    // A monitor changes nothing.
    let (watched, _) = watched(usize::MAX, new, |builder| builder.build(&mesh));
    assert_same(&watched.unwrap(), &Builder::new().build(&mesh).unwrap());
}

/// Where one triangle is left of many, what is cancelled is a leaf.
#[test]
fn cancel_with_one_triangle_left() {
    let positions = dust(1, 47);
    for count in [1023, 2001] {
        let mut indices = vec![[0; 3]; count];
        indices[0] = [0, 1, 2];
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let tree = BinaryTree::new(vec![node(0, 1)], vec![0]).unwrap();
        for stop_at in 0..4 {
            let (built, _) = watched(stop_at, Builder::new(), |builder| {
                builder.build_from_tree(&mesh, &tree)
            });
            assert!(built.is_ok() || built.err() == Some(BuildError::Cancelled));
        }
    }
}

impl<N: WideNode> Bvh<N, TriangleLeaf, Owned> {
    fn sorted_primitives(&self) -> Vec<u32> {
        let mut primitives = self.primitives().to_vec();
        primitives.sort_unstable();
        primitives
    }
}
