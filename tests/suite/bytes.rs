//! Hierarchies written and opened again: the same answers, and an error for whatever else.

use crate::common::{SEED, bits};
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{
        AlignedBytes, Borrowed, Bvh, Bvh4, Bvh8, BytesError, CompactBvh4, CompactBvh8,
        CompactNode4, CompactNode8, InBytes, LayoutError, MeshBvh4, MeshBvh8, MeshLeaf, Node4,
        Node8, Open, PrimitiveLeaf, RunLeaf, Storage, TriangleLeaf, WideNode, bytes::seal,
    },
};

/// A mesh of some hundred triangles, and rays at it.
struct Scene {
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
    rays: Vec<Ray>,
}

impl Scene {
    fn new(triangles: usize) -> Self {
        let mut random = fastrand::Rng::with_seed(SEED);
        let mut point = move || [(); 3].map(|()| 4.0 * random.f32() - 2.0);
        let positions: Vec<[f32; 3]> = (0..triangles + 2).map(|_| point()).collect();
        let indices = (0..triangles as u32).map(|i| [i, i + 1, i + 2]).collect();
        let rays = (0..100).map(|_| Ray::new(point(), point())).collect();
        Self {
            positions,
            indices,
            rays,
        }
    }

    fn mesh(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices).unwrap()
    }
}

/// Opens what was written, and has `same` compare the two.
fn there_and_back<N: WideNode, L: InBytes, S: Storage>(
    bvh: &Bvh<N, L, S>,
    same: impl Fn(&[u8]),
) -> Vec<u8> {
    let bytes = bvh.to_bytes().unwrap();
    assert_eq!(bytes.len() % 64, 0);
    same(&AlignedBytes::new(&bytes));
    bytes
}

#[test]
fn triangles_there_and_back() {
    let scene = Scene::new(500);
    let mesh = scene.mesh();
    let eight: Bvh8 = Builder::new().build(&mesh).unwrap();
    there_and_back(&eight, |bytes| {
        let opened = Bvh::<Node8, TriangleLeaf, Borrowed>::from_bytes(bytes).unwrap();
        assert_eq!(opened.bounds(), eight.bounds());
        for ray in &scene.rays {
            assert_eq!(bits(opened.closest_hit(ray)), bits(eight.closest_hit(ray)));
        }
    });
    let four: Bvh4 = Builder::new().build_as(&mesh).unwrap();
    there_and_back(&four, |bytes| {
        let opened = Bvh::<Node4, TriangleLeaf, Borrowed>::from_bytes(bytes).unwrap();
        for ray in &scene.rays {
            assert_eq!(bits(opened.closest_hit(ray)), bits(eight.closest_hit(ray)));
        }
    });
}

#[test]
fn compact_ones_there_and_back() {
    let scene = Scene::new(500);
    let mesh = scene.mesh();
    let full: Bvh8 = Builder::new().build(&mesh).unwrap();
    let eight: CompactBvh8 = Builder::new().build_compact(&mesh).unwrap();
    let four: CompactBvh4 = Builder::new().build_compact(&mesh).unwrap();
    // The tree alone, then the mesh with it.
    there_and_back(&eight, |bytes| {
        let opened = Bvh::<CompactNode8, RunLeaf, Borrowed>::from_bytes(bytes).unwrap();
        let opened = opened.over(&mesh).unwrap();
        for ray in &scene.rays {
            assert_eq!(bits(opened.closest_hit(ray)), bits(full.closest_hit(ray)));
        }
    });
    there_and_back(&eight.over(&mesh).unwrap(), |bytes| {
        let opened = MeshBvh8::from_bytes(bytes).unwrap();
        for ray in &scene.rays {
            assert_eq!(bits(opened.closest_hit(ray)), bits(full.closest_hit(ray)));
            assert_eq!(opened.any_hit(ray), full.any_hit(ray));
        }
    });
    there_and_back(&four.over(&mesh).unwrap(), |bytes| {
        let opened = MeshBvh4::from_bytes(bytes).unwrap();
        for ray in &scene.rays {
            assert_eq!(bits(opened.closest_hit(ray)), bits(full.closest_hit(ray)));
        }
    });
}

/// Compact nodes take their children in one order only, nodes before leaves. The builder has to give them that order, and
/// bounds that hold their larger boxes, with leaves of whatever kind; moved, too.
#[test]
fn compact_nodes_of_every_preset() {
    let scene = Scene::new(500);
    let mesh = scene.mesh();
    let full: Bvh8 = Builder::new().build(&mesh).unwrap();
    let moved: Vec<[f32; 3]> = scene.positions.iter().map(|p| p.map(|x| 3.0 * x)).collect();
    let moved = TriangleMesh::new(&moved, &scene.indices).unwrap();
    let full_moved: Bvh8 = Builder::new().build(&moved).unwrap();
    for preset in [Preset::Best, Preset::Balanced, Preset::Fast] {
        let builder = Builder::new().preset(preset);
        of_both_leaves::<CompactNode8>(&builder, &mesh, &scene.rays, &full);
        of_both_leaves::<CompactNode4>(&builder, &mesh, &scene.rays, &full);
    }
    let mut bvh = Builder::new().build_as::<CompactNode8>(&mesh).unwrap();
    bvh.refit(&moved).unwrap();
    same_hits(&bvh, &scene.rays, &full_moved);
}

fn of_both_leaves<N: WideNode>(builder: &Builder, mesh: &TriangleMesh, rays: &[Ray], full: &Bvh8) {
    let compact = builder.build_compact::<N>(mesh).unwrap();
    for ray in rays {
        let hit = compact.over(mesh).unwrap().closest_hit(ray);
        assert_eq!(bits(hit), bits(full.closest_hit(ray)));
    }
    let bvh = builder.build_as::<N>(mesh).unwrap();
    same_hits(&bvh, rays, full);
    there_and_back(&bvh, |bytes| {
        let opened = Bvh::<N, TriangleLeaf, Borrowed>::from_bytes(bytes).unwrap();
        same_hits(&opened, rays, full);
    });
}

fn same_hits<N: WideNode, S: Storage>(bvh: &Bvh<N, TriangleLeaf, S>, rays: &[Ray], full: &Bvh8) {
    let mut hits = vec![None; rays.len()];
    bvh.closest_hits(rays, &mut hits);
    for (ray, hit) in rays.iter().zip(hits) {
        assert_eq!(bits(bvh.closest_hit(ray)), bits(full.closest_hit(ray)));
        assert_eq!(bits(hit), bits(full.closest_hit(ray)));
        assert_eq!(bvh.any_hit(ray), full.any_hit(ray));
    }
}

#[test]
fn boxes_there_and_back() {
    let aabbs: Vec<Aabb> = (0..100u8)
        .map(|i| {
            let at = glam::Vec3::splat(f32::from(i));
            Aabb::new(at, at + 1.5)
        })
        .collect();
    let bvh = Builder::new().build_primitives::<Node4>(&aabbs).unwrap();
    there_and_back(&bvh, |bytes| {
        let opened = Bvh::<Node4, PrimitiveLeaf, Borrowed>::from_bytes(bytes).unwrap();
        assert_eq!(opened.primitives(), bvh.primitives());
    });
}

#[test]
fn nothing_there_and_back() {
    let mesh = TriangleMesh::new::<f32, u32>(&[], &[]).unwrap();
    let compact: CompactBvh8 = Builder::new().build_compact(&mesh).unwrap();
    there_and_back(&compact.over(&mesh).unwrap(), |bytes| {
        let opened = MeshBvh8::from_bytes(bytes).unwrap();
        assert_eq!(opened.closest_hit(&Ray::new([0.0; 3], [1.0; 3])), None);
    });
}

/// A file of a few triangles, and its mesh.
fn small() -> (Scene, Vec<u8>) {
    let scene = Scene::new(20);
    let compact: CompactBvh4 = Builder::new().build_compact(&scene.mesh()).unwrap();
    let bytes = compact.over(&scene.mesh()).unwrap().to_bytes().unwrap();
    (scene, bytes)
}

#[test]
fn one_byte_changed() {
    let (_, bytes) = small();
    let mut blocks = AlignedBytes::new(&bytes);
    for at in 0..bytes.len() {
        for change in [1, 0x80, 0xff] {
            blocks[at] ^= change;
            let opened = MeshBvh4::from_bytes(&blocks);
            assert!(opened.is_err(), "byte {at} changed by {change:#x}");
            blocks[at] ^= change;
        }
    }
    assert!(MeshBvh4::from_bytes(&blocks).is_ok());
}

/// What is changed and sealed again is no accident. It is opened or not, and if it is, it answers.
#[test]
fn one_byte_changed_and_sealed() {
    let (scene, bytes) = small();
    let (mut opened, mut refused) = (0, 0);
    for at in 0..bytes.len() {
        for change in [1, 0x10, 0x80, 0xff] {
            let mut changed = bytes.clone();
            changed[at] ^= change;
            seal(&mut changed);
            match MeshBvh4::from_bytes(&AlignedBytes::new(&changed)) {
                Ok(bvh) => {
                    opened += 1;
                    for ray in &scene.rays {
                        assert_eq!(bvh.any_hit(ray), bvh.closest_hit(ray).is_some(), "{at}");
                    }
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(opened > 1000 && refused > 1000, "{opened}, {refused}");
}

#[test]
fn cut_off() {
    let (_, bytes) = small();
    let blocks = AlignedBytes::new(&bytes);
    for len in 0..bytes.len() {
        assert!(MeshBvh4::from_bytes(&blocks[..len]).is_err());
    }
    let longer = [bytes.as_slice(), &[0; 64]].concat();
    let blocks = AlignedBytes::new(&longer);
    let opened = MeshBvh4::from_bytes(&blocks);
    assert_eq!(
        opened.err(),
        Some(BytesError::Length {
            expected: bytes.len() as u64,
            found: longer.len()
        })
    );
}

fn error<'a, N: WideNode, L: Open<'a>>(bytes: &'a [u8]) -> Option<BytesError> {
    Bvh::<N, L, Borrowed>::from_bytes(bytes).err()
}

#[test]
fn what_is_wrong_is_said() {
    let (scene, bytes) = small();
    let blocks = AlignedBytes::new(&bytes);
    let whole: &[u8] = &blocks;
    assert_eq!(
        error::<CompactNode8, RunLeaf>(whole),
        Some(BytesError::Nodes {
            expected: 4,
            found: 3
        })
    );
    assert_eq!(
        error::<CompactNode4, TriangleLeaf>(whole),
        Some(BytesError::Leaves {
            expected: 1,
            found: 3
        })
    );
    assert_eq!(
        error::<CompactNode4, RunLeaf>(&whole[..7]),
        Some(BytesError::NoHeader(7))
    );
    let changed = |at: usize, to: &[u8]| {
        let mut changed = bytes.clone();
        changed[at..at + to.len()].copy_from_slice(to);
        seal(&mut changed);
        let blocks = AlignedBytes::new(&changed);
        error::<CompactNode4, MeshLeaf>(&blocks)
    };
    assert_eq!(changed(0, b"x"), Some(BytesError::NotAHierarchy));
    // The byte order's mark, as the other kind of machine writes it.
    let swapped = 0x0102_0304_u32.swap_bytes().to_ne_bytes();
    assert_eq!(changed(8, &swapped), Some(BytesError::ByteOrder));
    assert_eq!(
        changed(12, &9_u32.to_ne_bytes()),
        Some(BytesError::Version(9))
    );
    // A tree without its mesh is not one over it.
    let compact: CompactBvh4 = Builder::new().build_compact(&scene.mesh()).unwrap();
    let tree = compact.to_bytes().unwrap();
    assert!(matches!(
        error::<CompactNode4, MeshLeaf>(&AlignedBytes::new(&tree)),
        Some(BytesError::MeshTooSmall(small)) if small.triangles == 0 && small.needed == 20
    ));
    // A full hierarchy has to be where its leaves may be.
    let full = Builder::new()
        .build(&scene.mesh())
        .unwrap()
        .to_bytes()
        .unwrap();
    for shift in [1, 4, 32] {
        let blocks = AlignedBytes::new(&[&[0; 64][..shift], full.as_slice()].concat());
        let shifted = &blocks[shift..];
        assert_eq!(
            error::<Node8, TriangleLeaf>(shifted),
            Some(BytesError::Misaligned { needed: 64 })
        );
    }
}

/// What was opened can be kept without the bytes, and refitted.
#[test]
fn opened_and_owned() {
    let scene = Scene::new(100);
    let mut moved = scene.positions.clone();
    moved.iter_mut().for_each(|[x, ..]| *x += 1.0);
    let moved = TriangleMesh::new(&moved, &scene.indices).unwrap();
    let builder = Builder::new().preset(Preset::Balanced);
    let mut built = builder.build(&scene.mesh()).unwrap();
    let bytes = AlignedBytes::new(&built.to_bytes().unwrap());
    let opened = Bvh::<Node8, TriangleLeaf, Borrowed>::from_bytes(&bytes).unwrap();
    let mut owned = opened.into_owned();
    drop(bytes);
    built.refit(&moved).unwrap();
    owned.refit(&moved).unwrap();
    for ray in &scene.rays {
        assert_eq!(bits(owned.closest_hit(ray)), bits(built.closest_hit(ray)));
    }
}

/// What a kind of hierarchy has none of, and what is kept for later, is 0.
#[test]
fn what_is_not_there_is_not_counted() {
    let (scene, _) = small();
    let full = Builder::new().build(&scene.mesh()).unwrap();
    let runs: CompactBvh8 = Builder::new().build_compact(&scene.mesh()).unwrap();
    let changed = |bytes: &[u8], place: usize| {
        let mut bytes = bytes.to_vec();
        bytes[place] ^= 1;
        seal(&mut bytes);
        bytes
    };
    let (full, runs) = (full.to_bytes().unwrap(), runs.to_bytes().unwrap());
    for (place, field) in [(36, "positions"), (40, "triangles"), (127, "reserved")] {
        let bytes = changed(&full, place);
        let opened = error::<Node8, TriangleLeaf>(&AlignedBytes::new(&bytes));
        assert_eq!(opened, Some(BytesError::NotZero(field)));
    }
    for (place, field) in [(28, "leaves"), (76, "reserved")] {
        let bytes = changed(&runs, place);
        let opened = error::<CompactNode8, RunLeaf>(&AlignedBytes::new(&bytes));
        assert_eq!(opened, Some(BytesError::NotZero(field)));
    }
}

/// A link has a node's place in units of 16 bytes: one that leads to the middle of a node is refused.
#[test]
fn a_link_to_the_middle_of_a_node() {
    let scene = Scene::new(500);
    let bvh: Bvh8 = Builder::new().build(&scene.mesh()).unwrap();
    let opened = |nodes: &[Node8]| {
        let (leaves, primitives) = (bvh.leaves(), bvh.primitives());
        Bvh::<Node8, TriangleLeaf, Borrowed>::from_parts(nodes, leaves, primitives, *bvh.bounds())
            .map(|_| ())
    };
    let mut nodes = bvh.nodes().to_vec();
    assert_eq!(opened(&nodes), Ok(()));
    // The links are the last 8 words of a node's 56; those of leaves have the highest bit set.
    let words: &mut [u32] = bytemuck::cast_slice_mut(&mut nodes);
    let link = (48..56).find(|&place| words[place] >> 31 == 0).unwrap();
    words[link] += 1;
    let lane = link - 48;
    assert_eq!(opened(&nodes), Err(LayoutError::Child { node: 0, lane }));
}
