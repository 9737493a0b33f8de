//! Baked files of triangles, opened as what they say they are.

use wide_bvh::{
    geometry::{Aabb, Hit, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, ByList, BytesError, CompactNode4, CompactNode8, InOrder, Node4, Node8,
        Order, Runs, Storage, TriangleLeaf, TriangleLeaves, WideNode, bytes::Header,
    },
    simd::Backend,
};

/// A hierarchy over triangles, of whatever nodes and leaves.
pub trait Opened {
    /// Its bounds.
    fn bounds(&self) -> &Aabb;
    /// The closest hit, and whether there is any.
    fn ask(&self, ray: &Ray) -> (Option<Hit>, bool);
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Opened for Bvh<N, L, S> {
    fn bounds(&self) -> &Aabb {
        self.bounds()
    }

    fn ask(&self, ray: &Ray) -> (Option<Hit>, bool) {
        (self.closest_hit(ray), self.any_hit(ray))
    }
}

/// Opens bytes in place as one kind of hierarchy, which will use the backend.
pub type Open = for<'a> fn(&'a [u8], Backend) -> Result<Box<dyn Opened + 'a>, BytesError>;

/// How to open a file with this header, if its leaves are triangles.
pub fn opener(header: &Header) -> Option<Open> {
    match (header.node_kind, header.leaf_kind) {
        (1, 1) => Some(leaves::<Node4>),
        (2, 1) => Some(leaves::<Node8>),
        (1, 3) => Some(runs::<Node4, ByList>),
        (2, 3) => Some(runs::<Node8, ByList>),
        (3, 3) => Some(runs::<CompactNode4, ByList>),
        (4, 3) => Some(runs::<CompactNode8, ByList>),
        (3, 4) => Some(runs::<CompactNode4, InOrder>),
        (4, 4) => Some(runs::<CompactNode8, InOrder>),
        _ => None,
    }
}

fn leaves<N: WideNode>(bytes: &[u8], backend: Backend) -> Result<Box<dyn Opened + '_>, BytesError> {
    Ok(set(Bvh::<N, TriangleLeaf, _>::from_bytes(bytes)?, backend))
}

fn runs<N: WideNode, O: Order + 'static>(
    bytes: &[u8],
    backend: Backend,
) -> Result<Box<dyn Opened + '_>, BytesError> {
    Ok(set(
        Bvh::<N, Runs<TriangleMesh, O>, _>::from_bytes(bytes)?,
        backend,
    ))
}

/// To be asked with a backend, and looking ahead, which relies on the most.
fn set<'a, N: WideNode, L: TriangleLeaves + 'a>(
    mut bvh: Bvh<N, L, Borrowed<'a>>,
    backend: Backend,
) -> Box<dyn Opened + 'a> {
    bvh.set_backend(backend);
    bvh.set_looks_ahead(true);
    Box::new(bvh)
}
