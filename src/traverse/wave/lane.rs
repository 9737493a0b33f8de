//! One ray of a wave.

use super::leaf_hits::LeafHits;
use crate::{
    geometry::Ray,
    layout::{Bvh, Leaves, Link, STACK, Storage, TriangleLeaves, Triangles, WideNode},
    primitive::triangle::{Look, RayShear, WhereUnbranched, Whether},
    simd::{Lanes, Simd, Vector},
    slab::{NarrowRay, reach_of},
    traverse::{feed::Feed, query::Query, triangles::Found},
};
use core::{hint::select_unpredictable, mem::MaybeUninit};

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
pub(in crate::traverse) struct Lane {
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
    /// What it has hit in the leaf it is at.
    hits: LeafHits,
    /// The caller's number of it.
    index: usize,
}

/// A node whose boxes have been tested.
pub(super) struct Tested<'a, T: Simd, N: WideNode> {
    node: &'a N,
    hit: N::Lanes<T>,
    near: N::Lanes<T>,
}

/// What a first look at a leaf has brought.
pub(super) type LookAt<'a, T, L> = Look<<<L as Leaves>::Ref<'a> as Triangles>::Lanes<T>>;

impl Lane {
    /// Writes what of a lane is there whether it is in use or not: hits, and as much of its stacks as is read then.
    ///
    /// # Safety
    /// `lane` may be written.
    #[inline(always)]
    pub(super) unsafe fn clear(lane: *mut Self) {
        // SAFETY: fields of memory that is there.
        unsafe {
            (&raw mut (*lane).links)
                .cast::<[Link; 1 + FEW]>()
                .write([BOTTOM; 1 + FEW]);
            (&raw mut (*lane).nears)
                .cast::<[f32; 1 + FEW]>()
                .write([0.0; 1 + FEW]);
            (&raw mut (*lane).hits).write(LeafHits::NONE);
        }
    }

    /// Puts the next ray into a lane. Whether there is one. Stacks stay as they are: the bottom is never written over.
    ///
    /// # Safety
    /// `lane` may be written, and was cleared.
    #[inline(always)]
    pub(super) unsafe fn start<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
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

    /// What is next for it.
    #[inline(always)]
    pub(super) fn current(&self) -> Link {
        self.current
    }

    /// Whether nothing is.
    #[inline(always)]
    pub(super) fn has_ended(&self) -> bool {
        self.top == ENDED
    }

    /// Writes down what was found.
    #[inline(always)]
    pub(super) fn answer<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &self,
        feed: &mut Feed<N, L, S, Q>,
    ) {
        feed.answer(self.index, self.found);
    }

    /// Tests the node's boxes.
    #[inline(always)]
    pub(super) fn test_boxes<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
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
    pub(super) fn take_children<T: Simd, N: WideNode, Q: Query>(
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

    /// The ray as triangles are tested with it.
    #[inline(always)]
    fn shear(&self) -> RayShear<'_> {
        RayShear::of(&self.ray, self.narrow.axes(), self.narrow.along())
    }

    /// Looks at the leaf's triangles.
    #[inline(always)]
    pub(super) fn look<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
        &self,
        token: T,
        bvh: &'a Bvh<N, L, S>,
    ) -> LookAt<'a, T, L> {
        // SAFETY: the layout's check saw that all leaves led to are there.
        let leaf = unsafe { bvh.leaf(self.current.leaf()) };
        leaf.look(token, &self.shear())
    }

    /// Tests the leaf's triangles after a look at them. A bit for each that is hit, which are then its hits; or any bit, if it is
    /// enough to know whether any is.
    #[inline(always)]
    pub(super) fn test_leaf<'a, T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &'a Bvh<N, L, S>,
        look: LookAt<'a, T, L>,
    ) -> u32 {
        // SAFETY: the layout's check saw that all leaves led to are there.
        let leaf = unsafe { bvh.leaf(self.current.leaf()) };
        let (shear, t_max) = (self.shear(), self.t_max);
        if !Q::CLOSEST {
            let hits = leaf.after_look::<T, Whether>(token, &shear, look, t_max);
            return u32::from(hits.is_some_and(|hits| hits.mask != 0));
        }
        let Some(hits) = leaf.after_look::<T, WhereUnbranched>(token, &shear, look, t_max) else {
            return 0;
        };
        self.hits.set(leaf.first(), &hits);
        hits.mask
    }

    /// Takes note of what is hit: one triangle, or if that is enough, any.
    #[inline(always)]
    pub(super) fn take_hit<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
    ) {
        if Q::CLOSEST {
            self.take_closest(token, bvh, self.hits.first());
        } else {
            (self.found, self.top) = (Some(Found::default()), 0);
        }
    }

    /// Takes note of the nearest of what is hit.
    #[inline(always)]
    pub(super) fn take_nearest_hit<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
    ) {
        self.take_closest(token, bvh, self.hits.nearest(bvh.primitives()));
    }

    #[inline(always)]
    fn take_closest<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage>(
        &mut self,
        token: T,
        bvh: &Bvh<N, L, S>,
        hit: Found,
    ) {
        let numbers = bvh.primitives();
        // None is farther than what was found before.
        if hit.t == self.t_max && self.found.is_some() {
            hit.compare(&mut self.found, &mut self.t_max, numbers);
        } else {
            (self.found, self.t_max) = (Some(hit), hit.t);
        }
        // Its number is read when the ray has ended.
        let place = self.found.as_ref().map_or(0, |found| found.place);
        token.prefetch_line(numbers.as_ptr().wrapping_add(place).cast());
        self.far = reach_of(self.t_max, self.narrow.margin());
        self.forget_the_far(token);
    }

    /// Goes on to the stack's last entry, or the end.
    #[inline(always)]
    pub(super) fn take_last(&mut self) {
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
