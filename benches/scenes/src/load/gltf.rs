//! glTF 2.0: a JSON description of nodes, meshes and accessors, and the buffers those look into.
//!
//! The crate checks the JSON; the bytes are read here, since its own accessors trust counts and strides.

use super::{Reason, fan};
use crate::Mesh;
use base64::{Engine, prelude::BASE64_STANDARD};
use glam::{Mat4, Vec3};
use gltf::{
    Accessor, Document, Gltf, Primitive, Semantic,
    accessor::{DataType, Dimensions},
    buffer::Source,
    json::validation::Checked,
    mesh::Mode,
};
use std::{fs, path::Path};

const FORMAT: &str = "glTF";

/// The most vertices, and triangles, that are taken from one file: 3 GB of either.
const MOST: usize = 1 << 28;

/// Reads binary glTF, or JSON whose buffers are embedded or in `folder`.
pub(super) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Mesh, Reason> {
    let (document, blob) = document(bytes)?;
    let buffers = buffers(&document, blob, folder)?;
    let mut mesh = Mesh::default();
    for (node, to_world) in placed_nodes(&document) {
        let Some(node_mesh) = node.mesh() else {
            continue;
        };
        for primitive in node_mesh.primitives() {
            add_primitive(&primitive, to_world, &buffers, &mut mesh)?;
        }
    }
    Ok(mesh)
}

/// The description, once everything in it that names a part of it names one that is there; and the binary chunk.
fn document(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), Reason> {
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(reason)?;
    let root = document.into_json();
    // The crate's check reads the accessors of positions before it looks whether they are there.
    let positions = Checked::Valid(Semantic::Positions);
    let are_there = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .filter_map(|primitive| primitive.attributes.get(&positions))
        .all(|accessor| accessor.value() < root.accessors.len());
    if !are_there {
        return Err(Reason::malformed(
            FORMAT,
            "a mesh names an accessor that is not there",
        ));
    }
    Ok((Document::from_json(root).map_err(reason)?, blob))
}

fn reason(error: gltf::Error) -> Reason {
    use gltf::binary;
    match error {
        gltf::Error::Deserialize(error) if error.is_eof() => Reason::Truncated,
        gltf::Error::Binary(
            binary::Error::Io(_) | binary::Error::Length { .. } | binary::Error::ChunkLength { .. },
        ) => Reason::Truncated,
        error => Reason::malformed(FORMAT, error),
    }
}

/// The bytes of every buffer, in order, each as long as the document says at least.
fn buffers(
    document: &Document,
    mut blob: Option<Vec<u8>>,
    folder: Option<&Path>,
) -> Result<Vec<Vec<u8>>, Reason> {
    let buffer = |buffer: gltf::Buffer<'_>| {
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or(Reason::Truncated)?,
            Source::Uri(uri) => resource(uri, folder)?,
        };
        match bytes.len() < buffer.length() {
            true => Err(Reason::Truncated),
            false => Ok(bytes),
        }
    };
    document.buffers().map(buffer).collect()
}

/// What a `uri` stands for: base64 within it, or a file beside the document.
fn resource(uri: &str, folder: Option<&Path>) -> Result<Vec<u8>, Reason> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((_, base64)) = data.split_once(";base64,") else {
            return Err(Reason::Unsupported("a data URI that is not base64"));
        };
        return BASE64_STANDARD
            .decode(base64)
            .map_err(|error| Reason::malformed(FORMAT, error));
    }
    if uri.contains(':') {
        return Err(Reason::Unsupported(
            "a buffer that is neither embedded nor beside the file",
        ));
    }
    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
    let path = folder.unwrap_or(Path::new("")).join(&*name);
    fs::read(&path)
        .map_err(|error| Reason::malformed(FORMAT, format!("its buffer {name}: {}", error.kind())))
}

/// The nodes of the default scene, or else of the first, with the transform of each to the world.
fn placed_nodes(document: &Document) -> Vec<(gltf::Node<'_>, Mat4)> {
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let roots = scene.into_iter().flat_map(|scene| scene.nodes());
    let mut waiting: Vec<_> = roots.map(|node| (node, Mat4::IDENTITY)).collect();
    // The format wants a tree: to enter a node once only keeps a file that has a cycle from going round it.
    let mut entered = vec![false; document.nodes().len()];
    let mut placed = Vec::new();
    while let Some((node, parent)) = waiting.pop() {
        if std::mem::replace(&mut entered[node.index()], true) {
            continue;
        }
        let to_world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        waiting.extend(node.children().map(|child| (child, to_world)));
        placed.push((node, to_world));
    }
    placed
}

/// Adds the triangles of one primitive; points and lines have none.
fn add_primitive(
    primitive: &Primitive<'_>,
    to_world: Mat4,
    buffers: &[Vec<u8>],
    mesh: &mut Mesh,
) -> Result<(), Reason> {
    let mode = primitive.mode();
    if !matches!(
        mode,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        return Ok(());
    }
    let Some(positions) = primitive.get(&Semantic::Positions) else {
        return Ok(());
    };
    let positions = read_positions(&positions, buffers)?;
    let corners = match primitive.indices() {
        Some(indices) => read_indices(&indices, buffers)?,
        None => (0..positions.len() as u32).collect(),
    };
    // Checked here since the next primitive's vertices would hide an index that is past these.
    if let Some(&index) = corners.iter().find(|&&i| i as usize >= positions.len()) {
        return Err(Reason::IndexOutOfRange {
            index: index.into(),
            vertices: positions.len(),
        });
    }

    // A short file can name the same buffer time and again.
    if mesh.positions.len() + positions.len() > MOST || mesh.indices.len() + corners.len() > MOST {
        return Err(Reason::Unsupported("a scene this large"));
    }

    let mut triangles = Vec::new();
    match mode {
        Mode::TriangleStrip => triangles.extend(corners.windows(3).enumerate().map(|(i, t)| {
            // Every other triangle of a strip is wound the other way.
            let flip = i % 2;
            [t[0], t[1 + flip], t[2 - flip]]
        })),
        Mode::TriangleFan => fan(&corners, &mut triangles),
        _ => triangles.extend_from_slice(corners.as_chunks::<3>().0),
    }
    mesh.append(&Mesh {
        name: String::new(),
        positions: positions
            .into_iter()
            .map(|p| to_world.transform_point3(Vec3::from(p)).to_array())
            .collect(),
        indices: triangles,
    });
    Ok(())
}

fn read_positions(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<Vec<[f32; 3]>, Reason> {
    if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
        return Err(Reason::Unsupported("a position that is not three floats"));
    }
    let position = |bytes: &[u8; 12]| {
        let (axes, _) = bytes.as_chunks::<4>();
        [axes[0], axes[1], axes[2]].map(f32::from_le_bytes)
    };
    Ok(elements(accessor, buffers)?.map(position).collect())
}

fn read_indices(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<Vec<u32>, Reason> {
    if accessor.dimensions() != Dimensions::Scalar {
        return Err(Reason::malformed(FORMAT, "an index that is not one number"));
    }
    Ok(match accessor.data_type() {
        DataType::U8 => elements(accessor, buffers)?
            .map(|&[byte]| byte.into())
            .collect(),
        DataType::U16 => elements(accessor, buffers)?
            .map(|&bytes| u16::from_le_bytes(bytes).into())
            .collect(),
        DataType::U32 => elements(accessor, buffers)?
            .map(|&bytes| u32::from_le_bytes(bytes))
            .collect(),
        _ => {
            return Err(Reason::malformed(
                FORMAT,
                "an index that is not an unsigned integer",
            ));
        }
    })
}

/// The elements of an accessor, each of `SIZE` bytes, once it is sure that all of them are in the buffer.
fn elements<'b, const SIZE: usize>(
    accessor: &Accessor<'_>,
    buffers: &'b [Vec<u8>],
) -> Result<impl Iterator<Item = &'b [u8; SIZE]>, Reason> {
    if accessor.sparse().is_some() {
        return Err(Reason::Unsupported("a sparse accessor"));
    }
    let Some(view) = accessor.view() else {
        return Err(Reason::Unsupported("an accessor without a buffer"));
    };
    let stride = view.stride().unwrap_or(SIZE);
    if stride < SIZE {
        return Err(Reason::malformed(FORMAT, "elements that overlap"));
    }
    let part = |bytes: &'b [u8], offset: usize, length: usize| bytes.get(offset..)?.get(..length);
    let in_view = || {
        let last = accessor.count().checked_sub(1)?;
        let length = last.checked_mul(stride)?.checked_add(SIZE)?;
        let view = part(
            &buffers[view.buffer().index()],
            view.offset(),
            view.length(),
        )?;
        part(view, accessor.offset(), length)
    };
    let bytes = match accessor.count() {
        0 => &[],
        _ => {
            in_view().ok_or_else(|| Reason::malformed(FORMAT, "an accessor is past its buffer"))?
        }
    };
    // The last element may be shorter than the stride; it is never shorter than `SIZE`.
    Ok(bytes
        .chunks(stride)
        .filter_map(|element| element.first_chunk()))
}
