//! Builds, for each node there is.
//!
//! None of them is generic, so they are compiled with this crate, as it is optimised. Else whoever builds would compile the
//! whole builder once more, and run it as fast as they are optimised themselves.

use super::{
    BinaryTree, BuildError, Builder,
    input::{Boxes, Triangles, TrianglesInRuns},
};
use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::{
        Bvh, CompactNode4, CompactNode8, Node4, Node8, Owned, PrimitiveLeaf, RunLeaf, TriangleLeaf,
        WideNode,
    },
};

/// A build, or what was wrong.
type Built<N, L> = Result<Bvh<N, L, Owned>, BuildError>;

/// What the [`Builder`] makes of this node.
pub trait Buildable: Sized {
    fn over_mesh(builder: &Builder, mesh: &TriangleMesh) -> Built<Self, TriangleLeaf>
    where
        Self: WideNode;

    fn over_boxes(builder: &Builder, aabbs: &[Aabb]) -> Built<Self, PrimitiveLeaf>
    where
        Self: WideNode;

    fn compact_over_mesh(builder: &Builder, mesh: &TriangleMesh) -> Built<Self, RunLeaf>
    where
        Self: WideNode;

    fn compact_over_boxes(builder: &Builder, aabbs: &[Aabb]) -> Built<Self, RunLeaf>
    where
        Self: WideNode;

    fn from_mesh_tree(
        builder: &Builder,
        mesh: &TriangleMesh,
        tree: &BinaryTree,
    ) -> Built<Self, TriangleLeaf>
    where
        Self: WideNode;

    fn from_boxes_tree(
        builder: &Builder,
        aabbs: &[Aabb],
        tree: &BinaryTree,
    ) -> Built<Self, PrimitiveLeaf>
    where
        Self: WideNode;
}

macro_rules! impl_buildable {
    ($($node:ty)*) => {$(
        impl Buildable for $node {
            fn over_mesh(builder: &Builder, mesh: &TriangleMesh) -> Built<Self, TriangleLeaf> {
                builder.wide_over(&Triangles(mesh))
            }

            fn over_boxes(builder: &Builder, aabbs: &[Aabb]) -> Built<Self, PrimitiveLeaf> {
                builder.wide_over(&Boxes(aabbs))
            }

            fn compact_over_mesh(builder: &Builder, mesh: &TriangleMesh) -> Built<Self, RunLeaf> {
                builder.compact_over(&TrianglesInRuns(mesh))
            }

            fn compact_over_boxes(builder: &Builder, aabbs: &[Aabb]) -> Built<Self, RunLeaf> {
                builder.compact_over(&Boxes(aabbs))
            }

            fn from_mesh_tree(
                builder: &Builder,
                mesh: &TriangleMesh,
                tree: &BinaryTree,
            ) -> Built<Self, TriangleLeaf> {
                builder.wide_from(&Triangles(mesh), tree)
            }

            fn from_boxes_tree(
                builder: &Builder,
                aabbs: &[Aabb],
                tree: &BinaryTree,
            ) -> Built<Self, PrimitiveLeaf> {
                builder.wide_from(&Boxes(aabbs), tree)
            }
        }
    )*};
}

impl_buildable!(Node4 Node8 CompactNode4 CompactNode8);
