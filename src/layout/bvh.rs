//! The hierarchy: its parts, checked once when they are put together.

#[cfg(feature = "std")]
use super::Counted;
use super::{
    Borrowed, Child, CompactNode4, CompactNode8, LayoutError, Leaf, Leaves, Link, MeshLeaf, Node4,
    Node8, OrderedLeaf, OrderedMeshLeaf, PrimitiveLeaf, RunLeaf, Storage, TriangleLeaf, WideNode,
    check,
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Simd},
};
use core::fmt;

/// Caches are likely to hold what is over no more primitives than this.
const LARGE: usize = 1 << 18;
/// And they are not likely to hold even what the rays of a picture meet of what is over more than this.
const VAST: usize = 1 << 22;

/// A wide bounding volume hierarchy: nodes `N`, leaves `L`, memory of `S`.
///
/// Built by [`Builder`](crate::build::Builder), opened by [`from_bytes`](Bvh::from_bytes), or put together by
/// [`from_parts`](Self::from_parts). Which kinds there are is in the module's [aliases](super#types), how they are asked in
/// [`traverse`](crate::traverse).
#[derive(Clone)]
pub struct Bvh<N: WideNode, L: Leaves, S: Storage> {
    nodes: S::Slice<N>,
    leaves: L::Store<S>,
    primitives: S::Slice<u32>,
    /// One more than the greatest primitive number, if that has been asked for.
    pub(super) numbers: u64,
    root: Child,
    bounds: Aabb,
    backend: Backend,
    dropped: u32,
    /// All bits, or none, if it is no more than caches are likely to hold: a mask on what is looked at only then, which is one
    /// branch less than a condition.
    large: u32,
    looks_ahead: bool,
}

/// Triangles under 8-wide nodes, borrowed. Queries: [`traverse`](crate::traverse).
pub type Bvh8Ref<'a> = Bvh<Node8, TriangleLeaf, Borrowed<'a>>;
/// Triangles under 4-wide nodes, borrowed. Queries: [`traverse`](crate::traverse).
pub type Bvh4Ref<'a> = Bvh<Node4, TriangleLeaf, Borrowed<'a>>;
/// A caller's primitives under 8-wide nodes, borrowed. Queries: [`traverse`](crate::traverse).
pub type PrimitiveBvh8Ref<'a> = Bvh<Node8, PrimitiveLeaf, Borrowed<'a>>;
/// A caller's primitives under 4-wide nodes, borrowed. Queries: [`traverse`](crate::traverse).
pub type PrimitiveBvh4Ref<'a> = Bvh<Node4, PrimitiveLeaf, Borrowed<'a>>;
/// Triangles under 8-wide nodes of 80 bytes, borrowed. Queries: [`traverse`](crate::traverse).
pub type QuantizedBvh8Ref<'a> = Bvh<CompactNode8, TriangleLeaf, Borrowed<'a>>;
/// Primitive numbers under 8-wide nodes of 80 bytes, borrowed. Queries: [`traverse`](crate::traverse).
pub type CompactBvh8Ref<'a> = Bvh<CompactNode8, RunLeaf, Borrowed<'a>>;
/// Primitive numbers under 4-wide nodes of 48 bytes, borrowed. Queries: [`traverse`](crate::traverse).
pub type CompactBvh4Ref<'a> = Bvh<CompactNode4, RunLeaf, Borrowed<'a>>;
/// A mesh's triangles under 8-wide nodes of 80 bytes, borrowed, mesh and all. Queries: [`traverse`](crate::traverse).
pub type MeshBvh8<'a> = Bvh<CompactNode8, MeshLeaf<'a>, Borrowed<'a>>;
/// A mesh's triangles under 4-wide nodes of 48 bytes, borrowed, mesh and all. Queries: [`traverse`](crate::traverse).
pub type MeshBvh4<'a> = Bvh<CompactNode4, MeshLeaf<'a>, Borrowed<'a>>;

/// Nodes of 80 bytes alone, 8 wide, over primitives in the order of leaves, borrowed. Queries: [`traverse`](crate::traverse).
pub type OrderedBvh8Ref<'a> = Bvh<CompactNode8, OrderedLeaf, Borrowed<'a>>;
/// Nodes of 48 bytes alone, 4 wide, over primitives in the order of leaves, borrowed. Queries: [`traverse`](crate::traverse).
pub type OrderedBvh4Ref<'a> = Bvh<CompactNode4, OrderedLeaf, Borrowed<'a>>;
/// The same 8-wide nodes over a mesh, borrowed, mesh and all. Queries: [`traverse`](crate::traverse).
pub type OrderedMeshBvh8<'a> = Bvh<CompactNode8, OrderedMeshLeaf<'a>, Borrowed<'a>>;
/// The same 4-wide nodes over a mesh, borrowed, mesh and all. Queries: [`traverse`](crate::traverse).
pub type OrderedMeshBvh4<'a> = Bvh<CompactNode4, OrderedMeshLeaf<'a>, Borrowed<'a>>;

#[cfg(feature = "alloc")]
mod owned {
    use super::*;
    use crate::layout::Owned;

    /// Triangles under 8-wide nodes. Queries: [`traverse`](crate::traverse).
    pub type Bvh8 = Bvh<Node8, TriangleLeaf, Owned>;
    /// Triangles under 4-wide nodes. Queries: [`traverse`](crate::traverse).
    pub type Bvh4 = Bvh<Node4, TriangleLeaf, Owned>;
    /// A caller's primitives under 8-wide nodes. Queries: [`traverse`](crate::traverse).
    pub type PrimitiveBvh8 = Bvh<Node8, PrimitiveLeaf, Owned>;
    /// A caller's primitives under 4-wide nodes. Queries: [`traverse`](crate::traverse).
    pub type PrimitiveBvh4 = Bvh<Node4, PrimitiveLeaf, Owned>;
    /// Triangles under 8-wide nodes of 80 bytes: for scenes of millions. [`Builder::build_as`](crate::build::Builder::build_as)
    /// makes it. Queries: [`traverse`](crate::traverse).
    pub type QuantizedBvh8 = Bvh<CompactNode8, TriangleLeaf, Owned>;
    /// Primitive numbers under 8-wide nodes of 80 bytes. Queries: [`traverse`](crate::traverse).
    pub type CompactBvh8 = Bvh<CompactNode8, RunLeaf, Owned>;
    /// Primitive numbers under 4-wide nodes of 48 bytes. Queries: [`traverse`](crate::traverse).
    pub type CompactBvh4 = Bvh<CompactNode4, RunLeaf, Owned>;
    /// Nodes of 80 bytes alone, 8 wide, over primitives in the order of leaves. Queries: [`traverse`](crate::traverse).
    pub type OrderedBvh8 = Bvh<CompactNode8, OrderedLeaf, Owned>;
    /// Nodes of 48 bytes alone, 4 wide, over primitives in the order of leaves. Queries: [`traverse`](crate::traverse).
    pub type OrderedBvh4 = Bvh<CompactNode4, OrderedLeaf, Owned>;
}
#[cfg(feature = "alloc")]
pub use owned::*;

impl<N: WideNode, L: Leaves, S: Storage> Bvh<N, L, S> {
    /// Puts a hierarchy together.
    ///
    /// The parts are in one canonical order, which makes the check linear and needs no memory: `root` is
    /// node 0, or leaf 0 where there is no node, or empty. Seen from the root in depth-first order,
    /// lane by lane, each node's children that are nodes follow, side by side, the last node met so far,
    /// and those that are leaves the last leaf. `primitives` is what leaves count in: the numbers that
    /// hits are reported with. `bounds` are the bounds of all primitives.
    ///
    /// # Errors
    /// Anything that would make a query read out of bounds, loop or need more than its stack; or a box that
    /// is no box, or is not within `bounds`.
    pub fn from_parts(
        nodes: S::Slice<N>,
        leaves: L::Store<S>,
        primitives: S::Slice<u32>,
        bounds: Aabb,
    ) -> Result<Self, LayoutError> {
        let root = check::check::<N, L, S>(&nodes, &leaves, &primitives, &bounds)?;
        Ok(Self::rooted(nodes, leaves, primitives, bounds, root))
    }

    fn rooted(
        nodes: S::Slice<N>,
        leaves: L::Store<S>,
        primitives: S::Slice<u32>,
        bounds: Aabb,
        root: Child,
    ) -> Self {
        let len = L::len::<S>(&leaves, &primitives);
        Self {
            large: u32::from(len > LARGE).wrapping_neg(),
            looks_ahead: len > VAST,
            numbers: L::numbers::<S>(&leaves, &primitives),
            nodes,
            leaves,
            primitives,
            root,
            bounds,
            backend: Backend::detect(),
            dropped: 0,
        }
    }

    /// The nodes, the root first.
    #[inline(always)]
    pub fn nodes(&self) -> &[N] {
        &self.nodes
    }

    /// How the leaves are kept.
    pub(super) fn leaf_store(&self) -> &L::Store<S> {
        &self.leaves
    }

    /// Whether it is more than the caches are likely to hold.
    #[inline(always)]
    pub(crate) fn is_large(&self) -> bool {
        self.large != 0
    }

    /// How many primitives all leaves have together: one that is in several is counted as often.
    #[inline(always)]
    pub fn primitive_count(&self) -> usize {
        L::len::<S>(&self.leaves, &self.primitives)
    }

    /// Has fetched what is read next of the leaf at a place: [`Leaves::fetch_next`].
    ///
    /// # Safety
    /// The leaf is there.
    #[inline(always)]
    pub(crate) unsafe fn fetch_next<T: Simd>(&self, token: T, place: usize) {
        // SAFETY: the caller's promise.
        unsafe { L::fetch_next::<T, S>(token, &self.leaves, &self.primitives, place) };
    }

    /// Has what a link leads to fetched.
    #[inline(always)]
    pub(crate) fn prefetch<T: Simd>(&self, token: T, link: Link) {
        token.prefetch(if link.is_leaf() {
            self.leaf_address(link.leaf())
        } else {
            let nodes = self.nodes().as_ptr();
            nodes.wrapping_byte_add(link.node_offset()).cast()
        });
    }

    /// Has the leaves fetched that a node leads to, the first of them, if it is quickly found where they are.
    #[inline(always)]
    pub(crate) fn prefetch_leaves<T: Simd>(&self, token: T, node: &N) {
        if let Some(place) = node.first_leaf(self.large) {
            token.prefetch_bytes(self.leaf_address(place), L::AHEAD);
        }
    }

    /// Has the vertices fetched that a node's leaves read, if it says where those are.
    #[inline(always)]
    pub(crate) fn prefetch_vertices<T: Simd>(&self, token: T, node: &N) {
        L::fetch_vertices::<T, S>(token, &self.leaves, node.first_vertex());
    }

    /// The node that a link leads to.
    ///
    /// # Safety
    /// It is a link of this hierarchy, to a node.
    #[inline(always)]
    pub(crate) unsafe fn node(&self, link: Link) -> &N {
        // SAFETY: the check of `from_parts` saw that all nodes led to are there, or the builder has emitted them in order.
        unsafe { &*self.nodes().as_ptr().byte_add(link.node_offset()) }
    }

    /// What is read first of the leaf at a place.
    #[inline(always)]
    pub(crate) fn leaf_address(&self, place: usize) -> *const u8 {
        L::address::<S>(&self.leaves, &self.primitives, place)
    }

    /// The leaf at a place.
    ///
    /// # Safety
    /// A link led there.
    #[inline(always)]
    pub(crate) unsafe fn leaf(&self, place: usize) -> L::Ref<'_> {
        // SAFETY: the check of `from_parts` saw that all leaves led to are there, or the builder has emitted them in order.
        unsafe { L::at::<S>(&self.leaves, &self.primitives, place) }
    }

    /// The number of each primitive in the leaves; none where it is its place ([`OrderedLeaf`](super::OrderedLeaf)).
    #[inline(always)]
    pub fn primitives(&self) -> &[u32] {
        &self.primitives
    }

    /// Where a walk begins.
    #[inline(always)]
    pub fn root(&self) -> Child {
        self.root
    }

    /// The bounds of all primitives; [`Aabb::EMPTY`] if there are none.
    #[inline(always)]
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// The instructions that queries use.
    #[inline(always)]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Has queries use other instructions than the best. The answers are the same.
    pub fn set_backend(&mut self, backend: Backend) {
        self.backend = backend;
    }

    /// Whether queries of one ray look ahead, as they do in a hierarchy over more than 2^22 primitives: while what is next is on
    /// its way from memory they walk what was left behind last.
    #[inline(always)]
    pub fn looks_ahead(&self) -> bool {
        self.looks_ahead
    }

    /// Has queries of one ray [look ahead](Self::looks_ahead), or not. They gain up to a sixth where caches do not hold what they
    /// read, and lose up to a seventh where they do: worth a try if a program uses the caches for much else, or asks seldom. The
    /// answers are the same.
    pub fn set_looks_ahead(&mut self, looks_ahead: bool) {
        self.looks_ahead = looks_ahead;
    }

    /// Notes that the builder left out this many primitives.
    pub(crate) fn with_dropped(self, dropped: u32) -> Self {
        Self { dropped, ..self }
    }

    /// How many primitives the builder left out because they were not finite.
    pub fn dropped(&self) -> usize {
        self.dropped as usize
    }

    /// The same nodes and numbers, borrowed, with leaves kept in another way.
    pub(crate) fn with_leaves<'a, K: Leaves>(
        &'a self,
        leaves: K::Store<Borrowed<'a>>,
    ) -> Bvh<N, K, Borrowed<'a>> {
        self.with_parts(self.nodes(), leaves, self.primitives())
    }

    /// The same hierarchy of other parts.
    fn with_parts<K: Leaves, T: Storage>(
        &self,
        nodes: T::Slice<N>,
        leaves: K::Store<T>,
        primitives: T::Slice<u32>,
    ) -> Bvh<N, K, T> {
        Bvh {
            nodes,
            leaves,
            primitives,
            numbers: self.numbers,
            root: self.root,
            bounds: self.bounds,
            backend: self.backend,
            dropped: self.dropped,
            large: self.large,
            looks_ahead: self.looks_ahead,
        }
    }

    /// The same hierarchy, borrowed.
    pub fn as_borrowed(&self) -> Bvh<N, L, Borrowed<'_>> {
        self.with_leaves(L::borrowed::<S>(&self.leaves))
    }

    /// The same hierarchy in memory of its own: one that was opened from bytes, to be kept without them, or
    /// [refitted](Bvh::refit).
    #[cfg(feature = "alloc")]
    pub fn into_owned(self) -> Bvh<N, L, super::Owned> {
        let leaves = L::owned::<S>(&self.leaves);
        self.with_parts(self.nodes.to_vec(), leaves, self.primitives.to_vec())
    }

    /// How many bytes nodes, leaves and primitive numbers take: what there is beside the primitives, or the mesh, of a
    /// caller.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes()) + L::bytes::<S>(&self.leaves) + size_of_val(self.primitives())
    }
}

impl<N: WideNode, L: Leaf, S: Storage> Bvh<N, L, S> {
    /// The leaves.
    #[inline(always)]
    pub fn leaves(&self) -> &[L] {
        &self.leaves
    }
}

#[cfg(feature = "std")]
impl<N: WideNode, L: Leaf> Bvh<N, L, crate::layout::Owned> {
    /// Puts together what the builder has emitted, which the check would let pass: that is up to the builder, and looked
    /// at in debug builds alone, as it takes as long as the sort of a fast build; and of compact nodes, whose links tell
    /// fewer places apart.
    ///
    /// # Errors
    /// More nodes, leaves or primitives than their numbers can tell apart.
    pub(crate) fn from_emitted(
        nodes: alloc::vec::Vec<N>,
        leaves: alloc::vec::Vec<L>,
        primitives: alloc::vec::Vec<u32>,
        bounds: Aabb,
    ) -> Result<Self, LayoutError> {
        if N::NODES_FIRST {
            let bounds = tested_bounds(&nodes, bounds);
            return Self::from_parts(nodes, leaves, primitives, bounds);
        }
        let root = check::root::<N, L>(nodes.len(), leaves.len(), primitives.len())?;
        debug_assert_eq!(
            check::check::<N, L, crate::layout::Owned>(&nodes, &leaves, &primitives, &bounds),
            Ok(root)
        );
        Ok(Self::rooted(nodes, leaves, primitives, bounds, root))
    }
}

#[cfg(feature = "std")]
impl<N: WideNode, L: Leaves> Bvh<N, L, crate::layout::Owned> {
    /// What changes when primitives move: leaves, nodes, and the bounds. That it stays sound is up to the caller.
    pub(crate) fn moving_parts(
        &mut self,
    ) -> (&mut L::Store<crate::layout::Owned>, &mut [N], &mut Aabb) {
        (&mut self.leaves, &mut self.nodes, &mut self.bounds)
    }
}

#[cfg(feature = "std")]
impl<N: WideNode> Bvh<N, RunLeaf, crate::layout::Owned> {
    /// The same over primitives that are in the order of the list. `nodes` are its own.
    pub(crate) fn in_order(
        &self,
        nodes: alloc::vec::Vec<N>,
    ) -> Bvh<N, OrderedLeaf, crate::layout::Owned> {
        let count = self.primitive_count();
        Bvh {
            numbers: count as u64,
            ..self.with_parts(nodes, Counted { of: (), count }, alloc::vec::Vec::new())
        }
    }
}

/// What holds the boxes of all nodes as they are tested, if `bounds` hold what is in them.
#[cfg(feature = "std")]
pub(crate) fn tested_bounds<N: WideNode>(nodes: &[N], bounds: Aabb) -> Aabb {
    let of_node = |node: &N| (0..N::WIDTH).fold(Aabb::EMPTY, |all, i| all.join(node.child_aabb(i)));
    nodes.iter().map(of_node).fold(bounds, Aabb::join)
}

impl<N: WideNode, L: Leaves, S: Storage> fmt::Debug for Bvh<N, L, S> {
    /// How much there is of each part, not the parts.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bvh")
            .field("width", &N::WIDTH)
            .field("nodes", &self.nodes.len())
            .field("primitives", &self.primitive_count())
            .field("bounds", &self.bounds)
            .field("backend", &self.backend)
            .finish()
    }
}
