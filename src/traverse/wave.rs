//! Many rays at once, a step at a time in turn.
//!
//! A ray alone waits: for its node to be loaded, for the boxes to be tested, for what was guessed wrong. Here some are under
//! way together, and one's wait is another's work. What follows from a step is not branched on, for it cannot be guessed:
//! a node's children are written to the ray's stack by a permutation, and the ray goes to the list of those at a node,
//! at a leaf, at a leaf whose triangles need a closer look, or at their end.
//!
//! Children on the stack are in the order of lanes, but for the nearest, which comes next.
//!
//! Several rays in flight to hide latency: Wald, Slusallek, Benthin, Wagner, "Interactive rendering with coherent ray
//! tracing" (2001). Children written by a permutation: Fuetterling, Lojewski, Pfreundt, Ebert, "Efficient ray
//! tracing kernels for modern CPU architectures" (2015).

use super::{feed::Feed, query::Query, triangles::Found};
use crate::{
    geometry::Ray,
    layout::{Bvh, Leaves, Link, STACK, Storage, TriangleLeaves, Triangles, WideNode},
    primitive::triangle::{Look, RayShear},
    simd::{Lanes, Simd},
    slab::{NarrowRay, reach_of},
};
use core::{hint::select_unpredictable, mem::MaybeUninit, ptr};

/// The most lanes of a wave.
pub(super) const MOST_LANES: usize = 64;

/// A stack's places: [`BOTTOM`], the entries, and room to write a whole vector above the last.
const PLACES: usize = STACK + 16;

/// What lies below all entries of a stack. It counts as a leaf.
const BOTTOM: Link = Link::from_bits(u32::MAX);

/// Over more primitives than this, of leaves that say where to read on that is fetched, too. Smaller scenes are in the
/// caches.
const LARGE: usize = 1 << 18;

/// A ray under way.
#[repr(C, align(64))]
pub(super) struct Lane {
    narrow: NarrowRay,
    current: Link,
    /// The place of the stack's last entry.
    top: u32,
    /// Up to which `t` boxes are of interest: `t_max` and the margin.
    far: f32,
    /// Up to which `t` triangles are.
    t_max: f32,
    links: [MaybeUninit<Link>; PLACES],
    nears: [MaybeUninit<f32>; PLACES],
    ray: Ray,
    found: Option<Found>,
    /// The caller's number of it.
    index: usize,
}

/// What a first look at a leaf has brought.
type LookAt<'a, T, L> = Look<<<L as Leaves>::Ref<'a> as Triangles>::Lanes<T>>;

/// Traces all rays of `feed`, on `lanes`.
#[inline(always)]
pub(super) fn trace<
    T: Simd,
    N: WideNode,
    L: TriangleLeaves,
    S: Storage,
    Q: Query,
    const LANES: usize,
>(
    token: T,
    bvh: &Bvh<N, L, S>,
    feed: &mut Feed<N, L, S, Q>,
    lanes: &mut [MaybeUninit<Lane>; LANES],
) {
    const { assert!(0 < LANES && LANES <= MOST_LANES) };
    // Lengths apart from what they are of, and both from all else, so that they stay in registers.
    let (mut at_node, mut at_rest) = (List::EMPTY, List::EMPTY);
    let (mut nodes, mut rest) = (0, 0);
    // What comes after nodes: leaves, those of them with candidates, and ends.
    let (mut at_leaf, mut at_triangles, mut at_end) = (List::EMPTY, List::EMPTY, List::EMPTY);
    // Apart, so that lists are short and what they are of is together.
    let mut looks = [const { MaybeUninit::<LookAt<T, L>>::uninit() }; LANES];
    let is_large = bvh.primitives().len() > LARGE;
    let root = Link::new::<N>(bvh.root());
    for (lane, state) in lanes.iter_mut().enumerate() {
        let started = Lane::start(state, root, feed);
        let leaf = root.is_leaf();
        at_node.push_if(&mut nodes, lane, started & !leaf);
        at_rest.push_if(&mut rest, lane, started & leaf);
    }
    loop {
        // Leaves wait for company until few rays are at nodes.
        if nodes > LANES / 4 || rest == 0 {
            if nodes == 0 {
                return;
            }
            for place in 0..take(&mut nodes) {
                let lane = at_node.get(place);
                let state = in_list(lanes, lane);
                state.test_node::<T, N, L, S, Q>(token, bvh);
                let leaf = state.current.is_leaf();
                at_node.push_if(&mut nodes, lane, !leaf);
                at_rest.push_if(&mut rest, lane, leaf);
            }
            continue;
        }
        let (mut leaves, mut triangles, mut ends) = (0, 0, 0);
        for place in 0..take(&mut rest) {
            let lane = at_rest.get(place);
            let end = in_list(lanes, lane).current == BOTTOM;
            at_leaf.push_if(&mut leaves, lane, !end);
            at_end.push_if(&mut ends, lane, end);
        }
        if is_large {
            for place in 0..leaves {
                let leaf = in_list(lanes, at_leaf.get(place)).current.leaf();
                // SAFETY: the layout's check saw that all leaves led to are there.
                unsafe { bvh.fetch_next(token, leaf) };
            }
        }
        for place in 0..leaves {
            let lane = at_leaf.get(place);
            // SAFETY: no more lanes are in a list than there are.
            let look = unsafe { looks.get_unchecked_mut(triangles) };
            let state = in_list(lanes, lane);
            let stays = state.look_at_leaf(token, bvh, look);
            let leaf = state.current.is_leaf();
            at_triangles.push_if(&mut triangles, lane, stays);
            at_node.push_if(&mut nodes, lane, !leaf);
            at_rest.push_if(&mut rest, lane, leaf & !stays);
        }
        for place in 0..triangles {
            let lane = at_triangles.get(place);
            // SAFETY: written when the lane came to this place of the list.
            let look = unsafe { looks.get_unchecked(place).assume_init_ref() };
            let state = in_list(lanes, lane);
            state.test_triangles::<T, N, L, S, Q>(token, bvh, look);
            let leaf = state.current.is_leaf();
            at_node.push_if(&mut nodes, lane, !leaf);
            at_rest.push_if(&mut rest, lane, leaf);
        }
        for place in 0..ends {
            let lane = at_end.get(place);
            let state = in_list(lanes, lane);
            feed.answer(state.index, state.found);
            // SAFETY: `lane` is one of them.
            let state = unsafe { lanes.get_unchecked_mut(lane) };
            let started = Lane::start(state, root, feed);
            let leaf = root.is_leaf();
            at_node.push_if(&mut nodes, lane, started & !leaf);
            at_rest.push_if(&mut rest, lane, started & leaf);
        }
    }
}

/// A lane that is in a list.
#[inline(always)]
fn in_list<const LANES: usize>(lanes: &mut [MaybeUninit<Lane>; LANES], lane: usize) -> &mut Lane {
    // SAFETY: lists have numbers of lanes in which `start` has put a ray.
    unsafe { lanes.get_unchecked_mut(lane).assume_init_mut() }
}

impl Lane {
    /// Puts the next ray into a lane. Whether there is one. Stacks stay as they are but for the bottom.
    #[inline(always)]
    fn start<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        lane: &mut MaybeUninit<Self>,
        root: Link,
        feed: &mut Feed<N, L, S, Q>,
    ) -> bool {
        let Some((index, ray, narrow)) = feed.next() else {
            return false;
        };
        let lane = lane.as_mut_ptr();
        // SAFETY: fields of memory that is there; no more of the stacks is read than was written.
        unsafe {
            (&raw mut (*lane).narrow).write(*narrow);
            (&raw mut (*lane).current).write(root);
            (&raw mut (*lane).top).write(0);
            (&raw mut (*lane).far).write(reach_of(ray.t_max, narrow.margin()));
            (&raw mut (*lane).t_max).write(ray.t_max);
            (&raw mut (*lane).links[0]).write(MaybeUninit::new(BOTTOM));
            (&raw mut (*lane).ray).write(*ray);
            (&raw mut (*lane).found).write(None);
            (&raw mut (*lane).index).write(index);
        }
        true
    }

    /// Tests the node's boxes, and goes on to the nearest child or else to the stack's last entry.
    #[inline(always)]
    fn test_node<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
    ) {
        let nodes = bvh.nodes().as_ptr();
        // SAFETY: the layout's check saw that all nodes led to are there.
        let node = unsafe { bvh.node(self.current) };
        let slabs = N::widen(token, &self.narrow);
        let far = N::Lanes::<T>::splat(token, self.far);
        let (hit, near) = node.test_lanes(token, &slabs, far);
        let mask = hit.bits();
        let links = node.link_lanes(token);
        // Read once: it might be in what is written below, for all that the compiler sees.
        let top = self.top as usize;
        let above = top + 1;
        // SAFETY: the layout's check saw that a walk never leaves more than `STACK` children behind, which `top` is at
        // most, and a vector's worth of places is above them. `top` and those below were written. `child` is a lane.
        unsafe {
            let last = self.links.get_unchecked(top).assume_init();
            let above_links = self.links.as_mut_ptr().add(above).cast();
            // The nearest; or the first, which is the largest.
            let child = if Q::CLOSEST {
                near.least(hit)
            } else {
                mask.trailing_zeros() as usize % N::WIDTH
            };
            let others = mask & !(1 << child);
            links.compress(others, above_links);
            if Q::CLOSEST {
                near.compress(others, self.nears.as_mut_ptr().add(above).cast());
            }
            let child = node.link_among(links, child % N::WIDTH);
            self.current = select_unpredictable(mask != 0, child, last);
        }
        self.top = (top as u32 + mask.count_ones()).wrapping_sub(1);

        // Not by a branch, nor anything that may become one. The address that is not meant may be of nothing, and past what
        // 32 bits hold.
        let node = nodes.wrapping_byte_add(self.current.node_offset()).addr();
        // Below the bottom there is no leaf, and to ask for what is nowhere near costs a walk through the page tables.
        let place = select_unpredictable(self.current == BOTTOM, 0, self.current.leaf());
        let leaf = bvh.leaf_address(place).addr();
        let is_leaf = 0usize.wrapping_sub(usize::from(self.current.is_leaf()));
        token.prefetch(ptr::without_provenance(node ^ ((node ^ leaf) & is_leaf)));
    }

    /// Whether the leaf has triangles that may be hit. If not, goes on to the stack's last entry.
    #[inline(always)]
    fn look_at_leaf<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
        &mut self,
        token: T,
        bvh: &'a Bvh<N, L, S>,
        look: &mut MaybeUninit<LookAt<'a, T, L>>,
    ) -> bool {
        let look = look.write(self.leaf(bvh).look(token, &self.shear()));
        let stays = look.may_hit();
        // SAFETY: `top` and those below were written.
        let last = unsafe { self.links.get_unchecked(self.top as usize).assume_init() };
        self.current = select_unpredictable(stays, self.current, last);
        self.top = self.top.wrapping_sub(u32::from(!stays));
        stays
    }

    /// Tests the leaf's triangles, and goes on to the stack's last entry, or the end if enough is known.
    #[inline(always)]
    fn test_triangles<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &'a Bvh<N, L, S>,
        &look: &LookAt<'a, T, L>,
    ) {
        let (leaf, shear, t_max) = (self.leaf(bvh), self.shear(), self.t_max);
        if Q::CLOSEST {
            let hits = leaf.hits::<T, true>(token, &shear, look, t_max);
            if let Some(hits) = hits {
                let primitives = bvh.primitives();
                let best = &mut self.found;
                if Found::choose(best, &mut self.t_max, leaf, hits, primitives) {
                    self.far = reach_of(self.t_max, self.narrow.margin());
                    self.forget_the_far();
                }
            }
        } else if (leaf.hits::<T, false>(token, &shear, look, t_max)).is_some() {
            self.found = Some(Found::default());
            self.current = BOTTOM;
            return;
        }
        // SAFETY: `top` and those below were written.
        self.current = unsafe { self.links.get_unchecked(self.top as usize).assume_init() };
        self.top = self.top.wrapping_sub(1);
    }

    /// Takes from the stack what is too far now.
    #[inline(always)]
    fn forget_the_far(&mut self) {
        let mut kept = 0;
        for place in 1..=self.top as usize {
            // SAFETY: `top` and those below were written; `kept + 1` is at most `place`.
            unsafe {
                let near = self.nears.get_unchecked(place).assume_init();
                *self.links.get_unchecked_mut(kept + 1) = *self.links.get_unchecked(place);
                self.nears.get_unchecked_mut(kept + 1).write(near);
                kept += usize::from(near <= self.far);
            }
        }
        self.top = kept as u32;
    }

    #[inline(always)]
    fn leaf<'a, N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        bvh: &'a Bvh<N, L, S>,
    ) -> L::Ref<'a> {
        // SAFETY: the layout's check saw that all leaves led to are there.
        unsafe { bvh.leaf(self.current.leaf()) }
    }

    #[inline(always)]
    fn shear(&self) -> RayShear<'_> {
        RayShear::of(&self.ray, self.narrow.axes(), self.narrow.along())
    }
}

/// Lanes that are to do the same next. How many is known apart.
struct List([u8; MOST_LANES + 1]);

impl List {
    const EMPTY: Self = Self([0; MOST_LANES + 1]);

    #[inline(always)]
    fn get(&self, place: usize) -> usize {
        // SAFETY: `place` was below the length, which is at most the number of lanes.
        usize::from(unsafe { *self.0.get_unchecked(place) })
    }

    /// Written always, kept or not: no branch.
    #[inline(always)]
    fn push_if(&mut self, len: &mut usize, lane: usize, wanted: bool) {
        // SAFETY: a lane is in a list once at most, so `len` is at most `MOST_LANES`.
        unsafe { *self.0.get_unchecked_mut(*len) = lane as u8 };
        *len += usize::from(wanted);
    }
}

/// Empties a list. Its places can be read until others are pushed over them.
#[inline(always)]
fn take(len: &mut usize) -> usize {
    core::mem::take(len)
}
