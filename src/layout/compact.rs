//! Compact nodes: boxes in 8 bits a plane, on a grid of the node's own.
//!
//! After Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs" (2017). A
//! plane is `origin + number · step`, `step` a power of two: the product is exact, so what is tested is that sum
//! rounded once, whether or not the processor fuses the two. The numbers are chosen such that the rounded planes
//! hold the child, and the slab test's proof holds for them as for any others.

use super::{
    Child, ChildKind, Link,
    frame::{Frame, Planes},
    node::impl_wide_node,
};
use crate::{
    geometry::Aabb,
    layout::run,
    simd::{Lanes, Simd, Vector, packed_run},
    slab::{BundlePasses, BundleSlabs, FirstPlanes, NarrowRay, Passing, RaySlabs, lane},
};
use bytemuck::{Pod, Zeroable};
use core::{fmt::Debug, mem::offset_of};
use glam::Vec3;

/// `W` children, first those that are nodes, side by side in memory, then those that are leaves, whose primitives are
/// side by side in the hierarchy's list. If all are leaves, where nodes would be is of no use, and says about where the vertices
/// are that leaves read, if [`Bvh::reorder`](super::Bvh::reorder) has put them in order: to be fetched, not relied on.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CompactNode<const W: usize, H> {
    frame: Frame,
    head: H,
    planes: Planes<W>,
}

/// Up to 4 children in 48 bytes.
pub type CompactNode4 = CompactNode<4, Head4>;
/// Up to 8 children in 80 bytes.
pub type CompactNode8 = CompactNode<8, Head8>;

impl_wide_node!(CompactNode4, 3, 4, F32x4, 48);
impl_wide_node!(CompactNode8, 4, 8, F32x8, 80);

/// Where a compact node's children are. Leaves have up to 4 primitives.
pub trait Head: Pod + Debug {
    /// How many places it tells apart.
    #[doc(hidden)]
    const PLACES: usize;
    /// The head, and its byte in the frame, of a node whose child nodes begin at `nodes` and whose primitives begin at
    /// `units`. `counts` are the primitives of each child, none of a node.
    #[doc(hidden)]
    fn new(nodes: u32, units: u32, counts: &[u8]) -> (Self, u8);
    /// The same after so many other nodes and primitives.
    #[doc(hidden)]
    fn after(&self, nodes: u32, units: u32) -> Self;
    /// The place of the first primitive.
    #[doc(hidden)]
    fn first_leaf(&self) -> usize;
    /// The place of the first child that is a node.
    #[doc(hidden)]
    fn first_node(&self) -> usize;
    /// How many children there are; of a node that is none, less than 16.
    #[doc(hidden)]
    fn children(&self, more: u8) -> usize;
    /// Where a child is. `N` are the nodes.
    #[doc(hidden)]
    fn link<N>(&self, more: u8, lane: usize) -> Link;
    /// Where all are.
    #[doc(hidden)]
    fn places(&self, more: u8) -> Places;
}

/// The place of the first child that is a node; the first primitive of those that are leaves; for each child how many
/// primitives there are up to its end, 0 for nodes.
#[doc(hidden)]
pub struct Places {
    nodes: u32,
    units: u32,
    ends: [u8; 8],
}

/// As [`Places`]. The frame's byte is the number of children.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Head8 {
    nodes: u32,
    units: u32,
    ends: [u8; 8],
}

impl Head for Head8 {
    const PLACES: usize = Link::PLACES;

    fn new(nodes: u32, units: u32, counts: &[u8]) -> (Self, u8) {
        let mut ends = [0; 8];
        let mut end = 0;
        for (lane, &count) in counts.iter().enumerate().take(8) {
            end += count;
            ends[lane] = end;
        }
        let head = Self { nodes, units, ends };
        (head, counts.len() as u8)
    }

    fn after(&self, nodes: u32, units: u32) -> Self {
        Self {
            nodes: self.nodes.wrapping_add(nodes),
            units: self.units.wrapping_add(units),
            ends: self.ends,
        }
    }

    #[inline(always)]
    fn first_leaf(&self) -> usize {
        self.units as usize
    }

    #[inline(always)]
    fn first_node(&self) -> usize {
        self.nodes as usize
    }

    #[inline(always)]
    fn children(&self, more: u8) -> usize {
        more as usize % 16
    }

    #[inline(always)]
    fn link<N>(&self, _: u8, lane: usize) -> Link {
        let ends = u64::from_le_bytes(self.ends);
        let (lane, bits) = (lane as u32 % 8, lane as u32 % 8 * 8);
        let (start, end) = ((ends << 8) >> bits & 0xff, ends >> bits & 0xff);
        if end == 0 {
            return Link::node::<N>(self.nodes.wrapping_add(lane));
        }
        leaf(self.units, start as u32, end as u32)
    }

    #[inline(always)]
    fn places(&self, _: u8) -> Places {
        let Self { nodes, units, ends } = *self;
        Places { nodes, units, ends }
    }
}

/// The same in less: the two places have 28 bits, above which stand the counts of the first two children, those of
/// the others are the frame's byte. 0 is a node, 15 is no child.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Head4 {
    nodes: u32,
    units: u32,
}

impl Head4 {
    const PLACE: u32 = Self::PLACES as u32 - 1;

    /// 4 bits a child.
    #[inline(always)]
    fn counts(&self, more: u8) -> u32 {
        self.nodes >> 28 | self.units >> 28 << 4 | u32::from(more) << 8
    }
}

impl Head for Head4 {
    const PLACES: usize = 1 << 28;

    fn new(nodes: u32, units: u32, counts: &[u8]) -> (Self, u8) {
        let mut all = [15; 4];
        for (own, &count) in all.iter_mut().zip(counts) {
            *own = u32::from(count);
        }
        let [a, b, c, d] = all;
        let head = Self {
            nodes: nodes & Self::PLACE | a << 28,
            units: units & Self::PLACE | b << 28,
        };
        (head, (c | d << 4) as u8)
    }

    fn after(&self, nodes: u32, units: u32) -> Self {
        let after =
            |place: u32, more| place & !Self::PLACE | place.wrapping_add(more) & Self::PLACE;
        Self {
            nodes: after(self.nodes, nodes),
            units: after(self.units, units),
        }
    }

    #[inline(always)]
    fn first_leaf(&self) -> usize {
        (self.units & Self::PLACE) as usize
    }

    #[inline(always)]
    fn first_node(&self) -> usize {
        (self.nodes & Self::PLACE) as usize
    }

    #[inline(always)]
    fn children(&self, more: u8) -> usize {
        let counts = self.counts(more);
        let none = counts & counts >> 1 & counts >> 2 & counts >> 3 & 0x1111;
        (none | 1 << 16).trailing_zeros() as usize / 4
    }

    #[inline(always)]
    fn link<N>(&self, more: u8, lane: usize) -> Link {
        let (lane, counts) = (lane as u32 % 4, self.counts(more));
        let count = counts >> (4 * lane) & 15;
        if count == 0 {
            return Link::node::<N>((self.nodes & Self::PLACE) + lane);
        }
        // Three counts of 4 at most: their sum has room in 4 bits.
        let before = counts & ((1 << (4 * lane)) - 1);
        let start = before.wrapping_mul(0x111) >> 8 & 15;
        leaf(self.units & Self::PLACE, start, start + count)
    }

    #[inline(always)]
    fn places(&self, more: u8) -> Places {
        let counts = self.counts(more);
        // A byte a child, then the sum of those up to it: 15, no child, comes after all.
        let pairs = counts & 0xff | (counts & 0xff00) << 8;
        let bytes = pairs & 0x000f_000f | (pairs & 0x00f0_00f0) << 4;
        let [a, b, c, d] = bytes.wrapping_mul(0x0101_0101).to_le_bytes();
        Places {
            nodes: self.nodes & Self::PLACE,
            units: self.units & Self::PLACE,
            ends: [a, b, c, d, 0, 0, 0, 0],
        }
    }
}

/// The leaf of the primitives from `start` to `end` after the first of a node's.
#[inline(always)]
fn leaf(first: u32, start: u32, end: u32) -> Link {
    Link::leaf_at(packed_run(
        first.wrapping_add(start),
        end.wrapping_sub(start),
    ))
}

impl<const W: usize, H: Head> CompactNode<W, H> {
    const ORDERED: bool = true;
    const PLACES: usize = H::PLACES;
    const LINKS: usize = offset_of!(Self, head);

    fn new(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self {
        let (mut aabbs, mut counts, mut len) = ([Aabb::EMPTY; W], [0; W], 0);
        let (mut nodes, mut units) = (None, None);
        for (aabb, child) in children.into_iter().take(W) {
            aabbs[len] = aabb;
            match child.kind() {
                ChildKind::Empty => break,
                ChildKind::Node(place) => _ = nodes.get_or_insert(place as u32),
                ChildKind::Leaf(place) => {
                    let run = run::of_place(place);
                    counts[len] = run.len() as u8;
                    units.get_or_insert(run.start as u32);
                }
            }
            len += 1;
        }
        let (mut frame, planes) = Frame::new(&aabbs[..len]);
        let (head, more) = H::new(nodes.unwrap_or(0), units.unwrap_or(0), &counts[..len]);
        frame.more = more;
        Self {
            frame,
            head,
            planes,
        }
    }

    /// The places of nodes and of leaves that there are not stay what they are.
    fn after(&self, nodes: u32, leaves: u32) -> Self {
        let is_leaf = |lane| self.head.link::<Self>(self.frame.more, lane).is_leaf();
        let (first, last) = (is_leaf(0), is_leaf(self.lanes().saturating_sub(1)));
        let head = self
            .head
            .after(if first { 0 } else { nodes }, if last { leaves } else { 0 });
        Self { head, ..*self }
    }

    /// Whether no child is a node: then nothing else reads where the first one would be. Without children it is either.
    #[inline(always)]
    fn has_leaves_alone(&self) -> bool {
        self.head.link::<Self>(self.frame.more, 0).is_leaf()
    }

    #[inline(always)]
    fn first_vertex(&self) -> usize {
        match self.has_leaves_alone() {
            true => self.head.first_node(),
            false => 0,
        }
    }

    fn with_first_vertex(self, vertex: u32) -> Self {
        if !self.has_leaves_alone() {
            return self;
        }
        let moved = vertex.wrapping_sub(self.head.first_node() as u32);
        let head = self.head.after(moved, 0);
        Self { head, ..self }
    }

    #[inline(always)]
    fn first_leaf(&self, _: u32) -> Option<usize> {
        Some(self.head.first_leaf())
    }

    /// How many lanes have a child.
    #[inline(always)]
    fn lanes(&self) -> usize {
        self.head.children(self.frame.more).min(W)
    }

    #[inline]
    fn aabb(&self, lane: usize) -> Aabb {
        if lane >= self.lanes() {
            return Aabb::EMPTY;
        }
        let plane = |side: usize| {
            Vec3::from_array(
                [0, 1, 2].map(|axis| self.frame.plane(axis, self.planes[axis][side][lane])),
            )
        };
        Aabb::new(plane(0), plane(1))
    }

    #[inline(always)]
    fn lane_planes(&self, lane: usize, first: FirstPlanes<W>) -> [[f32; 3]; 2] {
        let [[ax, ay, az], [bx, by, bz]] = first.pick(&self.planes);
        let lane = lane % W;
        let at = |axis, numbers: &[u8; W]| self.frame.plane(axis, numbers[lane]);
        [
            [at(0, ax), at(1, ay), at(2, az)],
            [at(0, bx), at(1, by), at(2, bz)],
        ]
    }

    #[inline(always)]
    fn planes<V: Vector<W>>(&self, token: V::Token, first: FirstPlanes<W>) -> [[V; 3]; 2] {
        let [[ax, ay, az], [bx, by, bz]] = first.pick(&self.planes);
        [
            [
                self.axis_planes(token, 0, ax),
                self.axis_planes(token, 1, ay),
                self.axis_planes(token, 2, az),
            ],
            [
                self.axis_planes(token, 0, bx),
                self.axis_planes(token, 1, by),
                self.axis_planes(token, 2, bz),
            ],
        ]
    }

    #[inline(always)]
    fn axis_planes<V: Vector<W>>(&self, token: V::Token, axis: usize, numbers: &[u8; W]) -> V {
        let step = V::splat(token, self.frame.step(axis));
        let origin = V::splat(token, self.frame.origin[axis]);
        V::of_bytes(token, numbers).mul_add(step, origin)
    }

    #[inline(always)]
    fn present<V: Vector<W>>(&self, token: V::Token, hit: V) -> V {
        hit & V::of_bits(token, self.present_bits(u32::MAX))
    }

    #[inline(always)]
    fn present_bits(&self, hit: u32) -> u32 {
        hit & ((1 << self.head.children(self.frame.more)) - 1)
    }

    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    unsafe fn link(&self, lane: usize) -> Link {
        self.head.link::<Self>(self.frame.more, lane)
    }

    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    unsafe fn link_among<'a>(&'a self, links: &'a [f32; W], lane: usize) -> &'a Link {
        // SAFETY: the caller's promise: there are `W` lanes.
        bytemuck::cast_ref(unsafe { links.get_unchecked(lane) })
    }

    #[inline(always)]
    fn link_lanes<V: Vector<W>>(&self, token: V::Token) -> V {
        let places = self.head.places(self.frame.more);
        let ends = places.ends.first_chunk().unwrap_or(&[0; W]);
        let stride = Link::node::<Self>(1).to_bits();
        let base = Link::node::<Self>(places.nodes).to_bits();
        V::links(token, ends, base, stride, places.units)
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::{
        layout::{WideNode, frame::MOST},
        simd::{Backend, Lanes, Operation},
    };
    use fastrand::Rng;
    use std::vec::Vec;

    /// A node's children: nodes first, then leaves, of boxes anywhere, of any size.
    fn children<const W: usize>(rng: &mut Rng) -> Vec<(Aabb, Child)> {
        let count = rng.usize(1..=W);
        let nodes = rng.usize(0..=count);
        let (mut node, mut unit) = (rng.u32(..1 << 27), rng.u32(..1 << 27));
        let scale = f32::exp2(rng.i32(-120..120) as f32);
        let center = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * rng.u32(..100_000) as f32 * scale;
        let mut child = |lane| {
            let mut corner = || center + (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * scale;
            let (a, b) = (corner(), corner());
            // Some are flat.
            let b = if rng.bool() {
                b
            } else {
                Vec3::new(a.x, b.y, b.z)
            };
            let link = if lane < nodes {
                node += 1;
                Child::node(node)
            } else {
                let len = rng.u32(1..=4);
                unit += len;
                Child::leaf(packed_run(unit - len, len))
            };
            (Aabb::new(a.min(b), a.max(b)), link)
        };
        (0..count).map(&mut child).collect()
    }

    fn check<N: WideNode, const W: usize>() {
        struct Links<'a, N>(&'a N);
        impl<N: WideNode> Operation for Links<'_, N> {
            type Output = Vec<u32>;
            fn run<S: Simd>(self, token: S) -> Vec<u32> {
                let links = self.0.link_lanes(token).to_array();
                links.as_ref().iter().map(|link| link.to_bits()).collect()
            }
        }

        let mut rng = Rng::with_seed(5);
        for _ in 0..20_000 {
            let children = children::<W>(&mut rng);
            let node = N::from_children(children.iter().copied());
            for (lane, &(aabb, child)) in children.iter().enumerate() {
                assert_eq!(node.child(lane), child);
                let tested = node.child_aabb(lane);
                let most = Vec3::splat(MOST);
                let aabb = Aabb::new(aabb.min.clamp(-most, most), aabb.max.clamp(-most, most));
                assert_eq!(tested.join(aabb), tested, "{aabb:?} is not in {tested:?}");
            }
            for lane in children.len()..W {
                assert_eq!(node.child(lane), Child::EMPTY);
                assert_eq!(node.child_aabb(lane), Aabb::EMPTY);
            }
            for backend in Backend::available() {
                let links = backend.run(Links(&node));
                for (lane, link) in links.into_iter().enumerate().take(children.len()) {
                    // SAFETY: there is such a lane.
                    assert_eq!(link, unsafe { node.link(lane) }.to_bits());
                }
            }
        }
    }

    #[test]
    fn children_are_where_they_were_put() {
        check::<CompactNode4, 4>();
        check::<CompactNode8, 8>();
    }
}
