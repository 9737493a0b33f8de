//! What is generic in the width, made here once: targets are sooner compiled.

use crate::{
    Answers,
    ask::{ask, ask_primitives},
};
use wide_bvh::{
    build::{BinaryTree, BuildError, Builder, RefitError},
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Borrowed, Bvh, Node4, Node8, Owned, PrimitiveLeaf, TriangleLeaf, WideNode},
    primitive::Primitives,
};

/// A hierarchy over triangles.
pub type Triangles<N> = Bvh<N, TriangleLeaf, Owned>;
/// A hierarchy over a caller's primitives.
pub type Boxes<N> = Bvh<N, PrimitiveLeaf, Owned>;

/// A node's width, with what there is to do with hierarchies of such nodes.
pub trait Width: WideNode {
    fn build(builder: &Builder, mesh: &TriangleMesh) -> Result<Triangles<Self>, BuildError>;
    fn build_from_tree(
        builder: &Builder,
        mesh: &TriangleMesh,
        tree: &BinaryTree,
    ) -> Result<Triangles<Self>, BuildError>;
    fn refit(bvh: &mut Triangles<Self>, mesh: &TriangleMesh) -> Result<(), RefitError>;
    /// Asks for each ray's closest hit and any hit, in every way and on every backend. In packets, the rays that `active`
    /// has bits for and the others are asked in two calls.
    fn ask(bvh: Bvh<Self, TriangleLeaf, Borrowed>, rays: &[Ray], active: u64) -> Vec<Answers>;

    fn build_primitives(builder: &Builder, boxes: &[Aabb]) -> Result<Boxes<Self>, BuildError>;
    fn build_primitives_from_tree(
        builder: &Builder,
        boxes: &[Aabb],
        tree: &BinaryTree,
    ) -> Result<Boxes<Self>, BuildError>;
    fn refit_primitives(bvh: &mut Boxes<Self>, boxes: &[Aabb]) -> Result<(), RefitError>;
    /// As [`ask`](Self::ask), over a caller's primitives.
    fn ask_primitives(
        bvh: Bvh<Self, PrimitiveLeaf, Borrowed>,
        primitives: &dyn Primitives<Detail = ()>,
        rays: &[Ray],
    ) -> Vec<Answers>;
}

macro_rules! impl_width {
    ($node:ty) => {
        impl Width for $node {
            #[inline(never)]
            fn build(
                builder: &Builder,
                mesh: &TriangleMesh,
            ) -> Result<Triangles<Self>, BuildError> {
                builder.build_as(mesh)
            }

            #[inline(never)]
            fn build_from_tree(
                builder: &Builder,
                mesh: &TriangleMesh,
                tree: &BinaryTree,
            ) -> Result<Triangles<Self>, BuildError> {
                builder.build_from_tree_as(mesh, tree)
            }

            #[inline(never)]
            fn refit(bvh: &mut Triangles<Self>, mesh: &TriangleMesh) -> Result<(), RefitError> {
                bvh.refit(mesh)
            }

            #[inline(never)]
            fn ask(
                bvh: Bvh<Self, TriangleLeaf, Borrowed>,
                rays: &[Ray],
                active: u64,
            ) -> Vec<Answers> {
                ask(bvh, rays, active)
            }

            #[inline(never)]
            fn build_primitives(
                builder: &Builder,
                boxes: &[Aabb],
            ) -> Result<Boxes<Self>, BuildError> {
                builder.build_primitives(boxes)
            }

            #[inline(never)]
            fn build_primitives_from_tree(
                builder: &Builder,
                boxes: &[Aabb],
                tree: &BinaryTree,
            ) -> Result<Boxes<Self>, BuildError> {
                builder.build_primitives_from_tree(boxes, tree)
            }

            #[inline(never)]
            fn refit_primitives(bvh: &mut Boxes<Self>, boxes: &[Aabb]) -> Result<(), RefitError> {
                bvh.refit(boxes)
            }

            #[inline(never)]
            fn ask_primitives(
                bvh: Bvh<Self, PrimitiveLeaf, Borrowed>,
                primitives: &dyn Primitives<Detail = ()>,
                rays: &[Ray],
            ) -> Vec<Answers> {
                ask_primitives(bvh, primitives, rays)
            }
        }
    };
}

impl_width!(Node4);
impl_width!(Node8);
