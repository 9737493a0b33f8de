//! What a ray has hit in one leaf.

use crate::{
    layout::{TriangleLeaf, number_at},
    primitive::triangle::{TriangleHits, bits},
    simd::Lanes,
    traverse::triangles::Found,
};
use core::hint::select_unpredictable;

/// The triangles of a leaf that a ray has hit.
pub(super) struct LeafHits {
    /// A bit each.
    mask: u32,
    /// The place of the leaf's first in the list of primitive numbers.
    first: usize,
    t: [f32; MOST],
    u: [f32; MOST],
    v: [f32; MOST],
}

/// No leaf has more triangles.
const MOST: usize = TriangleLeaf::MAX_TRIANGLES;

impl LeafHits {
    pub(super) const NONE: Self = Self {
        mask: 0,
        first: 0,
        t: [0.0; MOST],
        u: [0.0; MOST],
        v: [0.0; MOST],
    };

    /// Becomes those in a leaf whose triangles begin at place `first`.
    #[inline(always)]
    pub(super) fn set<V: Lanes>(&mut self, first: usize, hits: &TriangleHits<V>) {
        (self.mask, self.first) = (hits.mask, first);
        for (to, lanes) in [
            (&mut self.t, hits.t),
            (&mut self.u, hits.u),
            (&mut self.v, hits.v),
        ] {
            let lanes = lanes.to_array();
            to[..lanes.as_ref().len()].copy_from_slice(lanes.as_ref());
        }
    }

    /// The first of them.
    #[inline(always)]
    pub(super) fn first(&self) -> Found {
        self.get(self.mask.trailing_zeros() as usize)
    }

    /// The nearest; of those as near the one of the least number.
    #[inline(always)]
    pub(super) fn nearest(&self, primitives: &[u32]) -> Found {
        let (mut lanes, mut nearest) = (bits(self.mask), self.first());
        lanes.next();
        for lane in lanes {
            let other = self.get(lane);
            // The rule of `Found::compare`, but both numbers are read, for there to be no branch on which is nearer.
            let [a, b] = [other.place, nearest.place].map(|place| number_at(primitives, place));
            let is_nearer = (other.t < nearest.t) | (other.t == nearest.t) & (a < b);
            nearest = select_unpredictable(is_nearer, other, nearest);
        }
        nearest
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Found {
        let lane = lane % MOST;
        Found {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            place: self.first + lane,
        }
    }
}
