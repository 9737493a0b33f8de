//! Many rays at once, a step at a time in turn.
//!
//! A ray alone waits: for its node to be loaded, for the boxes to be tested, for what was guessed wrong. Here some are under
//! way together, and one's wait is another's work. What follows from a step is hardly branched on, for it cannot be guessed:
//! a node's children are written to the ray's stack by a permutation, the nearest hit is kept by selection, and the ray goes
//! to the list of those at a node, at a leaf or at their end. A step at a node is in three parts, of which each is done for
//! another ray than the one before it: a processor sees a few hundred instructions ahead, and one ray's step from its node's
//! place to the next one's is longer than that allows to hide.
//!
//! Children on the stack are in the order of lanes, but for the nearest, which comes next.
//!
//! Several rays in flight to hide latency: Wald, Slusallek, Benthin, Wagner, "Interactive rendering with coherent ray
//! tracing" (2001). Children written by a permutation: Fuetterling, Lojewski, Pfreundt, Ebert, "Efficient ray
//! tracing kernels for modern CPU architectures" (2015).

use super::{feed::Feed, query::Query, triangles::Found};
use crate::{
    geometry::Ray,
    layout::{Bvh, Child, Link, STACK, Storage, TriangleLeaves, Triangles, WideNode},
    primitive::triangle::{RayShear, WhereUnbranched},
    simd::{Lanes, Simd, Vector},
    slab::{NarrowRay, reach_of},
};
use core::{hint::select_unpredictable, mem::MaybeUninit, ptr};

/// The most lanes of a wave.
pub(super) const MOST_LANES: usize = 64;

/// A stack's places: [`BOTTOM`], the entries, and room to write a whole vector above the last.
const PLACES: usize = STACK + 16;

/// What lies below all entries of a stack. It counts as a leaf, and is one that may be fetched in vain.
const BOTTOM: Link = Link::leaf_at(0);

/// The place of the stack's last entry once the bottom has been taken.
const ENDED: u32 = u32::MAX;

/// As many of a stack's entries are looked at together.
const FEW: usize = 8;

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

/// A node whose boxes have been tested.
struct Tested<'a, T: Simd, N: WideNode> {
    node: &'a N,
    hit: N::Lanes<T>,
    near: N::Lanes<T>,
}

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
    // What comes after nodes.
    let (mut at_leaf, mut at_end) = (List::EMPTY, List::EMPTY);
    // Then nodes' links are fetched, too, and of leaves that say where to read on what is there.
    let is_large = bvh.is_large();
    if bvh.root() == Child::EMPTY {
        while let Some((index, ..)) = feed.next() {
            feed.answer(index, None);
        }
        return;
    }
    let root = Link::new::<N>(bvh.root());
    for lane in lanes.iter_mut().map(MaybeUninit::as_mut_ptr) {
        // SAFETY: `lane` is one of them.
        unsafe { Lane::clear(lane) };
        // SAFETY: the same.
        let started = unsafe { Lane::start(lane, root, feed) };
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
            let count = take(&mut nodes);
            // For there to be one ahead of the last.
            at_node.0[count] = at_node.get(count - 1);
            let mut tested = in_list(at_node.get(0)).test_boxes(token, bvh);
            let mut before = root;
            for place in 0..count {
                let lane = at_node.get(place);
                let ahead = in_list(at_node.get(place + 1)).test_boxes(token, bvh);
                let state = in_list(lane);
                state.take_children::<T, N, Q>(token, &tested);
                fetch(token, bvh, before, is_large);
                (tested, before) = (ahead, state.current);
                let leaf = before.is_leaf();
                at_node.push_if(&mut nodes, lane, !leaf);
                at_rest.push_if(&mut rest, lane, leaf);
            }
            fetch(token, bvh, before, is_large);
            continue;
        }
        let (mut leaves, mut ends) = (0, 0);
        for place in 0..take(&mut rest) {
            let lane = at_rest.get(place);
            let end = in_list(lane).top == ENDED;
            at_leaf.push_if(&mut leaves, lane, !end);
            at_end.push_if(&mut ends, lane, end);
        }
        if is_large {
            for place in 0..leaves {
                let leaf = in_list(at_leaf.get(place)).current.leaf();
                // SAFETY: the layout's check saw that all leaves led to are there.
                unsafe { bvh.fetch_next(token, leaf) };
            }
        }
        for place in 0..leaves {
            let lane = at_leaf.get(place);
            let state = in_list(lane);
            state.test_leaf::<T, N, L, S, Q>(token, bvh);
            let leaf = state.current.is_leaf();
            at_node.push_if(&mut nodes, lane, !leaf);
            at_rest.push_if(&mut rest, lane, leaf);
        }
        for place in 0..ends {
            let lane = at_end.get(place);
            let state = in_list(lane);
            feed.answer(state.index, state.found);
            // SAFETY: it is one of them.
            let started = unsafe { Lane::start(lane, root, feed) };
            let leaf = root.is_leaf();
            at_node.push_if(&mut nodes, lane, started & !leaf);
            at_rest.push_if(&mut rest, lane, started & leaf);
        }
    }
}

/// A lane that is in a list.
#[inline(always)]
fn in_list<'a>(lane: *mut Lane) -> &'a mut Lane {
    // SAFETY: lists have lanes in which `start` has put a ray, and no other reference to one is used after this is made.
    unsafe { &mut *lane }
}

/// Has what is next for a ray fetched, or anything if it has ended. All of a node only if the scene `is_large`.
#[inline(always)]
fn fetch<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
    token: T,
    bvh: &Bvh<N, L, S>,
    next: Link,
    is_large: bool,
) {
    // Not by a branch, nor anything that may become one. The address that is not meant may be of nothing, and past what
    // 32 bits hold.
    let nodes = bvh.nodes().as_ptr();
    let node = nodes.wrapping_byte_add(next.node_offset()).addr();
    let leaf = bvh.leaf_address(next.leaf()).addr();
    let is_leaf = 0usize.wrapping_sub(usize::from(next.is_leaf()));
    let next = ptr::without_provenance(node ^ ((node ^ leaf) & is_leaf));
    token.prefetch(next);
    if is_large {
        N::prefetch_links(token, next);
    }
}

impl Lane {
    /// Writes as much of a lane's stacks as is read whether it is in use or not.
    ///
    /// # Safety
    /// `lane` may be written.
    #[inline(always)]
    unsafe fn clear(lane: *mut Self) {
        // SAFETY: fields of memory that is there.
        unsafe {
            (&raw mut (*lane).links)
                .cast::<[Link; 1 + FEW]>()
                .write([BOTTOM; 1 + FEW]);
            (&raw mut (*lane).nears)
                .cast::<[f32; 1 + FEW]>()
                .write([0.0; 1 + FEW]);
        }
    }

    /// Puts the next ray into a lane. Whether there is one. Stacks stay as they are: the bottom is never written over.
    ///
    /// # Safety
    /// `lane` may be written, and was cleared.
    #[inline(always)]
    unsafe fn start<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        lane: *mut Self,
        root: Link,
        feed: &mut Feed<N, L, S, Q>,
    ) -> bool {
        let Some((index, ray, narrow)) = feed.next() else {
            return false;
        };
        // SAFETY: fields of memory that is there; no more of the stacks is read than was written.
        unsafe {
            (&raw mut (*lane).narrow).write(*narrow);
            (&raw mut (*lane).current).write(root);
            (&raw mut (*lane).top).write(0);
            (&raw mut (*lane).far).write(reach_of(ray.t_max, narrow.margin()));
            (&raw mut (*lane).t_max).write(ray.t_max);
            (&raw mut (*lane).ray).write(*ray);
            (&raw mut (*lane).found).write(None);
            (&raw mut (*lane).index).write(index);
        }
        true
    }

    /// Tests the node's boxes.
    #[inline(always)]
    fn test_boxes<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        token: T,
        bvh: &'a Bvh<N, L, S>,
    ) -> Tested<'a, T, N> {
        // SAFETY: the layout's check saw that all nodes led to are there.
        let node = unsafe { bvh.node(self.current) };
        let slabs = N::widen(token, &self.narrow);
        let far = N::Lanes::<T>::splat(token, self.far);
        let (hit, near) = node.test_lanes(token, &slabs, far);
        Tested { node, hit, near }
    }

    /// Goes on from the node to the nearest child or else to the stack's last entry.
    #[inline(always)]
    fn take_children<T: Simd, N: WideNode, Q: Query>(
        &mut self,
        token: T,
        &Tested { node, hit, near }: &Tested<T, N>,
    ) {
        let mask = hit.bits();
        let links = node.link_lanes(token);
        // Read once: it might be in what is written below, for all that the compiler sees.
        let top = self.top as usize;
        let above = top + 1;
        // The nearest; or the first, which is the largest.
        let child = if Q::CLOSEST {
            near.least(hit)
        } else {
            mask.trailing_zeros() as usize
        };
        let child = child % N::WIDTH;
        let others = mask & !(1 << child);
        let array = links.to_array();
        // SAFETY: the layout's check saw that a walk never leaves more than `STACK` children behind, which `top` is at
        // most, and a vector's worth of places is above them. `top` and those below were written. `child` is a lane.
        unsafe {
            links.compress(others, self.links.as_mut_ptr().add(above).cast());
            if Q::CLOSEST {
                near.compress(others, self.nears.as_mut_ptr().add(above).cast());
            }
            // Where it is read is chosen, since a choice of what was read may become a branch.
            let last = self.links.get_unchecked(top).assume_init_ref();
            let child = node.link_among(&array, child);
            self.current = *select_unpredictable(mask != 0, child, last);
        }
        self.top = (top as u32 + mask.count_ones()).wrapping_sub(1);
    }

    /// Tests the leaf's triangles, and goes on to the stack's last entry, or the end if enough is known.
    #[inline(always)]
    fn test_leaf<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
    ) {
        // SAFETY: the layout's check saw that all leaves led to are there.
        let leaf = unsafe { bvh.leaf(self.current.leaf()) };
        let shear = RayShear::of(&self.ray, self.narrow.axes(), self.narrow.along());
        if Q::CLOSEST {
            if let Some(hits) = leaf.test::<T, WhereUnbranched>(token, &shear, self.t_max) {
                let best = &mut self.found;
                Found::choose_unbranched(best, &mut self.t_max, leaf, hits, bvh.primitives());
                // Its number is read when the ray has ended.
                let place = best.as_ref().map_or(0, |best| best.place);
                token.prefetch_line(bvh.primitives().as_ptr().wrapping_add(place).cast());
                self.far = reach_of(self.t_max, self.narrow.margin());
                self.forget_the_far(token);
            }
        } else if leaf.is_hit(token, &shear, self.t_max) {
            self.found = Some(Found::default());
            (self.current, self.top) = (BOTTOM, ENDED);
            return;
        }
        // SAFETY: `top` and those below were written.
        self.current = unsafe { self.links.get_unchecked(self.top as usize).assume_init() };
        self.top = self.top.wrapping_sub(1);
    }

    /// Takes from the stack what is too far now.
    #[inline(always)]
    fn forget_the_far<T: Simd>(&mut self, token: T) {
        let few = self.top.min(FEW as u32);
        // SAFETY: as many were written when the lane was cleared, and each time with all that is written after.
        let (nears, links): (&[f32; FEW], &[f32; FEW]) = unsafe {
            (
                &*self.nears.as_ptr().add(1).cast(),
                &*self.links.as_ptr().add(1).cast(),
            )
        };
        let (nears, links) = (T::F32x8::load(token, nears), T::F32x8::load(token, links));
        let near = nears.le(T::F32x8::splat(token, self.far)).bits() & !(u32::MAX << few);
        // SAFETY: there is room for a vector.
        unsafe {
            nears.compress(near, self.nears.as_mut_ptr().add(1).cast());
            links.compress(near, self.links.as_mut_ptr().add(1).cast());
        }
        let mut kept = near.count_ones() as usize;
        for place in FEW + 1..=self.top as usize {
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
}

/// Lanes that are to do the same next. How many is known apart.
struct List([*mut Lane; MOST_LANES + 1]);

impl List {
    const EMPTY: Self = Self([ptr::null_mut(); MOST_LANES + 1]);

    #[inline(always)]
    fn get(&self, place: usize) -> *mut Lane {
        // SAFETY: `place` is at most the length, which is at most the number of lanes.
        unsafe { *self.0.get_unchecked(place) }
    }

    /// Written always, kept or not: no branch.
    #[inline(always)]
    fn push_if(&mut self, len: &mut usize, lane: *mut Lane, wanted: bool) {
        // SAFETY: a lane is in a list once at most, so `len` is at most `MOST_LANES`.
        unsafe { *self.0.get_unchecked_mut(*len) = lane };
        *len += usize::from(wanted);
    }
}

/// Empties a list. Its places can be read until others are pushed over them.
#[inline(always)]
fn take(len: &mut usize) -> usize {
    core::mem::take(len)
}
