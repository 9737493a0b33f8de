//! A few references, split down to single ones or leaves: every cut on every axis is weighed.
//!
//! The references are sorted once an axis; a cut keeps the other axes' orders.

use super::{
    binary::BinaryNode,
    input::{Input, leaf_of},
    refs::{Bounds, Ref, half_areas},
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Operation, Simd},
};
use bytemuck::Zeroable;
use std::vec::Vec;
use wide::f32x4;

/// The most references that are swept. Above it bins are faster and lose next to nothing.
pub(super) const MAX: usize = 32;

/// References by place, and their order along each axis.
struct Sweep<'a, I> {
    input: &'a I,
    refs: [Ref; MAX],
    orders: [[u8; MAX]; 3],
    /// The place of `refs[0]` in the tree's order.
    first: u32,
    leaves: Leaves,
    backend: Backend,
}

/// How far down a tree goes: to single primitives; or to leaves of as many as there is room for, if their box is small.
#[derive(Clone, Copy)]
pub(super) struct Leaves {
    /// Half the area, scaled, below which a leaf is full.
    pub below: f32,
}

impl Leaves {
    pub const SINGLE: Self = Self { below: 0.0 };
    pub const FULL: Self = Self { below: f32::MAX };

    /// Full leaves of less than this share of the area of all.
    pub fn smaller_than(share: f32, refs: &[Ref]) -> Self {
        let bounds = refs
            .iter()
            .fold(Bounds::EMPTY, |all, r| all.join(r.bounds()));
        Self {
            below: match refs {
                [] => 0.0,
                _ => share * bounds.half_area(),
            },
        }
    }
}

/// Builds the tree over `refs`, at most [`MAX`] of them, which are left in its order, where their first place is
/// `first`. Its root goes to a place of `nodes`, those below it to their end.
pub(super) fn build<I: Input>(
    input: &I,
    refs: &mut [Ref],
    first: usize,
    leaves: Leaves,
    nodes: &mut Vec<BinaryNode>,
    root: usize,
) {
    let backend = Backend::detect();
    backend.run(Build {
        input,
        refs,
        first,
        leaves,
        backend,
        nodes,
        root,
    });
}

struct Build<'a, I> {
    input: &'a I,
    refs: &'a mut [Ref],
    first: usize,
    leaves: Leaves,
    backend: Backend,
    nodes: &'a mut Vec<BinaryNode>,
    root: usize,
}

impl<I: Input> Operation for Build<'_, I> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            input,
            refs,
            first,
            leaves,
            backend,
            nodes,
            root,
        } = self;
        // Leaves are going to read what there is of primitives: it is fetched while they are sorted.
        for r in &*refs {
            input.fetch_place(token, r.id());
        }
        let len = refs.len();
        let mut sweep = Sweep {
            input,
            refs: [Ref::NONE; MAX],
            orders: [[0; MAX]; 3],
            first: first as u32,
            leaves,
            backend,
        };
        sweep.refs[..len].copy_from_slice(refs);
        let mut keys = [0; MAX];
        for axis in 0..3 {
            for (place, r) in refs.iter().enumerate() {
                let center = r.center2().to_array()[axis];
                keys[place] = (u64::from(sortable(center)) << 32) | place as u64;
            }
            keys[..len].sort_unstable();
            for (order, key) in sweep.orders[axis].iter_mut().zip(&keys[..len]) {
                *order = *key as u8;
            }
            if axis == 1 {
                for r in &*refs {
                    input.fetch(token, input.place(r.id()));
                }
            }
        }
        let below = nodes.len();
        sweep.split_all(len, nodes, root);
        for (r, &place) in refs.iter_mut().zip(&sweep.orders[0]) {
            *r = sweep.refs[place as usize];
        }
        // Nodes after those below them.
        for place in (below..nodes.len()).rev().chain([root]) {
            let node = nodes[place];
            if !node.is_leaf() {
                let [left, right] = node.children();
                nodes[place].aabb = nodes[left].aabb.join(nodes[right].aabb);
            }
        }
    }
}

/// Bits that are in order as the floats are.
fn sortable(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    }
}

impl<I: Input> Sweep<'_, I> {
    /// Splits the first so many. The boxes of nodes with children are left open.
    #[inline(always)]
    fn split_all(&mut self, len: usize, nodes: &mut Vec<BinaryNode>, root: usize) {
        // Runs that are to be split, and the places of their nodes.
        let mut todo = [(0, 0, 0); MAX];
        todo[0] = (0, len, root);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (start, end, place) = todo[count % MAX];
            let fits = end - start <= I::MAX_LEAF && self.fits(start, end);
            if fits || end - start == 1 {
                nodes[place] = self.leaf(start, end);
                continue;
            }
            // Of two there is one cut.
            let mut mid = start + 1;
            if end - start > 2 {
                let axis;
                (axis, mid) = self.cheapest(start, end);
                self.partition(axis, start, mid, end);
            }
            let below = nodes.len();
            nodes[place] = BinaryNode {
                first: below as u32,
                ..BinaryNode::zeroed()
            };
            nodes.extend([BinaryNode::zeroed(); 2]);
            for run in [(mid, end, below + 1), (start, mid, below)] {
                todo[count % MAX] = run;
                count += 1;
            }
        }
    }

    #[inline(always)]
    fn id(&self, place: usize) -> u32 {
        self.refs[self.orders[0][place] as usize].id()
    }

    #[inline(always)]
    fn leaf(&self, start: usize, end: usize) -> BinaryNode {
        let aabbs = (start..end).map(|place| self.input.aabb(self.id(place)));
        BinaryNode {
            aabb: aabbs.reduce(Aabb::join).unwrap_or(Aabb::EMPTY),
            first: self.first + start as u32,
            count: (end - start) as u32,
        }
    }

    /// Whether these can be one leaf, and one that is small enough.
    #[inline(always)]
    fn fits(&self, start: usize, end: usize) -> bool {
        let refs = self.orders[0][start..end].iter();
        let bounds = refs.fold(Bounds::EMPTY, |bounds, &place| {
            bounds.join(self.refs[place as usize].bounds())
        });
        if bounds.half_area() >= self.leaves.below {
            return false;
        }
        let mut ids = [0; MAX];
        for (id, place) in ids.iter_mut().zip(start..end) {
            *id = self.id(place);
        }
        leaf_of(self.backend, self.input, &ids[..end - start], 0).is_some()
    }

    /// The axis and the place of the cheapest cut; of equals the one nearest to halves.
    #[inline(always)]
    fn cheapest(&self, start: usize, end: usize) -> (usize, usize) {
        let len = end - start;
        let [xs, ys, zs] = &self.orders;
        let (xs, ys, zs) = (&xs[start..end], &ys[start..end], &zs[start..end]);
        let at = |order: &[u8], place: usize| self.refs[order[place] as usize].bounds();
        let join = |all: [Bounds; 3], place: usize| {
            [
                all[0].join(at(xs, place)),
                all[1].join(at(ys, place)),
                all[2].join(at(zs, place)),
            ]
        };
        // An axis a lane.
        let mut right_costs = [f32x4::ZERO; MAX];
        let mut bounds = [Bounds::EMPTY; 3];
        for place in (1..len).rev() {
            bounds = join(bounds, place);
            right_costs[place] = half_areas(bounds) * f32x4::splat((len - place) as f32);
        }
        let mut best = [((f32::INFINITY, usize::MAX), len / 2); 3];
        let mut least = f32x4::splat(f32::INFINITY);
        let mut bounds = [Bounds::EMPTY; 3];
        for (place, &right_costs) in right_costs[..len].iter().enumerate().skip(1) {
            bounds = join(bounds, place - 1);
            let costs = half_areas(bounds) * f32x4::splat(place as f32) + right_costs;
            if costs.simd_le(least).to_bitmask() & 7 == 0 {
                continue;
            }
            for (best, cost) in best.iter_mut().zip(costs.to_array()) {
                let key = (cost, place.abs_diff(len - place));
                if key < best.0 {
                    *best = (key, place);
                }
            }
            least = f32x4::new([best[0].0.0, best[1].0.0, best[2].0.0, f32::NEG_INFINITY]);
        }
        let mut axis = 0;
        for other in 1..3 {
            if best[other].0 < best[axis].0 {
                axis = other;
            }
        }
        (axis, start + best[axis].1)
    }

    /// Has the other axes' orders agree on what is left of `mid`.
    #[inline(always)]
    fn partition(&mut self, axis: usize, start: usize, mid: usize, end: usize) {
        let mut is_left = [false; MAX];
        for &place in &self.orders[axis][start..mid] {
            is_left[place as usize] = true;
        }
        for other in [(axis + 1) % 3, (axis + 2) % 3] {
            let order = &mut self.orders[other];
            let mut rest = [0; MAX];
            let (mut left, mut right) = (start, 0);
            for place in start..end {
                let r = order[place];
                let go_left = is_left[r as usize];
                // Both are written, one is kept: no branch to miss.
                order[left] = r;
                rest[right] = r;
                left += usize::from(go_left);
                right += usize::from(!go_left);
            }
            order[mid..end].copy_from_slice(&rest[..right]);
        }
    }
}
