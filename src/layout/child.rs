//! What a lane of a node leads to.

use bytemuck::{Pod, Zeroable};
use core::fmt;

/// A node, a leaf, or nothing, in 32 bits: all set is nothing, else the highest says that the rest is the
/// place of a leaf and not of a node.
#[derive(Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Child(u32);

/// A [`Child`] taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Nothing.
    Empty,
    /// The place of a node.
    Node(usize),
    /// The place of a leaf: see [`Child::leaf`].
    Leaf(usize),
}

impl Child {
    /// Nothing.
    pub const EMPTY: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    /// Node number `index`, of which 31 bits count.
    #[inline]
    pub const fn node(index: u32) -> Self {
        Self(index & !Self::LEAF)
    }

    /// Leaf number `index`, less than 2^31 - 1, of which 31 bits count. Of a leaf that is a run of the list of primitive
    /// numbers ([`RunLeaf`](super::RunLeaf)) it is its place in the list, with the number of them less one in bits 29 and 30.
    #[inline]
    pub const fn leaf(index: u32) -> Self {
        Self(index | Self::LEAF)
    }

    /// What it leads to.
    #[inline]
    pub const fn kind(self) -> ChildKind {
        match self {
            Self::EMPTY => ChildKind::Empty,
            _ if self.is_leaf() => ChildKind::Leaf(self.index()),
            _ => ChildKind::Node(self.index()),
        }
    }

    /// Whether it leads to a leaf, if it is not empty.
    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The place it leads to, if it is not empty.
    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// A [`Child`] as nodes hold it: the place of a node is counted in [`Link::UNIT`]s of bytes, so that a walk
/// shifts where it would multiply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Link(u32);

impl Link {
    /// 16 bytes.
    pub const UNIT: usize = 1 << Self::SHIFT;
    const SHIFT: u32 = 4;
    /// To nothing.
    pub(crate) const EMPTY: Self = Self(Child::EMPTY.0);
    /// How many places 31 bits tell apart, from each other and from no child.
    pub(crate) const PLACES: usize = (1 << 31) - 2;

    /// The link to `child`, nodes being `N`, which is a whole number of units. Of a place too far away for
    /// 31 bits, nothing sensible comes: the layout's check sees it.
    #[inline]
    pub const fn new<N>(child: Child) -> Self {
        const { assert!(size_of::<N>().is_multiple_of(Self::UNIT)) };
        match child.kind() {
            ChildKind::Node(index) => Self::node::<N>(index as u32),
            _ => Self(child.0),
        }
    }

    /// The link to a node. As [`new`](Self::new), of a place too far away nothing sensible comes.
    #[inline(always)]
    pub(crate) const fn node<N>(index: u32) -> Self {
        Self(index.wrapping_mul(Self::units::<N>()) & !Child::LEAF)
    }

    /// The link to a leaf's place, of which 31 bits count.
    #[inline(always)]
    pub(crate) const fn leaf_at(place: u32) -> Self {
        Self(place | Child::LEAF)
    }

    /// The link to the same after so many other nodes and leaves.
    #[inline(always)]
    pub(crate) const fn after<N>(self, nodes: u32, leaves: u32) -> Self {
        if self.0 == Child::EMPTY.0 {
            self
        } else if self.is_leaf() {
            Self::leaf_at(self.0.wrapping_add(leaves))
        } else {
            Self(self.0.wrapping_add(Self::node::<N>(nodes).0) & !Child::LEAF)
        }
    }

    /// What it leads to.
    #[inline]
    pub const fn child<N>(self) -> Child {
        if self.is_leaf() {
            Child(self.0)
        } else {
            Child(self.0 / Self::units::<N>())
        }
    }

    const fn units<N>() -> u32 {
        (size_of::<N>() / Self::UNIT) as u32
    }

    /// Whether it leads to a leaf, if it is not empty.
    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & Child::LEAF != 0
    }

    /// The place of the leaf it leads to, less than 2^31.
    #[inline(always)]
    pub(crate) const fn leaf(self) -> usize {
        (self.0 & !Child::LEAF) as usize
    }

    /// How many bytes after the first node is that it leads to.
    #[inline(always)]
    pub(crate) const fn node_offset(self) -> usize {
        (self.0 as usize) << Self::SHIFT
    }

    #[inline(always)]
    pub(crate) const fn to_bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

impl fmt::Debug for Child {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.kind().fmt(f)
    }
}
