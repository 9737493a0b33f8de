//! What a query cost.

use super::single::Visitor;
use crate::layout::Leaves;
use core::ops::ControlFlow;

/// How much a query looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Nodes whose boxes were tested.
    pub nodes: u32,
    /// Leaves reached.
    pub leaves: u32,
    /// Triangles in these leaves.
    pub triangles: u32,
}

/// A visitor that counts what another one meets.
pub(super) struct Counting<V> {
    pub(super) visitor: V,
    pub(super) counts: Counts,
}

impl<L: Leaves, V: Visitor<L>> Visitor<L> for Counting<V> {
    const NEAREST_FIRST: bool = V::NEAREST_FIRST;

    #[inline(always)]
    fn node(&mut self) {
        self.counts.nodes += 1;
        self.visitor.node();
    }

    #[inline(always)]
    fn leaf(&mut self, leaf: L::Ref<'_>) -> ControlFlow<(), f32> {
        self.counts.leaves += 1;
        self.counts.triangles += L::primitives(leaf) as u32;
        self.visitor.leaf(leaf)
    }
}
