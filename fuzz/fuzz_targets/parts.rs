//! Nodes, leaves and primitive numbers of any bytes, or of a hierarchy that was built and then spoilt, into the check; and
//! what passes it into every query.
//!
//! The check promises that queries read nothing out of bounds and come to an end; of answers it promises nothing, for it
//! does not know what is in a leaf. So here a hit that is found is one of a leaf's own triangles, and where that is in its
//! box, and so on up to the root, answers are those of the reference. Whatever passed, a refit makes it right.
#![no_main]

use arbitrary::Arbitrary;
use bytemuck::{Pod, cast_slice, pod_collect_to_vec, pod_read_unaligned};
use glam::Vec3;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Aabb, Ray},
    layout::{
        Borrowed, Bvh, ChildKind, Leaf, Node4, Node8, Owned, PrimitiveLeaf, TriangleLeaf, WideNode,
    },
    primitive::{Cuboids, Primitives},
    simd::Backend,
    traverse::sweep::{count_boxes, count_triangles},
};
use wide_bvh_fuzz::{
    Answers, BoxBytes, Float, Found, Mesh, MeshBytes, Move, RayBytes, Width, assert_all, boxes,
    change, copy, corners, moved, of_boxes, of_mesh, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    start: Start,
    wide: bool,
    edits: Vec<Edit>,
    moves: Vec<Move>,
    rays: Vec<RayBytes>,
}

#[derive(Arbitrary, Debug)]
enum Start {
    Triangles(MeshBytes, bool),
    Boxes(Vec<BoxBytes>),
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Part {
    Nodes,
    Leaves,
    Primitives,
    Bounds,
}

/// What is done to the bytes of a part.
#[derive(Arbitrary, Debug)]
enum Edit {
    Flip(Part, u16, u8),
    Word(Part, u16, u32),
    Float(Part, u16, Float),
    /// Of words: from, to, and how many.
    Copy(Part, u16, u16, u8),
    /// Of words: the first, and by how much each is more than it was.
    Add(Part, u16, u8, i8),
    Cut(Part, u16),
    Append(Part, Vec<u8>),
    /// So many times again.
    Repeat(Part, u8),
}

/// The bytes of each part.
struct Bytes([Vec<u8>; 4]);

impl Bytes {
    fn of<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>) -> Self {
        Self([
            cast_slice(bvh.nodes()).to_vec(),
            cast_slice(bvh.leaves()).to_vec(),
            cast_slice(bvh.primitives()).to_vec(),
            bytemuck::bytes_of(bvh.bounds()).to_vec(),
        ])
    }

    fn edit(&mut self, edit: &Edit) {
        let Self(parts) = self;
        match *edit {
            Edit::Flip(part, at, bits) => {
                let part = &mut parts[part as usize];
                let count = part.len().max(1);
                if let Some(byte) = part.get_mut(usize::from(at) % count) {
                    *byte ^= bits;
                }
            }
            Edit::Word(part, at, value) => change(&mut parts[part as usize], at, |_| value),
            Edit::Float(part, at, Float(value)) => {
                change(&mut parts[part as usize], at, |_| value.to_bits());
            }
            Edit::Copy(part, from, to, count) => copy(&mut parts[part as usize], from, to, count),
            Edit::Add(part, at, count, by) => {
                for i in 0..u16::from(count) {
                    change(&mut parts[part as usize], at.wrapping_add(i), |word| {
                        word.wrapping_add_signed(by.into())
                    });
                }
            }
            Edit::Cut(part, bytes) => {
                let part = &mut parts[part as usize];
                part.truncate(part.len().saturating_sub(bytes.into()));
            }
            Edit::Append(part, ref bytes) => parts[part as usize].extend(bytes),
            Edit::Repeat(part, times) => {
                let part = &mut parts[part as usize];
                if part.len() < 1 << 14 {
                    *part = part.repeat(1 + usize::from(times % 8));
                }
            }
        }
    }

    fn part<T: Pod>(&self, part: Part) -> Vec<T> {
        let bytes = &self.0[part as usize];
        pod_collect_to_vec(&bytes[..bytes.len() - bytes.len() % size_of::<T>()])
    }

    fn bounds(&self) -> Aabb {
        let mut bytes = self.0[Part::Bounds as usize].clone();
        bytes.resize(size_of::<Aabb>(), 0);
        pod_read_unaligned(&bytes)
    }
}

fuzz_target!(|input: Input| {
    match (&input.start, input.wide) {
        (Start::Triangles(mesh, fast), true) => triangles::<Node8>(&input, &mesh.mesh(), *fast),
        (Start::Triangles(mesh, fast), false) => triangles::<Node4>(&input, &mesh.mesh(), *fast),
        (Start::Boxes(bytes), true) => primitives::<Node8>(&input, &whole(bytes)),
        (Start::Boxes(bytes), false) => primitives::<Node4>(&input, &whole(bytes)),
    }
});

/// Those that are boxes.
fn whole(bytes: &[BoxBytes]) -> Vec<Aabb> {
    let mut boxes = boxes(bytes, 1);
    boxes.retain(|aabb| aabb.is_finite() && !aabb.is_empty());
    boxes
}

/// What passes the check, of the spoilt bytes.
fn passed<N: WideNode, L: Leaf>(
    start: &Bvh<N, L, Owned>,
    edits: &[Edit],
    rays: &[Ray],
) -> Option<Bvh<N, L, Owned>> {
    let mut bytes = Bytes::of(start);
    edits.iter().for_each(|edit| bytes.edit(edit));
    let (nodes, leaves) = (bytes.part::<N>(Part::Nodes), bytes.part::<L>(Part::Leaves));
    let (primitives, bounds) = (bytes.part(Part::Primitives), bytes.bounds());
    // Tests without a walk take any.
    for (backend, ray) in
        Backend::available().flat_map(|backend| rays.iter().map(move |ray| (backend, ray)))
    {
        let passed = count_boxes(backend, &nodes, &bounds, ray) as usize;
        assert!(passed <= N::WIDTH * nodes.len());
        let leaves = bytes.part::<TriangleLeaf>(Part::Leaves);
        assert!(count_triangles(backend, &leaves, ray) as usize <= 8 * leaves.len());
    }
    let borrowed = Bvh::<N, L, Borrowed>::from_parts(&nodes, &leaves, &primitives, bounds);
    let owned = Bvh::from_parts(nodes.clone(), leaves.clone(), primitives.clone(), bounds);
    match (borrowed, owned) {
        (Ok(borrowed), Ok(owned)) => {
            assert!(borrowed.root() == owned.root() && borrowed.bytes() == owned.bytes());
            Some(owned)
        }
        (borrowed, owned) => {
            assert_eq!(borrowed.err(), owned.err());
            None
        }
    }
}

/// Whether everything is in the boxes above it, `inside` being what is in a leaf.
fn boxes_hold<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>, inside: impl Fn(&L) -> Aabb) -> bool {
    let leaves: Vec<Aabb> = bvh.leaves().iter().map(inside).collect();
    let mut nodes = vec![Aabb::EMPTY; bvh.nodes().len()];
    let of = |child: ChildKind, nodes: &[Aabb]| match child {
        ChildKind::Empty => Aabb::EMPTY,
        ChildKind::Node(node) => nodes[node],
        ChildKind::Leaf(leaf) => leaves[leaf],
    };
    let mut hold = true;
    // Nodes come after the one that leads to them.
    for (index, node) in bvh.nodes().iter().enumerate().rev() {
        for lane in 0..N::WIDTH {
            let (inside, aabb) = (of(node.child(lane).kind(), &nodes), node.child_aabb(lane));
            hold &= aabb.join(inside) == aabb;
            nodes[index] = nodes[index].join(inside);
        }
    }
    let all = of(bvh.root().kind(), &nodes);
    hold && bvh.bounds().join(all) == *bvh.bounds()
}

fn triangles<N: Width>(input: &Input, mesh: &Mesh, fast: bool) {
    let preset = if fast { Preset::Fast } else { Preset::Best };
    let builder = Builder::new().preset(preset).drop_non_finite(true);
    let start = N::build(&builder, &mesh.view()).expect("a build");
    let most = if mesh.is_large() { 4 } else { 20 };
    let rays = rays(&input.rays, &mesh.corners(), most);
    let Some(mut bvh) = passed(&start, &input.edits, &rays) else {
        return;
    };
    let answers = N::ask(bvh.as_borrowed(), &rays, u64::MAX);
    let leaves = LeafTriangles::of(&bvh);
    for answers in &answers {
        leaves.assert_there(answers, &rays);
    }
    let inside = |leaf: &TriangleLeaf| {
        let places = leaf.primitives();
        let leaf = decode(leaf);
        Aabb::from_points(leaf.corners[..(places.end - places.start) as usize].concat())
    };
    if leaves.all_can_be_hit() && boxes_hold(&bvh, inside) {
        leaves.assert_closest(&answers, &rays);
    }
    assert!(!bvh.report().to_string().is_empty());

    let now = Mesh {
        positions: moved(&mesh.positions, &input.moves),
        ..mesh.clone()
    };
    if N::refit(&mut bvh, &now.view()).is_ok() {
        let truth = of_mesh(&now.view(), &rays);
        assert_all(&N::ask(bvh.as_borrowed(), &rays, u64::MAX), &rays, &truth);
    }
}

struct Decoded {
    corners: [[Vec3; 3]; 8],
}

/// A leaf's triangles, from its bytes: x, y and z of 8 vertices, then three corners of 8 triangles.
fn decode(leaf: &TriangleLeaf) -> Decoded {
    let bytes = bytemuck::bytes_of(leaf);
    let [x, y, z]: [[f32; 8]; 3] = pod_read_unaligned(&bytes[..96]);
    let lanes: [[u8; 8]; 3] = pod_read_unaligned(&bytes[96..120]);
    let vertex = |lane: u8| {
        let lane = usize::from(lane);
        Vec3::new(x[lane], y[lane], z[lane])
    };
    Decoded {
        corners: core::array::from_fn(|i| lanes.map(|corner| vertex(corner[i]))),
    }
}

/// The triangles of all leaves, in the order of their numbers.
struct LeafTriangles {
    numbers: Vec<u32>,
    mesh: Mesh,
    /// Those that can be hit.
    kept: Vec<bool>,
}

impl LeafTriangles {
    fn of<N: WideNode>(bvh: &Bvh<N, TriangleLeaf, Owned>) -> Self {
        let mut all: Vec<(u32, [Vec3; 3])> = Vec::new();
        for leaf in bvh.leaves() {
            let places = leaf.primitives();
            let numbers = &bvh.primitives()[places.start as usize..places.end as usize];
            all.extend(numbers.iter().copied().zip(decode(leaf).corners));
        }
        all.sort_by_key(|&(number, _)| number);
        let mesh = Mesh {
            positions: all
                .iter()
                .flat_map(|(_, corners)| corners.map(Vec3::into))
                .collect(),
            indices: (0..all.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
        };
        let builder = Builder::new().preset(Preset::Fast).drop_non_finite(true);
        let of_all = Node8::build(&builder, &mesh.view()).expect("a build");
        let mut kept = vec![false; all.len()];
        for &triangle in of_all.primitives() {
            kept[triangle as usize] = true;
        }
        Self {
            numbers: all.into_iter().map(|(number, _)| number).collect(),
            mesh,
            kept,
        }
    }

    fn all_can_be_hit(&self) -> bool {
        self.kept.iter().all(|&kept| kept)
    }

    /// Whether one of the triangles of that number is hit so.
    fn is_there(&self, ray: &Ray, [t, u, v, number]: [u32; 4]) -> bool {
        let first = self.numbers.partition_point(|&other| other < number);
        let last = self.numbers.partition_point(|&other| other <= number);
        (first..last).any(|place| {
            let one = Mesh {
                positions: self.mesh.positions.clone(),
                indices: vec![self.mesh.indices[place]],
            };
            !self.kept[place] || of_mesh(&one.view(), &[*ray]) == [Some([t, u, v, 0])]
        })
    }

    /// Every hit is one of a triangle there is.
    fn assert_there(&self, Answers { how, closest, any }: &Answers, rays: &[Ray]) {
        for ((ray, closest), any) in rays.iter().zip(closest).zip(any) {
            if let &Some(hit) = closest {
                assert!(self.is_there(ray, hit), "{how}: {hit:?}, {ray:?}");
                let t = f32::from_bits(hit[0]);
                assert!(ray.t_min <= t && t <= ray.t_max, "{how}: {t}, {ray:?}");
            }
            if *any && self.all_can_be_hit() {
                let truth = of_mesh(&self.mesh.view(), &[*ray]);
                assert!(truth[0].is_some(), "any hit, {how}: {ray:?}");
            }
        }
    }

    /// Every hit is the closest. Of triangles of one number at one distance it may be any.
    fn assert_closest(&self, answers: &[Answers], rays: &[Ray]) {
        let number = |[t, _, _, place]: [u32; 4]| [t, self.numbers[place as usize]];
        let truth = of_mesh(&self.mesh.view(), rays);
        let truth: Vec<Option<[u32; 2]>> = truth.into_iter().map(|hit| hit.map(number)).collect();
        for Answers { how, closest, any } in answers {
            let closest = closest
                .iter()
                .map(|hit| hit.map(|[t, _, _, number]| [t, number]));
            for (((ray, truth), closest), any) in rays.iter().zip(&truth).zip(closest).zip(any) {
                assert_eq!(closest, *truth, "{how}: {ray:?}");
                assert_eq!(*any, truth.is_some(), "any hit, {how}: {ray:?}");
            }
        }
    }
}

/// The primitives that leaves list, in the order of their numbers.
struct Listed<'a> {
    primitives: Cuboids<'a>,
    numbers: &'a [u32],
}

impl Primitives for Listed<'_> {
    type Detail = ();

    fn aabb(&self, place: u32) -> Aabb {
        self.primitives.aabb(self.numbers[place as usize])
    }

    fn intersect(&self, place: u32, ray: &Ray) -> Option<(f32, ())> {
        self.primitives.intersect(self.numbers[place as usize], ray)
    }
}

fn primitives<N: Width>(input: &Input, boxes: &[Aabb]) {
    let start = N::build_primitives(&Builder::new(), boxes).expect("a build");
    let rays = rays(&input.rays, &corners(boxes), 20);
    let Some(mut bvh) = passed(&start, &input.edits, &rays) else {
        return;
    };
    let primitives = Cuboids(boxes);
    let ids = |leaf: &PrimitiveLeaf| {
        let places = leaf.primitives();
        &bvh.primitives()[places.start as usize..places.end as usize]
    };
    let mut numbers: Vec<u32> = bvh.leaves().iter().flat_map(ids).copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let inside = |leaf: &PrimitiveLeaf| {
        let own = ids(leaf).iter().map(|&id| primitives.aabb(id));
        own.fold(Aabb::EMPTY, Aabb::join)
    };
    let hold = boxes_hold(&bvh, inside);
    let listed = Listed {
        primitives,
        numbers: &numbers,
    };
    let number = |[t, u, v, place]: [u32; 4]| [t, u, v, numbers[place as usize]];
    let truth: Vec<Found> = of_boxes(&listed, numbers.len(), &rays)
        .into_iter()
        .map(|hit| hit.map(number))
        .collect();
    let answers = N::ask_primitives(bvh.as_borrowed(), &primitives, &rays);
    for answers in &answers {
        for (any, truth) in answers.any.iter().zip(&truth) {
            assert!(!any || truth.is_some(), "{}", answers.how);
        }
    }
    if hold {
        assert_all(&answers, &rays, &truth);
    }
    assert!(!bvh.report().to_string().is_empty());
    if N::refit_primitives(&mut bvh, boxes).is_ok() {
        let truth = of_boxes(&primitives, boxes.len(), &rays);
        assert_all(
            &N::ask_primitives(bvh.as_borrowed(), &primitives, &rays),
            &rays,
            &truth,
        );
    }
}
