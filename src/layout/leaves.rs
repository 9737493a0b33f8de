//! How a hierarchy keeps its leaves, and what the traversal needs of those that hold triangles.

use super::{Borrowed, Gather, LayoutError, Leaf, Storage, bytes::TRIANGLE_LEAVES};
use crate::{
    primitive::{
        exact::{Pair, Pairs},
        triangle::{Aim, Look, Precision, RayShear, TriangleHits, Whether},
    },
    simd::{Lanes, PREFETCHED, Simd},
};
use core::ops::Range;

/// A kind of leaves: stored one by one ([`Leaf`]), or as runs of the list of primitive numbers alone
/// ([`RunLeaf`](super::RunLeaf), [`MeshLeaf`](super::MeshLeaf)).
pub trait Leaves: Sized + sealed::Sealed {
    /// All leaves of a hierarchy, in memory of `S`.
    type Store<S: Storage>: Clone;
    /// One of them.
    #[doc(hidden)]
    type Ref<'a>: Copy;

    /// Whether they are [`TriangleLeaf`](super::TriangleLeaf)s.
    #[doc(hidden)]
    const ARE_TRIANGLES: bool = false;

    /// Whether there is a list of primitive numbers.
    #[doc(hidden)]
    const LISTED: bool = true;

    /// How many bytes of leaves that are side by side are fetched in one go.
    #[doc(hidden)]
    const AHEAD: usize = PREFETCHED;

    /// Which of what is counted a leaf at `place` takes up: leaves, or primitive numbers.
    #[doc(hidden)]
    fn span(place: usize) -> Range<usize>;
    /// The place of the only leaf of a hierarchy, over `count` of what is counted, if that is one leaf.
    #[doc(hidden)]
    fn only(count: usize) -> Option<u32>;
    /// How many places of primitives there are.
    #[doc(hidden)]
    fn len<S: Storage>(_store: &Self::Store<S>, primitives: &[u32]) -> usize {
        primitives.len()
    }
    /// How many there are of what is counted.
    ///
    /// # Errors
    /// More than places tell apart; or the first leaf that cannot be walked.
    #[doc(hidden)]
    fn count<S: Storage>(store: &Self::Store<S>, primitives: &[u32]) -> Result<usize, LayoutError>;
    /// One more than the greatest primitive number, if what has the numbers is not checked by itself.
    #[doc(hidden)]
    fn numbers<S: Storage>(_store: &Self::Store<S>, _primitives: &[u32]) -> u64 {
        0
    }
    /// How many primitives there are for numbers to tell apart, if that is known.
    #[doc(hidden)]
    fn known<S: Storage>(_store: &Self::Store<S>) -> Option<usize> {
        None
    }
    /// The first place at which is the number of none of them, if that is known.
    #[doc(hidden)]
    fn unknown<S: Storage>(_store: &Self::Store<S>, _primitives: &[u32]) -> Option<usize> {
        None
    }
    /// The same, borrowed.
    #[doc(hidden)]
    fn borrowed<S: Storage>(store: &Self::Store<S>) -> Self::Store<Borrowed<'_>>;
    /// The same, in memory of their own.
    #[cfg(feature = "alloc")]
    #[doc(hidden)]
    fn owned<S: Storage>(store: &Self::Store<S>) -> Self::Store<super::Owned>;
    /// How many bytes they take.
    #[doc(hidden)]
    fn bytes<S: Storage>(store: &Self::Store<S>) -> usize;
    /// The leaf at a place.
    ///
    /// # Safety
    /// The layout's check saw that it is there.
    #[doc(hidden)]
    unsafe fn at<'a, S: Storage>(
        store: &'a Self::Store<S>,
        primitives: &'a [u32],
        place: usize,
    ) -> Self::Ref<'a>;
    /// What is read first of the leaf at a place, to be fetched.
    #[doc(hidden)]
    fn address<S: Storage>(store: &Self::Store<S>, primitives: &[u32], place: usize) -> *const u8;
    /// Has fetched what is read of a leaf next, if what is read first says where that is.
    ///
    /// # Safety
    /// The layout's check saw that the leaf is there.
    #[doc(hidden)]
    #[inline(always)]
    unsafe fn fetch_next<T: Simd, S: Storage>(_: T, _: &Self::Store<S>, _: &[u32], _place: usize) {}
    /// Has fetched the vertices, from one on, that leaves read whose triangles are in their order.
    #[doc(hidden)]
    #[inline(always)]
    fn fetch_vertices<T: Simd, S: Storage>(_: T, _: &Self::Store<S>, _first: usize) {}
    /// How many primitives a leaf has.
    #[doc(hidden)]
    fn primitives(leaf: Self::Ref<'_>) -> usize;
}

pub(super) mod sealed {
    pub trait Sealed {}
    impl<L: super::Leaf> Sealed for L {}
}

impl<L: Leaf> Leaves for L {
    const ARE_TRIANGLES: bool = L::KIND == TRIANGLE_LEAVES;
    type Store<S: Storage> = S::Slice<L>;
    type Ref<'a> = &'a L;

    const AHEAD: usize = 4 * size_of::<L>();

    #[inline(always)]
    fn span(place: usize) -> Range<usize> {
        place..place + 1
    }

    fn only(count: usize) -> Option<u32> {
        (count == 1).then_some(0)
    }

    fn count<S: Storage>(store: &S::Slice<L>, primitives: &[u32]) -> Result<usize, LayoutError> {
        for (index, leaf) in store.iter().enumerate() {
            if !leaf.is_sound() || leaf.primitives().end > primitives.len() as u64 {
                return Err(LayoutError::Leaf(index));
            }
        }
        Ok(store.len())
    }

    fn borrowed<S: Storage>(store: &S::Slice<L>) -> &[L] {
        store
    }

    #[cfg(feature = "alloc")]
    fn owned<S: Storage>(store: &S::Slice<L>) -> alloc::vec::Vec<L> {
        store.to_vec()
    }

    fn bytes<S: Storage>(store: &S::Slice<L>) -> usize {
        size_of_val(&**store)
    }

    #[inline(always)]
    unsafe fn at<'a, S: Storage>(store: &'a S::Slice<L>, _: &'a [u32], place: usize) -> &'a L {
        // SAFETY: the caller's promise.
        unsafe { store.get_unchecked(place) }
    }

    #[inline(always)]
    fn address<S: Storage>(store: &S::Slice<L>, _: &[u32], place: usize) -> *const u8 {
        store.as_ptr().wrapping_add(place).cast()
    }

    fn primitives(leaf: &L) -> usize {
        let Range { start, end } = leaf.primitives();
        (end - start) as usize
    }
}

/// A few triangles: what the one triangle test needs of a leaf.
#[doc(hidden)]
pub trait Triangles: Copy {
    /// How they are tested.
    type Precision: Precision;
    /// A number of each, in a backend's vector.
    type Lanes<S: Simd>: Lanes<Token = S>;
    /// Four of them, or fewer.
    type Four: Triangles;

    /// The first four, the next four, and so on, if there are any.
    fn four(self, number: usize) -> Option<Self::Four>;
    /// Where their numbers begin in the hierarchy's list.
    fn first(self) -> usize;
    /// How many there are.
    fn count(self) -> usize;
    /// The corners of the triangle in a lane, of which there are [`count`](Self::count).
    fn triangle(self, lane: usize) -> [[f32; 3]; 3];
    /// Which of them the ray may hit, and what the rest of the test works on.
    fn look<S: Simd>(self, token: S, ray: &RayShear) -> Look<Self::Lanes<S>>;
    /// The rest of the test, in some precision.
    fn finish<S: Simd, P: Precision, A: Aim>(
        self,
        token: S,
        ray: &RayShear,
        look: Look<Self::Lanes<S>>,
        t_max: f32,
    ) -> TriangleHits<Self::Lanes<S>>;

    /// A bit for each triangle there is.
    #[inline(always)]
    fn lanes(self) -> u32 {
        (1 << self.count()) - 1
    }

    /// All of them, four at a time. No leaf has more than eight.
    #[inline(always)]
    fn fours(self) -> impl Iterator<Item = Self::Four> {
        (0..2).map_while(move |number| self.four(number))
    }

    /// Whether the ray hits any, up to `t_max`.
    #[inline(always)]
    fn is_hit<S: Simd>(self, token: S, ray: &RayShear, t_max: f32) -> bool {
        if !S::IN_FOURS {
            let hits = self.test::<S, Whether>(token, ray, t_max);
            return hits.is_some_and(|hits| hits.mask != 0);
        }
        for four in self.fours() {
            let hits = four.test::<S, Whether>(token, ray, t_max);
            if hits.is_some_and(|hits| hits.mask != 0) {
                return true;
            }
        }
        false
    }

    /// The ray against all of them, up to `t_max`. `None` if none is hit as soon as the first look shows.
    #[inline(always)]
    fn test<S: Simd, A: Aim>(
        self,
        token: S,
        ray: &RayShear,
        t_max: f32,
    ) -> Option<TriangleHits<Self::Lanes<S>>> {
        self.after_look::<S, A>(token, ray, self.look(token, ray), t_max)
    }

    /// The same after a look at them.
    #[inline(always)]
    fn after_look<S: Simd, A: Aim>(
        self,
        token: S,
        ray: &RayShear,
        look: Look<Self::Lanes<S>>,
        t_max: f32,
    ) -> Option<TriangleHits<Self::Lanes<S>>> {
        if !look.may_hit() {
            return None;
        }
        Some(self.finish::<S, Self::Precision, A>(token, ray, look, t_max))
    }
}

/// What of [`Triangles`] is the same for all but in the number of lanes: `$vector`, of `$lanes`. And what is the same for all
/// that have no more than four: `in_lanes!(four)`.
macro_rules! in_lanes {
    (four) => {
        type Four = Self;
        $crate::layout::leaves::in_lanes!(F32x4, 4);

        #[inline(always)]
        fn four(self, number: usize) -> Option<Self> {
            (number == 0).then_some(self)
        }
    };
    ($vector:ident, $lanes:literal) => {
        type Lanes<S: $crate::simd::Simd> = S::$vector;

        #[inline(always)]
        fn finish<
            S: $crate::simd::Simd,
            P: $crate::primitive::triangle::Precision,
            A: $crate::primitive::triangle::Aim,
        >(
            self,
            token: S,
            ray: &RayShear,
            look: Look<S::$vector>,
            t_max: f32,
        ) -> $crate::primitive::triangle::TriangleHits<S::$vector> {
            let pairs = $crate::layout::leaves::OneRay(self, ray);
            look.finish::<$lanes, A, P, _>(token, ray, t_max, pairs)
        }
    };
}
pub(super) use in_lanes;

/// A ray against all triangles of a leaf.
#[derive(Clone, Copy)]
pub(super) struct OneRay<'a, R>(pub R, pub &'a RayShear<'a>);

impl<R: Triangles> Pairs for OneRay<'_, R> {
    #[inline(always)]
    fn pair(&self, lane: usize) -> Pair {
        self.1.pair(&self.0.triangle(lane))
    }
}

/// A leaf that is a run of the list of primitive numbers, and no more.
#[doc(hidden)]
pub trait Listed: Copy {
    /// Its places in the list.
    fn places(self) -> Range<usize>;
}

/// Leaves of triangles.
pub trait TriangleLeaves: for<'a> Leaves<Ref<'a>: Gather> {}
impl<L: for<'a> Leaves<Ref<'a>: Gather>> TriangleLeaves for L {}
