//! How a hierarchy keeps its leaves, and what the traversal needs of those that hold triangles.

use super::{Borrowed, LayoutError, Leaf, Storage, TriangleLeaf};
use crate::{
    primitive::{
        exact::{Pair, Pairs},
        triangle::{Corners, Edges, Precision, RayShear, TriangleHits},
    },
    simd::{Lanes, Simd},
};
use core::ops::Range;

/// A kind of leaves: stored one by one ([`Leaf`]), or as runs of the list of primitive numbers alone
/// ([`RunLeaf`](super::RunLeaf), [`MeshLeaf`](super::MeshLeaf)).
pub trait Leaves: Sized {
    /// All leaves of a hierarchy, in memory of `S`.
    type Store<S: Storage>: Clone;
    /// One of them.
    #[doc(hidden)]
    type Ref<'a>: Copy;

    /// Which of what is counted a leaf at `place` takes up: leaves, or primitive numbers.
    #[doc(hidden)]
    fn span(place: usize) -> Range<usize>;
    /// The place of the only leaf of a hierarchy, over `count` of what is counted, if that is one leaf.
    #[doc(hidden)]
    fn only(count: usize) -> Option<u32>;
    /// How many there are of what is counted.
    ///
    /// # Errors
    /// More than places tell apart; or the first leaf that cannot be walked.
    #[doc(hidden)]
    fn count<S: Storage>(store: &Self::Store<S>, primitives: &[u32]) -> Result<usize, LayoutError>;
    /// One more than the greatest primitive number, if what has the numbers is not checked by itself.
    #[doc(hidden)]
    fn numbers(_primitives: &[u32]) -> u64 {
        0
    }
    /// How many primitives there are for numbers to tell apart, if that is known.
    #[doc(hidden)]
    fn known<S: Storage>(_store: &Self::Store<S>) -> Option<usize> {
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
    /// How many primitives a leaf has.
    #[doc(hidden)]
    fn primitives(leaf: Self::Ref<'_>) -> usize;
}

impl<L: Leaf> Leaves for L {
    type Store<S: Storage> = S::Slice<L>;
    type Ref<'a> = &'a L;

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

/// Up to 8 triangles: what the one triangle test needs of a leaf.
#[doc(hidden)]
pub trait Triangles: Copy {
    /// How they are tested.
    type Precision: Precision;

    /// Where their numbers begin in the hierarchy's list.
    fn first(self) -> usize;
    /// How many there are.
    fn count(self) -> usize;
    /// Their corners as the ray sees them. What stands in lanes past the last triangle is finite if they all are.
    fn corners<T: Simd>(self, token: T, ray: &RayShear<'_, T::F32x8>) -> Corners<T::F32x8>;
    /// The corners of the triangle in a lane, of which there are [`count`](Self::count).
    fn triangle(self, lane: usize) -> [[f32; 3]; 3];

    /// The leaf, if it has vertices that triangles share.
    #[inline(always)]
    fn shared<'a>(self) -> Option<&'a TriangleLeaf>
    where
        Self: 'a,
    {
        None
    }

    /// A bit for each triangle there is.
    #[inline(always)]
    fn lanes(self) -> u32 {
        (1 << self.count()) - 1
    }

    /// Their corners as the ray sees them, and which of them the ray may hit: what the rest of the test works on.
    #[inline(always)]
    fn edges<T: Simd>(
        self,
        token: T,
        ray: &RayShear<'_, T::F32x8>,
    ) -> (Corners<T::F32x8>, Edges<T::F32x8>) {
        let corners = self.corners(token, ray);
        let edges = Edges::new(token, corners, self.lanes());
        (corners, edges)
    }

    /// The ray against all of them, up to `t_max`. If `NEED_T` is not set, it is enough to know whether any is hit.
    #[inline(always)]
    fn test<T: Simd, const NEED_T: bool>(
        self,
        token: T,
        ray: &RayShear<'_, T::F32x8>,
        t_max: f32,
    ) -> Option<TriangleHits<T::F32x8>> {
        let (corners, edges) = self.edges(token, ray);
        if edges.candidates == 0 {
            return None;
        }
        let t_max = T::F32x8::splat(token, t_max);
        self.hits::<T, NEED_T>(token, ray, corners, edges, t_max)
    }

    /// The rest of the test.
    #[inline(always)]
    fn hits<T: Simd, const NEED_T: bool>(
        self,
        token: T,
        ray: &RayShear<'_, T::F32x8>,
        corners: Corners<T::F32x8>,
        edges: Edges<T::F32x8>,
        t_max: T::F32x8,
    ) -> Option<TriangleHits<T::F32x8>> {
        let pairs = OneRay(self, ray);
        (ray.along(token))
            .test::<8, NEED_T, Self::Precision, _>(token, corners, edges, t_max, pairs)
    }
}

/// A ray against all triangles of a leaf.
#[derive(Clone, Copy)]
struct OneRay<'a, R, V>(R, &'a RayShear<'a, V>);

impl<R: Triangles, V: Copy> Pairs for OneRay<'_, R, V> {
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
pub trait TriangleLeaves: for<'a> Leaves<Ref<'a>: Triangles> {}
impl<L: for<'a> Leaves<Ref<'a>: Triangles>> TriangleLeaves for L {}
