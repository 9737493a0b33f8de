//! Closed solids with shared vertices.

use crate::Mesh;
use glam::Vec3;
use std::collections::HashMap;

/// A ball of radius 1 around the origin: an icosahedron each of whose triangles is split in four
/// `subdivisions` times, 20 * 4^`subdivisions` triangles in all. Closed: every edge has two triangles.
///
/// # Panics
/// Above 12 subdivisions, which are 335 million triangles.
pub fn icosphere(subdivisions: u32) -> Mesh {
    assert!(subdivisions <= 12);
    let mut mesh = icosahedron();
    for _ in 0..subdivisions {
        let mut middles = HashMap::with_capacity(mesh.indices.len() * 3 / 2);
        let mut split = Vec::with_capacity(mesh.indices.len() * 4);
        for &[a, b, c] in &mesh.indices {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
                *middles
                    .entry((from.min(to), from.max(to)))
                    .or_insert_with(|| {
                        let [from, to] = [from, to].map(|i| Vec3::from(mesh.positions[i as usize]));
                        mesh.positions.push((from + to).normalize().to_array());
                        mesh.positions.len() as u32 - 1
                    })
            });
            split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        mesh.indices = split;
    }
    mesh
}

/// Its vertices are the corners of three golden rectangles, one in each plane of two axes.
fn icosahedron() -> Mesh {
    let golden = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let mut positions = Vec::new();
    for axis in 0..3 {
        for (short, long) in [
            (-1.0, -golden),
            (1.0, -golden),
            (-1.0, golden),
            (1.0, golden),
        ] {
            let mut corner = [0.0; 3];
            corner[(axis + 1) % 3] = short;
            corner[(axis + 2) % 3] = long;
            positions.push(Vec3::from(corner).normalize().to_array());
        }
    }
    let mut indices = Vec::new();
    // Twelve vertices: all trios that are two by two a side apart are the faces.
    let side = Vec3::from(positions[0]).distance(Vec3::from(positions[1])) * 1.01;
    let near = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|i| Vec3::from(positions[i as usize]));
        a.distance(b) < side
    };
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let [p, q, r] = [a, b, c].map(|i| Vec3::from(positions[i as usize]));
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    indices.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    Mesh {
        name: "icosphere".into(),
        positions,
        indices,
    }
}

/// The box between two corners, 12 triangles over 8 shared vertices. Closed.
pub fn cuboid(min: [f32; 3], max: [f32; 3]) -> Mesh {
    let corner = |bits: usize| {
        let side = |axis: usize| if bits >> axis & 1 == 1 { max } else { min }[axis];
        [side(0), side(1), side(2)]
    };
    Mesh {
        name: "cuboid".into(),
        positions: (0..8).map(corner).collect(),
        indices: vec![
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ],
    }
}
