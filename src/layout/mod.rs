//! How a hierarchy lies in memory: nodes, leaves, and the check that makes them safe to walk.

mod approximate;
mod bvh;
pub mod bytes;
mod check;
mod child;
mod compact;
mod frame;
mod full;
mod gather;
mod leaf;
mod leaves;
mod node;
mod order;
mod run;
mod storage;

pub use approximate::Approximate;
#[cfg(feature = "std")]
pub(crate) use bvh::tested_bounds;
pub use bvh::{
    Bvh, Bvh4Ref, Bvh8Ref, CompactBvh4Ref, CompactBvh8Ref, MeshBvh4, MeshBvh8, OrderedBvh4Ref,
    OrderedBvh8Ref, OrderedMeshBvh4, OrderedMeshBvh8, PrimitiveBvh4Ref, PrimitiveBvh8Ref,
    QuantizedBvh8Ref,
};
#[cfg(feature = "alloc")]
pub use bvh::{
    Bvh4, Bvh8, CompactBvh4, CompactBvh8, OrderedBvh4, OrderedBvh8, PrimitiveBvh4, PrimitiveBvh8,
    QuantizedBvh8,
};
#[cfg(feature = "alloc")]
pub use bytes::AlignedBytes;
pub use bytes::{Aligned, BytesError, InBytes, Open};
pub use check::LayoutError;
pub(crate) use check::STACK;
pub use child::{Child, ChildKind, Link};
pub use compact::{CompactNode, CompactNode4, CompactNode8};
pub use full::{Node, Node4, Node8};
pub use gather::{Gather, Gathered};
pub use leaf::{Leaf, PrimitiveLeaf, TriangleLeaf};
pub(crate) use leaves::Listed;
pub use leaves::{Leaves, TriangleLeaves, Triangles};
pub use node::WideNode;
pub(crate) use order::number_at;
pub use order::{ByList, Counted, InOrder, Order};
pub use run::{MeshLeaf, MeshTooSmall, OrderedLeaf, OrderedMeshLeaf, RunLeaf, Runs};
#[cfg(feature = "std")]
pub(crate) use run::{VERTICES, of_child, of_place};
#[cfg(feature = "alloc")]
pub use storage::Owned;
pub use storage::{Borrowed, Storage};
