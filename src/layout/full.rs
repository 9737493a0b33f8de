//! Full-precision nodes, 4 and 8 wide.

use super::{Child, Link, node::impl_wide_node};
use crate::{
    geometry::Aabb,
    simd::{Lanes, Simd, Vector},
    slab::{BundlePasses, BundleSlabs, FirstPlanes, NarrowRay, Passing, RaySlabs, lane},
};
use bytemuck::{Pod, Zeroable};
use core::mem::offset_of;
use glam::Vec3;

/// `W` children: the planes of their boxes by axis, side and child, then where they lie. Empty lanes come
/// last, with a box that no ray passes.
///
/// `A` is a type of the alignment that a load of `W` floats wants.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Node<const W: usize, A> {
    align: [A; 0],
    planes: [[[f32; W]; 2]; 3],
    links: [Link; W],
}

/// 16 bytes of alignment.
#[derive(Clone, Copy, Debug, Zeroable, Pod)]
#[repr(C, align(16))]
pub struct Align16([u8; 16]);

/// 32 bytes of alignment.
#[derive(Clone, Copy, Debug, Zeroable, Pod)]
#[repr(C, align(32))]
pub struct Align32([u8; 32]);

/// 4 children in 112 bytes.
pub type Node4 = Node<4, Align16>;
/// 8 children in 224 bytes.
pub type Node8 = Node<8, Align32>;

impl_wide_node!(Node4, 1, 4, F32x4, 112);
impl_wide_node!(Node8, 2, 8, F32x8, 224);

impl<const W: usize, A> Node<W, A> {
    const ORDERED: bool = false;
    const PLACES: usize = Link::PLACES;
    const LINKS: usize = offset_of!(Self, links);

    fn new(children: impl IntoIterator<Item = (Aabb, Child)>) -> Self {
        let mut node = Self {
            align: [],
            planes: [[[f32::INFINITY; W], [f32::NEG_INFINITY; W]]; 3],
            links: [Link::new::<Self>(Child::EMPTY); W],
        };
        for (lane, (aabb, child)) in children.into_iter().take(W).enumerate() {
            for axis in 0..3 {
                node.planes[axis][0][lane] = aabb.min[axis];
                node.planes[axis][1][lane] = aabb.max[axis];
            }
            node.links[lane] = Link::new::<Self>(child);
        }
        node
    }

    #[inline(always)]
    fn after(&self, nodes: u32, leaves: u32) -> Self {
        Self {
            align: [],
            planes: self.planes,
            links: self.links.map(|link| link.after::<Self>(nodes, leaves)),
        }
    }

    #[inline]
    fn aabb(&self, lane: usize) -> Aabb {
        if lane >= W {
            return Aabb::EMPTY;
        }
        let [[min_x, max_x], [min_y, max_y], [min_z, max_z]] = &self.planes;
        Aabb::new(
            Vec3::new(min_x[lane], min_y[lane], min_z[lane]),
            Vec3::new(max_x[lane], max_y[lane], max_z[lane]),
        )
    }

    #[inline(always)]
    fn first_vertex(&self) -> usize {
        0
    }

    fn with_first_vertex(self, _: u32) -> Self {
        self
    }

    #[inline(always)]
    fn first_leaf(&self, mask: u32) -> Option<usize> {
        // Most nodes that lead to leaves lead to nothing else.
        let link = Link::from_bits(self.links[0].to_bits() & mask);
        link.is_leaf().then(|| link.leaf())
    }

    /// Those without a child say so themselves.
    #[inline(always)]
    fn lanes(&self) -> usize {
        W
    }

    #[inline(always)]
    fn lane_planes(&self, lane: usize, first: FirstPlanes<W>) -> [[f32; 3]; 2] {
        let [[ax, ay, az], [bx, by, bz]] = first.pick(&self.planes);
        let lane = lane % W;
        [
            [ax[lane], ay[lane], az[lane]],
            [bx[lane], by[lane], bz[lane]],
        ]
    }

    #[inline(always)]
    fn planes<V: Vector<W>>(&self, token: V::Token, first: FirstPlanes<W>) -> [[V; 3]; 2] {
        let [[ax, ay, az], [bx, by, bz]] = first.pick(&self.planes);
        [
            [V::load(token, ax), V::load(token, ay), V::load(token, az)],
            [V::load(token, bx), V::load(token, by), V::load(token, bz)],
        ]
    }

    /// All: a lane without a child has a box that no ray passes.
    #[inline(always)]
    fn present<V: Vector<W>>(&self, _: V::Token, hit: V) -> V {
        hit
    }

    #[inline(always)]
    fn present_bits(&self, hit: u32) -> u32 {
        hit
    }

    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    unsafe fn link(&self, lane: usize) -> Link {
        // SAFETY: the caller's promise.
        unsafe { *self.links.get_unchecked(lane) }
    }

    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    unsafe fn link_among<'a>(&'a self, _: &'a [f32; W], lane: usize) -> &'a Link {
        // SAFETY: the caller's promise.
        unsafe { self.links.get_unchecked(lane) }
    }

    #[inline(always)]
    fn link_lanes<V: Vector<W>>(&self, token: V::Token) -> V {
        // SAFETY: as many links, each of a float's size and alignment.
        V::load(token, unsafe { &*self.links.as_ptr().cast() })
    }
}
