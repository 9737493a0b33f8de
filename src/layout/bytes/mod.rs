//! Hierarchies as bytes: written once, opened in place anywhere, not trusted.
//!
//! All numbers are in the byte order of the machine that wrote them, which the header tells. A file is the header,
//! then the sections in the order below, each from the next multiple of [`ALIGN`] bytes on, zeros between them,
//! its length a multiple of [`ALIGN`]. Places and lengths follow from the header's counts.
//!
//! | section | what it is an array of |
//! | --- | --- |
//! | nodes | [`Node4`](super::Node4), [`Node8`](super::Node8), [`CompactNode4`](super::CompactNode4) or [`CompactNode8`](super::CompactNode8) |
//! | leaves | [`TriangleLeaf`](super::TriangleLeaf) or [`PrimitiveLeaf`](super::PrimitiveLeaf); none if leaves are runs |
//! | primitives | numbers of primitives, 4 bytes each; none if leaves are runs of primitives in their order |
//! | positions | of a mesh's vertices, 12 bytes each; none without a mesh |
//! | indices | three corners of 4 bytes each, as places of positions |

mod aligned;
mod checksum;
mod error;
mod header;

pub use aligned::Aligned;
#[cfg(feature = "alloc")]
pub use aligned::AlignedBytes;
pub use checksum::seal;
pub use error::BytesError;
pub use header::Header;
pub(super) use header::{ORDERED_RUNS, PRIMITIVE_LEAVES, RUNS, TRIANGLE_LEAVES};

use super::{
    Borrowed, Bvh, LayoutError, Leaf, Leaves, MeshTooSmall, Order, Runs, Storage, WideNode,
};
use crate::geometry::TriangleMesh;
use bytemuck::{Pod, cast_slice};

/// Every section starts at a multiple of this, of bytes from the first.
pub const ALIGN: usize = 64;

/// What there is to write beside nodes and numbers: leaves, and of a mesh the positions and indices.
#[doc(hidden)]
pub type Sections<'a> = (&'a [u8], &'a [[f32; 3]], &'a [[u32; 3]]);

/// Leaves that can be written.
pub trait InBytes: Leaves {
    /// In the header.
    #[doc(hidden)]
    const KIND: u32;
    /// Bytes of a leaf; 0 if none is stored.
    #[doc(hidden)]
    const SIZE: usize;
    /// What leaves that are stored are to begin at a multiple of.
    #[doc(hidden)]
    const ALIGN: usize = 1;
    /// Whether there may be a mesh.
    #[doc(hidden)]
    const MESH: bool = true;
    /// What there is to write of them.
    #[doc(hidden)]
    fn sections<'a, S: Storage>(store: &'a Self::Store<S>) -> Sections<'a>
    where
        Self: 'a;
}

/// Leaves that can be read in place for as long as `'a`.
pub trait Open<'a>: InBytes {
    /// Over what was read, of so many primitives.
    ///
    /// # Errors
    /// The mesh has an index out of range.
    #[doc(hidden)]
    fn open(
        primitives: usize,
        leaves: &'a [u8],
        positions: &'a [[f32; 3]],
        indices: &'a [[u32; 3]],
    ) -> Result<Self::Store<Borrowed<'a>>, BytesError>;
}

impl<L: Leaf> InBytes for L {
    const KIND: u32 = <L as Leaf>::KIND;
    const SIZE: usize = size_of::<L>();
    const ALIGN: usize = align_of::<L>();
    const MESH: bool = false;

    fn sections<'a, S: Storage>(store: &'a S::Slice<L>) -> Sections<'a>
    where
        Self: 'a,
    {
        (cast_slice(store), &[], &[])
    }
}

impl<'a, L: Leaf> Open<'a> for L {
    fn open(
        _: usize,
        leaves: &'a [u8],
        _: &'a [[f32; 3]],
        _: &'a [[u32; 3]],
    ) -> Result<&'a [L], BytesError> {
        cast(leaves)
    }
}

impl<O: Order> InBytes for Runs<(), O> {
    const KIND: u32 = O::KIND;
    const SIZE: usize = 0;

    fn sections<'a, S: Storage>(_: &'a Self::Store<S>) -> Sections<'a>
    where
        Self: 'a,
    {
        (&[], &[], &[])
    }
}

impl<'a, O: Order> Open<'a> for Runs<(), O> {
    fn open(
        primitives: usize,
        _: &'a [u8],
        _: &'a [[f32; 3]],
        _: &'a [[u32; 3]],
    ) -> Result<O::Over<()>, BytesError> {
        Ok(O::counted((), primitives))
    }
}

impl<O: Order> InBytes for Runs<TriangleMesh<'_>, O> {
    const KIND: u32 = O::KIND;
    const SIZE: usize = 0;

    fn sections<'a, S: Storage>(over: &'a Self::Store<S>) -> Sections<'a>
    where
        Self: 'a,
    {
        let mesh = O::of(over);
        (&[], mesh.positions(), mesh.indices())
    }
}

impl<'a, O: Order> Open<'a> for Runs<TriangleMesh<'a>, O> {
    fn open(
        primitives: usize,
        _: &'a [u8],
        positions: &'a [[f32; 3]],
        indices: &'a [[u32; 3]],
    ) -> Result<O::Over<TriangleMesh<'a>>, BytesError> {
        let mesh = TriangleMesh::new(positions, indices)?;
        Ok(O::counted(mesh, primitives))
    }
}

impl<'a, N: WideNode, L: Open<'a>> Bvh<N, L, Borrowed<'a>> {
    /// Opens a hierarchy in place: no copy, no allocation, and no trust. The bytes are checked once, in linear time,
    /// and are then traversed as any hierarchy is.
    ///
    /// They are to start at a multiple of 4 bytes for compact nodes, of 64 for nodes over triangles, of 16 and 32 for 4- and
    /// 8-wide nodes over a caller's primitives. What maps a file or allocates pages gives that; see also [`Aligned`] and
    /// `AlignedBytes`.
    ///
    /// # Errors
    /// Whatever else than a whole file of this version, machine and kind, unharmed: what is wrong with it and where.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Self, BytesError> {
        let header = Header::read(bytes)?;
        header.expect(N::KIND, L::KIND)?;
        let needed = align_of::<N>().max(L::ALIGN).max(align_of::<u32>());
        if !bytes.as_ptr().addr().is_multiple_of(needed) {
            return Err(BytesError::Misaligned { needed });
        }
        let [nodes, leaves, primitives, positions, indices] = header.sections::<N, L>(bytes)?;
        checksum::check(bytes)?;
        let store = L::open(
            header.primitives as usize,
            &bytes[leaves],
            cast(&bytes[positions])?,
            cast(&bytes[indices])?,
        )?;
        let primitives = cast(&bytes[primitives])?;
        let known = L::known::<Borrowed>(&store);
        let needed = L::numbers::<Borrowed>(&store, primitives);
        let bvh = Self::from_parts(cast(&bytes[nodes])?, store, primitives, header.bounds());
        match (bvh, known) {
            (Ok(bvh), _) => Ok(bvh.with_dropped(header.dropped)),
            (Err(LayoutError::Primitive(_)), Some(triangles)) => {
                Err(MeshTooSmall { triangles, needed }.into())
            }
            (Err(error), _) => Err(error.into()),
        }
    }
}

/// The elements that bytes are.
///
/// # Errors
/// They are not where such elements may be.
fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], BytesError> {
    bytemuck::try_cast_slice(bytes).map_err(|_| BytesError::Misaligned {
        needed: align_of::<T>(),
    })
}

#[cfg(feature = "alloc")]
impl<N: WideNode, L: InBytes, S: Storage> Bvh<N, L, S> {
    /// The hierarchy as bytes, for [`from_bytes`](Bvh::from_bytes) on any machine of this byte order: of one
    /// [`over`](Bvh::over) a mesh, mesh and all.
    ///
    /// # Errors
    /// More positions than the header can count.
    pub fn to_bytes(&self) -> Result<alloc::vec::Vec<u8>, BytesError> {
        let (leaves, positions, indices) = L::sections::<S>(self.leaf_store());
        let header = Header::new(
            self,
            leaves.len().checked_div(L::SIZE).unwrap_or(0),
            positions.len(),
            indices.len(),
        )?;
        let mut bytes = alloc::vec![0; header.len::<N, L>()];
        bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        let sections = [
            cast_slice(self.nodes()),
            leaves,
            cast_slice(self.primitives()),
            cast_slice(positions),
            cast_slice(indices),
        ];
        for (place, section) in header.places::<N, L>().into_iter().zip(sections) {
            bytes[place].copy_from_slice(section);
        }
        seal(&mut bytes);
        Ok(bytes)
    }
}
