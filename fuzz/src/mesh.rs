//! Meshes.

use crate::{Float, floats};
use arbitrary::Arbitrary;
use glam::Vec3;
use wide_bvh::geometry::TriangleMesh;

/// A mesh of few triangles, or a crowd of copies of them.
#[derive(Arbitrary, Debug)]
pub struct MeshBytes {
    positions: Vec<[Float; 3]>,
    triangles: Vec<[u8; 3]>,
    crowd: Crowd,
}

/// How a mesh is repeated, so that it takes few bytes to be large enough for all parts of the builder.
#[derive(Arbitrary, Debug)]
struct Crowd {
    /// Above [`ALONE`](Self::ALONE), there are more triangles the greater it is.
    size: u8,
    /// From each copy to the next.
    step: [Float; 3],
    /// How many sizes copies have, and how far their vertices are off.
    bend: u8,
}

impl Crowd {
    const ALONE: u8 = 207;
    /// Triangles a unit of the size.
    const UNIT: usize = 64;

    fn copies(&self, triangles: usize) -> usize {
        match self.size.checked_sub(Self::ALONE) {
            None | Some(0) => 1,
            Some(units) => (usize::from(units) * Self::UNIT).div_ceil(triangles.max(1)),
        }
    }

    /// Where a vertex of a copy is. Sums and products of bits that are no number are none either.
    fn place(&self, position: [f32; 3], copy: usize, vertex: usize) -> [f32; 3] {
        if copy == 0 {
            return position;
        }
        let place = [copy % 16, copy / 16 % 16, copy / 256];
        let size = 1 + copy % (1 + usize::from(self.bend >> 5));
        [0, 1, 2].map(|axis| {
            let x = position[axis] * size as f32 + self.step[axis].0 * place[axis] as f32;
            let noise = (copy * 3 + vertex * 7 + axis).wrapping_mul(0x9e37_79b9) >> 7;
            f32::from_bits(x.to_bits() ^ (noise as u32 & u32::from(self.bend & 31)))
        })
    }
}

/// A mesh's buffers.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    /// All in range.
    pub indices: Vec<[u32; 3]>,
}

impl MeshBytes {
    pub fn mesh(&self) -> Mesh {
        let per_copy = self.positions.len();
        if per_copy == 0 {
            return Mesh::default();
        }
        let copies = self.crowd.copies(self.triangles.len());
        let mut mesh = Mesh::default();
        for copy in 0..copies {
            let first = mesh.positions.len();
            let place = |(vertex, &position)| self.crowd.place(floats(position), copy, vertex);
            mesh.positions
                .extend(self.positions.iter().enumerate().map(place));
            let corner = |corner: u8| (first + usize::from(corner) % per_copy) as u32;
            mesh.indices
                .extend(self.triangles.iter().map(|triangle| triangle.map(corner)));
            if self.triangles.is_empty() {
                break;
            }
        }
        mesh
    }
}

impl Mesh {
    pub fn view(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices).expect("indices in range")
    }

    /// The corners of every triangle.
    pub fn corners(&self) -> Vec<[Vec3; 3]> {
        let mesh = self.view();
        (0..mesh.len()).filter_map(|i| mesh.triangle(i)).collect()
    }

    /// Whether brute force takes long.
    pub fn is_large(&self) -> bool {
        self.indices.len() > 256
    }
}

/// A vertex or a box that goes elsewhere.
pub type Move = (u16, [Float; 3]);

/// The positions after some have moved.
pub fn moved(positions: &[[f32; 3]], moves: &[Move]) -> Vec<[f32; 3]> {
    let mut moved = positions.to_vec();
    for &(vertex, to) in moves {
        if !moved.is_empty() {
            let vertex = usize::from(vertex) % moved.len();
            moved[vertex] = floats(to);
        }
    }
    moved
}
