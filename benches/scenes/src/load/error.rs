//! Why a file gave no mesh.

use std::{error::Error, fmt, io, path::PathBuf};

/// The file that could not be loaded, and why. Shown as one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadError {
    /// The file asked for.
    pub path: PathBuf,
    /// What is wrong with it.
    pub reason: Reason,
}

/// What can be wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// It is missing, a folder, or may not be read.
    Unreadable(io::ErrorKind),
    /// It has no bytes.
    Empty,
    /// It is neither PLY, OBJ nor glTF.
    AnotherKind,
    /// It ends before its own header says it should.
    Truncated,
    /// It breaks the rules of its format, in the words of the reader.
    Malformed {
        /// `PLY`, `OBJ` or `glTF`.
        format: &'static str,
        /// What is broken, on one line.
        detail: String,
    },
    /// It uses something that its format allows and this loader does not read.
    Unsupported(&'static str),
    /// A face names a vertex that is not there.
    IndexOutOfRange {
        /// The first such index.
        index: i64,
        /// How many vertices there are.
        vertices: usize,
    },
    /// It is well-formed, and holds no triangle.
    NoTriangles,
}

impl Reason {
    /// The words of another crate's error, which may quote the file, as one short printable line.
    pub(super) fn malformed(format: &'static str, error: impl fmt::Display) -> Self {
        const LONGEST: usize = 160;
        let printable = |c: char| if c.is_control() { ' ' } else { c };
        let text: String = error.to_string().chars().map(printable).collect();
        let words: Vec<&str> = text.split_whitespace().collect();
        let detail = words.join(" ").chars().take(LONGEST).collect();
        Self::Malformed { format, detail }
    }
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.reason)
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(io::ErrorKind::NotFound) => f.write_str("no such file"),
            Self::Unreadable(kind) => write!(f, "cannot be read: {kind}"),
            Self::Empty => f.write_str("the file is empty"),
            Self::AnotherKind => f.write_str("not a mesh in PLY, OBJ or glTF"),
            Self::Truncated => f.write_str("the file is truncated: it ends before its data does"),
            Self::Malformed { format, detail } => write!(f, "not well-formed {format}: {detail}"),
            Self::Unsupported(what) => write!(f, "{what} is not supported"),
            Self::IndexOutOfRange { index, vertices } => {
                write!(f, "a face names vertex {index} of only {vertices}")
            }
            Self::NoTriangles => f.write_str("there are no triangles in it"),
        }
    }
}

impl Error for LoadError {}
