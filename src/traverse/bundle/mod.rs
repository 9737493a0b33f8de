//! Rays of about one origin and one direction, side by side through the tree.
//!
//! A node is tested once for all of them, by intervals; a child that any of them may meet is tested again for each, eight or
//! sixteen rays at a time, unless the intervals say that all pass; and so are the triangles of a leaf that is left. Where few
//! are left, each is tested by itself, against all children at once. The camera's rays, and shadow rays towards one light,
//! share most of their way.
//!
//! After Reshetov, Soupikov, Hurley, "Multi-level ray tracing algorithm" (2005), and Overbeck, Ramamoorthi, Mark, "Large ray
//! packets for real-time Whitted ray tracing" (2008): the rays that a node is for are kept as a mask. One by one: Barringer and
//! Akenine-Möller, "Dynamic ray stream traversal" (2014).

mod leaf;
mod packet;
mod shears;
mod tightness;
mod ways;

pub(super) use self::tightness::Tightness;

use self::{
    packet::Packet,
    ways::{Entry, Ways, insert},
};
use super::{query::Query, triangles::Found};
use crate::{
    geometry::{Aabb, Ray},
    layout::{Bvh, Child, Link, STACK, Storage, TriangleLeaves, WideNode},
    primitive::triangle::bits,
    simd::{Lanes, Operation, PacketOperation, Simd, Vector, splat3},
    slab::{
        BundlePasses, BundleSlabs, Bundling, MAX_EXTENT, Passing, PreparedRay, least, most, passing,
    },
};
use core::mem::MaybeUninit;
use glam::Vec3;

/// The most rays of a bundle: a bit each.
pub(super) const RAYS: usize = 64;
/// The most packets: no less than eight rays are tested at a time.
const PACKETS: usize = RAYS / 8;
/// No more rays than this at a node are tested one by one, against all children at once.
const FEW_AT_NODE: u32 = 12;
/// The same of a bundle that is one packet: all of it takes hardly more than one of its rays.
const FEW_OF_A_PACKET: u32 = 3;
/// How far apart the rays of a bundle may go, across for one along their largest component.
const SPREAD: f32 = 0.5;

/// From so many tests a ray on a loose bundle is given up: before, it cannot be told.
const TRIED: usize = 1;
/// From so many on it is not: most is done.
const DONE: usize = 4;

/// Rays under way.
struct Bundle<'a, const LANES: usize, V> {
    rays: &'a [Ray],
    axes: &'static [usize; 3],
    slabs: BundleSlabs,
    /// Those below `count` were written. Lanes past the last ray repeat the first.
    packets: [MaybeUninit<Packet<LANES, V>>; PACKETS],
    count: usize,
    /// The greatest of the packets'.
    far: f32,
    /// Those that look on.
    looking: u64,
    /// Those that have found something.
    found: u64,
    tightness: Tightness,
}

/// What has come of a bundle.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The rays are not alike: nothing was done.
    Unlike,
    /// Their ways part so soon that each by itself is as fast: nothing has come of it.
    GivenUp,
    /// The same, but all are traced.
    Loose,
    /// The rays are traced.
    Tight,
}

impl Outcome {
    /// Whether all answers are there.
    pub(super) fn is_traced(self) -> bool {
        matches!(self, Self::Loose | Self::Tight)
    }
}

/// Traces rays, no more than [`RAYS`], of which there are as many as answers, if they are alike. `before` is of the bundles
/// traced before, and then of this one, too.
#[inline(always)]
pub(super) fn trace<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    before: &mut Tightness,
) -> Outcome {
    // By a call: the stack that it takes is given back before waves take theirs.
    bvh.backend().call(Trace::<N, L, S, Q> {
        bvh,
        rays,
        answers,
        before,
    })
}

/// The same of no more than eight rays.
#[inline(always)]
pub(super) fn trace_eight<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    token: T,
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) -> Outcome {
    let before = &mut Tightness::default();
    let trace = Trace::<N, L, S, Q> {
        bvh,
        rays,
        answers,
        before,
    };
    PacketOperation::run::<8, T::F32x8>(trace, token)
}

/// [`trace`].
struct Trace<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    before: &'a mut Tightness,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> Operation for Trace<'_, N, L, S, Q> {
    type Output = Outcome;

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> Outcome {
        token.in_packets(self)
    }
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> PacketOperation
    for Trace<'_, N, L, S, Q>
{
    type Output = Outcome;

    #[inline(always)]
    fn run<const LANES: usize, V: Vector<LANES>>(self, token: V::Token) -> Outcome {
        let Self {
            bvh,
            rays,
            answers,
            before,
        } = self;
        if bvh.root() == Child::EMPTY {
            return Outcome::Unlike;
        }
        let Some(mut bundle) = Bundle::<LANES, V>::new(token, bvh.bounds(), rays) else {
            return Outcome::Unlike;
        };
        let traced = bundle.walk::<N, L, S, Q>(token, bvh);
        *before = before.with(bundle.tightness);
        if !traced {
            return Outcome::GivenUp;
        }
        for (index, answers) in answers.chunks_mut(LANES).enumerate() {
            let found = bundle.found >> (LANES * index);
            let shears = &bundle.packet(index).shears;
            let (t, u, v) = (
                shears.t_max.to_array(),
                shears.u.to_array(),
                shears.v.to_array(),
            );
            let places = shears.places.to_array();
            for (lane, answer) in answers.iter_mut().enumerate() {
                let lane = lane % LANES;
                *answer = if found >> lane & 1 == 0 {
                    Q::MISS
                } else {
                    let found = Found {
                        t: t[lane],
                        u: u[lane],
                        v: v[lane],
                        place: places[lane].to_bits() as usize,
                    };
                    Q::answer(found, bvh.primitives())
                };
            }
        }
        // Where there are waves they are faster then.
        if bundle.tightness.is_loose() || V::Token::INTERLEAVES && before.is_loose_on_the_whole() {
            Outcome::Loose
        } else {
            Outcome::Tight
        }
    }
}

/// About where rays are closest to one another: at an origin, or, as shadow rays of one light are, at an end within the
/// bounds.
#[inline(always)]
fn crossing(rays: &[Ray], bounds: &Aabb) -> Vec3 {
    let (Some(first), Some(last)) = (rays.first(), rays.last()) else {
        return Vec3::ZERO;
    };
    let [end, last_end] = [first, last].map(|ray| ray.origin + ray.direction * ray.t_max);
    let is_within = end.max(bounds.min).min(bounds.max) == end;
    let between_origins = first.origin.distance_squared(last.origin);
    if is_within && end.distance_squared(last_end) < between_origins {
        end
    } else {
        first.origin
    }
}

/// How many children of `nodes`, all within `bounds`, a bundle of the rays may pass the boxes of, if there is such a bundle.
#[inline(always)]
pub(super) fn count_boxes<T: Simd, N: WideNode>(
    token: T,
    nodes: &[N],
    bounds: &Aabb,
    rays: &[Ray],
) -> Option<u32> {
    if rays.len() > RAYS {
        return None;
    }
    let bundle = Bundle::<8, T::F32x8>::new(token, bounds, rays)?;
    let far = N::Lanes::<T>::splat(token, bundle.far);
    let mut passed = 0;
    for node in nodes {
        let BundlePasses { any, .. } = node.test_bundle(token, &bundle.slabs, far);
        passed += any.count_ones();
    }
    Some(passed)
}

impl<'a, const LANES: usize, V: Vector<LANES>> Bundle<'a, LANES, V> {
    /// `None` if the rays are not alike, or one of them is out of the ordinary, or all is too far away.
    #[inline(always)]
    fn new(token: V::Token, bounds: &Aabb, rays: &'a [Ray]) -> Option<Self> {
        const { assert!(RAYS / LANES <= PACKETS) };
        let first = rays.first()?;
        let mut room = PreparedRay::ROOM;
        let prepared = PreparedRay::new(first, &mut room)?;
        let axes = prepared.axes;
        let count = rays.len().div_ceil(LANES).min(PACKETS);
        let mut packets = [const { MaybeUninit::uninit() }; PACKETS];
        let nothing = V::splat(token, f32::NEG_INFINITY);
        let (mut extent, mut far) = (nothing, nothing);
        let mut start = V::splat(token, f32::INFINITY);
        // Of the slopes and the slopes' negatives.
        let mut steepest = [[nothing; 2]; 2];
        for index in 0..count {
            let (packet, extents, starts) =
                Packet::new(token, bounds, &rays[LANES * index..], &prepared)?;
            extent = extent.max(extents);
            start = start.min(starts);
            far = far.max(packet.far);
            let ([x, y], zero) = (packet.shears.slope, V::splat(token, 0.0));
            let [up, down] = &mut steepest;
            *up = [up[0].max(x), up[1].max(y)];
            *down = [down[0].max(zero - x), down[1].max(zero - y)];
            packets[index].write(packet);
        }
        let extent = most(extent);
        let spread = |axis: usize| most(steepest[0][axis]) + most(steepest[1][axis]);
        if !(extent < MAX_EXTENT && spread(0) <= SPREAD && spread(1) <= SPREAD) {
            return None;
        }
        let mut bundling = Bundling::new(token, crossing(rays, bounds), extent);
        for packet in &packets[..count] {
            // SAFETY: just written.
            let Packet { slabs, shears, .. } = unsafe { packet.assume_init_ref() };
            bundling.add(token, shears.origin, slabs.reciprocals());
        }
        Some(Self {
            rays,
            axes,
            slabs: bundling.finish(first.direction, least(start)),
            packets,
            count,
            far: most(far),
            looking: u64::MAX >> (RAYS - rays.len().min(RAYS)),
            found: 0,
            tightness: Tightness::default(),
        })
    }

    #[inline(always)]
    fn packet(&mut self, index: usize) -> &mut Packet<LANES, V> {
        debug_assert!(index < self.count);
        // SAFETY: callers' indices are below `count`, and those were written.
        unsafe { self.packets.get_unchecked_mut(index).assume_init_mut() }
    }

    /// Finds what all rays find, unless that is given up.
    #[inline(always)]
    fn walk<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: V::Token,
        bvh: &Bvh<N, L, S>,
    ) -> bool {
        let direction = self.rays[0].direction;
        let few = match self.count {
            1 => FEW_OF_A_PACKET,
            _ => FEW_AT_NODE,
        };
        let given_up_at = TRIED * self.rays.len()..DONE * self.rays.len();
        let mut ways: Ways = [MaybeUninit::uninit(); STACK];
        let mut len = 0;
        let mut current = Link::new::<N>(bvh.root());
        let mut rays = self.looking;
        loop {
            if current.is_leaf() {
                // SAFETY: the layout's check saw that all leaves led to are there.
                let leaf = unsafe { bvh.leaf(current.leaf()) };
                self.test_leaf::<Q>(token, leaf, bvh.primitives(), rays);
            } else {
                // SAFETY: the layout's check saw that all nodes led to are there.
                bvh.prefetch_leaves(token, unsafe { bvh.node(current) });
                if rays.count_ones() <= few {
                    self.test_one_by_one::<N, L, S, Q>(
                        token, bvh, current, rays, &mut ways, &mut len,
                    );
                } else {
                    self.test_together(token, bvh, current, rays, &mut ways, &mut len);
                }
            }
            // The last child left behind that any of its rays passes, with as near as they have come.
            loop {
                if len == 0 {
                    return true;
                }
                len -= 1;
                // SAFETY: those below the length were written.
                let entry = unsafe { ways.get_unchecked(len).assume_init() };
                current = entry.link;
                rays = entry.rays & self.looking;
                if rays == 0 || self.far < entry.near {
                    continue;
                }
                if entry.lane == Entry::TESTED {
                    break;
                }
                // Those that have found something may look less far.
                if entry.by_all && self.found & rays == 0 {
                    let (tests, passes) = (packets_of::<LANES>(rays), rays.count_ones());
                    self.tightness.add::<LANES>(tests, passes);
                } else {
                    // SAFETY: it was walked through.
                    let parent = unsafe { bvh.node(entry.parent) };
                    let [near, far] = parent.child_planes(entry.lane as usize, direction);
                    rays = self.passing(token, near, far, rays);
                }
                if rays != 0 {
                    if given_up_at.contains(&self.tightness.tests()) && self.tightness.is_loose() {
                        return false;
                    }
                    break;
                }
            }
        }
    }

    /// Adds the children of a node that any of the rays may pass, by intervals. Which do is still to be tested.
    #[inline(always)]
    fn test_together<N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        token: V::Token,
        bvh: &Bvh<N, L, S>,
        current: Link,
        rays: u64,
        ways: &mut Ways,
        len: &mut usize,
    ) {
        // SAFETY: the layout's check saw that all nodes led to are there.
        let node = unsafe { bvh.node(current) };
        let far = N::Lanes::<V::Token>::splat(token, self.far);
        let BundlePasses { any, all, near } = node.test_bundle(token, &self.slabs, far);
        let near = near.to_array();
        let base = *len;
        for lane in bits(any) {
            // SAFETY: `any` has bits for the node's lanes alone, `near` is of as many. The layout's check saw that a walk leaves
            // less than `STACK` children behind, so there is room for the one that it goes on to.
            unsafe {
                let entry = Entry {
                    link: node.link(lane),
                    near: *near.as_ref().get_unchecked(lane),
                    parent: current,
                    lane: lane as u8,
                    by_all: all >> lane & 1 != 0,
                    rays,
                };
                insert(token, bvh, ways, base, len, entry);
            }
        }
    }

    /// Adds the children of a node that any of the rays passes, for those that do.
    #[inline(always)]
    fn test_one_by_one<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: V::Token,
        bvh: &Bvh<N, L, S>,
        current: Link,
        rays: u64,
        ways: &mut Ways,
        len: &mut usize,
    ) {
        // SAFETY: the layout's check saw that all nodes led to are there.
        let node = unsafe { bvh.node(current) };
        // Of compact nodes worked out, and so once for all.
        let planes = node.planes(token, &self.slabs);
        let mut halves = [Passing::<N::Lanes<V::Token>>::none(token); 2];
        const { assert!(RAYS == 2 * passing::RAYS) };
        for (half, passing) in halves.iter_mut().enumerate() {
            let first = half * passing::RAYS;
            for ray in bits((rays >> first) as u32) {
                let packet = self.packet((first + ray) / LANES);
                N::test_one_of::<LANES, V>(
                    &planes,
                    token,
                    &packet.slabs,
                    &packet.far,
                    ray,
                    passing,
                );
            }
        }
        let mut children = node.present(halves[0].children() | halves[1].children());
        let (low, high) = (halves[0].rays(), halves[1].rays());
        let nears = (halves[0].near(), halves[1].near());
        let base = *len;
        while children != 0 {
            // If no nearest one is looked for, the first, which is the largest, comes next.
            let lane = children.ilog2() as usize % N::WIDTH;
            children &= !(1 << lane);
            let near = if Q::CLOSEST {
                nears.0.as_ref()[lane].min(nears.1.as_ref()[lane])
            } else {
                f32::NEG_INFINITY
            };
            let [low, high] = [low.as_ref()[lane], high.as_ref()[lane]].map(f32::to_bits);
            // SAFETY: `children` has bits for the node's lanes alone. As above, there is room.
            unsafe {
                let entry = Entry {
                    link: node.link(lane),
                    near,
                    parent: current,
                    lane: Entry::TESTED,
                    by_all: false,
                    rays: u64::from(high) << 32 | u64::from(low),
                };
                insert(token, bvh, ways, base, len, entry);
            }
        }
    }

    /// Which of the rays pass a box, given by the planes that they meet first and those they meet last.
    #[inline(always)]
    fn passing(&mut self, token: V::Token, near: [f32; 3], far: [f32; 3], rays: u64) -> u64 {
        let (near, far) = (splat3(token, near), splat3(token, far));
        let (mut passing, mut tests) = (0, 0);
        let mut left = rays;
        while let Some(index) = first_packet::<LANES>(&mut left) {
            let packet = self.packet(index);
            let (hit, _) = packet.slabs.between(near, far, packet.far);
            tests += 1;
            passing |= u64::from(hit.bits()) << (LANES * index);
        }
        passing &= rays;
        self.tightness.add::<LANES>(tests, passing.count_ones());
        passing
    }
}

/// How many packets have any of the rays.
#[inline(always)]
fn packets_of<const LANES: usize>(rays: u64) -> u32 {
    // Each packet's bits brought down to its lowest.
    let (mut ones, mut step) = (rays, LANES / 2);
    while step > 0 {
        ones |= ones >> step;
        step /= 2;
    }
    (ones & (u64::MAX / packet_mask::<LANES>())).count_ones()
}

/// The rays of the first packet.
#[inline(always)]
const fn packet_mask<const LANES: usize>() -> u64 {
    const { assert!(LANES.is_power_of_two() && LANES < RAYS) };
    (1 << LANES) - 1
}

/// The first packet that has any of the rays. Takes its rays from them.
#[inline(always)]
fn first_packet<const LANES: usize>(rays: &mut u64) -> Option<usize> {
    if *rays == 0 {
        return None;
    }
    let index = rays.trailing_zeros() as usize / LANES;
    *rays &= !(packet_mask::<LANES>() << (LANES * index));
    Some(index)
}
