//! What trees are built over: the triangles of a mesh, or a caller's boxes. All that differs between
//! the two is here.

use super::{
    BuildError, cost,
    fill::{Corners, Filling},
    refs::Bounds,
};
use crate::{
    geometry::{Aabb, TriangleMesh, has_area, is_degenerate},
    layout::{Leaf, PrimitiveLeaf, TriangleLeaf},
    simd::{Backend, Operation, Simd},
};
use glam::{Vec3, Vec3A};
use wide::f32x4;

/// Whether a primitive has a place in the tree.
#[derive(Clone, Copy, Debug)]
pub(super) enum Verdict {
    /// Yes, in this box.
    Keep(Bounds),
    /// No: no ray hits a triangle without area or what has no points.
    Unhittable,
    /// No, if the caller wants such ones left out; else an error.
    NonFinite(BuildError),
    /// An error.
    Invalid(BuildError),
}

/// Primitives, by number, and the leaves they go into.
pub(super) trait Input: Sync {
    type Leaf: Leaf + Send + Sync;
    /// A leaf while it is filled, in a backend's vectors.
    type Filling<S: Simd>: Copy;
    /// Where what a leaf has of a primitive is.
    type Place: Copy + Default;
    /// What a leaf has of a primitive.
    type Loaded: Copy;
    /// That of no primitive.
    const UNLOADED: Self::Loaded;
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
    /// A finite box around all that are kept; not the least.
    fn around(&self) -> Bounds;
    /// Where what a leaf has of a primitive is.
    fn place(&self, id: u32) -> Self::Place;
    /// What a leaf has of the primitive at a place.
    fn load_from(&self, place: Self::Place) -> Self::Loaded;
    /// Has fetched what [`place`](Self::place) reads.
    fn fetch_place<S: Simd>(&self, token: S, id: u32);
    /// Has fetched what [`load_from`](Self::load_from) reads.
    fn fetch<S: Simd>(&self, token: S, place: Self::Place);
    /// Has fetched what a leaf has of the primitive at the first of these places in `ids`, and where that of the second is, if
    /// they are there.
    #[inline(always)]
    fn fetch_of<S: Simd>(&self, token: S, ids: &[u32], [soon, later]: [usize; 2]) {
        if let Some(&id) = ids.get(later) {
            self.fetch_place(token, id);
        }
        if let Some(&id) = ids.get(soon) {
            self.fetch(token, self.place(id));
        }
    }
    /// What a leaf has of a primitive.
    #[inline(always)]
    fn load(&self, id: u32) -> Self::Loaded {
        self.load_from(self.place(id))
    }
    /// The box around it, but for the sign of zeros.
    fn bounds(loaded: &Self::Loaded) -> Bounds;
    /// A leaf of one primitive that is kept.
    fn begin<S: Simd>(token: S, loaded: &Self::Loaded) -> Self::Filling<S>;
    /// Adds a primitive that is kept to a leaf, if it fits.
    fn add<S: Simd>(token: S, filling: &mut Self::Filling<S>, loaded: &Self::Loaded) -> bool;
    /// The cost of a leaf of `count`.
    fn leaf_cost(count: usize) -> f32;
    /// The leaf of the primitives whose numbers begin at `first` in the list.
    fn leaf<S: Simd>(filling: &Self::Filling<S>, first: u32) -> Self::Leaf;
}

/// The leaf of a few primitives that are kept, whose numbers begin at `first` in the list, if they fit into one and are
/// some.
pub(super) fn leaf_of<I: Input>(
    backend: Backend,
    input: &I,
    ids: &[u32],
    first: u32,
) -> Option<I::Leaf> {
    backend.run(LeafOf { input, ids, first })
}

/// What [`leaf_of`] does.
pub(super) struct LeafOf<'a, I> {
    pub input: &'a I,
    pub ids: &'a [u32],
    pub first: u32,
}

impl<I: Input> Operation for LeafOf<'_, I> {
    type Output = Option<I::Leaf>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Option<I::Leaf> {
        let (&first, rest) = self.ids.split_first()?;
        let mut filling = I::begin(token, &self.input.load(first));
        for &id in rest {
            if !I::add(token, &mut filling, &self.input.load(id)) {
                return None;
            }
        }
        Some(I::leaf(&filling, self.first))
    }
}

/// The box around all points that are finite; one point if there are none.
fn around(points: impl Iterator<Item = Vec3>) -> Bounds {
    let mut around = Bounds::EMPTY;
    for point in points {
        let point = Vec3A::from(point);
        if point.is_finite() {
            let [x, y, z] = point.to_array();
            around = around.join_point(f32x4::new([x, y, z, 0.0]));
        }
    }
    match around.min.to_array()[0] > around.max.to_array()[0] {
        true => Bounds::EMPTY.join_point(f32x4::ZERO),
        false => around,
    }
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

    /// The box around three vertices.
    #[inline(always)]
    fn aabb_of(&self, vertices: [u32; 3]) -> Aabb {
        Self::bounds(&self.load_from(vertices)).aabb()
    }

    /// The first corner that is not finite.
    #[cold]
    fn non_finite(&self, id: u32) -> Option<BuildError> {
        let corners = self.corners(id);
        let corner = corners.iter().position(|corner| !corner.is_finite())?;
        Some(BuildError::NonFinitePosition {
            triangle: id as usize,
            corner,
            vertex: self.0.indices()[id as usize][corner],
            position: corners[corner],
        })
    }
}

impl Input for Triangles<'_> {
    type Leaf = TriangleLeaf;
    type Filling<S: Simd> = Filling<S>;
    type Place = [u32; 3];
    type Loaded = Corners;
    const UNLOADED: Corners = Corners::NONE;
    const MAX_LEAF: usize = TriangleLeaf::MAX_TRIANGLES;
    const JOINED: f32 = cost::TRIANGLES_JOINED;
    const CAN_SPLIT: bool = true;

    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn verdict(&self, id: u32) -> Verdict {
        let loaded = self.load(id);
        let Corners([a, b, c]) = loaded;
        let vectors = [
            Vec3A::from_vec4(a.into()),
            Vec3A::from_vec4(b.into()),
            Vec3A::from_vec4(c.into()),
        ];
        // What is not finite has no area that is seen at once.
        if !has_area(vectors) {
            if let Some(error) = self.non_finite(id) {
                return Verdict::NonFinite(error);
            }
            if is_degenerate(self.corners(id)) {
                return Verdict::Unhittable;
            }
        }
        // The sum turns -0.0 into 0.0, so that the order of joins never shows.
        let Bounds { min, max } = Self::bounds(&loaded);
        Verdict::Keep(Bounds {
            min: min + f32x4::ZERO,
            max: max + f32x4::ZERO,
        })
    }

    #[inline]
    fn aabb(&self, id: u32) -> Aabb {
        self.aabb_of(self.place(id))
    }

    #[inline]
    fn triangle(&self, id: u32) -> Option<[Vec3; 3]> {
        Some(self.corners(id))
    }

    #[inline]
    fn primitive(&self, number: u32) -> u32 {
        number
    }

    fn around(&self) -> Bounds {
        around(self.0.positions().iter().map(|&p| Vec3::from_array(p)))
    }

    #[inline(always)]
    fn place(&self, id: u32) -> [u32; 3] {
        self.0.indices()[id as usize]
    }

    #[inline(always)]
    fn fetch_place<S: Simd>(&self, token: S, id: u32) {
        let indices = self.0.indices().as_ptr();
        token.prefetch_line(indices.wrapping_add(id as usize).cast());
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, vertices: [u32; 3]) {
        let positions = self.0.positions().as_ptr();
        for vertex in vertices {
            token.prefetch_line(positions.wrapping_add(vertex as usize).cast());
        }
    }

    #[inline(always)]
    fn load_from(&self, vertices: [u32; 3]) -> Corners {
        Corners::new(self.0, vertices)
    }

    #[inline(always)]
    fn bounds(&Corners([a, b, c]): &Corners) -> Bounds {
        let [a, b, c] = [f32x4::new(a), f32x4::new(b), f32x4::new(c)];
        Bounds {
            min: a.fast_min(b).fast_min(c),
            max: a.fast_max(b).fast_max(c),
        }
    }

    #[inline(always)]
    fn begin<S: Simd>(token: S, corners: &Corners) -> Filling<S> {
        Filling::of(token, corners)
    }

    #[inline(always)]
    fn add<S: Simd>(token: S, filling: &mut Filling<S>, corners: &Corners) -> bool {
        filling.add(token, corners)
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::TRIANGLE_LEAF + cost::TRIANGLE * count as f32
    }

    #[inline(always)]
    fn leaf<S: Simd>(filling: &Filling<S>, first: u32) -> TriangleLeaf {
        filling.leaf(first)
    }
}

/// A caller's primitives, of which boxes are known.
#[derive(Clone, Copy)]
pub(super) struct Boxes<'a>(pub &'a [Aabb]);

impl Input for Boxes<'_> {
    type Leaf = PrimitiveLeaf;
    /// How many there are.
    type Filling<S: Simd> = usize;
    type Place = u32;
    type Loaded = Aabb;
    const UNLOADED: Aabb = Aabb::EMPTY;
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
            () => Verdict::Keep(Bounds::of(&self.aabb(id))),
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

    fn around(&self) -> Bounds {
        let kept = self.0.iter().filter(|aabb| !aabb.is_empty());
        around(kept.flat_map(|aabb| [aabb.min, aabb.max]))
    }

    #[inline(always)]
    fn place(&self, id: u32) -> u32 {
        id
    }

    #[inline(always)]
    fn fetch_place<S: Simd>(&self, _: S, _: u32) {}

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, id: u32) {
        token.prefetch_line(self.0.as_ptr().wrapping_add(id as usize).cast());
    }

    #[inline(always)]
    fn load_from(&self, id: u32) -> Aabb {
        self.aabb(id)
    }

    #[inline(always)]
    fn bounds(aabb: &Aabb) -> Bounds {
        Bounds::of(aabb)
    }

    #[inline(always)]
    fn begin<S: Simd>(_: S, _: &Aabb) -> usize {
        1
    }

    #[inline(always)]
    fn add<S: Simd>(_: S, count: &mut usize, _: &Aabb) -> bool {
        let fits = *count < Self::MAX_LEAF;
        *count += usize::from(fits);
        fits
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::PRIMITIVE_LEAF + cost::PRIMITIVE * count as f32
    }

    fn leaf<S: Simd>(&count: &usize, first: u32) -> PrimitiveLeaf {
        PrimitiveLeaf::new(first, count as u32)
    }
}

/// The triangles of a mesh, for leaves that read them there: any few make a leaf.
#[derive(Clone, Copy)]
pub(super) struct TrianglesInRuns<'a>(pub &'a TriangleMesh<'a>);

impl Input for TrianglesInRuns<'_> {
    type Leaf = PrimitiveLeaf;
    /// How many there are.
    type Filling<S: Simd> = usize;
    type Place = [u32; 3];
    type Loaded = Aabb;
    const UNLOADED: Aabb = Aabb::EMPTY;
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

    fn around(&self) -> Bounds {
        Triangles(self.0).around()
    }

    #[inline(always)]
    fn place(&self, id: u32) -> [u32; 3] {
        Triangles(self.0).place(id)
    }

    #[inline(always)]
    fn fetch_place<S: Simd>(&self, token: S, id: u32) {
        Triangles(self.0).fetch_place(token, id);
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, vertices: [u32; 3]) {
        Triangles(self.0).fetch(token, vertices);
    }

    #[inline(always)]
    fn load_from(&self, vertices: [u32; 3]) -> Aabb {
        Triangles(self.0).aabb_of(vertices)
    }

    #[inline(always)]
    fn bounds(aabb: &Aabb) -> Bounds {
        Boxes::bounds(aabb)
    }

    #[inline(always)]
    fn begin<S: Simd>(token: S, aabb: &Aabb) -> usize {
        Boxes::begin(token, aabb)
    }

    #[inline(always)]
    fn add<S: Simd>(token: S, count: &mut usize, aabb: &Aabb) -> bool {
        Boxes::add(token, count, aabb)
    }

    #[inline]
    fn leaf_cost(count: usize) -> f32 {
        cost::RUN_LEAF + cost::RUN_TRIANGLE * count as f32
    }

    fn leaf<S: Simd>(count: &usize, first: u32) -> PrimitiveLeaf {
        Boxes::leaf::<S>(count, first)
    }
}
