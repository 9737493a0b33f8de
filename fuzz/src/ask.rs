//! Every query, in every way it can be asked, on every backend.

use wide_bvh::{
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Borrowed, Bvh, Order, PrimitiveLeaf, Runs, TriangleLeaf, TriangleLeaves, WideNode},
    primitive::{PrimitiveHit, Primitives},
    simd::Backend,
    traverse::Scratch,
};

/// A closest hit as bits, for -0 to differ from 0: t, u, v and the primitive.
pub type Found = Option<[u32; 4]>;

/// A hit as bits.
pub fn found(hit: Option<Hit>) -> Found {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive])
}

/// A hit on a caller's primitive, of no detail.
pub(crate) struct Primitive(pub Option<PrimitiveHit<()>>);

impl From<Primitive> for Found {
    fn from(hit: Primitive) -> Self {
        hit.0.map(|h| [h.t.to_bits(), 0, 0, h.primitive])
    }
}

/// What was answered for each ray.
#[derive(Debug)]
pub struct Answers {
    /// How it was asked.
    pub how: String,
    pub closest: Vec<Found>,
    pub any: Vec<bool>,
}

/// Asks for each ray's closest hit and any hit: one by one, with counts, in batches, in lent memory, in packets, of which
/// the rays that `active` has bits for and the others are asked in two calls.
pub(crate) fn ask<N: WideNode>(
    mut bvh: Bvh<N, TriangleLeaf, Borrowed>,
    rays: &[Ray],
    active: u64,
) -> Vec<Answers> {
    let mut answers = Vec::new();
    for backend in Backend::available() {
        bvh.set_backend(backend);
        let mut add = |how: &str, (closest, any): (Vec<Option<Hit>>, Vec<bool>)| {
            answers.push(Answers {
                how: format!("{how}, {} wide, {}", N::WIDTH, backend.name()),
                closest: closest.into_iter().map(found).collect(),
                any,
            });
        };
        bvh.set_looks_ahead(true);
        add("one by one, looking ahead", singles(&bvh, rays));
        add("counted, looking ahead", counted(&bvh, rays));
        bvh.set_looks_ahead(false);
        add("one by one", singles(&bvh, rays));
        add("counted", counted(&bvh, rays));
        add("a batch", batch(&bvh, rays));
        add("one lane", waves::<N, _, 1>(&bvh, rays));
        add("13 lanes", waves::<N, _, 13>(&bvh, rays));
        add("64 lanes", waves::<N, _, 64>(&bvh, rays));
        add("packets of 4", packets::<N, _, 4>(&bvh, rays, active));
        add("packets of 8", packets::<N, _, 8>(&bvh, rays, active));
        add("packets of 64", packets::<N, _, 64>(&bvh, rays, active));
        approximate(&bvh, rays);
    }
    answers
}

/// What is left of the contract where triangles are tested in `f32` alone: hits are in range and of the hierarchy's
/// triangles, and there is any just when there is a closest, by every call.
fn approximate<N: WideNode>(bvh: &Bvh<N, TriangleLeaf, Borrowed>, rays: &[Ray]) {
    let bvh = bvh.approximate();
    let (closest, any) = singles(&bvh, rays);
    let (batched, batched_any) = batch(&bvh, rays);
    for (place, ray) in rays.iter().enumerate() {
        let hits = [closest[place], batched[place]];
        for hit in hits.into_iter().flatten() {
            assert!(ray.t_min <= hit.t && hit.t <= ray.t_max, "{hit:?}, {ray:?}");
            assert!(hit.t.is_finite());
            assert!(bvh.primitives().contains(&hit.primitive));
        }
        let found = hits.map(|hit| hit.is_some());
        let all = [any[place], batched_any[place], found[0], found[1]];
        assert!(all == [all[0]; 4], "{all:?} of {ray:?}");
    }
}

fn singles<N: WideNode, L: TriangleLeaves>(
    bvh: &Bvh<N, L, Borrowed>,
    rays: &[Ray],
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let answer = |ray| (bvh.closest_hit(ray), bvh.any_hit(ray));
    rays.iter().map(answer).unzip()
}

fn counted<N: WideNode, L: TriangleLeaves>(
    bvh: &Bvh<N, L, Borrowed>,
    rays: &[Ray],
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let answer = |ray| (bvh.closest_hit_counted(ray).0, bvh.any_hit_counted(ray).0);
    rays.iter().map(answer).unzip()
}

fn batch<N: WideNode, L: TriangleLeaves>(
    bvh: &Bvh<N, L, Borrowed>,
    rays: &[Ray],
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut occluded) = unanswered(rays);
    bvh.closest_hits(rays, &mut hits);
    bvh.any_hits(rays, &mut occluded);
    (hits, occluded)
}

/// Room for answers, all of them wrong if no ray hits anything.
fn unanswered(rays: &[Ray]) -> (Vec<Option<Hit>>, Vec<bool>) {
    let wrong = Hit {
        t: f32::NAN,
        u: 0.0,
        v: 0.0,
        primitive: u32::MAX,
    };
    (vec![Some(wrong); rays.len()], vec![true; rays.len()])
}

fn waves<N: WideNode, L: TriangleLeaves, const LANES: usize>(
    bvh: &Bvh<N, L, Borrowed>,
    rays: &[Ray],
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut occluded) = unanswered(rays);
    // One piece of memory for both, which is not cleared between.
    let mut scratch = Box::new(Scratch::<LANES>::new());
    bvh.closest_hits_in(&mut scratch, rays, &mut hits);
    bvh.any_hits_in(&mut scratch, rays, &mut occluded);
    (hits, occluded)
}

fn packets<N: WideNode, L: TriangleLeaves, const RAYS: usize>(
    bvh: &Bvh<N, L, Borrowed>,
    rays: &[Ray],
    active: u64,
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut occluded) = (Vec::new(), Vec::new());
    for rays in rays.chunks(RAYS) {
        let packet: [Ray; RAYS] = core::array::from_fn(|lane| rays[lane % rays.len()]);
        let halves = [active, !active].map(|active| {
            let (hits, occluded) = (
                bvh.closest_hit_packet(&packet, active),
                bvh.any_hit_packet(&packet, active),
            );
            for lane in (0..RAYS).filter(|&lane| active >> lane & 1 == 0) {
                assert!(hits[lane].is_none() && !occluded[lane], "an inactive ray");
            }
            (hits, occluded)
        });
        for lane in 0..rays.len() {
            let (half_hits, half_occluded) = &halves[usize::from(active >> lane & 1 == 0)];
            hits.push(half_hits[lane]);
            occluded.push(half_occluded[lane]);
        }
    }
    (hits, occluded)
}

/// As [`ask`], of leaves that read a mesh, in a few ways.
pub(crate) fn ask_mesh<'a, N: WideNode, O: Order>(
    mut bvh: Bvh<N, Runs<TriangleMesh<'a>, O>, Borrowed<'a>>,
    rays: &[Ray],
) -> Vec<Answers> {
    let mut answers = Vec::new();
    for backend in Backend::available() {
        bvh.set_backend(backend);
        bvh.set_looks_ahead(true);
        let ahead = singles(&bvh, rays);
        bvh.set_looks_ahead(false);
        let asked = [
            ("one by one, looking ahead", ahead),
            ("one by one", singles(&bvh, rays)),
            ("counted", counted(&bvh, rays)),
            ("a batch", batch(&bvh, rays)),
            ("13 lanes", waves::<N, _, 13>(&bvh, rays)),
            ("packets of 8", packets::<N, _, 8>(&bvh, rays, u64::MAX)),
        ];
        answers.extend(asked.map(|(how, (closest, any))| Answers {
            how: format!("{how}, of a mesh, {} wide, {}", N::WIDTH, backend.name()),
            closest: closest.into_iter().map(found).collect(),
            any,
        }));
    }
    answers
}

/// As [`ask`], over a caller's primitives.
pub(crate) fn ask_primitives<N: WideNode>(
    mut bvh: Bvh<N, PrimitiveLeaf, Borrowed>,
    primitives: &dyn Primitives<Detail = ()>,
    rays: &[Ray],
) -> Vec<Answers> {
    let mut answers = Vec::new();
    for backend in Backend::available() {
        bvh.set_backend(backend);
        for (looks_ahead, how) in [(false, ""), (true, ", looking ahead")] {
            bvh.set_looks_ahead(looks_ahead);
            let closest = |ray: &Ray| Primitive(bvh.closest_hit(primitives, ray)).into();
            answers.push(Answers {
                how: format!("primitives, {} wide, {}{how}", N::WIDTH, backend.name()),
                closest: rays.iter().map(closest).collect(),
                any: rays
                    .iter()
                    .map(|ray| bvh.any_hit(primitives, ray))
                    .collect(),
            });
        }
    }
    answers
}
