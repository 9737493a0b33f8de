//! Reading meshes from files: PLY, OBJ and glTF, told apart by what is in them.

mod error;
mod gltf;
mod obj;
mod ply;

pub use error::{LoadError, Reason};

use crate::Mesh;
use std::{fs, path::Path};

/// Reads the triangles of the file at `path`: PLY (ASCII or binary, either byte order), OBJ, glTF (`.glb`,
/// or `.gltf` with its buffers embedded or beside it).
///
/// Polygons become fans of triangles. Materials, normals and textures are left behind; the nodes of a glTF
/// scene are applied. The content decides the format; the extension only where the content leaves it open.
///
/// # Errors
/// A file that cannot be read, is not a mesh, ends too soon, contradicts itself, or has no triangle.
pub fn load(path: &Path) -> Result<Mesh, LoadError> {
    let failed = |reason| LoadError {
        path: path.to_owned(),
        reason,
    };
    let bytes = fs::read(path).map_err(|error| failed(Reason::Unreadable(error.kind())))?;
    let mut mesh = parse(&bytes, path).map_err(failed)?;
    check(&mesh).map_err(failed)?;
    mesh.name = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default();
    Ok(mesh)
}

fn parse(bytes: &[u8], path: &Path) -> Result<Mesh, Reason> {
    if bytes.is_empty() {
        return Err(Reason::Empty);
    }
    let first = bytes.trim_ascii_start().first();
    if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
        ply::parse(bytes)
    } else if bytes.starts_with(b"glTF") || first == Some(&b'{') {
        gltf::parse(bytes, path.parent())
    } else if has_extension(path, "obj") || obj::looks_like(bytes) {
        obj::parse(bytes)
    } else {
        Err(Reason::AnotherKind)
    }
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}

/// What every format has to keep.
fn check(mesh: &Mesh) -> Result<(), Reason> {
    if mesh.indices.is_empty() {
        return Err(Reason::NoTriangles);
    }
    let vertices = mesh.positions.len();
    match mesh
        .indices
        .iter()
        .flatten()
        .find(|&&index| index as usize >= vertices)
    {
        Some(&index) => Err(Reason::IndexOutOfRange {
            index: index.into(),
            vertices,
        }),
        None => Ok(()),
    }
}

/// Adds the polygon with these corners as triangles that all share its first.
fn fan(corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    if let [first, rest @ ..] = corners {
        triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
}
