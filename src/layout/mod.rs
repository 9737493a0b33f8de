//! How a hierarchy lies in memory: nodes, leaves, and the check that makes them safe to walk.

mod bvh;
mod check;
mod child;
mod leaf;
mod node;
mod storage;

pub use bvh::{Bvh, Bvh4Ref, Bvh8Ref, PrimitiveBvh4Ref, PrimitiveBvh8Ref};
#[cfg(feature = "alloc")]
pub use bvh::{Bvh4, Bvh8, PrimitiveBvh4, PrimitiveBvh8};
pub use check::LayoutError;
pub(crate) use check::STACK;
pub use child::{Child, ChildKind, Link};
pub use leaf::{Leaf, PrimitiveLeaf, TriangleLeaf};
pub use node::{Node, Node4, Node8, WideNode};
#[cfg(feature = "alloc")]
pub use storage::Owned;
pub use storage::{Borrowed, Storage};
