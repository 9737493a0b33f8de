//! Bytes of any content, put together as a file, or of a file that was written and then spoilt, into `from_bytes` for every
//! kind of nodes with every kind of leaves, sealed again or not, at any address; and what opens into every query.
//!
//! What was not spoilt has to give the reference's answers; of what was, any hit has to agree with closest hit where both
//! go the same way. Where bytes begin changes nothing, but that they may be misaligned there.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::{Builder, Preset},
    geometry::TriangleMesh,
    layout::{
        Aligned, BytesError, CompactNode4, CompactNode8, Node4, Node8, WideNode,
        bytes::{Header, seal},
    },
};
use wide_bvh_fuzz::{
    BoxBytes, Float, Mesh, MeshBytes, Opened, RayBytes, Width, assert_all, boxes, change, copy,
    corners, floats, of_mesh, open, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    start: Start,
    edits: Vec<Edit>,
    /// Whether the bytes become as many as their header tells of.
    fit: bool,
    seal: bool,
    /// By how much they are off a multiple of 64.
    shift: u8,
    mesh: MeshBytes,
    boxes: Vec<BoxBytes>,
    rays: Vec<RayBytes>,
}

#[derive(Arbitrary, Debug)]
enum Start {
    /// Any.
    Bytes(Vec<u8>),
    /// A header that fits the sections.
    Parts {
        nodes: u8,
        leaves: u8,
        bounds: [Float; 6],
        sections: [Vec<u8>; 5],
    },
    /// Of the mesh or the boxes.
    File { nodes: u8, leaves: u8, fast: bool },
}

/// What is done to bytes.
#[derive(Arbitrary, Debug)]
enum Edit {
    Flip(u16, u8),
    Word(u16, u32),
    Float(u16, Float),
    /// A word of the header.
    Field(u8, u32),
    /// What is added to one.
    Count(u8, i8),
    /// Of words: from, to, and how many.
    Copy(u16, u16, u8),
    /// Bytes that are taken out.
    Remove(u16, u8),
    /// Bytes that are put in.
    Insert(u16, Vec<u8>),
    Cut(u16),
    Append(Vec<u8>),
}

/// Where a header has the counts of nodes, leaves, primitives, positions and triangles.
const COUNTS: usize = 24;
/// Where it has the bounds.
const BOUNDS: usize = 48;
/// Bytes are few enough that a leaf a byte, each of all primitives, is still soon walked.
const MOST: usize = 1 << 14;

/// Bytes of an element of each section.
fn sizes(nodes: u8, leaves: u8) -> [usize; 5] {
    let nodes = [112, 224, 48, 80][usize::from(nodes % 4)];
    let ordered = leaves % 4 == 3;
    let leaves = [128, 8, 0, 0][usize::from(leaves % 4)];
    [nodes, leaves, if ordered { 0 } else { 4 }, 12, 12]
}

fn of_parts(nodes: u8, leaves: u8, bounds: [f32; 6], sections: &[Vec<u8>; 5]) -> Vec<u8> {
    let mut bytes = b"wide-bvh".to_vec();
    bytes.resize(size_of::<Header>(), 0);
    let mut put = |at: usize, word: u32| bytes[at..at + 4].copy_from_slice(&word.to_ne_bytes());
    put(8, 0x0102_0304);
    put(12, Header::VERSION);
    put(16, u32::from(nodes % 4) + 1);
    put(20, u32::from(leaves % 4) + 1);
    let sizes = sizes(nodes, leaves);
    let counts = [0, 1, 2, 3, 4].map(|i| sections[i].len().checked_div(sizes[i]).unwrap_or(0));
    for (i, count) in counts.into_iter().enumerate() {
        put(COUNTS + 4 * i, count as u32);
    }
    for (i, bound) in bounds.into_iter().enumerate() {
        put(BOUNDS + 4 * i, bound.to_bits());
    }
    for (i, section) in sections.iter().enumerate() {
        bytes.extend(&section[..counts[i] * sizes[i]]);
        bytes.resize(bytes.len().next_multiple_of(64), 0);
    }
    bytes
}

fn of_nodes<N: WideNode>(builder: &Builder, input: &Input, mesh: &Mesh, leaves: u8) -> Vec<u8> {
    let mesh = mesh.view();
    let compact = |builder: Builder| builder.build_compact::<N>(&mesh).expect("a build");
    let bytes = match leaves {
        1 => {
            let mut boxes = boxes(&input.boxes, 1);
            boxes.retain(|aabb| aabb.is_finite() && !aabb.is_empty());
            let bvh = builder.build_compact_primitives::<N>(&boxes);
            bvh.expect("a build").to_bytes()
        }
        2 => compact(*builder).to_bytes(),
        3 => compact(*builder).over(&mesh).expect("its mesh").to_bytes(),
        _ => {
            let uncut = compact(builder.splits(0.0));
            let (ordered, new) = uncut.reorder(&mesh).expect("its mesh");
            let mesh = TriangleMesh::new(&new.positions, &new.indices).expect("a mesh");
            match leaves {
                4 => ordered.to_bytes(),
                _ => ordered.over(&mesh).expect("its mesh").to_bytes(),
            }
        }
    };
    bytes.expect("few")
}

/// Those whose nodes are not compact have leaves of triangles and of primitives, too.
fn full<N: Width>(builder: &Builder, input: &Input, mesh: &Mesh, leaves: u8) -> Vec<u8> {
    let bytes = match leaves {
        0 => N::build(builder, &mesh.view()).expect("a build").to_bytes(),
        1 => {
            let mut boxes = boxes(&input.boxes, 1);
            boxes.retain(|aabb| aabb.is_finite() && !aabb.is_empty());
            let bvh = N::build_primitives(builder, &boxes);
            bvh.expect("a build").to_bytes()
        }
        _ => return of_nodes::<N>(builder, input, mesh, leaves),
    };
    bytes.expect("few")
}

fn edit(bytes: &mut Vec<u8>, edit: &Edit) {
    let len = bytes.len();
    let place = |at: u16| usize::from(at) % len.max(1);
    match *edit {
        Edit::Flip(at, bits) => {
            if let Some(byte) = bytes.get_mut(place(at)) {
                *byte ^= bits;
            }
        }
        Edit::Word(at, value) => change(bytes, at, |_| value),
        Edit::Float(at, Float(value)) => change(bytes, at, |_| value.to_bits()),
        Edit::Field(field, value) => change(bytes, u16::from(field % 32), |_| value),
        Edit::Count(count, by) => {
            let at = COUNTS as u16 / 4 + u16::from(count % 5);
            change(bytes, at, |word| word.wrapping_add_signed(by.into()));
        }
        Edit::Copy(from, to, count) => copy(bytes, from, to, count),
        Edit::Remove(at, count) => {
            let at = place(at);
            bytes.drain(at..(at + usize::from(count)).min(len));
        }
        Edit::Insert(at, ref more) => {
            let at = place(at);
            bytes.splice(at..at, more.iter().copied());
        }
        Edit::Cut(count) => bytes.truncate(len.saturating_sub(count.into())),
        Edit::Append(ref more) => bytes.extend(more),
    }
}

/// The bytes, and whether they are a file as it was written.
fn bytes(input: &Input, mesh: &Mesh) -> (Vec<u8>, bool) {
    let mut bytes = match input.start {
        Start::Bytes(ref bytes) => bytes.clone(),
        Start::Parts {
            nodes,
            leaves,
            bounds,
            ref sections,
        } => of_parts(nodes, leaves, floats(bounds), sections),
        Start::File {
            nodes,
            leaves,
            fast,
        } => {
            let preset = if fast { Preset::Fast } else { Preset::Best };
            let builder = Builder::new().preset(preset).drop_non_finite(true);
            let leaves = kind_of_leaves(nodes, leaves);
            match nodes % 4 {
                0 => full::<Node4>(&builder, input, mesh, leaves),
                1 => full::<Node8>(&builder, input, mesh, leaves),
                2 => of_nodes::<CompactNode4>(&builder, input, mesh, leaves),
                _ => of_nodes::<CompactNode8>(&builder, input, mesh, leaves),
            }
        }
    };
    let written = matches!(input.start, Start::File { .. }) && input.edits.is_empty();
    if written {
        return (bytes, true);
    }
    bytes.truncate(MOST);
    input.edits.iter().for_each(|e| edit(&mut bytes, e));
    bytes.truncate(MOST);
    if input.fit {
        // Its own error tells how many there should be, of which kinds alike.
        let kinds = open(&bytes, &[], &NOTHING.view(), &[]);
        for error in kinds.into_iter().filter_map(Result::err) {
            if let BytesError::Length { expected, .. } = error
                && expected <= MOST as u64
            {
                bytes.resize(expected as usize, 0);
            }
        }
    }
    if input.seal {
        seal(&mut bytes);
    }
    (bytes, false)
}

/// Which leaves a file has: 1 is those over boxes, 4 and 5 are over the mesh in their order, the others over the mesh. Compact
/// nodes have no 0, others no 4 and 5.
fn kind_of_leaves(nodes: u8, leaves: u8) -> u8 {
    match nodes % 4 {
        0 | 1 => leaves % 4,
        _ => (leaves % 6).max(1),
    }
}

const NOTHING: Mesh = Mesh {
    positions: Vec::new(),
    indices: Vec::new(),
};

/// `shift` bytes, then these, from a multiple of 64 on.
fn shifted(bytes: &[u8], shift: usize) -> Vec<Aligned<[u8; 64]>> {
    let all: Vec<u8> = vec![0xa5; shift]
        .into_iter()
        .chain(bytes.to_vec())
        .collect();
    let block = |chunk: &[u8]| {
        let mut block = Aligned([0; 64]);
        block.0[..chunk.len()].copy_from_slice(chunk);
        block
    };
    all.chunks(64).map(block).collect()
}

fn at(blocks: &[Aligned<[u8; 64]>], shift: usize, len: usize) -> &[u8] {
    assert!(shift + len <= 64 * blocks.len());
    // SAFETY: blocks of 64 bytes without padding, and so many of them.
    let all = unsafe { core::slice::from_raw_parts(blocks.as_ptr().cast::<u8>(), shift + len) };
    &all[shift..]
}

fuzz_target!(|input: Input| {
    let mesh = input.mesh.mesh();
    let (bytes, written) = bytes(&input, &mesh);
    let most = if mesh.is_large() { 4 } else { 20 };
    let boxes = boxes(&input.boxes, 1);
    let targets = [mesh.corners(), corners(&boxes)].concat();
    let rays = rays(&input.rays, &targets, most);
    let mesh: &TriangleMesh = &mesh.view();

    let blocks = shifted(&bytes, 0);
    let opened = open(at(&blocks, 0, bytes.len()), &rays, mesh, &boxes);
    // What has a mesh in it opens without that, too, and is then written without it.
    let again = |opened: &Opened| opened.bytes == bytes;
    assert!(!written || opened.iter().flatten().any(again));
    let shift = usize::from(input.shift % 64);
    let blocks = shifted(&bytes, shift);
    let elsewhere = open(at(&blocks, shift, bytes.len()), &rays, mesh, &boxes);
    for (here, there) in opened.iter().zip(&elsewhere) {
        match (here, there) {
            (Ok(here), Ok(there)) => {
                assert_eq!(here.primitives, there.primitives);
                assert_eq!(here.bytes, there.bytes);
            }
            (_, Err(BytesError::Misaligned { needed })) => assert_ne!(shift % needed, 0),
            (here, there) => assert_eq!(here.as_ref().err(), there.as_ref().err()),
        }
    }
    for opened in opened.iter().chain(&elsewhere).flatten() {
        check(opened, &rays);
        if written {
            let of_triangles = opened
                .answers
                .iter()
                .filter(|a| !a.how.contains("primitives"));
            let truth = of_mesh(mesh, &rays);
            let made_of_mesh = match input.start {
                Start::File { nodes, leaves, .. } => {
                    matches!(kind_of_leaves(nodes, leaves), 0 | 2 | 3)
                }
                _ => false,
            };
            for answers in of_triangles.filter(|_| made_of_mesh) {
                assert_all(core::slice::from_ref(answers), &rays, &truth);
            }
        }
    }
});

/// What holds of whatever opened.
fn check(opened: &Opened, rays: &[wide_bvh::geometry::Ray]) {
    for answers in &opened.answers {
        let same_way = ["one by one", "counted", "primitives"];
        let same_way = same_way.iter().any(|how| answers.how.starts_with(how));
        for ((ray, closest), any) in rays.iter().zip(&answers.closest).zip(&answers.any) {
            if same_way {
                assert_eq!(*any, closest.is_some(), "{}: {ray:?}", answers.how);
            }
            if let Some([t, _, _, primitive]) = closest {
                let t = f32::from_bits(*t);
                let within = ray.t_min <= t && t <= ray.t_max;
                assert!(
                    within || answers.how.starts_with("primitives"),
                    "{}: {t}",
                    answers.how
                );
                let is_there = match &opened.primitives[..] {
                    [] => (*primitive as usize) < opened.count,
                    list => list.contains(primitive),
                };
                assert!(is_there, "{}", answers.how);
            }
        }
    }
}
