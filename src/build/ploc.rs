//! A binary tree from the bottom up: neighbours along a curve that are best for each other become one, round by round.
//!
//! Meister and Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy construction" (2018).

use super::monitor::Watch;
use crate::{
    geometry::Aabb,
    simd::{Backend, Lanes, Operation, Simd, Vector},
};
use std::{vec, vec::Vec};

/// How far along the curve a cluster looks to either side.
const RADIUS: usize = 3;
/// The offsets to those that it looks at, from `-RADIUS` on, are told by a slot each; the one in the middle is its own.
const SLOTS: usize = 2 * RADIUS + 1;
/// The bits of a slot.
const SLOT: u32 = 7;
const _: () = assert!(SLOTS <= SLOT as usize);
/// So many are looked at in one go.
const LANES: usize = 8;
const AROUND: usize = LANES + 2 * RADIUS;
/// Places of no cluster after the last.
const AFTER: usize = LANES + RADIUS;

/// A node of the tree, after those below it. It is never in two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Node {
    pub aabb: Aabb,
    /// A leaf's number, or the place of the first child.
    first: u32,
    /// How many primitives a leaf has, or the place of the second child and [`Self::INNER`].
    second: u32,
}

impl Node {
    const INNER: u32 = 1 << 31;

    pub const NONE: Self = Self::leaf(Aabb::EMPTY, 0, 0);

    #[inline(always)]
    pub const fn leaf(aabb: Aabb, number: u32, count: u32) -> Self {
        Self {
            aabb,
            first: number,
            second: count,
        }
    }

    #[inline(always)]
    pub const fn is_leaf(&self) -> bool {
        self.second & Self::INNER == 0
    }

    /// A leaf's number.
    #[inline(always)]
    pub const fn number(&self) -> usize {
        self.first as usize
    }

    /// How many primitives a leaf has.
    #[inline(always)]
    pub const fn count(&self) -> usize {
        self.second as usize
    }

    /// The two children, if it is no leaf.
    #[inline(always)]
    pub const fn children(&self) -> [usize; 2] {
        [self.first as usize, (self.second & !Self::INNER) as usize]
    }

    /// The same after so many other leaves, if it is one; else over the nodes that are where `place` says of its children.
    #[inline(always)]
    pub fn moved(&self, leaves: u32, place: impl Fn(u32) -> u32) -> Self {
        let (first, second) = match self.is_leaf() {
            true => (self.first + leaves, self.second),
            false => {
                let second = self.second & !Self::INNER;
                (place(self.first), place(second) | Self::INNER)
            }
        };
        Self {
            aabb: self.aabb,
            first,
            second,
        }
    }
}

/// Beyond any scene, whose coordinates are less than 4; its area is still finite.
const FAR: f32 = 1e18;

/// Joins clusters, which are nodes that follow each other along the curve, until there are no more than `until`: those
/// that are left. New nodes go to the end.
pub(super) fn join(
    nodes: &mut Vec<Node>,
    clusters: Vec<u32>,
    until: usize,
    scale: f32,
    watch: &Watch,
) -> Vec<u32> {
    let backend = Backend::detect();
    let mut slots = vec![0.0; RADIUS + clusters.len() + AFTER];
    let mut clusters = Clusters::new(nodes, clusters, scale);
    while clusters.places.len() > until.max(1) {
        let count = clusters.places.len();
        clusters.search(backend, &mut slots[RADIUS..]);
        backend.run(JoinPairs {
            clusters: &mut clusters,
            nodes,
            slots: &slots,
        });
        let left = clusters.places.len();
        // Clusters that all like the one before better than the one after are joined one a round. Then it
        // is halves.
        if left > count - count / 16 {
            let own = &mut slots[RADIUS..][..left];
            for (index, slot) in own.iter_mut().enumerate() {
                *slot = to_slot(if index % 2 == 0 {
                    RADIUS + 1
                } else {
                    RADIUS - 1
                });
            }
            if left % 2 == 1 {
                own[left - 1] = to_slot(RADIUS);
            }
            backend.run(JoinPairs {
                clusters: &mut clusters,
                nodes,
                slots: &slots,
            });
        }
        if !watch.advance(count - clusters.places.len()) {
            break;
        }
    }
    clusters.places
}

/// A slot as floats have it that are compared: no denormal, which some programs have taken for zero.
const fn to_slot(slot: usize) -> f32 {
    f32::from_bits(1.0f32.to_bits() | slot as u32)
}

/// Clusters along the curve.
struct Clusters {
    /// Their boxes, by side and axis, scaled by the scene's measure. There are [`RADIUS`] before the first and
    /// [`AFTER`] after the last that are far too large for anyone.
    planes: [Vec<f32>; 6],
    /// Their places among the nodes.
    places: Vec<u32>,
}

impl Clusters {
    fn new(nodes: &[Node], places: Vec<u32>, scale: f32) -> Self {
        let count = places.len();
        let mut planes =
            [-FAR, -FAR, -FAR, FAR, FAR, FAR].map(|far| vec![far; RADIUS + count + AFTER]);
        {
            let [x0, y0, z0, x1, y1, z1] = planes
                .each_mut()
                .map(|planes| &mut planes[RADIUS..RADIUS + count]);
            for (index, &place) in places.iter().enumerate() {
                let Aabb { min, max } = nodes[place as usize].aabb;
                let (min, max) = (min * scale, max * scale);
                (x0[index], y0[index], z0[index]) = (min.x, min.y, min.z);
                (x1[index], y1[index], z1[index]) = (max.x, max.y, max.z);
            }
        }
        Self { planes, places }
    }

    /// The slot of each one's best partner.
    fn search(&self, backend: Backend, slots: &mut [f32]) {
        let slots = &mut slots[..self.places.len().next_multiple_of(LANES)];
        let search = |(first, slots): (usize, &mut [f32])| {
            backend.run(Search {
                planes: self.planes.each_ref().map(|planes| &planes[first..]),
                slots,
            });
        };
        #[cfg(feature = "rayon")]
        if super::parallel::is_worth_it(slots.len()) {
            use super::parallel::TASK;
            use rayon::prelude::*;
            let chunks = slots.par_chunks_mut(TASK).enumerate();
            chunks.for_each(|(chunk, slots)| search((chunk * TASK, slots)));
            return;
        }
        search((0, slots));
    }
}

/// For each of a run of clusters the one with which the box is least; of equals the first.
///
/// Areas are compared together with the slot, which takes the last bits. So the order is one of pairs, the same
/// seen from both sides: the least pair is always joined.
struct Search<'a> {
    /// From [`RADIUS`] before the first on.
    planes: [&'a [f32]; 6],
    /// Of whole [`LANES`].
    slots: &'a mut [f32],
}

impl Operation for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let [a, b, c, d, e, f] = self.planes;
        let area_bits = S::F32x8::splat(token, f32::from_bits(!SLOT));
        let slot_bits = S::F32x8::splat(token, f32::from_bits(SLOT));
        let one = S::F32x8::splat(token, 1.0);
        let (chunks, _) = self.slots.as_chunks_mut::<LANES>();
        for (slots, first) in chunks.iter_mut().zip((0..).step_by(LANES)) {
            let boxes = [
                around(a, first),
                around(b, first),
                around(c, first),
                around(d, first),
                around(e, first),
                around(f, first),
            ];
            let [x0, y0, z0, x1, y1, z1]: [S::F32x8; 6] = boxes_at(token, boxes, RADIUS);
            let mut least = S::F32x8::splat(token, f32::INFINITY);
            for slot in (0..SLOTS).filter(|&slot| slot != RADIUS) {
                let other = boxes_at(token, boxes, slot);
                let x = x1.max(other[3]) - x0.min(other[0]);
                let y = y1.max(other[4]) - y0.min(other[1]);
                let z = z1.max(other[5]) - z0.min(other[2]);
                let area = x * y + (x + y) * z;
                let slot = S::F32x8::splat(token, f32::from_bits(slot as u32));
                least = ((area & area_bits) | slot).min_from_zero(least);
            }
            *slots = ((least & slot_bits) | one).to_array();
        }
    }
}

/// Joins those that are each other's nearest, eight at a time: who is joined nobody foresees.
struct JoinPairs<'a> {
    clusters: &'a mut Clusters,
    nodes: &'a mut Vec<Node>,
    /// After [`RADIUS`] of no cluster.
    slots: &'a [f32],
}

impl Operation for JoinPairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            clusters: Clusters { planes, places },
            nodes,
            slots,
        } = self;
        let count = places.len();
        places.resize(count + AFTER, 0);
        // What is left moves up: it never comes after where it was.
        let mut left = 0;
        for first in (0..count).step_by(LANES) {
            let pairs = Pairs::<S::F32x8>::new(token, around(slots, first));
            let all = (1 << (count - first).min(LANES)) - 1;
            let kept = all & !pairs.joined_before.bits();
            for (side, planes) in planes.iter_mut().enumerate() {
                let around = around(planes, first);
                let own: S::F32x8 = at(token, around, RADIUS);
                let other = pairs.partners(token, around);
                let joined = if side < 3 {
                    own.min(other)
                } else {
                    own.max(other)
                };
                compress::<S>(joined, kept, planes, RADIUS + left);
            }

            let old: [u32; LANES + RADIUS] = places[first..]
                .first_chunk()
                .copied()
                .unwrap_or([0; LANES + RADIUS]);
            let own: &[f32; LANES] = bytemuck::cast_ref(old.first_chunk().unwrap_or(&[0; LANES]));
            let own = S::F32x8::load(token, own);
            compress::<S>(own, kept, bytemuck::cast_slice_mut(places), left);
            let mut joined = all & pairs.joined();
            while joined != 0 {
                let lane = joined.trailing_zeros() as usize % LANES;
                joined &= joined - 1;
                let (one, other) = (old[lane], old[lane + pairs.offset(lane)]);
                let (a, b) = (nodes[one as usize].aabb, nodes[other as usize].aabb);
                let kept_before = (kept & ((1 << lane) - 1)).count_ones() as usize;
                places[left + kept_before] = nodes.len() as u32;
                nodes.push(Node {
                    aabb: a.join(b),
                    first: one,
                    second: other | Node::INNER,
                });
            }
            left += kept.count_ones() as usize;
        }
        places.truncate(left);
        for (side, planes) in planes.iter_mut().enumerate() {
            planes.truncate(RADIUS + left);
            planes.resize(RADIUS + left + AFTER, if side < 3 { -FAR } else { FAR });
        }
    }
}

/// Which of eight clusters are joined.
struct Pairs<V> {
    /// With the one after them, with the second after them, and so on.
    joined_after: [V; RADIUS],
    /// The bits of those.
    bits: [u32; RADIUS],
    /// With any before them.
    joined_before: V,
}

impl<V: Vector<LANES>> Pairs<V> {
    /// Those of which each is in the other's slot.
    #[inline(always)]
    fn new(token: V::Token, slots: &[f32; AROUND]) -> Self {
        let own: V = at(token, slots, RADIUS);
        let none = own.lt(own);
        let mut pairs = Self {
            joined_after: [none; RADIUS],
            bits: [0; RADIUS],
            joined_before: none,
        };
        for offset in 1..=RADIUS {
            let before = V::splat(token, to_slot(RADIUS - offset));
            let after = V::splat(token, to_slot(RADIUS + offset));
            let slots_before: V = at(token, slots, RADIUS - offset);
            let slots_after: V = at(token, slots, RADIUS + offset);
            let joined_after = own.eq(after) & slots_after.eq(before);
            pairs.joined_after[offset - 1] = joined_after;
            pairs.bits[offset - 1] = joined_after.bits();
            pairs.joined_before = pairs.joined_before | own.eq(before) & slots_before.eq(after);
        }
        pairs
    }

    /// Those that are joined with one after them.
    #[inline(always)]
    fn joined(&self) -> u32 {
        self.bits[0] | self.bits[1] | self.bits[2]
    }

    /// How far after a cluster the one is that it is joined with.
    #[inline(always)]
    fn offset(&self, lane: usize) -> usize {
        let [_, second, third] = self.bits;
        1 + (second >> lane & 1) as usize + 2 * (third >> lane & 1) as usize
    }

    /// What those have that they are joined with; of others, what they have themselves.
    #[inline(always)]
    fn partners(&self, token: V::Token, all: &[f32; AROUND]) -> V {
        let mut partners = at(token, all, RADIUS);
        for (&joined, slot) in self.joined_after.iter().zip(RADIUS + 1..) {
            partners = joined.select(at(token, all, slot), partners);
        }
        partners
    }
}

/// What is within [`RADIUS`] of eight clusters, where there is as much before the first of all.
#[inline(always)]
fn around(all: &[f32], first: usize) -> &[f32; AROUND] {
    let all = all.get(first..).and_then(|all| all.first_chunk());
    all.unwrap_or(&[0.0; AROUND])
}

/// What is in a slot of each of the eight.
#[inline(always)]
fn at<V: Vector<LANES>>(token: V::Token, around: &[f32; AROUND], slot: usize) -> V {
    V::load(token, around[slot..].first_chunk().unwrap_or(&[0.0; LANES]))
}

/// The same of boxes.
//
// Not a closure given to `map`: closures do not inherit a backend's instructions and stay calls.
#[inline(always)]
fn boxes_at<V: Vector<LANES>>(
    token: V::Token,
    [a, b, c, d, e, f]: [&[f32; AROUND]; 6],
    slot: usize,
) -> [V; 6] {
    [
        at(token, a, slot),
        at(token, b, slot),
        at(token, c, slot),
        at(token, d, slot),
        at(token, e, slot),
        at(token, f, slot),
    ]
}

/// Writes the lanes that `mask` has a bit for from a place on, and anything after them, eight in all.
#[inline(always)]
fn compress<S: Simd>(lanes: S::F32x8, mask: u32, to: &mut [f32], place: usize) {
    let to = to.get_mut(place..).and_then(|to| to.first_chunk_mut());
    if let Some(to) = to {
        let to: &mut [f32; LANES] = to;
        // SAFETY: an array of as many as there are lanes.
        unsafe { lanes.compress(mask, to.as_mut_ptr()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Has a tree of all in parts of so many.
    fn check(boxes: &[Aabb], part: usize) -> Vec<Node> {
        let watch = Watch::none();
        let mut nodes = Vec::new();
        let mut roots = Vec::new();
        for (part, number) in boxes.chunks(part).zip((0..).step_by(part)) {
            let start = nodes.len() as u32;
            nodes.extend(part.iter().zip(number..).map(|(&b, i)| Node::leaf(b, i, 1)));
            let clusters = (start..nodes.len() as u32).collect();
            roots.extend(join(&mut nodes, clusters, part.len() / 4, 1.0, &watch));
        }
        let root = join(&mut nodes, roots, 1, 1.0, &watch);
        assert_eq!(root, [nodes.len() as u32 - 1]);
        assert_eq!(nodes.len(), 2 * boxes.len() - 1);
        // Every node but the root is another's child, once.
        let mut led_to = vec![0; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let aabb = if node.is_leaf() {
                boxes[node.number()]
            } else {
                let [left, right] = node.children();
                assert!(left < index && right < index);
                led_to[left] += 1;
                led_to[right] += 1;
                nodes[left].aabb.join(nodes[right].aabb)
            };
            assert_eq!(node.aabb, aabb);
        }
        assert!(led_to[..nodes.len() - 1].iter().all(|&times| times == 1));
        let leaves = nodes.iter().filter(|node| node.is_leaf());
        assert!(leaves.map(Node::number).eq(0..boxes.len()));
        nodes
    }

    #[test]
    fn trees() {
        let at = |x: f32| Aabb::new(Vec3::splat(x), Vec3::splat(x + 0.001));
        for count in [1, 2, 3, 7, 100, 1000] {
            let row: Vec<_> = (0..count).map(|i| at(i as f32 / 1000.0)).collect();
            for part in [1, 3, 64, 1000] {
                check(&row, part);
            }
            check(&vec![at(0.0); count], 64);
        }
        // Pairs that are close are joined first.
        let pairs = [0.0, 0.002, 1.0, 1.002, 2.0, 2.002].map(at);
        let nodes = check(&pairs, 6);
        let lowest = |node: &&Node| {
            !node.is_leaf() && node.children().iter().all(|&child| nodes[child].is_leaf())
        };
        assert_eq!(nodes.iter().filter(lowest).count(), 3);
    }

    /// Each is best joined with the one before: as many rounds as there are, but for the halving.
    #[test]
    fn rounds_are_few() {
        let boxes: Vec<_> = (0..20_000)
            .map(|i| {
                let x = 1.0 - 0.9998f32.powi(i);
                Aabb::new(Vec3::splat(x), Vec3::splat(x))
            })
            .collect();
        let nodes = check(&boxes, boxes.len());
        let mut depths = vec![0; nodes.len()];
        for (index, node) in nodes.iter().enumerate().rev() {
            if !node.is_leaf() {
                for child in node.children() {
                    depths[child] = depths[index] + 1;
                }
            }
        }
        assert!(depths.into_iter().max() < Some(300));
    }
}
