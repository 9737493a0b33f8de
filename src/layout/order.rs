//! How leaves that are runs know the numbers of their primitives: by a list, or because primitives are in their order.

use core::fmt::Debug;

/// [`ByList`] or [`InOrder`].
pub trait Order: Copy + Debug + sealed::Sealed {
    /// In the header of [bytes](super::bytes).
    #[doc(hidden)]
    const KIND: u32;
    /// Whether there is a list.
    #[doc(hidden)]
    const LISTED: bool;
    /// What there is beside the nodes: an `M`, from which primitives are read, and how many there are if no list tells.
    #[doc(hidden)]
    type Over<M: Part>: Part;
    /// What primitives are read from.
    #[doc(hidden)]
    fn of<M: Part>(over: &Self::Over<M>) -> &M;
    /// How many there are.
    #[doc(hidden)]
    fn len<M: Part>(over: &Self::Over<M>, primitives: &[u32]) -> usize;
    /// So many over something.
    #[doc(hidden)]
    fn counted<M: Part>(of: M, count: usize) -> Self::Over<M>;
}

/// What there is beside the nodes, or a part of that: a mesh, nothing, how many there are.
#[doc(hidden)]
pub trait Part: Copy + Send + Sync {}
impl<M: Copy + Send + Sync> Part for M {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ByList {}
    impl Sealed for super::InOrder {}
}

/// A list has the number of each place.
#[derive(Clone, Copy, Debug)]
pub enum ByList {}

/// Each place is a number: there is no list.
#[derive(Clone, Copy, Debug)]
pub enum InOrder {}

/// So many primitives of an `M`, in the order of leaves.
#[derive(Clone, Copy, Debug)]
pub struct Counted<M> {
    /// What they are read from.
    pub of: M,
    /// How many there are.
    pub count: usize,
}

impl Order for ByList {
    const KIND: u32 = super::bytes::RUNS;
    const LISTED: bool = true;
    type Over<M: Part> = M;

    #[inline(always)]
    fn of<M: Part>(over: &M) -> &M {
        over
    }

    #[inline(always)]
    fn len<M: Part>(_: &M, primitives: &[u32]) -> usize {
        primitives.len()
    }

    fn counted<M: Part>(of: M, _: usize) -> M {
        of
    }
}

impl Order for InOrder {
    const KIND: u32 = super::bytes::ORDERED_RUNS;
    const LISTED: bool = false;
    type Over<M: Part> = Counted<M>;

    #[inline(always)]
    fn of<M: Part>(over: &Counted<M>) -> &M {
        &over.of
    }

    #[inline(always)]
    fn len<M: Part>(over: &Counted<M>, _: &[u32]) -> usize {
        over.count
    }

    fn counted<M: Part>(of: M, count: usize) -> Counted<M> {
        Counted { of, count }
    }
}

/// The number of the primitive at a place: the list's, or the place where there is none.
#[inline(always)]
pub(crate) fn number_at(primitives: &[u32], place: usize) -> u32 {
    primitives.get(place).copied().unwrap_or(place as u32)
}
