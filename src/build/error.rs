//! Why a hierarchy could not be built.

use crate::layout::{LayoutError, MeshTooSmall};
use core::{error::Error, fmt};
use glam::Vec3;

/// Why a hierarchy could not be built; names the first offender.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BuildError {
    /// A corner of a triangle is NaN or infinite.
    NonFinitePosition {
        /// The triangle.
        triangle: usize,
        /// Which of its corners, 0 to 2.
        corner: usize,
        /// The corner's place in the mesh's positions.
        vertex: u32,
        /// Where it is.
        position: Vec3,
    },
    /// A bound of a primitive's box is NaN or infinite.
    NonFiniteBox {
        /// The primitive.
        primitive: usize,
    },
    /// A primitive's box has its `min` above its `max` on some axis.
    InvalidBox {
        /// The primitive.
        primitive: usize,
    },
    /// There are this many primitives, which is more than
    /// [`TriangleMesh::MAX_TRIANGLES`](crate::geometry::TriangleMesh::MAX_TRIANGLES), or a tree that
    /// lists them this often; or, over a compact hierarchy's limit of 2^29 - 2, 2^28 under 4-wide nodes, numbers in its leaves.
    TooManyPrimitives(usize),
    /// No leaf of the tree lists this primitive, which can be hit.
    PrimitiveMissing {
        /// The primitive.
        primitive: usize,
    },
    /// The tree lists a primitive that is not there.
    PrimitiveOutOfRange {
        /// Where in the tree's order.
        place: usize,
        /// The primitive listed there.
        primitive: u32,
        /// How many primitives there are.
        primitives: usize,
    },
    /// The [`Monitor`](super::Monitor) said to stop.
    Cancelled,
    /// The parts did not pass the layout's check. A bug in the builder, should it ever be seen.
    Layout(LayoutError),
}

/// Why a hierarchy could not follow what moved; names the first offender.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RefitError {
    /// A primitive that is in the hierarchy is not there any more.
    PrimitiveGone {
        /// The primitive.
        primitive: usize,
    },
    /// A primitive that is not in the hierarchy, for having been left out or not there, can be hit now.
    PrimitiveLeftOut {
        /// The primitive.
        primitive: usize,
    },
    /// A triangle that is in a leaf which reads it from the mesh has lost its area.
    AreaLost {
        /// The triangle.
        primitive: usize,
    },
    /// Corners of triangles that were at one place are not any more, and their leaf has no room for so many.
    VerticesParted {
        /// The first triangle for which there is no room.
        primitive: usize,
    },
    /// A triangle or a box that no hierarchy can be built of: it is not finite, or inside out.
    Primitive {
        /// The primitive.
        primitive: usize,
        /// What is wrong with it.
        error: BuildError,
    },
}

/// Why a mesh could not be put in the order of a hierarchy's leaves; names the first offender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReorderError {
    /// It is not the mesh that the hierarchy was built on.
    Mesh(MeshTooSmall),
    /// A triangle is in several leaves, and would have a number in each.
    Repeated {
        /// The triangle.
        primitive: usize,
    },
}

impl RefitError {
    /// The primitive that it is about.
    pub fn primitive(&self) -> usize {
        match *self {
            Self::PrimitiveGone { primitive }
            | Self::PrimitiveLeftOut { primitive }
            | Self::AreaLost { primitive }
            | Self::VerticesParted { primitive }
            | Self::Primitive { primitive, .. } => primitive,
        }
    }
}

impl fmt::Display for RefitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::PrimitiveGone { primitive } => {
                write!(f, "primitive {primitive} is not there any more")
            }
            Self::PrimitiveLeftOut { primitive } => write!(
                f,
                "primitive {primitive} can be hit now, and was left out when this was built: build again"
            ),
            Self::AreaLost { primitive } => write!(
                f,
                "triangle {primitive} has lost its area, and is in a leaf that reads it from the mesh: build again"
            ),
            Self::VerticesParted { primitive } => write!(
                f,
                "triangle {primitive}: vertices that were at one place have parted, more than its leaf has room for: build again"
            ),
            Self::Primitive { error, .. } => error.fmt(f),
        }
    }
}

// What is inside is in the text: there is no source that would say it twice.
impl Error for RefitError {}

impl fmt::Display for ReorderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(error) => error.fmt(f),
            Self::Repeated { primitive } => write!(
                f,
                "triangle {primitive} is in several leaves, and would have a number in each: build with splits(0.0)"
            ),
        }
    }
}

// What is inside is in the text: there is no source that would say it twice.
impl Error for ReorderError {}

impl From<MeshTooSmall> for ReorderError {
    fn from(error: MeshTooSmall) -> Self {
        Self::Mesh(error)
    }
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NonFinitePosition {
                triangle,
                corner,
                vertex,
                position: Vec3 { x, y, z },
            } => write!(
                f,
                "triangle {triangle}, corner {corner}: vertex {vertex} is not finite, but ({x}, {y}, {z})"
            ),
            Self::NonFiniteBox { primitive } => {
                write!(f, "primitive {primitive}: its box is NaN or infinite")
            }
            Self::InvalidBox { primitive } => {
                write!(f, "primitive {primitive}: its box has min above max")
            }
            Self::TooManyPrimitives(count) => write!(
                f,
                "{count} primitives are more than a hierarchy tells apart"
            ),
            Self::PrimitiveMissing { primitive } => {
                write!(f, "primitive {primitive} is in no leaf of the tree")
            }
            Self::PrimitiveOutOfRange {
                place,
                primitive,
                primitives,
            } => write!(
                f,
                "place {place} of the tree's order: primitive {primitive} is past the {primitives} there are"
            ),
            Self::Cancelled => write!(f, "the build was cancelled"),
            Self::Layout(error) => write!(f, "the hierarchy built is not sound: {error}"),
        }
    }
}

// What is inside is in the text: there is no source that would say it twice.
impl Error for BuildError {}

impl From<LayoutError> for BuildError {
    fn from(error: LayoutError) -> Self {
        Self::Layout(error)
    }
}
