//! Wavefront OBJ.

use super::Reason;
use crate::Mesh;
use std::io::Cursor;
use tobj::LoadOptions;

/// Whether a text without a telling name has a line that begins like a vertex or a face.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    // A mesh has its first vertex near the top; more need not be searched.
    const TOP: usize = 1 << 16;
    let top = &bytes[..bytes.len().min(TOP)];
    !top.contains(&0)
        && top
            .split(|&byte| byte == b'\n')
            .any(|line| line.starts_with(b"v ") || line.starts_with(b"f "))
}

pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, Reason> {
    if bytes.contains(&0) {
        return Err(Reason::AnotherKind);
    }
    // Comments and names are often in an old 8-bit encoding; nothing that is read is.
    let text = String::from_utf8_lossy(bytes);
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(text.as_bytes()), &options, no_materials)
        .map_err(|error| Reason::malformed("OBJ", error))?;

    let mut whole = Mesh::default();
    for tobj::Model { mesh, .. } in models {
        let base = whole.positions.len() as u32;
        let (positions, _) = mesh.positions.as_chunks::<3>();
        let (triangles, _) = mesh.indices.as_chunks::<3>();
        whole.positions.extend_from_slice(positions);
        for triangle in triangles {
            whole.indices.push(triangle.map(|index| index + base));
        }
    }
    Ok(whole)
}
