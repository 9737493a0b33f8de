//! What a caller builds with.

use super::{
    BinaryTree, BuildError, Monitor, Preset,
    compact::compact,
    input::{Boxes, Input, Triangles},
    monitor::{Monitored, Watch},
    pipeline::{self, Wants},
    refs::Refs,
};
use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh, Bvh8, Node4, Node8, Owned, PrimitiveLeaf, RunLeaf, TriangleLeaf, WideNode},
};

/// Builds hierarchies: a binary tree by the surface area heuristic, its subtrees moved to where they cost
/// least, collapsed to wide nodes at the least cost.
///
/// - The tree: Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007).
/// - The cuts through large triangles: Stich, Friedrich, Dietrich, "Spatial splits in bounding volume
///   hierarchies" (2009).
/// - The moves: Meister and Bittner, "Parallel reinsertion for bounding volume hierarchy optimization" (2018).
/// - The collapse: Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide
///   BVHs" (2017).
///
/// The same input gives the same bits, on however many threads (feature `rayon`).
///
/// ```
/// use wide_bvh::{build::Builder, geometry::{Ray, TriangleMesh}};
///
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// let bvh = Builder::new().build(&mesh)?;
/// assert!(bvh.closest_hit(&Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0])).is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Builder<'m> {
    preset: Preset,
    drop_non_finite: bool,
    /// If it is not the preset's.
    splits: Option<f32>,
    monitored: Monitored<'m>,
}

impl<'m> Builder<'m> {
    /// A builder of the best hierarchies, which refuses primitives that are not finite.
    pub fn new() -> Self {
        Self::default()
    }

    /// What the hierarchy is for: how much time a build may take.
    ///
    /// [`build_binary`](Self::build_binary), [`build_from_tree`](Self::build_from_tree) and the like do not look at it.
    pub fn preset(mut self, preset: Preset) -> Self {
        self.preset = preset;
        self
    }

    /// Has a monitor told how far builds have got, which may stop them.
    ///
    /// ```
    /// use core::{ops::ControlFlow, sync::atomic::{AtomicBool, Ordering}};
    /// use wide_bvh::{build::{Builder, BuildError}, geometry::TriangleMesh};
    ///
    /// let stop = AtomicBool::new(false); // somebody else's
    /// let monitor = |fraction: f32| match stop.load(Ordering::Relaxed) {
    ///     true => ControlFlow::Break(()),
    ///     false => ControlFlow::Continue(println!("{:.0} %", 100.0 * fraction)),
    /// };
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// let builder = Builder::new().monitor(&monitor);
    /// assert!(builder.build(&mesh).is_ok());
    /// stop.store(true, Ordering::Relaxed);
    /// assert_eq!(builder.build(&mesh).err(), Some(BuildError::Cancelled));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn monitor(self, monitor: &'m dyn Monitor) -> Self {
        Self {
            monitored: Monitored(Some(monitor)),
            ..self
        }
    }

    /// Whether triangles with a corner that is NaN or infinite, and boxes with such a bound, are left out,
    /// and counted, instead of being an error.
    pub fn drop_non_finite(mut self, drop_non_finite: bool) -> Self {
        self.drop_non_finite = drop_non_finite;
        self
    }

    /// How many references to triangles may be added by cutting large triangles in pieces, as a fraction of their
    /// number; 0 or less, or NaN, is none. A triangle in pieces is in more than one leaf.
    ///
    /// Unless it is set, it is 0, and 0.3 for [`Preset::Best`], of which little is used: a scan gets 1 % more references, game levels 5 to 12 %,
    /// which takes 6 to 15 % more memory, and up to 9 % off the nodes and leaves that a ray meets.
    ///
    /// Builds that take a mesh and no tree, and whose preset is not [`Preset::Fast`], are those that cut.
    pub fn splits(mut self, fraction: f32) -> Self {
        self.splits = Some(fraction);
        self
    }

    /// The hierarchy over a mesh, 8 wide.
    ///
    /// Triangles without area, whose corners are on one line, are left out: no ray hits them.
    ///
    /// # Errors
    /// The first position that is not finite, of those that triangles use.
    pub fn build(&self, mesh: &TriangleMesh) -> Result<Bvh8, BuildError> {
        self.build_as(mesh)
    }

    /// The hierarchy over a mesh, of nodes `N`. See [`build`](Self::build).
    ///
    /// Over many millions of triangles compact nodes are the fastest, as more of them are in the caches:
    ///
    /// ```
    /// use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::QuantizedBvh8};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// let bvh: QuantizedBvh8 = Builder::new().build_as(&mesh)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_as<N: WideNode>(
        &self,
        mesh: &TriangleMesh,
    ) -> Result<Bvh<N, TriangleLeaf, Owned>, BuildError> {
        N::over_mesh(self, mesh)
    }

    /// The compact hierarchy over a mesh, which stays where it is and is read there: see
    /// [`over`](Bvh::over). `N` is [`CompactNode8`](crate::layout::CompactNode8) or
    /// [`CompactNode4`](crate::layout::CompactNode4). A large mesh is read faster in the order of leaves: see
    /// [`reorder`](Bvh::reorder).
    ///
    /// ```
    /// use wide_bvh::{build::Builder, geometry::{Ray, TriangleMesh}, layout::CompactBvh8};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// let compact: CompactBvh8 = Builder::new().build_compact(&mesh)?;
    /// let bvh = compact.over(&mesh)?;
    /// assert!(bvh.closest_hit(&Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0])).is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`build`](Self::build); more than 2^29 - 2 triangles or pieces of them, 2^28 under 4-wide nodes.
    pub fn build_compact<N: WideNode>(
        &self,
        mesh: &TriangleMesh,
    ) -> Result<Bvh<N, RunLeaf, Owned>, BuildError> {
        N::compact_over_mesh(self, mesh)
    }

    /// The compact hierarchy over a caller's primitives, asked as one of [`build_primitives`](Self::build_primitives) is.
    ///
    /// # Errors
    /// As [`build_primitives`](Self::build_primitives); more than 2^29 - 2 primitives, 2^28 under 4-wide nodes.
    pub fn build_compact_primitives<N: WideNode>(
        &self,
        aabbs: &[Aabb],
    ) -> Result<Bvh<N, RunLeaf, Owned>, BuildError> {
        N::compact_over_boxes(self, aabbs)
    }

    /// The hierarchy over a caller's primitives, which are numbered as their boxes are.
    ///
    /// A box that is [`Aabb::EMPTY`] stands for a primitive that is never hit.
    ///
    /// ```
    /// use wide_bvh::{Aabb, Builder, Ray, layout::PrimitiveBvh8, primitive::Primitives};
    ///
    /// /// Squares of side 2 that face the z axis, each at its own height.
    /// struct Squares(Vec<f32>);
    ///
    /// impl Primitives for Squares {
    ///     type Detail = ();
    ///
    ///     fn aabb(&self, primitive: u32) -> Aabb {
    ///         let z = self.0[primitive as usize];
    ///         Aabb::new([-1.0, -1.0, z].into(), [1.0, 1.0, z].into())
    ///     }
    ///
    ///     fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, ())> {
    ///         let t = (self.0[primitive as usize] - ray.origin.z) / ray.direction.z;
    ///         let point = ray.at(t);
    ///         (point.x.abs() <= 1.0 && point.y.abs() <= 1.0).then_some((t, ()))
    ///     }
    /// }
    ///
    /// let squares = Squares(vec![5.0, 3.0, 4.0]);
    /// let aabbs = [0, 1, 2].map(|primitive| squares.aabb(primitive));
    /// let bvh: PrimitiveBvh8 = Builder::new().build_primitives(&aabbs)?;
    /// let hit = bvh.closest_hit(&squares, &Ray::new([0.0; 3], [0.1, 0.0, 1.0])).unwrap();
    /// assert_eq!(hit.primitive, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first box that is not finite or has `min` above `max`; too many of them.
    pub fn build_primitives<N: WideNode>(
        &self,
        aabbs: &[Aabb],
    ) -> Result<Bvh<N, PrimitiveLeaf, Owned>, BuildError> {
        N::over_boxes(self, aabbs)
    }

    /// The binary tree over a mesh, before it is collapsed: one triangle a leaf.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_binary(&self, mesh: &TriangleMesh) -> Result<BinaryTree, BuildError> {
        self.binary(&Triangles(mesh))
    }

    /// The binary tree over a caller's primitives, before it is collapsed: one a leaf.
    ///
    /// # Errors
    /// As [`build_primitives`](Self::build_primitives).
    pub fn build_primitives_binary(&self, aabbs: &[Aabb]) -> Result<BinaryTree, BuildError> {
        self.binary(&Boxes(aabbs))
    }

    /// The hierarchy over a mesh from a binary tree over its triangles, 8 wide.
    ///
    /// The tree's boxes are not relied on: they are worked out anew. Its leaves are split down to single triangles,
    /// and the collapse chooses the leaves and the wide nodes. Else the tree stays as it is, unless that
    /// would take a query more than its stack.
    ///
    /// # Errors
    /// As [`build`](Self::build); the first place of the tree's order with a triangle that is not in the mesh, or the
    /// first triangle that is in no leaf and would not be left out.
    pub fn build_from_tree(
        &self,
        mesh: &TriangleMesh,
        tree: &BinaryTree,
    ) -> Result<Bvh8, BuildError> {
        self.build_from_tree_as(mesh, tree)
    }

    /// The hierarchy over a mesh from a binary tree, of nodes `N`. See
    /// [`build_from_tree`](Self::build_from_tree).
    ///
    /// # Errors
    /// As [`build_from_tree`](Self::build_from_tree).
    pub fn build_from_tree_as<N: WideNode>(
        &self,
        mesh: &TriangleMesh,
        tree: &BinaryTree,
    ) -> Result<Bvh<N, TriangleLeaf, Owned>, BuildError> {
        N::from_mesh_tree(self, mesh, tree)
    }

    /// The hierarchy over a caller's primitives from a binary tree over them. See
    /// [`build_from_tree`](Self::build_from_tree).
    ///
    /// # Errors
    /// As [`build_primitives`](Self::build_primitives) and [`build_from_tree`](Self::build_from_tree).
    pub fn build_primitives_from_tree<N: WideNode>(
        &self,
        aabbs: &[Aabb],
        tree: &BinaryTree,
    ) -> Result<Bvh<N, PrimitiveLeaf, Owned>, BuildError> {
        N::from_boxes_tree(self, aabbs, tree)
    }

    pub(super) fn wide_over<N: WideNode, I: Input>(
        &self,
        input: &I,
    ) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
        let wants = Wants {
            preset: self.preset,
            drop_non_finite: self.drop_non_finite,
            splits: self.splits.unwrap_or(self.preset.splits()),
        };
        pipeline::build(input, wants, &Watch::new(self.monitored))
    }

    pub(super) fn compact_over<N: WideNode, I: Input<Leaf = PrimitiveLeaf>>(
        &self,
        input: &I,
    ) -> Result<Bvh<N, RunLeaf, Owned>, BuildError> {
        match N::WIDTH {
            4 => compact(&self.wide_over::<Node4, I>(input)?),
            _ => compact(&self.wide_over::<Node8, I>(input)?),
        }
    }

    pub(super) fn wide_from<N: WideNode, I: Input>(
        &self,
        input: &I,
        tree: &BinaryTree,
    ) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
        let watch = Watch::new(self.monitored);
        let refs = Refs::gather(input, self.drop_non_finite, &watch)?;
        pipeline::from_tree(input, &refs, tree, &watch)
    }

    fn binary<I: Input>(&self, input: &I) -> Result<BinaryTree, BuildError> {
        let watch = Watch::new(self.monitored);
        let refs = Refs::gather(input, self.drop_non_finite, &watch)?;
        pipeline::binary(input, refs, &watch)
    }
}
