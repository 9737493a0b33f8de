//! What is wrong with bytes.

use super::header::{PRIMITIVE_LEAVES, RUNS, TRIANGLE_LEAVES};
use crate::{
    geometry::MeshError,
    layout::{LayoutError, MeshTooSmall},
};
use core::{error::Error, fmt};

/// Why bytes are not a hierarchy of the kind that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BytesError {
    /// So many bytes are no header.
    NoHeader(usize),
    /// The first bytes are not those of this format.
    NotAHierarchy,
    /// Written by a machine of the other byte order.
    ByteOrder,
    /// Written by another version of the format.
    Version(u32),
    /// Other nodes than were asked for: their number in the header.
    Nodes {
        /// The number asked for.
        expected: u32,
        /// The number in the header.
        found: u32,
    },
    /// Other leaves than were asked for: their number in the header.
    Leaves {
        /// The number asked for.
        expected: u32,
        /// The number in the header.
        found: u32,
    },
    /// More or fewer bytes than the header tells of.
    Length {
        /// How many there should be; more than there can be if the counts make no sense.
        expected: u64,
        /// How many there are.
        found: usize,
    },
    /// A field of the header counts what hierarchies of this kind have none of, or is reserved.
    NotZero(&'static str),
    /// The bytes do not start at a multiple of this.
    Misaligned {
        /// What the first byte's address is to be a multiple of.
        needed: usize,
    },
    /// Some bytes have changed.
    Checksum {
        /// In the header.
        expected: u32,
        /// Of the bytes.
        found: u32,
    },
    /// The parts are not a hierarchy.
    Layout(LayoutError),
    /// The buffers are not a mesh.
    Mesh(MeshError),
    /// The mesh has too few triangles: none if there is no mesh in the file.
    MeshTooSmall(MeshTooSmall),
    /// More of this than the header can count.
    TooMany(&'static str),
}

impl fmt::Display for BytesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoHeader(len) => write!(f, "{len} bytes are too few for a header"),
            Self::NotAHierarchy => write!(f, "the first bytes are not those of a hierarchy"),
            Self::ByteOrder => write!(f, "written by a machine of the other byte order"),
            Self::Version(version) => write!(f, "version {version} of the format is not known"),
            Self::Nodes { expected, found } => {
                let (found, expected) = (nodes(found), nodes(expected));
                write!(f, "{found} nodes, where {expected} ones were asked for")
            }
            Self::Leaves { expected, found } => {
                let (found, expected) = (leaves(found), leaves(expected));
                write!(
                    f,
                    "leaves of {found}, where those of {expected} were asked for"
                )
            }
            Self::Length { expected, found } => {
                let what = if (found as u64) < expected {
                    "cut short"
                } else {
                    "too long"
                };
                write!(
                    f,
                    "{what}: {found} bytes, and the header tells of {expected}"
                )
            }
            Self::NotZero(field) => write!(f, "the header's field `{field}` is not 0"),
            Self::Misaligned { needed } => {
                write!(f, "the first byte's address is no multiple of {needed}")
            }
            Self::Checksum { expected, found } => {
                write!(
                    f,
                    "some bytes have changed: their checksum is {found:08x}, the header has {expected:08x}"
                )
            }
            Self::Layout(error) => error.fmt(f),
            Self::Mesh(error) => error.fmt(f),
            Self::MeshTooSmall(error) => error.fmt(f),
            Self::TooMany(what) => write!(f, "more {what} than the header can count"),
        }
    }
}

/// A kind of nodes for people.
fn nodes(kind: u32) -> &'static str {
    match kind {
        1 => "4-wide",
        2 => "8-wide",
        3 => "compact 4-wide",
        4 => "compact 8-wide",
        _ => "unknown",
    }
}

/// A kind of leaves for people.
fn leaves(kind: u32) -> &'static str {
    match kind {
        TRIANGLE_LEAVES => "triangles",
        PRIMITIVE_LEAVES => "a caller's primitives",
        RUNS => "primitive numbers alone",
        _ => "an unknown kind",
    }
}

// What is inside is in the text: there is no source that would say it twice.
impl Error for BytesError {}

impl From<LayoutError> for BytesError {
    fn from(error: LayoutError) -> Self {
        Self::Layout(error)
    }
}

impl From<MeshError> for BytesError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error)
    }
}

impl From<MeshTooSmall> for BytesError {
    fn from(error: MeshTooSmall) -> Self {
        Self::MeshTooSmall(error)
    }
}
