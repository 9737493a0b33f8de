//! Rays of about one origin and one direction, side by side through the tree.
//!
//! A node is tested once for all of them, by intervals; a child that any of them may meet is tested again for each, eight
//! rays at a time; and so are the triangles of a leaf that is left. The camera's rays, and shadow rays towards one light,
//! share most of their way.
//!
//! After Reshetov, Soupikov, Hurley, "Multi-level ray tracing algorithm" (2005), and Overbeck, Ramamoorthi, Mark, "Large ray
//! packets for real-time Whitted ray tracing" (2008): the rays that a node is for are kept as a mask.

use super::{query::Query, triangles::Found};
use crate::{
    geometry::{Aabb, Ray},
    layout::{Bvh, Child, Link, STACK, Storage, TriangleLeaves, Triangles, WideNode},
    primitive::{
        exact::{Pair, Pairs},
        triangle::{Along, Edges, RayShear, Sheared, bits},
    },
    simd::{Lanes, Simd, Vector, load_all, splat3},
    slab::{BundleSlabs, Bundling, MAX_EXTENT, PreparedRay, RaySlabs, most, reach, reciprocals},
};
use core::mem::MaybeUninit;
use glam::Vec3;

/// The most rays of a bundle: a bit each.
pub(super) const RAYS: usize = 64;
/// Rays tested at a time.
const LANES: usize = 8;
const PACKETS: usize = RAYS / LANES;
/// No more rays than this of a packet at a leaf are tested one by one.
const FEW: u32 = 2;
/// How far apart the rays of a bundle may go, across for one along their largest component.
const SPREAD: f32 = 0.5;

/// A bundle is loose if fewer rays, in eighths, pass a box for each test of a packet: of the eight that are tested at once
/// hardly one goes on. Waves are faster then.
const LEAST_PASSES: usize = 9;
/// From so many tests a ray on a loose bundle is given up: before, it cannot be told.
const TRIED: usize = 1;
/// From so many on it is not: most is done.
const DONE: usize = 4;

/// A number of each ray of a packet.
type V<T> = <T as Simd>::F32x8;

/// Eight rays.
struct Packet<T: Simd> {
    origin: [V<T>; 3],
    slabs: RaySlabs<LANES, V<T>>,
    /// Up to which `t` boxes are of interest: `t_max` and the margin.
    far: V<T>,
    along: Along<V<T>>,
    slope: [V<T>; 2],
    /// The best hits so far, in the lanes that have one.
    t_max: V<T>,
    u: V<T>,
    v: V<T>,
    /// Their places in the list of primitive numbers, as bits.
    places: V<T>,
}

/// Rays under way.
struct Bundle<'a, T: Simd> {
    rays: &'a [Ray],
    axes: &'static [usize; 3],
    slabs: BundleSlabs,
    /// Those below `count` were written. Lanes past the last ray repeat the first.
    packets: [MaybeUninit<Packet<T>>; PACKETS],
    count: usize,
    /// The greatest of the packets'.
    far: f32,
    /// Those that look on.
    looking: u64,
    /// Those that have found something.
    found: u64,
    /// How many boxes packets were tested against.
    tests: usize,
    /// How many boxes of those each ray passed, in all.
    passes: usize,
}

/// A child to go to, for some of the rays.
#[derive(Clone, Copy)]
struct Entry {
    link: Link,
    near: f32,
    /// The node whose child it is.
    parent: Link,
    lane: u32,
    rays: u64,
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

/// Traces rays, no more than [`RAYS`], of which there are as many as answers, if they are alike.
#[inline(always)]
pub(super) fn trace<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    token: T,
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) -> Outcome {
    if bvh.root() == Child::EMPTY {
        return Outcome::Unlike;
    }
    let Some(mut bundle) = Bundle::<T>::new(token, bvh.bounds(), rays) else {
        return Outcome::Unlike;
    };
    if !bundle.walk::<N, L, S, Q>(token, bvh) {
        return Outcome::GivenUp;
    }
    let packets = rays.chunks(LANES).zip(answers.chunks_mut(LANES));
    for (index, (rays, answers)) in packets.enumerate() {
        let found = bundle.found >> (LANES * index);
        let packet = bundle.packet(index);
        let (t, u, v) = (
            packet.t_max.to_array(),
            packet.u.to_array(),
            packet.v.to_array(),
        );
        let places = packet.places.to_array();
        for (lane, (ray, answer)) in rays.iter().zip(answers).enumerate() {
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
                Q::answer(found, ray, bvh.primitives())
            };
        }
    }
    if bundle.is_loose() {
        Outcome::Loose
    } else {
        Outcome::Tight
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
    let bundle = Bundle::<T>::new(token, bounds, rays)?;
    let far = N::Lanes::<T>::splat(token, bundle.far);
    let mut passed = 0;
    for node in nodes {
        let (hit, _) = node.test_bundle(token, &bundle.slabs, far);
        passed += hit.count_ones();
    }
    Some(passed)
}

impl<'a, T: Simd> Bundle<'a, T> {
    /// `None` if the rays are not alike, or one of them is out of the ordinary, or all is too far away.
    #[inline(always)]
    fn new(token: T, bounds: &Aabb, rays: &'a [Ray]) -> Option<Self> {
        let first = rays.first()?;
        let mut room = PreparedRay::ROOM;
        let prepared = PreparedRay::new(first, &mut room)?;
        let axes = prepared.axes;
        let count = rays.len().div_ceil(LANES).min(PACKETS);
        let mut packets = [const { MaybeUninit::uninit() }; PACKETS];
        let nothing = V::<T>::splat(token, f32::NEG_INFINITY);
        let (mut extent, mut far) = (nothing, nothing);
        // Of the slopes and the slopes' negatives.
        let mut steepest = [[nothing; 2]; 2];
        for index in 0..count {
            let (packet, extents) = Packet::new(token, bounds, &rays[LANES * index..], &prepared)?;
            extent = extent.max(extents);
            far = far.max(packet.far);
            let ([x, y], zero) = (packet.slope, V::<T>::splat(token, 0.0));
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
            let Packet { origin, slabs, .. } = unsafe { packet.assume_init_ref() };
            bundling.add(token, *origin, slabs.reciprocals(), slabs.t_min());
        }
        Some(Self {
            rays,
            axes,
            slabs: bundling.finish(first.direction),
            packets,
            count,
            far: most(far),
            looking: u64::MAX >> (RAYS - rays.len().min(RAYS)),
            found: 0,
            tests: 0,
            passes: 0,
        })
    }

    #[inline(always)]
    fn packet(&mut self, index: usize) -> &mut Packet<T> {
        debug_assert!(index < self.count);
        // SAFETY: callers' indices are below `count`, and those were written.
        unsafe { self.packets.get_unchecked_mut(index).assume_init_mut() }
    }

    #[inline(always)]
    fn is_loose(&self) -> bool {
        8 * self.passes < LEAST_PASSES * self.tests
    }

    /// Finds what all rays find, unless that is given up.
    #[inline(always)]
    fn walk<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
    ) -> bool {
        let nodes = bvh.nodes().as_ptr();
        let direction = self.rays[0].direction;
        let given_up_at = TRIED * self.rays.len()..DONE * self.rays.len();
        let mut stack = [MaybeUninit::<Entry>::uninit(); STACK];
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
                let node = unsafe { &*nodes.byte_add(current.node_offset()) };
                let far = N::Lanes::<T>::splat(token, self.far);
                let (hit, near) = node.test_bundle(token, &self.slabs, far);
                let near = near.to_array();
                let base = len;
                for lane in bits(hit) {
                    // SAFETY: `hit` has bits for the node's lanes alone, `near` is of as many.
                    let (link, near) = unsafe {
                        let link = node.link(lane);
                        (link, *near.as_ref().get_unchecked(lane))
                    };
                    token.prefetch(if link.is_leaf() {
                        bvh.leaf_address(link.leaf())
                    } else {
                        nodes.wrapping_byte_add(link.node_offset()).cast()
                    });
                    let entry = Entry {
                        link,
                        near,
                        parent: current,
                        lane: lane as u32,
                        rays,
                    };
                    // SAFETY: the layout's check saw that a walk leaves less than `STACK` children behind, so there is
                    // room for the one that it goes on to; those from `base` to `len` were just written.
                    unsafe { insert(&mut stack, base, len, entry) };
                    len += 1;
                }
            }
            // The last child left behind that any of its rays passes, with as near as they have come.
            loop {
                if len == 0 {
                    return true;
                }
                len -= 1;
                // SAFETY: those below the length were written.
                let entry = unsafe { stack.get_unchecked(len).assume_init() };
                current = entry.link;
                rays = entry.rays & self.looking;
                if entry.near <= self.far && rays != 0 {
                    // SAFETY: it was walked through.
                    let parent = unsafe { &*nodes.byte_add(entry.parent.node_offset()) };
                    let [near, far] = parent.child_planes(entry.lane as usize, direction);
                    rays = self.passing(token, near, far, rays);
                    if rays != 0 {
                        if given_up_at.contains(&self.tests) && self.is_loose() {
                            return false;
                        }
                        break;
                    }
                }
            }
        }
    }

    /// Which of the rays pass a box, given by the planes that they meet first and those they meet last.
    #[inline(always)]
    fn passing(&mut self, token: T, near: [f32; 3], far: [f32; 3], rays: u64) -> u64 {
        let (near, far) = (splat3(token, near), splat3(token, far));
        let (mut passing, mut tests) = (0, 0);
        let mut left = rays;
        while let Some(index) = first_packet(&mut left) {
            let packet = self.packet(index);
            let (hit, _) = packet.slabs.between(near, far, packet.far);
            tests += 1;
            passing |= u64::from(hit.bits()) << (LANES * index);
        }
        passing &= rays;
        self.tests += tests;
        self.passes += passing.count_ones() as usize;
        passing
    }

    /// Tests the leaf's triangles for some of the rays.
    #[inline(always)]
    fn test_leaf<Q: Query>(
        &mut self,
        token: T,
        leaf: impl Triangles,
        primitives: &[u32],
        rays: u64,
    ) {
        let mut closer = 0;
        let mut left = rays;
        while let Some(index) = first_packet(&mut left) {
            let lanes = u32::from((rays >> (LANES * index)) as u8);
            let found = u32::from((self.found >> (LANES * index)) as u8);
            let (axes, of_packet) = (self.axes, &self.rays[LANES * index..]);
            let packet = self.packet(index);
            let new = if lanes.count_ones() <= FEW {
                packet.test_by_ray::<Q>(token, leaf, primitives, lanes, found, of_packet, axes)
            } else {
                packet.test_leaf::<Q, _>(token, leaf, primitives, lanes, found, of_packet, axes)
            };
            packet.far = reach(token, packet.t_max, packet.slabs.margins());
            closer |= u64::from(new) << (LANES * index);
        }
        self.found |= closer;
        if !Q::CLOSEST {
            self.looking &= !closer;
        } else if closer != 0 {
            let mut far = V::<T>::splat(token, f32::NEG_INFINITY);
            for index in 0..self.count {
                far = far.max(self.packet(index).far);
            }
            self.far = most(far);
        }
    }
}

impl<T: Simd> Packet<T> {
    /// Of the first eight rays, or as many as there are, if they are like the one that is prepared; and each one's D.
    #[inline(always)]
    fn new(token: T, bounds: &Aabb, rays: &[Ray], like: &PreparedRay) -> Option<(Self, V<T>)> {
        let mut padded = [[0.0; 8]; LANES];
        let rows: &[[f32; 8]; LANES] = match rays.first_chunk::<LANES>() {
            Some(rays) => bytemuck::cast_ref(rays),
            None => {
                for (lane, row) in padded.iter_mut().enumerate() {
                    *row = bytemuck::cast(*rays.get(lane).unwrap_or(like.ray));
                }
                &padded
            }
        };
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = token.transpose(load_all(token, rows));
        let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
        if !like.is_like(token, origin, direction, [t_min, t_max]) {
            return None;
        }
        let reciprocals = reciprocals(token, direction);
        let signs = like.ray.direction;
        let (slabs, extent) = RaySlabs::of_lanes(token, origin, reciprocals, t_min, signs, bounds);
        let [kx, ky, kz] = *like.axes;
        let zero = V::<T>::splat(token, 0.0);
        let packet = Self {
            origin,
            slabs,
            far: reach(token, t_max, slabs.margins()),
            along: Along {
                reciprocal: reciprocals[kz],
                t_min,
            },
            slope: [
                direction[kx] * reciprocals[kz],
                direction[ky] * reciprocals[kz],
            ],
            t_max,
            u: zero,
            v: zero,
            places: zero,
        };
        Some((packet, extent))
    }

    /// All lanes at once, a triangle after the other. The lanes that have a new best hit.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn test_leaf<Q: Query, R: Triangles>(
        &mut self,
        token: T,
        leaf: R,
        primitives: &[u32],
        mut lanes: u32,
        mut found: u32,
        rays: &[Ray],
        axes: &'static [usize; 3],
    ) -> u32 {
        let [kx, ky, kz] = *axes;
        // SAFETY: a prepared ray's axes, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        let origin = [self.origin[kx], self.origin[ky], self.origin[kz]];
        let nowhere = [V::<T>::splat(token, 0.0); 3];
        let mut vertices = [Sheared::new(nowhere, nowhere, [nowhere[0]; 2]); 8];
        if let Some(leaf) = leaf.shared() {
            let [x, y, z] = [&leaf.vertices[kx], &leaf.vertices[ky], &leaf.vertices[kz]];
            for vertex in 0..8 {
                let position = splat3(token, [x[vertex], y[vertex], z[vertex]]);
                vertices[vertex] = Sheared::new(position, origin, self.slope);
            }
        }
        let mut new = 0;
        for triangle in 0..leaf.count() % 16 {
            let place = leaf.first() + triangle;
            let triangle = triangle % 8;
            let [a, b, c] = if let Some(leaf) = leaf.shared() {
                let [a, b, c] = &leaf.corners;
                [
                    vertices[a[triangle] as usize % 8],
                    vertices[b[triangle] as usize % 8],
                    vertices[c[triangle] as usize % 8],
                ]
            } else {
                let mut corners = [vertices[0]; 3];
                let own = leaf.triangle(triangle);
                for corner in 0..3 {
                    let position = [own[corner][kx], own[corner][ky], own[corner][kz]];
                    let position = splat3(token, position);
                    corners[corner] = Sheared::new(position, origin, self.slope);
                }
                corners
            };
            let corners = [[a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z]];
            let mut edges = Edges::new(token, corners, lanes);
            let pairs = OneTriangle {
                triangles: leaf,
                triangle,
                rays,
                axes,
            };
            if !Q::CLOSEST {
                // Not all lanes that are hit at once, but some if there are any.
                while edges.candidates != 0 {
                    let hits = (self.along).test::<LANES, false, R::Precision, _>(
                        token, corners, edges, self.t_max, pairs,
                    );
                    let Some(hits) = hits else {
                        break;
                    };
                    new |= hits.mask;
                    lanes &= !hits.mask;
                    edges.candidates &= !hits.mask;
                }
                continue;
            }
            if edges.candidates == 0 {
                continue;
            }
            let hits = (self.along)
                .test::<LANES, true, R::Precision, _>(token, corners, edges, self.t_max, pairs);
            let Some(hits) = hits else {
                continue;
            };
            let nearer = hits.t.lt(self.t_max).bits() | !found;
            let mut closer = hits.mask & nearer;
            for lane in bits(hits.mask & !nearer) {
                // As near as the best one: the lesser number.
                let best = self.places.to_array()[lane % LANES].to_bits() as usize;
                closer |= u32::from(primitives[place] < primitives[best]) << lane;
            }
            let set = V::<T>::of_bits(token, closer);
            self.t_max = set.select(hits.t, self.t_max);
            self.u = set.select(hits.u, self.u);
            self.v = set.select(hits.v, self.v);
            let places = V::<T>::splat(token, f32::from_bits(place as u32));
            self.places = set.select(places, self.places);
            found |= closer;
            new |= closer;
        }
        new
    }

    /// All triangles at once, a lane after the other. The lanes that have a new best hit.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn test_by_ray<Q: Query>(
        &mut self,
        token: T,
        leaf: impl Triangles,
        primitives: &[u32],
        lanes: u32,
        found: u32,
        rays: &[Ray],
        axes: &'static [usize; 3],
    ) -> u32 {
        let (t_max, reciprocals) = (self.t_max.to_array(), self.along.reciprocal.to_array());
        let mut new = 0;
        for lane in bits(lanes) {
            let lane = lane % LANES;
            let Some(ray) = rays.get(lane) else {
                break;
            };
            let shear = RayShear::of(ray, axes, reciprocals[lane]);
            let mut t_max = t_max[lane];
            if !Q::CLOSEST {
                let hit = leaf.test::<T, false>(token, &shear, t_max).is_some();
                new |= u32::from(hit) << lane;
                continue;
            }
            let mut best = None;
            if found >> lane & 1 != 0 {
                best = Some(Found {
                    t: t_max,
                    place: self.places.to_array()[lane].to_bits() as usize,
                    ..Found::default()
                });
            }
            let closer = Found::update(token, &mut best, &mut t_max, leaf, &shear, primitives);
            if let (true, Some(best)) = (closer, best) {
                let place = f32::from_bits(best.place as u32);
                self.t_max = self.t_max.replace(token, lane, best.t);
                self.u = self.u.replace(token, lane, best.u);
                self.v = self.v.replace(token, lane, best.v);
                self.places = self.places.replace(token, lane, place);
                new |= 1 << lane;
            }
        }
        new
    }
}

/// The rays of a packet against one triangle of a leaf.
#[derive(Clone, Copy)]
struct OneTriangle<'a, R> {
    triangles: R,
    triangle: usize,
    rays: &'a [Ray],
    axes: &'static [usize; 3],
}

impl<R: Triangles> Pairs for OneTriangle<'_, R> {
    #[inline(always)]
    fn pair(&self, lane: usize) -> Pair {
        // Lanes past the last ray are not among those that are asked for.
        let ray = self.rays.get(lane).unwrap_or(&PreparedRay::ROOM);
        Pair::new(&self.triangles.triangle(self.triangle), ray, self.axes)
    }
}

/// The first packet that has any of the rays. Takes its rays from them.
#[inline(always)]
fn first_packet(rays: &mut u64) -> Option<usize> {
    if *rays == 0 {
        return None;
    }
    let index = rays.trailing_zeros() as usize / LANES;
    *rays &= !(0xff << (LANES * index));
    Some(index)
}

/// Puts an entry where it belongs among those from `base` to `len`, of which the nearest is the last.
///
/// # Safety
/// Those were written, and there is a place after them.
#[inline(always)]
unsafe fn insert(stack: &mut [MaybeUninit<Entry>; STACK], base: usize, len: usize, entry: Entry) {
    let mut place = len;
    // SAFETY: the caller's promise: `place` is from `base` to `len`.
    unsafe {
        while place > base {
            let before = stack.get_unchecked(place - 1).assume_init();
            if before.near >= entry.near {
                break;
            }
            stack.get_unchecked_mut(place).write(before);
            place -= 1;
        }
        stack.get_unchecked_mut(place).write(entry);
    }
}
