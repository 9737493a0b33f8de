//! A view of the caller's vertex and index buffers as triangles.

use bytemuck::Pod;
use core::{error::Error, fmt};
use glam::{UVec3, Vec3};

/// An indexed triangle mesh, borrowed from its owner: every index is within the positions.
///
/// Positions may still be NaN or infinite: that is for the builder to refuse or to drop.
#[derive(Clone, Copy, Debug)]
pub struct TriangleMesh<'a> {
    positions: &'a [[f32; 3]],
    indices: &'a [[u32; 3]],
}

/// What a vertex buffer may hold: three floats in a row.
pub trait Position: Pod + sealed::Sealed {}
impl Position for Vec3 {}
impl Position for [f32; 3] {}
impl Position for f32 {}

/// What an index buffer may hold: three corners in a row.
pub trait TriangleIndices: Pod + sealed::Sealed {}
impl TriangleIndices for UVec3 {}
impl TriangleIndices for [u32; 3] {}
impl TriangleIndices for u32 {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for glam::Vec3 {}
    impl Sealed for [f32; 3] {}
    impl Sealed for f32 {}
    impl Sealed for glam::UVec3 {}
    impl Sealed for [u32; 3] {}
    impl Sealed for u32 {}
}

impl<'a> TriangleMesh<'a> {
    /// Views `positions` and `indices` as a mesh, without a copy. Three indices make a triangle;
    /// both may be flat (`&[f32]`, `&[u32]`), arrays of three, or glam's `Vec3` and `UVec3`.
    ///
    /// # Errors
    /// An index past the positions, a flat buffer whose length is no multiple of three, or more
    /// triangles than [`TriangleMesh::MAX_TRIANGLES`].
    pub fn new<P: Position, I: TriangleIndices>(
        positions: &'a [P],
        indices: &'a [I],
    ) -> Result<Self, MeshError> {
        let positions: &[[f32; 3]] = bytemuck::try_cast_slice(positions)
            .map_err(|_| MeshError::PositionsNotTriples(positions.len()))?;
        let indices: &[[u32; 3]] = bytemuck::try_cast_slice(indices)
            .map_err(|_| MeshError::IndicesNotTriples(indices.len()))?;
        if indices.len() > Self::MAX_TRIANGLES {
            return Err(MeshError::TooManyTriangles(indices.len()));
        }
        for (triangle, corners) in indices.iter().enumerate() {
            for (corner, &index) in corners.iter().enumerate() {
                if index as usize >= positions.len() {
                    return Err(MeshError::IndexOutOfRange {
                        triangle,
                        corner,
                        index,
                        positions: positions.len(),
                    });
                }
            }
        }
        Ok(Self { positions, indices })
    }

    /// The most triangles a mesh may have: their numbers, and those of a tree's nodes, are 31 bits.
    pub const MAX_TRIANGLES: usize = (1 << 30) - 1;

    /// How many triangles there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there is no triangle.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// All vertex positions.
    #[inline]
    pub fn positions(&self) -> &'a [[f32; 3]] {
        self.positions
    }

    /// The corners of every triangle, as places in [`positions`](Self::positions).
    #[inline]
    pub fn indices(&self) -> &'a [[u32; 3]] {
        self.indices
    }

    /// The corners of triangle number `triangle`, or `None` past the end.
    #[inline]
    pub fn triangle(&self, triangle: usize) -> Option<[Vec3; 3]> {
        let corners = self.indices.get(triangle)?;
        Some(corners.map(|i| Vec3::from_array(self.positions[i as usize])))
    }
}

/// Why buffers are not a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshError {
    /// A flat position buffer of this length is no whole number of vertices.
    PositionsNotTriples(usize),
    /// A flat index buffer of this length is no whole number of triangles.
    IndicesNotTriples(usize),
    /// More triangles than [`TriangleMesh::MAX_TRIANGLES`].
    TooManyTriangles(usize),
    /// The first index that is past the positions.
    IndexOutOfRange {
        /// The triangle it is in.
        triangle: usize,
        /// Which of its corners, 0 to 2.
        corner: usize,
        /// The index.
        index: u32,
        /// How many positions there are.
        positions: usize,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::PositionsNotTriples(len) => {
                write!(f, "{len} position values are no whole number of vertices")
            }
            Self::IndicesNotTriples(len) => {
                write!(f, "{len} indices are no whole number of triangles")
            }
            Self::TooManyTriangles(len) => {
                let most = TriangleMesh::MAX_TRIANGLES;
                write!(f, "{len} triangles are more than {most}")
            }
            Self::IndexOutOfRange {
                triangle,
                corner,
                index,
                positions,
            } => write!(
                f,
                "triangle {triangle}, corner {corner}: index {index} is past the {positions} positions"
            ),
        }
    }
}

impl Error for MeshError {}
