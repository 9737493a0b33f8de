//! PLY, the Stanford triangle format: a header that describes lists of records, then the records.

use super::{Reason, fan};
use crate::Mesh;
use ply_rs_bw::{
    parser::{ParseError, Parser, Reader},
    ply::{
        BeginList, ElementDef, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    },
};
use std::io::ErrorKind;

const FORMAT: &str = "PLY";

pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, Reason> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new()
        .read_header(&mut reader)
        .map_err(reason)?;
    check(&header, bytes.len())?;

    let mut mesh = Mesh::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                let vertices = records::<Vertex>(&mut reader, element, &header)?;
                mesh.positions = vertices.into_iter().map(|vertex| vertex.0).collect();
            }
            "face" => {
                let faces = records::<Face>(&mut reader, element, &header)?;
                mesh.indices.reserve(faces.len());
                for face in &faces {
                    if let Some(index) = face.negative {
                        return Err(Reason::IndexOutOfRange {
                            index: index.into(),
                            vertices: mesh.positions.len(),
                        });
                    }
                    fan(&face.corners, &mut mesh.indices);
                }
            }
            _ => drop(records::<Skipped>(&mut reader, element, &header)?),
        }
    }
    Ok(mesh)
}

/// Refuses what would read as a mesh of nothing but zeros, and counts that no file of `bytes` could hold.
fn check(header: &Header, bytes: usize) -> Result<(), Reason> {
    let Some(vertex) = header.elements.get("vertex") else {
        return Err(Reason::malformed(FORMAT, "it declares no vertices"));
    };
    let is_scalar = |axis| {
        let property = vertex.properties.get(axis);
        property.is_some_and(|p| matches!(p.data_type, PropertyType::Scalar(_)))
    };
    if !["x", "y", "z"].into_iter().all(is_scalar) {
        return Err(Reason::malformed(FORMAT, "its vertices lack x, y or z"));
    }
    // A record is a byte at least. Without this an element with no properties could be counted forever.
    let records = header.elements.values().try_fold(0_usize, |sum, element| {
        sum.checked_add(element.count)
            .filter(|&records| records <= bytes)
    });
    records.map(drop).ok_or(Reason::Truncated)
}

fn records<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, Reason> {
    Parser::<E>::new()
        .read_payload_for_element(reader, element, header)
        .map_err(reason)
}

fn reason(error: ParseError) -> Reason {
    match error.kind() {
        ErrorKind::UnexpectedEof => Reason::Truncated,
        _ => Reason::malformed(FORMAT, error),
    }
}

/// A vertex's position, from numbers of any type.
struct Vertex([f32; 3]);

impl Vertex {
    fn set(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([0.0; 3])
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match value.to_f32_lossy() {
            Some(value) => self.set(name, value),
            None => PropertyAccessResult::Ignored,
        }
    }
}

/// The corners of a polygon, from integers of any type.
#[derive(Default)]
struct Face {
    corners: Vec<u32>,
    /// The first corner below zero, which is no vertex.
    negative: Option<i32>,
}

impl Face {
    const NAMES: [&str; 2] = ["vertex_indices", "vertex_index"];
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn begin_list_uint(&mut self, name: &str, _len: usize) -> BeginList<'_, u32> {
        match Self::NAMES.contains(&name) {
            true => BeginList::Fill(&mut self.corners),
            false => BeginList::UseSetter,
        }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !Self::NAMES.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        let signed: Vec<i32> = match value {
            Property::ListInt(list) => list,
            Property::ListChar(list) => list.into_iter().map(i32::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i32::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i32::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i32::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        self.negative = signed.iter().copied().find(|&index| index < 0);
        self.corners = signed.into_iter().map(|index| index as u32).collect();
        PropertyAccessResult::Set
    }
}

/// A record of which nothing is kept.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
