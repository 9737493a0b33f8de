//! Leaves: a few triangles that share vertices, or a few of a caller's primitives.

use crate::{
    primitive::triangle::{Corners, Edges, RayShear, TriangleHits},
    simd::{Lanes, Simd, Vector},
};
use bytemuck::{Pod, Zeroable};
use core::{fmt::Debug, ops::Range};
use glam::Vec3;

/// What all leaves have: primitives, as a run of places in the hierarchy's list of primitive numbers.
pub trait Leaf: Pod + Debug {
    /// Which places of the list are its own.
    fn primitives(&self) -> Range<u64>;

    /// Whether it can be walked: not empty, not over-full, its corners in range.
    fn is_sound(&self) -> bool;
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

    /// A leaf of `count` triangles, whose corners are lanes of `vertices`; both repeat the first past the last.
    #[cfg(feature = "std")]
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

    /// The ray against all its triangles, up to `t_max`. If `NEED_T` is not set, it is enough to know
    /// whether any is hit.
    #[inline(always)]
    pub(crate) fn test<T: Simd, const NEED_T: bool>(
        &self,
        token: T,
        ray: &RayShear<'_, T::F32x8>,
        t_max: f32,
    ) -> Option<TriangleHits<T::F32x8>> {
        let (corners, edges) = self.edges(token, ray);
        if edges.candidates == 0 {
            return None;
        }
        let t_max = T::F32x8::splat(token, t_max);
        ray.along(token)
            .test::<8, NEED_T>(token, corners, edges, t_max)
    }

    /// Its triangles' corners as the ray sees them, and which of them the ray may hit: what the rest of the test works on.
    #[inline(always)]
    pub(crate) fn edges<T: Simd>(
        &self,
        token: T,
        ray: &RayShear<'_, T::F32x8>,
    ) -> (Corners<T::F32x8>, Edges<T::F32x8>) {
        let vertices = ray.shear(token, &self.vertices);
        let corners = [
            self.corners_of(vertices.x),
            self.corners_of(vertices.y),
            self.corners_of(vertices.z),
        ];
        (
            corners,
            ray.along(token).edges::<8>(token, corners, self.lanes()),
        )
    }

    /// A number of each vertex as that of each triangle's first, second and third corner.
    #[inline(always)]
    fn corners_of<V: Vector<8>>(&self, vertices: V) -> [V; 3] {
        [
            vertices.permute(&self.corners[0]),
            vertices.permute(&self.corners[1]),
            vertices.permute(&self.corners[2]),
        ]
    }

    /// Where its primitives' numbers begin.
    #[inline(always)]
    pub(crate) fn first(&self) -> usize {
        self.first as usize
    }

    /// How many triangles there are.
    #[inline(always)]
    pub(crate) fn count(&self) -> usize {
        self.count as usize
    }

    /// A bit for each triangle there is.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> u32 {
        (1 << (self.count & 15)) - 1
    }
}

impl Leaf for TriangleLeaf {
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
    /// The most primitives a leaf holds. A bound of the builder's: more in a leaf is slow.
    pub const MAX_PRIMITIVES: usize = 8;

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

impl Leaf for PrimitiveLeaf {
    fn primitives(&self) -> Range<u64> {
        let first = u64::from(self.first);
        first..first + u64::from(self.count)
    }

    fn is_sound(&self) -> bool {
        self.count > 0
    }
}
