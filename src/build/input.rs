//! What trees are built over: the triangles of a mesh, or a caller's boxes. All that differs between
//! the two is here.

use super::{
    BuildError, cost,
    fill::{Corners, Filling},
};
use crate::{
    geometry::{Aabb, TriangleMesh, is_degenerate},
    layout::{Leaf, PrimitiveLeaf, TriangleLeaf},
};
use glam::{Vec3, Vec3A};

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
    /// A leaf while it is filled.
    type Filling: Copy + Send;
    /// What a leaf has of a primitive.
    type Loaded: Copy;
    /// That of no primitive.
    const UNLOADED: Self::Loaded;
    /// One without primitives.
    const EMPTY: Self::Filling;
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
    /// Empties a leaf.
    fn clear(filling: &mut Self::Filling);
    /// What a leaf has of a primitive.
    fn load(&self, id: u32) -> Self::Loaded;
    /// Adds a primitive to a leaf, if it fits.
    fn add_loaded(filling: &mut Self::Filling, loaded: &Self::Loaded) -> bool;
    /// Adds a primitive to a leaf, if it fits.
    #[inline(always)]
    fn add(&self, filling: &mut Self::Filling, id: u32) -> bool {
        Self::add_loaded(filling, &self.load(id))
    }
    /// Whether these primitives can be one leaf.
    #[inline]
    fn fits(&self, ids: &[u32]) -> bool {
        let mut filling = Self::EMPTY;
        ids.iter().all(|&id| self.add(&mut filling, id))
    }
    /// The cost of a leaf of `count`.
    fn leaf_cost(count: usize) -> f32;
    /// The box around the primitives of a leaf, of which there are some.
    fn aabb_of(filling: &Self::Filling) -> Aabb;
    /// The leaf, unless it is empty, of the primitives whose numbers begin at `first` in the list.
    fn leaf(filling: &Self::Filling, first: u32) -> Option<Self::Leaf>;
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
fn triangle_aabb(corners: [Vec3; 3]) -> Aabb {
    let [a, b, c] = corners.map(Vec3A::from);
    let (min, max) = (a.min(b).min(c) + 0.0, a.max(b).max(c) + 0.0);
    Aabb::new(min.into(), max.into())
}

impl Input for Triangles<'_> {
    type Leaf = TriangleLeaf;
    type Filling = Filling;
    type Loaded = Corners;
    const UNLOADED: Corners = Corners::NONE;
    const EMPTY: Filling = Filling::EMPTY;
    const MAX_LEAF: usize = TriangleLeaf::MAX_TRIANGLES;
    const JOINED: f32 = cost::TRIANGLES_JOINED;
    const CAN_SPLIT: bool = true;

    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn verdict(&self, id: u32) -> Verdict {
        let corners = self.corners(id);
        let [a, b, c] = corners.map(Vec3A::from);
        let is_finite = a.is_finite() && b.is_finite() && c.is_finite();
        if !is_finite && let Some(corner) = corners.iter().position(|corner| !corner.is_finite()) {
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

    #[inline(always)]
    fn clear(filling: &mut Filling) {
        filling.clear();
    }

    #[inline(always)]
    fn load(&self, id: u32) -> Corners {
        Corners::new(self.0, id)
    }

    #[inline(always)]
    fn add_loaded(filling: &mut Filling, corners: &Corners) -> bool {
        filling.add(corners)
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::TRIANGLE_LEAF + cost::TRIANGLE * count as f32
    }

    #[inline(always)]
    fn aabb_of(filling: &Filling) -> Aabb {
        filling.aabb()
    }

    #[inline(always)]
    fn leaf(filling: &Filling, first: u32) -> Option<TriangleLeaf> {
        filling.leaf(first)
    }
}

/// A caller's primitives, of which boxes are known.
#[derive(Clone, Copy)]
pub(super) struct Boxes<'a>(pub &'a [Aabb]);

impl Input for Boxes<'_> {
    type Leaf = PrimitiveLeaf;
    /// How many there are, and the box around them.
    type Filling = (usize, Aabb);
    type Loaded = Aabb;
    const UNLOADED: Aabb = Aabb::EMPTY;
    const EMPTY: Self::Filling = (0, Aabb::EMPTY);
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

    #[inline]
    fn clear(filling: &mut Self::Filling) {
        *filling = Self::EMPTY;
    }

    #[inline]
    fn load(&self, id: u32) -> Aabb {
        self.aabb(id)
    }

    #[inline]
    fn add_loaded((count, aabb): &mut Self::Filling, own: &Aabb) -> bool {
        let fits = *count < Self::MAX_LEAF;
        if fits {
            *count += 1;
            *aabb = aabb.join(*own);
        }
        fits
    }

    fn aabb_of(&(_, aabb): &Self::Filling) -> Aabb {
        aabb
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::PRIMITIVE_LEAF + cost::PRIMITIVE * count as f32
    }

    fn leaf(&(count, _): &Self::Filling, first: u32) -> Option<PrimitiveLeaf> {
        (count > 0).then(|| PrimitiveLeaf::new(first, count as u32))
    }
}

/// The triangles of a mesh, for leaves that read them there: any few make a leaf.
#[derive(Clone, Copy)]
pub(super) struct TrianglesInRuns<'a>(pub &'a TriangleMesh<'a>);

impl Input for TrianglesInRuns<'_> {
    type Leaf = PrimitiveLeaf;
    type Filling = (usize, Aabb);
    type Loaded = Aabb;
    const UNLOADED: Aabb = Aabb::EMPTY;
    const EMPTY: Self::Filling = Boxes::EMPTY;
    const MAX_LEAF: usize = PrimitiveLeaf::MAX_PRIMITIVES;
    const JOINED: f32 = cost::RUNS_JOINED;
    const CAN_SPLIT: bool = true;

    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline]
    fn verdict(&self, id: u32) -> Verdict {
        Triangles(self.0).verdict(id)
    }

    #[inline]
    fn aabb(&self, id: u32) -> Aabb {
        Triangles(self.0).aabb(id)
    }

    #[inline]
    fn triangle(&self, id: u32) -> Option<[Vec3; 3]> {
        Triangles(self.0).triangle(id)
    }

    #[inline]
    fn primitive(&self, number: u32) -> u32 {
        number
    }

    #[inline]
    fn clear(filling: &mut Self::Filling) {
        Boxes::clear(filling);
    }

    #[inline]
    fn load(&self, id: u32) -> Aabb {
        self.aabb(id)
    }

    #[inline]
    fn add_loaded(filling: &mut Self::Filling, own: &Aabb) -> bool {
        Boxes::add_loaded(filling, own)
    }

    fn aabb_of(filling: &Self::Filling) -> Aabb {
        Boxes::aabb_of(filling)
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::RUN_LEAF + cost::RUN_TRIANGLE * count as f32
    }

    fn leaf(filling: &Self::Filling, first: u32) -> Option<PrimitiveLeaf> {
        Boxes::leaf(filling, first)
    }
}
