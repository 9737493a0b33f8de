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
    /// The place of a leaf.
    Leaf(usize),
}

impl Child {
    /// Nothing.
    pub const EMPTY: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    /// Node number `index`, less than 2^31.
    #[inline]
    pub const fn node(index: u32) -> Self {
        debug_assert!(index < Self::LEAF);
        Self(index)
    }

    /// Leaf number `index`, less than 2^31 - 1.
    #[inline]
    pub const fn leaf(index: u32) -> Self {
        debug_assert!(index < Self::LEAF - 1);
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

    #[inline(always)]
    pub(crate) const fn to_bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The place it leads to, if it is not empty.
    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

impl fmt::Debug for Child {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.kind().fmt(f)
    }
}
