//! What a caller builds with.

use super::{
    BinaryTree, BuildError, adopt,
    collapse::Collapse,
    emit::{Parts, emit},
    group::group,
    input::{Boxes, Input, Triangles},
    pieces::Pieces,
    rebalance::rebalance,
    refs::Refs,
    reinsertion::{self, Effort},
    spatial,
};
use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh, Bvh8, LayoutError, Owned, PrimitiveLeaf, STACK, TriangleLeaf, WideNode},
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
#[derive(Clone, Copy, Debug)]
pub struct Builder {
    drop_non_finite: bool,
    splits: f32,
}

impl Default for Builder {
    fn default() -> Self {
        Self {
            drop_non_finite: false,
            splits: SPLITS,
        }
    }
}

/// Room enough: game levels and a kitchen use 0.05 to 0.12. With 0.1, a level that uses 0.12 loses half its gain.
const SPLITS: f32 = 0.3;

impl Builder {
    /// A builder that refuses primitives that are not finite.
    pub fn new() -> Self {
        Self::default()
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
    /// The default is 0.3, of which little is used: a scan gets 1 % more references, game levels 5 to 12 %,
    /// which takes 6 to 15 % more memory, and up to 9 % off the nodes and leaves that a ray meets.
    ///
    /// Only [`build`](Self::build) and [`build_as`](Self::build_as) cut triangles.
    pub fn splits(mut self, fraction: f32) -> Self {
        self.splits = fraction;
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
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_as<N: WideNode>(
        &self,
        mesh: &TriangleMesh,
    ) -> Result<Bvh<N, TriangleLeaf, Owned>, BuildError> {
        self.wide_over(&Triangles(mesh))
    }

    /// The hierarchy over a caller's primitives, which are numbered as their boxes are.
    ///
    /// A box that is [`Aabb::EMPTY`] stands for a primitive that is never hit.
    ///
    /// # Errors
    /// The first box that is not finite or has `min` above `max`; too many of them.
    pub fn build_primitives<N: WideNode>(
        &self,
        aabbs: &[Aabb],
    ) -> Result<Bvh<N, PrimitiveLeaf, Owned>, BuildError> {
        self.wide_over(&Boxes(aabbs))
    }

    /// The binary tree over a mesh, before it is collapsed: one triangle a leaf.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_binary(&self, mesh: &TriangleMesh) -> Result<BinaryTree, BuildError> {
        self.binary(&Triangles(mesh), 0.0).map(|(tree, ..)| tree)
    }

    /// The binary tree over a caller's primitives, before it is collapsed: one a leaf.
    ///
    /// # Errors
    /// As [`build_primitives`](Self::build_primitives).
    pub fn build_primitives_binary(&self, aabbs: &[Aabb]) -> Result<BinaryTree, BuildError> {
        self.binary(&Boxes(aabbs), 0.0).map(|(tree, ..)| tree)
    }

    /// The hierarchy over a mesh from a binary tree over its triangles, 8 wide.
    ///
    /// The tree's boxes are not relied on: they are worked out anew. Its leaves are split down to single triangles,
    /// and the collapse chooses the leaves and the wide nodes. Else the tree stays as it is, unless that
    /// would take a query more than its stack.
    ///
    /// # Errors
    /// As [`build`](Self::build); the first place of the tree's order with a triangle that is not in the mesh, or the
    /// first triangle that is in no leaf.
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
        self.wide_from(&Triangles(mesh), tree)
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
        self.wide_from(&Boxes(aabbs), tree)
    }

    fn wide_over<N: WideNode, I: Input>(
        &self,
        input: &I,
    ) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
        let (tree, pieces, dropped) = self.binary(input, self.splits)?;
        wide(&pieces, tree, dropped, Some(GROUPED))
    }

    fn wide_from<N: WideNode, I: Input>(
        &self,
        input: &I,
        tree: &BinaryTree,
    ) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
        let refs = Refs::gather(input, self.drop_non_finite)?;
        let pieces = Pieces::whole(input);
        let tree = adopt::adopt(&pieces, tree, &refs)?;
        wide(&pieces, tree, refs.dropped, None)
    }

    /// The binary tree, what it is over, and how many primitives were left out of it for not being finite.
    fn binary<'a, I: Input>(
        &self,
        input: &'a I,
        splits: f32,
    ) -> Result<(BinaryTree, Pieces<'a, I>, usize), BuildError> {
        let refs = Refs::gather(input, self.drop_non_finite)?;
        let dropped = refs.dropped;
        let (tree, pieces) = spatial::build(input, refs, splits);
        Ok((reinsertion::optimize(tree, SINGLE), pieces, dropped))
    }
}

/// For a tree of single primitives: what is large finds its place before leaves are made.
const SINGLE: Effort = Effort {
    rounds: 20,
    share: 40,
    least_gain: 1e-3,
};

/// For a tree of leaves, of which there are a fourth as many. Together the two take a kitchen from 8.5 to 6.4
/// nodes a bounce ray, game levels from 8.5, 8.2 and 8.6 to 7.2, 7.8 and 7.5, for as much time again as the
/// build takes without; more rounds bring 1 % more at most. A scan gains 1 % and is done after a few.
const GROUPED: Effort = Effort {
    rounds: 40,
    share: 3,
    least_gain: 1e-3,
};

/// The hierarchy from a tree in our order.
fn wide<N: WideNode, I: Input>(
    input: &I,
    tree: BinaryTree,
    dropped: usize,
    effort: Option<Effort>,
) -> Result<Bvh<N, I::Leaf, Owned>, BuildError> {
    let Parts {
        nodes,
        leaves,
        primitives,
        bounds,
    } = match N::WIDTH {
        4 => collapse::<N, I, 4>(input, &tree, effort),
        _ => collapse::<N, I, 8>(input, &tree, effort),
    }?;
    let bvh = Bvh::from_parts(nodes, leaves, primitives, bounds)?;
    Ok(bvh.with_dropped(dropped as u32))
}

fn collapse<N: WideNode, I: Input, const W: usize>(
    input: &I,
    tree: &BinaryTree,
    effort: Option<Effort>,
) -> Result<Parts<N, I::Leaf>, LayoutError> {
    let mut tree = group(input, tree, &Collapse::<W>::new(input, tree));
    if let Some(effort) = effort {
        tree = reinsertion::optimize(tree, effort);
    }
    let parts = emit(input, &tree, &Collapse::<W>::new(input, &tree));
    let Err(LayoutError::TooDeep(_)) = parts else {
        return parts;
    };
    // A wide node takes up a binary level at least and leaves W - 1 children behind at most. So a tree
    // of no more levels than this fits the stack, however it is collapsed; and it has room for halving
    // 2^30 leaves, whatever the width.
    const { assert!((STACK - 1) / (W - 1) >= 30) };
    let levels = ((STACK - 1) / (W - 1)) as u32;
    tree = rebalance(&tree, levels);
    emit(input, &tree, &Collapse::<W>::new(input, &tree))
}
