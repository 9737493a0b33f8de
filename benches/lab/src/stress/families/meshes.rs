//! Small meshes of all kinds.

use crate::stress::aim::{log_uniform, unit};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh_scenes::{Mesh, shapes};

/// A mesh of 1 to 320 triangles, about one extent in size, near the origin.
pub fn any(rng: &mut Rng) -> Mesh {
    let mesh = match rng.u32(..8) {
        0 => shapes::soup(rng.usize(1..120), rng.u64(..)),
        1 => pool(rng),
        2 => shapes::icosphere(rng.u32(..3)),
        3 => shapes::cuboid([-1.0; 3], [1.0; 3]),
        4 => shapes::terrain(rng.usize(1..9), 0.5, rng.u64(..)),
        5 => shapes::torus_knot(2, 3, 0.2, rng.usize(8..20), rng.usize(3..6)),
        6 => quantised(rng),
        _ => copies(rng),
    };
    if rng.bool() { mesh } else { turned(rng, mesh) }
}

/// Triangles between random pairs of few vertices: they share vertices and edges, cross one another, are degenerate.
pub fn pool(rng: &mut Rng) -> Mesh {
    let vertices = rng.usize(3..40);
    let coarse = rng.bool();
    let mut coordinate = || {
        let x = 2.0 * rng.f32() - 1.0;
        if coarse { (x * 4.0).round() / 4.0 } else { x }
    };
    let positions = (0..vertices)
        .map(|_| [coordinate(), coordinate(), coordinate()])
        .collect();
    let mut index = || rng.u32(..vertices as u32);
    let indices = (0..2 * vertices)
        .map(|_| [index(), index(), index()])
        .collect();
    mesh("pool", positions, indices)
}

/// A mesh on a grid of whole numbers.
pub fn quantised(rng: &mut Rng) -> Mesh {
    let shape = match rng.u32(..3) {
        0 => shapes::icosphere(rng.u32(1..3)),
        1 => shapes::torus_knot(2, 3, 0.2, 16, 5),
        _ => shapes::terrain(8, 0.7, rng.u64(..)),
    };
    shapes::quantised(shape, 1 << rng.u32(2..9))
}

/// A shape several times over, of all sizes.
fn copies(rng: &mut Rng) -> Mesh {
    let mut all = Mesh::default();
    for _ in 0..rng.usize(2..6) {
        let (at, size) = (unit(rng), log_uniform(rng, -4.0, 0.0));
        let shape = match rng.u32(..2) {
            0 => shapes::icosphere(0),
            _ => shapes::cuboid([-1.0; 3], [1.0; 3]),
        };
        all.append(&shape.moved(|p| at + size * p));
    }
    all
}

/// Turned, stretched and sheared at random: any three columns will do.
fn turned(rng: &mut Rng, mesh: Mesh) -> Mesh {
    let columns = [unit(rng), unit(rng), unit(rng)];
    mesh.moved(|p| columns[0] * p.x + columns[1] * p.y + columns[2] * p.z)
}

/// A mesh of single triangles.
pub fn of_triangles(name: &str, triangles: &[[Vec3; 3]]) -> Mesh {
    let positions = triangles.iter().flatten().map(|p| p.to_array()).collect();
    let indices = (0..triangles.len() as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    mesh(name, positions, indices)
}

/// A mesh of its parts.
pub fn mesh(name: &str, positions: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        name: name.into(),
        positions,
        indices,
    }
}
