//! Leaves that are stored: a few triangles that share vertices, or a few of a caller's primitives.

use super::{
    Gather, Gathered, Listed, Triangles,
    bytes::{PRIMITIVE_LEAVES, TRIANGLE_LEAVES},
    leaves::in_lanes,
};
use crate::{
    primitive::triangle::{Exact, Look, RayShear, Sheared},
    simd::{MAX_RUN, Simd},
};
use bytemuck::{Pod, Zeroable};
use core::{fmt::Debug, mem::MaybeUninit, ops::Range};
use glam::Vec3;

/// What all leaves that are stored have: primitives, as a run of places in the hierarchy's list of primitive numbers.
pub trait Leaf: Pod + Debug + sealed::Sealed {
    /// In the header of [bytes](super::bytes).
    #[doc(hidden)]
    const KIND: u32;

    /// Which places of the list are its own.
    fn primitives(&self) -> Range<u64>;

    /// Whether it can be walked: not empty, not over-full, its corners in range.
    fn is_sound(&self) -> bool;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::TriangleLeaf {}
    impl Sealed for super::PrimitiveLeaf {}
}

/// Up to 8 triangles over up to 8 vertices, in two cache lines.
///
/// A shared vertex is there once and is sheared once, which is both the economy and the watertightness.
/// Lanes past the last vertex, and corners past the last triangle, repeat the first.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct TriangleLeaf {
    /// x, y and z of the vertices.
    pub(crate) vertices: [[f32; 8]; 3],
    /// The first, second and third corner of each triangle, as lanes of `vertices`.
    pub(crate) corners: [[u8; 8]; 3],
    /// Where its primitives' numbers begin.
    first: u32,
    /// How many triangles there are.
    count: u32,
}

const _: () = assert!(size_of::<TriangleLeaf>() == 128);

impl TriangleLeaf {
    /// The most triangles a leaf holds.
    pub const MAX_TRIANGLES: usize = 8;
    /// The most distinct vertices a leaf holds.
    pub const MAX_VERTICES: usize = 8;

    /// A leaf of `triangles`, whose primitive numbers begin at `first` in the hierarchy's list; `None`
    /// if there are none, or more triangles or distinct positions than it holds.
    pub fn new(triangles: &[[Vec3; 3]], first: u32) -> Option<Self> {
        if triangles.is_empty() || triangles.len() > Self::MAX_TRIANGLES {
            return None;
        }
        let mut vertices = [Vec3::ZERO; Self::MAX_VERTICES];
        let mut count = 0;
        let mut corners = [[0; 8]; 3];
        for (lane, triangle) in triangles.iter().enumerate() {
            for (corner, vertex) in triangle.iter().enumerate() {
                let known = vertices[..count].iter().position(|v| v == vertex);
                let place = known.unwrap_or(count);
                *vertices.get_mut(place)? = *vertex;
                count = count.max(place + 1);
                corners[corner][lane] = place as u8;
            }
        }
        let first_vertex = vertices[0];
        vertices[count..].fill(first_vertex);
        Some(Self {
            vertices: [0, 1, 2].map(|axis| vertices.map(|v| v[axis])),
            corners,
            first,
            count: triangles.len() as u32,
        })
    }

    /// A leaf of `count` triangles, whose corners are lanes of `vertices`; both repeat the first past the last, in leaves that
    /// are kept.
    #[inline(always)]
    pub(crate) fn from_lanes(
        vertices: [[f32; 8]; 3],
        corners: [[u8; 8]; 3],
        first: u32,
        count: usize,
    ) -> Self {
        Self {
            vertices,
            corners,
            first,
            count: count as u32,
        }
    }
}

impl<'a> Triangles for &'a TriangleLeaf {
    type Precision = Exact;
    type Four = FourOfLeaf<'a>;
    in_lanes!(F32x8, 8);

    #[inline(always)]
    fn four(self, number: usize) -> Option<FourOfLeaf<'a>> {
        (4 * number < self.count()).then_some(FourOfLeaf { leaf: self, number })
    }

    #[inline(always)]
    fn first(self) -> usize {
        self.first as usize
    }

    #[inline(always)]
    fn count(self) -> usize {
        self.count as usize & 15
    }

    #[inline(always)]
    fn look<S: Simd>(self, token: S, ray: &RayShear) -> Look<S::F32x8> {
        let vertices = ray.shear_arrays(token, &self.vertices);
        let [a, b, c] = &self.corners;
        let corners = [
            vertices.permute(a),
            vertices.permute(b),
            vertices.permute(c),
        ];
        Look::new(token, corners, self.lanes())
    }

    #[inline(always)]
    fn triangle(self, lane: usize) -> [[f32; 3]; 3] {
        let [x, y, z] = &self.vertices;
        self.corners.each_ref().map(|corners| {
            let vertex =
                corners[lane % TriangleLeaf::MAX_TRIANGLES] as usize % TriangleLeaf::MAX_VERTICES;
            [x[vertex], y[vertex], z[vertex]]
        })
    }
}

impl Gathered for &TriangleLeaf {
    #[inline(always)]
    fn stored<'a>(self) -> &'a TriangleLeaf
    where
        Self: 'a,
    {
        self
    }
}

impl Gather for &TriangleLeaf {
    type Gathered<'a> = Self;

    #[inline(always)]
    fn gather(self, _: usize, _: &mut MaybeUninit<TriangleLeaf>) -> Self {
        self
    }
}

/// Four triangles of a leaf, or fewer.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct FourOfLeaf<'a> {
    leaf: &'a TriangleLeaf,
    /// 0 or 1: which four.
    number: usize,
}

impl Triangles for FourOfLeaf<'_> {
    type Precision = Exact;
    in_lanes!(four);

    #[inline(always)]
    fn first(self) -> usize {
        self.leaf.first() + 4 * self.number
    }

    #[inline(always)]
    fn count(self) -> usize {
        (self.leaf.count() - 4 * self.number).min(4)
    }

    #[inline(always)]
    fn look<S: Simd>(self, token: S, ray: &RayShear) -> Look<S::F32x4> {
        let vertices: Sheared<S::F32x8> = ray.shear_arrays(token, &self.leaf.vertices);
        let [a, b, c]: &[[[u8; 4]; 2]; 3] = bytemuck::cast_ref(&self.leaf.corners);
        let corners = [
            vertices.pick(token, &a[self.number % 2]),
            vertices.pick(token, &b[self.number % 2]),
            vertices.pick(token, &c[self.number % 2]),
        ];
        Look::new(token, corners, self.lanes())
    }

    #[inline(always)]
    fn triangle(self, lane: usize) -> [[f32; 3]; 3] {
        self.leaf.triangle(4 * self.number + lane)
    }
}

impl Leaf for TriangleLeaf {
    const KIND: u32 = TRIANGLE_LEAVES;

    fn primitives(&self) -> Range<u64> {
        let first = u64::from(self.first);
        first..first + u64::from(self.count)
    }

    fn is_sound(&self) -> bool {
        let count_fits = (1..=Self::MAX_TRIANGLES).contains(&(self.count as usize));
        let corners_fit = self
            .corners
            .iter()
            .flatten()
            .all(|&corner| (corner as usize) < Self::MAX_VERTICES);
        count_fits && corners_fit
    }
}

/// A run of a caller's primitives.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PrimitiveLeaf {
    first: u32,
    count: u32,
}

impl PrimitiveLeaf {
    /// The most primitives a leaf holds. A bound of the builder's: more in a leaf is slow, and more than compact nodes
    /// can tell of.
    pub const MAX_PRIMITIVES: usize = MAX_RUN;

    /// A leaf of `count` primitives, whose numbers begin at `first` in the hierarchy's list.
    pub const fn new(first: u32, count: u32) -> Self {
        Self { first, count }
    }

    /// Its places in the list.
    #[inline(always)]
    pub(crate) fn range(&self) -> Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

impl Listed for &PrimitiveLeaf {
    #[inline(always)]
    fn places(self) -> Range<usize> {
        self.range()
    }
}

impl Leaf for PrimitiveLeaf {
    const KIND: u32 = PRIMITIVE_LEAVES;

    fn primitives(&self) -> Range<u64> {
        let first = u64::from(self.first);
        first..first + u64::from(self.count)
    }

    fn is_sound(&self) -> bool {
        self.count > 0
    }
}
