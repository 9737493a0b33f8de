//! What trees are built over: the triangles of a mesh, or a caller's boxes. All that differs between
//! the two is here.

use super::{BuildError, cost};
use crate::{
    geometry::{Aabb, TriangleMesh, is_degenerate},
    layout::{Leaf, PrimitiveLeaf, TriangleLeaf},
};
use glam::Vec3;

/// Whether a primitive has a place in the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Yes, in this box.
    Keep(Aabb),
    /// No: no ray hits a triangle without area or what has no points.
    Unhittable,
    /// No, if the caller wants such ones left out; else an error.
    NonFinite(BuildError),
    /// An error.
    Invalid(BuildError),
}

/// Primitives, by number, and the leaves they go into.
pub(super) trait Input: Sync {
    type Leaf: Leaf + Send;
    /// The most primitives a leaf has.
    const MAX_LEAF: usize;
    /// How many times the cost of two leaves one may have for which they are given up.
    const JOINED: f32;
    /// Whether they are triangles, which can be cut into pieces.
    const CAN_SPLIT: bool;

    /// How many there are.
    fn len(&self) -> usize;
    /// Whether number `id` has a place in the tree.
    fn verdict(&self, id: u32) -> Verdict;
    /// The exact box of a primitive that is kept.
    fn aabb(&self, id: u32) -> Aabb;
    /// Its corners, if it is a triangle.
    fn triangle(&self, id: u32) -> Option<[Vec3; 3]>;
    /// The primitive that a number in a tree stands for.
    fn primitive(&self, number: u32) -> u32;
    /// Whether these primitives, no more than [`Input::MAX_LEAF`], can be one leaf.
    fn fits(&self, ids: &[u32]) -> bool;
    /// The cost of a leaf of `count`.
    fn leaf_cost(count: usize) -> f32;
    /// The leaf of these primitives, which do fit, their numbers beginning at `first` in the list.
    fn leaf(&self, ids: &[u32], first: u32) -> Option<Self::Leaf>;
}

/// The triangles of a mesh.
#[derive(Clone, Copy)]
pub(super) struct Triangles<'a>(pub &'a TriangleMesh<'a>);

impl Triangles<'_> {
    #[inline(always)]
    fn corner(&self, vertex: u32) -> Vec3 {
        Vec3::from_array(self.0.positions()[vertex as usize])
    }

    #[inline(always)]
    fn corners(&self, id: u32) -> [Vec3; 3] {
        self.0.indices()[id as usize].map(|vertex| self.corner(vertex))
    }
}

/// The box around a triangle. The sum turns -0.0 into 0.0, so that the order of joins never shows.
#[inline(always)]
fn triangle_aabb([a, b, c]: [Vec3; 3]) -> Aabb {
    Aabb::new(a.min(b).min(c) + 0.0, a.max(b).max(c) + 0.0)
}

impl Input for Triangles<'_> {
    type Leaf = TriangleLeaf;
    const MAX_LEAF: usize = TriangleLeaf::MAX_TRIANGLES;
    const JOINED: f32 = cost::TRIANGLES_JOINED;
    const CAN_SPLIT: bool = true;

    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn verdict(&self, id: u32) -> Verdict {
        let corners = self.corners(id);
        if let Some(corner) = corners.iter().position(|corner| !corner.is_finite()) {
            return Verdict::NonFinite(BuildError::NonFinitePosition {
                triangle: id as usize,
                corner,
                vertex: self.0.indices()[id as usize][corner],
                position: corners[corner],
            });
        }
        if is_degenerate(corners) {
            return Verdict::Unhittable;
        }
        Verdict::Keep(triangle_aabb(corners))
    }

    #[inline]
    fn aabb(&self, id: u32) -> Aabb {
        triangle_aabb(self.corners(id))
    }

    #[inline]
    fn triangle(&self, id: u32) -> Option<[Vec3; 3]> {
        Some(self.corners(id))
    }

    #[inline]
    fn primitive(&self, number: u32) -> u32 {
        number
    }

    /// Few enough distinct positions. Most repeats are seen by number.
    fn fits(&self, ids: &[u32]) -> bool {
        const MOST: usize = TriangleLeaf::MAX_VERTICES;
        // Vertices past the last are a number that none has, and NaN, which nothing equals: so whole
        // arrays are compared, in vectors.
        const NONE: u32 = u32::MAX;
        let mut vertices = [NONE; MOST];
        let mut positions = [[f32::NAN; MOST]; 3];
        let mut count = 0;
        for &id in ids {
            for vertex in self.0.indices()[id as usize] {
                if vertex != NONE
                    && vertices
                        .iter()
                        .fold(false, |known, &v| known | (v == vertex))
                {
                    continue;
                }
                let [x, y, z] = self.0.positions()[vertex as usize];
                let [xs, ys, zs] = &positions;
                let known = (0..MOST).fold(false, |known, i| {
                    known | ((xs[i] == x) & (ys[i] == y) & (zs[i] == z))
                });
                if known {
                    continue;
                }
                if count == MOST || vertex == NONE {
                    return false;
                }
                vertices[count] = vertex;
                for (axis, x) in [x, y, z].into_iter().enumerate() {
                    positions[axis][count] = x;
                }
                count += 1;
            }
        }
        true
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::TRIANGLE_LEAF + cost::TRIANGLE * count as f32
    }

    fn leaf(&self, ids: &[u32], first: u32) -> Option<TriangleLeaf> {
        let mut triangles = [[Vec3::ZERO; 3]; TriangleLeaf::MAX_TRIANGLES];
        let triangles = triangles.get_mut(..ids.len())?;
        for (triangle, &id) in triangles.iter_mut().zip(ids) {
            *triangle = self.corners(id);
        }
        TriangleLeaf::new(triangles, first)
    }
}

/// A caller's primitives, of which boxes are known.
#[derive(Clone, Copy)]
pub(super) struct Boxes<'a>(pub &'a [Aabb]);

impl Input for Boxes<'_> {
    type Leaf = PrimitiveLeaf;
    const MAX_LEAF: usize = PrimitiveLeaf::MAX_PRIMITIVES;
    const JOINED: f32 = 1.0;
    const CAN_SPLIT: bool = false;

    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn verdict(&self, id: u32) -> Verdict {
        let aabb = self.0[id as usize];
        let primitive = id as usize;
        match () {
            () if aabb == Aabb::EMPTY => Verdict::Unhittable,
            () if !aabb.is_finite() => Verdict::NonFinite(BuildError::NonFiniteBox { primitive }),
            () if aabb.is_empty() => Verdict::Invalid(BuildError::InvalidBox { primitive }),
            () => Verdict::Keep(self.aabb(id)),
        }
    }

    #[inline]
    fn aabb(&self, id: u32) -> Aabb {
        let Aabb { min, max } = self.0[id as usize];
        Aabb::new(min + 0.0, max + 0.0)
    }

    fn triangle(&self, _: u32) -> Option<[Vec3; 3]> {
        None
    }

    #[inline]
    fn primitive(&self, number: u32) -> u32 {
        number
    }

    fn fits(&self, _: &[u32]) -> bool {
        true
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::PRIMITIVE_LEAF + cost::PRIMITIVE * count as f32
    }

    fn leaf(&self, ids: &[u32], first: u32) -> Option<PrimitiveLeaf> {
        Some(PrimitiveLeaf::new(first, ids.len() as u32))
    }
}
